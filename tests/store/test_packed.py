"""Spectra as small integers: what is lost, what is left out, and that everything reads them as it reads floats."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from solver import registry
from solver.dehydration import SOLVER
from store import tables
from store.blending import methods
from store.checking import audit, truncation
from store.generations import generation
from store.lookup import ShapeTable
from store.store import Store
from store.surfaces import packed, spectra


def wrinkled(n: int, seed: int) -> np.ndarray:
    """Fields (n, 2n, 3) of a table: large for low waves, small for high ones, mirrored at x = 0 and z = 0."""
    rng = np.random.default_rng(seed)
    field = rng.normal(size=(n, 2 * n, 3))
    turn = (-np.arange(2 * n)) % (2 * n)
    half = (n - np.arange(2 * n)) % (2 * n)
    for axis, across in ((2, turn), (0, half)):
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        field = field + sign * field[:, across]
    return np.asarray(field)


def blocks(n: int = 16, samples: int = 2) -> list[np.ndarray]:
    found = []
    for i in range(samples):
        stages = []
        for scale in (0.1, 0.3):
            waves = np.moveaxis(spectra.spectrum(wrinkled(n, i)), -1, 0)
            k = np.arange(n + 1)
            waves = scale * waves * np.exp(-0.4 * np.add.outer(k, k))
            stages.append(np.ascontiguousarray(waves).view(float).reshape(*waves.shape, 2).astype(np.float32))
        found.append(np.stack(stages))
    return found


def test_what_is_lost_is_what_is_said_and_less_than_a_ten_thousandth() -> None:
    whole = blocks()
    codes = packed.encode(whole)
    rms, most = packed.loss(whole, codes)
    read = packed.Packed(codes)
    worst = 0.0
    for i, block in enumerate(whole):
        for j in range(2):
            gone = np.ascontiguousarray(block[j] - read[i, j]).astype(float).view(complex)[..., 0]
            worst = max(worst, float(np.linalg.norm(spectra.synthesize(gone, 16), axis=0).max()))
    assert most == pytest.approx(worst, rel=1e-6)
    assert 0 < rms < most < 1e-4
    assert np.abs(codes.codes).max() == 32767


def test_small_waves_that_meet_in_one_point_get_finer_steps() -> None:
    whole = blocks(n=48)
    # each less than half a step, and all of them in phase near a pole
    whole[1][1, 0, 0, 1:, 0] += 0.45 * packed.FINEST
    whole[1][1, 0, 2::2, :, 0] += 0.45 * packed.FINEST
    assert packed.loss(whole, packed.encode(whole))[1] > packed.MOST
    codes, lost = packed.within(whole)
    assert lost == packed.loss(whole, codes)
    assert lost[1] <= packed.MOST
    assert codes.step.min() < packed.FINEST
    # what loses little is packed as ever, and what 16 bits cannot hold is given up
    codes, _ = packed.within(blocks())
    assert (codes.codes == packed.encode(blocks()).codes).all()
    large = [1e4 * block for block in blocks()]
    assert packed.within(large)[1][1] > packed.MOST


def test_mirror_images_take_a_quarter() -> None:
    """Between two planes that hold the poles, of four numbers of a wave one is not zero: no symmetry is told."""
    codes = packed.encode(blocks())
    full = blocks()[0][0].size
    assert len(codes.place) < 0.28 * full
    read = packed.Packed(codes)
    for i, block in enumerate(blocks()):
        steps = np.repeat(codes.step[np.maximum.outer(np.arange(17), np.arange(17))][:, :, None], 2, axis=-1)
        assert (np.abs(read[i, 1] - block[1]) <= 0.5001 * steps).all()


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """The same runs as floats and packed."""
    from ._wrinkled import wrinkled as fill

    store = Store.open(tmp_path_factory.mktemp("packed"), create=True)
    fill(store)
    tables.build(store, SOLVER, "floats")
    tables.build(store, SOLVER, "packed", dtype="int16", text="# a plan\n")
    return store


def test_look_ups_of_a_packed_table(both: Store) -> None:
    floats, small = (ShapeTable.open(both, name, surfaces=registry.surface) for name in ("floats", "packed"))
    middle = {name: (low * high) ** 0.5 for name, (low, high) in floats.axes.items()}
    for stage in (floats.stages[0], 0.5 * (floats.stages[-1] + floats.stages[-2])):
        for method in (methods.DEFAULT, "linear+LL+env", "idw", "nearest"):
            a, b = (table.at(middle, stage, method=method) for table in (floats, small))
            assert np.abs(np.asarray(a.position) - np.asarray(b.position)).max() < 1e-4
            # only of the default is known how far it errs
            assert (a.expected_error is None) == (method != methods.DEFAULT)
            assert b.expected_error == (a.expected_error and pytest.approx(a.expected_error, rel=0.01))
    at = small.left_out(0, small.stages[0])
    assert np.abs(at - floats.left_out(0, floats.stages[0])).max() < 1e-4


def test_it_is_smaller_states_its_loss_and_can_be_checked(both: Store) -> None:
    info = tables.info(both, "packed")
    assert (info.dtype, info.plan) == ("int16", "# a plan\n")
    path = tables.path_of(both, info)
    assert path.stat().st_size < 0.7 * tables.path_of(both, tables.info(both, "floats")).stat().st_size
    assert audit.verify(both, "packed") == []
    with generation.open(path) as opened:
        assert opened.spectrum.dtype == np.int16
        stated = float(opened.spectrum.attrs["max_loss"])
    floor = max(row.max for row in truncation.losses(both, tables.info(both, "floats")))
    most = max(row.max for row in truncation.losses(both, info))
    assert floor < most <= stated * 1.5 < 1e-4


def test_rebuilding_packs_unpacks_and_keeps_the_plan(both: Store) -> None:
    digest = tables.info(both, "packed").digest
    assert tables.rebuild(both, SOLVER, "packed", dtype="float32").digest == tables.info(both, "floats").digest
    again = tables.rebuild(both, SOLVER, "packed", dtype="int16")
    assert (again.digest, again.plan) == (digest, "# a plan\n")
    assert tables.rebuild(both, SOLVER, "packed").dtype == "int16"


def test_what_packing_lost_is_still_said_of_what_is_made_of_packed_spectra(both: Store, tmp_path: Path) -> None:
    store = Store.open(tmp_path / "alone", create=True)
    shutil.copytree(both.tables_dir / "packed", store.tables_dir / "packed")

    def stated() -> list[float]:
        with tables.open(store, "packed") as opened:
            return [float(opened.spectrum.attrs[name]) for name in ("rms_loss", "max_loss")]

    first = stated()
    assert min(first) > 0
    tables.rebuild(store, SOLVER, "packed", dtype="int16")
    assert stated() == pytest.approx(first, rel=1e-3)
    tables.rebuild(store, SOLVER, "packed", dtype="float32")
    assert stated() == pytest.approx(first, rel=1e-3)
    tables.rebuild(store, SOLVER, "packed", resolution=8, dtype="int16")
    assert all(now >= 0.999 * before for now, before in zip(stated(), first, strict=True))
