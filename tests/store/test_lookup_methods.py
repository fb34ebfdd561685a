"""Methods of look-up: weights, what corrections give back, and what a query may be told of its error."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from solver import registry
from solver.dehydration import SOLVER
from solver.fruit import directions, lattice
from store import starter, tables
from store.blending import methods
from store.blending.methods import envelope
from store.blending.methods.bands import Bands, Targets, add_up, multiplier
from store.blending.methods.weights import Samples
from store.errors import OutsideTable, TooUncertain
from store.generations import trust
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import harmonics, spectra
from store.surfaces.measures import Measures, Surface, compare

from ._wrinkled import N, at, grid, pattern, wrinkled
from .conftest import GAMMA, STAGES, TE, fill

CORRECTED = (
    *("linear+LL", "linear+env", "linear+LL+env", "idw+LL+env", "scattered+LL+env"),
    *("thin+LL+env", "lean+LL+env"),
)


def found(table: ShapeTable, te: float, gamma: float, stage: float, method: str, n: int = N) -> np.ndarray:
    shape = table.at({"te": te, "gamma": gamma}, stage, fields=("displacement",), method=method, resolution=n)
    assert shape.displacement is not None
    return shape.displacement


def radial_power(u: np.ndarray) -> np.ndarray:
    n = len(u)
    radial = np.einsum("tpi,tpi->tp", u.astype(float), directions(*lattice(n)))
    power = harmonics.power(harmonics.degrees(spectra.spectrum(radial)))
    power[: harmonics.LOWEST] = 0
    return power


# --- names ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["liner", "idw+LLL", "linear+env+env", "", "LL"])
def test_unknown_methods(name: str, rough: ShapeTable) -> None:
    with pytest.raises(OutsideTable, match="method"):
        rough.at({"te": 0.04, "gamma": 20}, 0.2, method=name)


def test_corrections_are_composed_in_their_order() -> None:
    assert str(methods.parse("linear+env+LL")) == "linear+LL+env"
    assert {str(methods.parse(name)) for name in methods.NAMED} == set(methods.NAMED)
    assert methods.DEFAULT in methods.NAMED


# --- corrections ------------------------------------------------------------------------------------------------


def test_incoherent_patterns_lose_half_and_get_it_back(rough: ShapeTable) -> None:
    te, gamma = np.sqrt(0.03 * 0.04), np.sqrt(10 * 20.0)
    wanted = 0.9 * te * 0.2
    rms = {m: np.sqrt(radial_power(found(rough, te, gamma, 0.2, m)).sum()) for m in ("linear", "idw", *CORRECTED)}
    assert rms["linear"] < 0.6 * wanted
    assert rms["idw"] < 0.6 * wanted
    for method in ("linear+LL", "linear+LL+env", "idw+LL+env"):
        assert rms[method] == pytest.approx(wanted, rel=0.06)
    # and the waves are as long as they should be, between those of the samples
    power = radial_power(found(rough, te, gamma, 0.2, "linear+LL+env"))
    assert (np.arange(N + 1) * power).sum() / power.sum() == pytest.approx(0.3 / te, rel=0.08)


@pytest.mark.parametrize("method", CORRECTED)
def test_samples_stay_as_they_are_and_so_does_the_fresh_shape(rough: ShapeTable, method: str) -> None:
    theta, phi = lattice(N)
    for i, te in enumerate(TE):
        radial = pattern(10 * i + 1, 0.3 / te, 0.9 * te)
        truth = (0.2 * radial - 0.1)[..., None] * directions(theta, phi)
        np.testing.assert_allclose(found(rough, te, 20.0, 0.2, method), truth, atol=1e-6)
    assert not found(rough, 0.033, 17.0, 0.0, method).any()


@pytest.mark.parametrize("method", CORRECTED)
def test_no_jump_at_samples_cells_or_stages(rough: ShapeTable, method: str) -> None:
    places = [(0.04, 20.0, 0.2), (0.04, 14.0, 0.2), (0.036, 20.0, 0.15), (0.036, 14.0, 0.2), (0.036, 14.0, 1e-5)]
    for te, gamma, stage in places:
        there = found(rough, te, gamma, stage, method)
        for step in ((1e-8, 0, 0), (-1e-8, 0, 0), (0, 1e-5, 0), (0, -1e-5, 0), (0, 0, 1e-6), (0, 0, -1e-6)):
            moved = found(rough, te + step[0], gamma + step[1], stage + step[2], method)
            assert np.abs(moved - there).max() < 1e-5


def test_smooth_stages_are_left_alone(tmp_path: Path) -> None:
    # no wrinkles before s = 0.2: nothing to correct, and nothing to divide by
    store = Store.open(tmp_path, create=True)
    wrinkled(store, onset=0.2)
    tables.build(store, SOLVER)
    table = ShapeTable.open(store, surfaces=registry.surface)
    for stage in (1e-9, 0.05, 0.1, 0.2):
        for method in CORRECTED:
            u = found(table, 0.034, 13.0, stage, method)
            assert np.isfinite(u).all()
            np.testing.assert_allclose(u, -0.5 * stage * directions(*lattice(N)), atol=2e-6)
    assert np.isfinite(found(table, 0.034, 13.0, 0.2001, "linear+LL+env")).all()


@pytest.mark.parametrize("n", [8, 33, 96])
def test_corrections_at_any_resolution(rough: ShapeTable, n: int) -> None:
    shape = rough.at({"te": 0.034, "gamma": 13.0}, 0.17, resolution=n, fields=("position", "displacement"))
    own = found(rough, 0.034, 13.0, 0.17, methods.DEFAULT, 128)
    assert shape.displacement is not None
    assert shape.poles is not None
    if n == 96:
        finer = spectra.synthesize(spectra.spectrum(shape.displacement), 128)
        np.testing.assert_allclose(finer, own, atol=2e-5)
        # the poles are the surface's own
        moved = shape.poles - [[0, 1.034, 0], [0, -1.034, 0]]
        np.testing.assert_allclose(moved, spectra.poles(spectra.spectrum(shape.displacement)), atol=2e-5)


def test_gains_are_exact_for_equal_spectra() -> None:
    samples = grid()
    power = np.zeros((6, 1, 33))
    power[:, 0, 3:] = np.random.default_rng(0).uniform(0.5, 1, 30) * 1e-3
    targets = Targets(power, samples)
    mean = add_up(power[0, 0], targets.bands)
    near = samples.weigh("linear", np.array([0.03, 30.0]), 6, 2.0)
    gains = targets.gains(samples.scale(np.array([0.03, 30.0])), near.samples, near.weights[:, None], {0: 1.0}, mean)
    np.testing.assert_allclose(gains, 1, atol=1e-6)
    halved = targets.gains(
        samples.scale(np.array([0.03, 30.0])), near.samples, near.weights[:, None], {0: 1.0}, mean / 4
    )
    np.testing.assert_allclose(halved, 2, rtol=0.01)


def test_the_shape_of_the_fruit_is_not_amplified() -> None:
    bands = Bands(32)
    factor = multiplier(np.full(len(bands.first), 3.0), bands, 32)
    assert (factor[:2, :3] == 1).all()
    assert factor[2, 2] == 1
    np.testing.assert_allclose(factor[10:, 10:], 3, rtol=0.1)


def test_gains_reach_the_degrees_they_are_meant_for() -> None:
    bands = Bands(N)
    gains = 1 + 0.5 * np.tanh(bands.centres - np.log(9))
    fields = [sum(pattern(seed, middle, 1.0) for middle in (5.0, 8.0, 11.0, 15.0)) for seed in range(12)]
    waves = spectra.spectrum(np.stack(fields))
    before = add_up(harmonics.power(harmonics.degrees(waves)).mean(axis=0), bands)
    after = add_up(harmonics.power(harmonics.degrees(waves * multiplier(gains, bands, N))).mean(axis=0), bands)
    strong = before > 0.02 * before.sum()
    assert strong.sum() > 5
    np.testing.assert_allclose(np.sqrt(after / before)[strong], gains[strong], rtol=0.06)


# --- trust ------------------------------------------------------------------------------------------------------


def test_expected_errors_vanish_at_samples_and_grow_between(rough: ShapeTable) -> None:
    there = rough.at({"te": 0.04, "gamma": 20.0}, 0.2, fields=())
    assert there.expected_error == dict.fromkeys(Measures._fields, 0.0)
    near, far = (rough.at({"te": 0.04 - d, "gamma": 20.0}, 0.2, fields=()).expected_error for d in (1e-4, 5e-3))
    assert near is not None
    assert far is not None
    for name in ("L2nr", "corr", "ang"):
        assert 0 < near[name] < 0.1 * far[name]
    # patterns with nothing in common: half a spacing away, at least a third of what another seed would err
    assert far["L2nr"] > 0.4
    assert far["corr"] > 0.25
    assert far["rgh"] < 0.3
    assert there.inside
    assert there.method == methods.DEFAULT


def test_between_two_stages_an_error_is_expected_as_well(tmp_path: Path) -> None:
    """At the parameters of a run, too: patterns go on merging between one stage and the next."""
    store = Store.open(tmp_path, create=True)
    wrinkled(store, turning=6.0)
    tables.build(store, SOLVER)
    table = ShapeTable.open(store, surfaces=registry.surface)
    query, start = {"te": TE[1], "gamma": GAMMA[1]}, directions(*lattice(N))
    for stage in STAGES:
        assert table.at(query, stage, fields=(), max_error=0).expected_error == dict.fromkeys(Measures._fields, 0.0)
    halves, last = [], 0.0
    for stage in (0.05, 0.15, 0.25):
        shape = table.at(query, stage, fields=("displacement",), resolution=N, apart=False)
        assert shape.displacement is not None
        assert shape.expected_error is not None
        truth = Surface(start, at(1, 1, stage, turning=6.0))
        made = trust.errors(compare(Surface(start, shape.displacement), truth))
        halves.append({name: (made[name], shape.expected_error[name]) for name in ("L2nr", "corr", "ang")})
    # half-way from one stage to the next it errs, and by no more than is said
    assert all(0 < error <= said for half in halves for error, said in half.values())
    assert all(half["L2nr"][0] > 0.05 for half in halves)
    with pytest.raises(TooUncertain, match="expected error") as refused:
        table.at(query, 0.15, max_error={"L2nr": 0.01})
    assert "ask for a stage of the table (0.1 or 0.2), " in refused.value.advice
    # no jump at a stage: the nearer, the less
    for stage in (0.15, 0.175, 0.19, 0.1999, 0.2):
        expected = table.at(query, stage, fields=()).expected_error
        assert expected is not None
        assert stage == 0.15 or expected["L2nr"] < last
        last = expected["L2nr"]
    # and between the runs both add up
    off = table.at({"te": 0.035, "gamma": 14.0}, 0.15, fields=()).expected_error
    assert off is not None
    alone = table.at({"te": 0.035, "gamma": 14.0}, 0.2, fields=()).expected_error
    assert alone is not None
    assert off["L2nr"] > 0.7 * alone["L2nr"]


def test_a_table_that_knows_nothing_between_its_stages_says_so(rough: ShapeTable) -> None:
    found, samples = np.zeros((9, 3, len(Measures._fields))), rough._samples
    assert samples is not None
    trusted, near = trust.Trust(found, methods.DEFAULT, samples), samples.without(4, "linear")
    assert trusted.expect(near, {1: 1.0}) is not None
    assert trusted.expect(near, {0: 0.5, 1: 0.5}) is None
    with pytest.raises(TooUncertain, match="between two stages") as refused:
        trust.refuse(None, 0.1, True, methods.DEFAULT, (0.1, 0.2))
    assert "rebuild" in refused.value.advice


def test_nine_tenths_of_the_errors_are_within_what_is_expected() -> None:
    rng = np.random.default_rng(3)
    values = np.array([(te, gamma) for te in (0.03, 0.035, 0.04, 0.045) for gamma in (10.0, 20.0, 30.0, 40.0)])
    samples = Samples(values)
    rows = rng.lognormal(0, 1, (len(values), 5, len(Measures._fields)))
    rows[..., -1] = 1 - rows[..., -1]  # correlations, whose error is what they lack
    trusted = trust.Trust(rows, methods.DEFAULT, samples)
    made, mean = trust.foretold(rows, methods.DEFAULT, samples)
    within = []
    for i in range(len(values)):
        near = samples.without(i, "linear")
        said = [list(trusted.expect(near._replace(nearest=1.0), {j: 1.0}).values()) for j in range(5)]
        within.append(made[i] <= np.array(said) + 1e-12)
    assert (np.mean(within, axis=(0, 1)) >= trust.COVERED - 1e-9).all()
    # a mean of neighbours' errors does not
    assert ((made <= mean).mean(axis=(0, 1)) < 0.8).all()


def test_a_poor_answer_is_refused(rough: ShapeTable) -> None:
    query = {"te": 0.035, "gamma": 14.0}
    with pytest.raises(TooUncertain, match=r"L2nr.*above 0\.1") as refused:
        rough.at(query, 0.2, max_error={"L2nr": 0.1})
    assert refused.value.code == "too-uncertain"
    assert "Run" in refused.value.advice
    assert rough.at(query, 0.2, max_error={"L2nr": 3, "dB": 30}).position is not None
    assert rough.at({"te": 0.04, "gamma": 20}, 0.2, max_error=0).exact
    assert rough.at(query, 0.0, max_error=0).exact
    with pytest.raises(TooUncertain, match="does not say"):
        rough.at(query, 0.2, method="idw", max_error=1)
    with pytest.raises(OutsideTable, match="corr"):
        rough.at(query, 0.2, max_error={"beauty": 1})
    with pytest.raises(OutsideTable, match="max_error"):
        rough.at(query, 0.2, max_error=float("nan"))


def test_neighbours_with_nothing_in_common(rough: ShapeTable, filled: Store) -> None:
    assert max(map(abs, rough.neighbour_correlation.values())) < 0.25
    tables.build(filled, SOLVER)
    assert min(ShapeTable.open(filled, surfaces=registry.surface).neighbour_correlation.values()) > 0.99
    with tables.open(filled) as opened:
        np.testing.assert_allclose(
            opened["neighbour_correlation"],
            list(ShapeTable.open(filled, surfaces=registry.surface).neighbour_correlation.values()),
            rtol=1e-3,
        )
        assert opened["left_out_corr"].shape == (9, 3)
        assert opened["degree_power"].shape == (9, 3, 17)


def test_what_is_left_out_is_not_used(rough: ShapeTable) -> None:
    i = next(i for i in range(9) if rough.sample(i) == {"te": 0.04, "gamma": 20.0})
    predicted = rough.left_out(i, 0.2, "linear")
    assert np.abs(predicted - found(rough, 0.04, 20.0, 0.2, "linear")).max() > 0.001
    nearest = rough.left_out(i, 0.2, "nearest")
    assert any(np.allclose(nearest, found(rough, te, g, 0.2, "linear")) for te in TE for g in GAMMA)
    with pytest.raises(OutsideTable):
        rough.left_out(i, 0.21)


def test_a_table_without_errors_still_answers(tmp_path: Path) -> None:
    # the table in the package may be older than this; its power by degree is then read from the spectra
    store = Store.open(shutil.copytree(starter.ROOT, tmp_path / "starter"))
    shape = ShapeTable.open(store, surfaces=registry.surface).at({"te": 0.034, "gamma": 22.0}, 0.2)
    assert np.isfinite(shape.position).all()  # type: ignore[arg-type]
    with tables.open(store) as opened:
        assert ("degree_power" in opened) == (shape.expected_error is not None)


def test_one_axis_and_two_samples(store: Store) -> None:
    fill(store, te=[0.03, 0.04])
    tables.build(store, SOLVER)
    table = ShapeTable.open(store, surfaces=registry.surface)
    assert np.isfinite(table.at({"te": 0.035}, 0.2, max_error=10).position).all()  # type: ignore[arg-type]
    assert set(table.neighbour_correlation) == set(STAGES)


# --- the envelope -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("share", "expected"), [(0.5, 2.0), (1.0, 1.0), (2.0, 0.5), (0.4, 2.5), (0.02, 3.0), (50.0, 1 / 3)]
)
def test_faint_places_are_strengthened_and_strong_ones_weakened_by_what_they_lack(
    share: float, expected: float
) -> None:
    """Amplitude wanted over amplitude there, at most three times and at least a third.

    A hundredth of the mean square counts as nothing: it moves these factors by less than 3 %.
    """
    places = 2 * envelope.COARSE**2
    wanted = np.full(places, 0.03)
    assert envelope.factor((share * wanted) ** 2, wanted) == pytest.approx(np.full((12, 24), expected), rel=0.03)


def test_each_place_has_its_own_factor_and_the_total_is_settled_elsewhere() -> None:
    """Half of the places have half the amplitude they should have; with a total only their places count."""
    places = 2 * envelope.COARSE**2
    wanted = np.full(places, 0.03)
    faint = np.arange(places) % 2 == 0
    mean = np.where(faint, 0.5 * wanted, wanted) ** 2
    ratio = envelope.factor(mean, wanted).ravel()
    assert ratio[faint] == pytest.approx(2, rel=0.02)
    assert ratio[~faint] == pytest.approx(1, rel=0.02)
    for total in (1e-4, 1e-2):
        settled = envelope.factor(mean, wanted, envelope.Total(total, total)).ravel()
        # the mean square of all, (1 + 1/4) / 2, is what the total is spread over
        assert settled[faint] == pytest.approx(2 * np.sqrt(0.625), rel=0.03)
        assert settled[~faint] == pytest.approx(np.sqrt(0.625), rel=0.03)
