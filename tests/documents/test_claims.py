"""The criteria of the paper's claims: each holds where the paper is right, and fails where the contrary is measured."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.dehydration.claims import __main__ as claims
from benchmarks.dehydration.claims.criteria import Found, judge
from benchmarks.dehydration.claims.pattern import Pattern, name_of
from solver.dehydration import SOLVER as DEHYDRATION
from solver.dehydration import DehydrationParams

_PLAIN = Pattern(
    name="", seed=0, quality="preview", mirrors="", version="0", converged=True, te=0.04, gamma=10.0, stone=(0.4, 0.4),
    waist=1.0, buckles=40.0, wavelength=0.4, roughness=0.05, elongation=2.0, poles_to_equator=1.0,
    equator_anisotropy=0.0, polar_anisotropy=0.0, thick_to_thin=1.0, residual=1e-3, penetration=0.0,
)  # fmt: skip
_THIN, _THICK = 0.03, 0.04


def _paper(te: float, gamma: float = 10.0, stone: float = 0.4, waist: float = 1.0, name: str = "") -> Pattern:
    """Return a fruit that does all that the paper says."""
    strips = {_THIN: 2.0, _THICK: 0.2}[te] * (stone - 0.3)
    return _PLAIN._replace(
        name=name,
        te=te,
        gamma=gamma,
        stone=(stone, 0.4),
        waist=waist,
        wavelength=0.4 * (te / 0.04) * (gamma / 10) ** (1 / 3),
        buckles=40 * (0.04 / te) ** 2,
        elongation=2 * np.exp(strips),
        poles_to_equator=np.exp(-strips - (stone - 0.4)),
        equator_anisotropy={"jujube1": 0.6, "jujube2": 0.1, "plum2": 0.1, "raisin": 0.6, "wolfberry": 0.6}.get(
            name, 2 * (1 - waist)
        ),
        thick_to_thin=2.0 if name == "plum1" else 1.0,
    )


def _turned(one: Pattern) -> Pattern:
    """Return the fruit that does the contrary of what `one` does."""
    return one._replace(
        wavelength=1 / one.wavelength,
        buckles=1 / one.buckles,
        elongation=1 / one.elongation,
        poles_to_equator=1 / one.poles_to_equator,
        equator_anisotropy=0.7 - one.equator_anisotropy,
        thick_to_thin=1 / one.thick_to_thin,
    )


def _plans() -> dict[str, list[Pattern]]:
    skins = (_THIN, _THICK)
    return {
        "fig7": [_paper(te, gamma) for te in skins for gamma in (10, 30, 50)],
        "fig8": [_paper(te, stone=stone) for te in skins for stone in (0.3, 0.4, 0.5, 0.6)],
        "fig9": [_paper(te, stone=stone) for te in skins for stone in (0.4, 0.5, 0.6, 0.7)],
        "fig10": [_paper(te, waist=waist) for te in skins for waist in (0.6, 0.7, 0.8, 0.9)],
        "table1": [_paper(_THIN, name=n) for n in ("jujube1", "raisin", "wolfberry", "jujube2", "plum2", "plum1")],
    }


def _seeded(plans: dict[str, list[Pattern]], scatter: float, seeds: int = 3) -> dict[str, list[Pattern]]:
    """Return all fruits with several seeds, whose measures differ by that share of a normal deviate."""
    rng = np.random.default_rng(5)

    def once(one: Pattern, seed: int) -> Pattern:
        names = ("wavelength", "buckles", "elongation", "poles_to_equator", "thick_to_thin")
        moved = {name: getattr(one, name) * np.exp(scatter * rng.standard_normal()) for name in names}
        off = one.equator_anisotropy + scatter * rng.standard_normal()
        return one._replace(seed=seed, equator_anisotropy=off, **moved)

    return {name: [once(one, seed) for seed in range(seeds) for one in row] for name, row in plans.items()}


def _verdicts(found: list[Found]) -> set[str]:
    return {one.verdict for one in found}


def test_what_the_paper_says_holds_where_it_is_so() -> None:
    found = judge(_seeded(_plans(), 0.003))
    # strips hardly grow at the thick skin, as the paper says: there it is no strip, and the clause fails
    strips = [one for one in found if one.clause == "strips with a larger stone"]
    assert [one.verdict for one in strips] == ["holds", "fails"]
    poles = [one for one in found if one.clause == "poles shallower with a longer stone"]
    assert _verdicts(poles) == {"holds"}
    assert _verdicts([one for one in found if one not in strips]) == {"holds"}
    assert {one.claim for one in found} == {"C1", "C2", "C3", "C4", "C5", "C6"}


def test_every_clause_fails_where_the_contrary_is_measured() -> None:
    right = judge(_seeded(_plans(), 0.003))
    wrong = judge(_seeded({name: [_turned(one) for one in row] for name, row in _plans().items()}, 0.003))
    clauses = {(one.claim, one.clause, one.row) for one in right}
    assert {(one.claim, one.clause, one.row) for one in wrong} == clauses
    assert len({one.clause for one in wrong}) >= 15
    assert [one for one in wrong if one.verdict != "fails"] == []


@pytest.mark.parametrize("clause", sorted({one.clause for one in judge(_seeded(_plans(), 0.003))}))
def test_what_another_seed_changes_as_much_is_unclear(clause: str) -> None:
    """With seeds that scatter by as much as is measured, no clause is sure of anything."""
    found = judge(_seeded(_plans(), 2.0, 2))
    own = [one.verdict for one in found if one.clause == clause]
    assert "unclear" in own


def test_one_seed_judges_nothing() -> None:
    assert _verdicts(judge(_plans())) == {"not judged: one seed only"}


def test_what_was_not_run_is_not_judged() -> None:
    found = judge({})
    assert {one.claim for one in found} == {"C1", "C2", "C3", "C4", "C5", "C6"}
    assert all(one.verdict.startswith("not judged: ") for one in found)
    alone = judge({"fig8": [one for one in _seeded(_plans(), 0.01)["fig8"] if one.te == _THIN]})
    most = [one for one in alone if one.clause == "most so for thin skin"]
    assert [one.verdict.split(":")[0] for one in most] == ["not judged"]


def test_the_cheap_part_of_the_plans() -> None:
    jobs = claims.jobs("table1", [0, 1], 0.03)
    assert [(job.params["mirrors"], job.params["seed"]) for job in jobs] == [("xyz", 0), ("xyz", 1)]
    assert {job.params["mirrors"] for job in claims.jobs("table1", [0], 0.001)} == {"xyz", "xz"}
    assert not any(job.params["pattern"] for job in jobs)


@pytest.mark.parametrize(("name", "count"), [("fig7", 12), ("fig8", 16), ("fig9", 16), ("fig10", 16), ("table1", 6)])
def test_what_figures_and_tables_show_is_planned(name: str, count: int) -> None:
    """Four skins by three stiffnesses, stone radii, stone lengths or waists four each, and six fruits."""
    params = [DehydrationParams.model_validate(job.params) for job in claims.jobs(name, [0], 0.001)]
    shown = {(each.exocarp_thickness, each.modulus_ratio, each.stone, each.radii) for each in params}
    assert len(shown) == len(params) == count


def test_table_1_is_its_six_fruits() -> None:
    params = [DehydrationParams.model_validate(job.params) for job in claims.jobs("table1", [0], 0.001)]
    assert {name_of(each) for each in params} == {"plum1", "plum2", "jujube1", "jujube2", "raisin", "wolfberry"}
    own = [DEHYDRATION.parse({"gamma": 10}, name_of(each)) for each in params]
    assert [each.exocarp_thickness for each in params] == [each.axis("te") for each in own]
