"""Which table answers a question: equal parameters, presets, ties, distances."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver import registry
from solver.dehydration import SOLVER
from store import starter, tables
from store.errors import OutsideTable
from store.families import stored, ties
from store.families.choose import Families
from store.lookup import ShapeTable
from store.manifest import TableInfo
from store.store import Store

from .conftest import fill

RADII = {"r2": 0.7, "r3": 0.5, "r4": 0.45, "r5": 0.5, "r6": 0.7, "r8": 0.45}


@pytest.fixture(scope="module")
def families(tmp_path_factory: pytest.TempPathFactory) -> Families:
    """A table of spheres, one of spheres with thinner skins, and one of raisins, of which a part was solved."""
    store = Store.open(tmp_path_factory.mktemp("families"), create=True)
    fill(store, te=[0.03, 0.04], gamma=[10.0, 30.0])
    sphere = tables.build(store, SOLVER, "sphere")
    raisin = dataclasses.replace(
        sphere,
        name="raisin",
        axes={"te": (0.005, 0.02), "gamma": (5.0, 20.0)},
        fixed={**sphere.fixed, **RADII, "rs1": 0.3, "rs2": 0.2, "mirrors": "xz"},
    )
    thin = dataclasses.replace(sphere, name="thin", axes={"te": (0.01, 0.032), "gamma": (10.0, 30.0)})
    places = {"sphere": [0.03, 0.04], "thin": [0.01, 0.032], "raisin": [0.005, 0.02]}
    return Families(
        [raisin, sphere, thin],
        stored.base(SOLVER),
        lambda info: np.array([[te, gamma] for te in places[info.name] for gamma in (10.0, 30.0)]),
    )


def chosen(families: Families, said: dict[str, Any], preset: str | None = None, stage: float = 0.2) -> str | None:
    fit = families.choose(said, stage, preset)
    return None if fit is None else fit.info.name


@pytest.mark.parametrize("number", [5e-324, 1e-308, 1e308])
def test_numbers_that_no_quotient_holds_are_a_finite_distance_apart(families: Families, number: float) -> None:
    # gamma: 5e-324 / 5 is 0, and 1e308 / 0.02 for te infinite
    for name, others in (("gamma", {"te": 0.01}), ("te", {"gamma": 10.0})):
        fits = families.nearest({name: number, **others}, 0.2, "raisin")
        # the fruit that is named comes first
        assert fits[0].info.name == "raisin"
        distances = [fit.distance for fit in fits[1:]]
        assert distances == sorted(distances)
        for fit in fits:
            (miss,) = (miss for miss in fit.misses if miss.name == name)
            assert miss.distance == pytest.approx(abs(math.log(number) - math.log(miss.held)), rel=1e-12)
            assert miss.distance <= fit.distance < miss.distance + 5


def test_what_is_incidental_and_named_is_what_is_missed(families: Families) -> None:
    said = {"seed": 3, "mirrors": "xyz"}
    assert chosen(families, {}, "raisin") == "raisin"
    assert chosen(families, said, "raisin") is None
    near = families.nearest(said, 0.2, "raisin")[0]
    assert near.info.name == "raisin"
    assert {miss.name for miss in near.misses} == set(said)
    told = str(stored.refusal(families.nearest(said, 0.2, "raisin")))
    assert "seed = 3 (holds 0)" in told
    assert "mirrors = xyz (holds xz)" in told


def test_the_table_is_the_one_that_holds_the_fruit(families: Families) -> None:
    assert chosen(families, {"te": 0.035, "gamma": 20.0}) == "sphere"
    assert chosen(families, {}, "raisin") == "raisin"
    assert chosen(families, {"te": 0.02, "gamma": 5.0}, "raisin") == "raisin"
    assert chosen(families, {"te": 0.01, "gamma": 10.0, "rs1": 0.3, "rs2": 0.2, **RADII}) == "raisin"
    assert chosen(families, {"stone": [0.3, 0.2], "te": 0.01, "gamma": 10.0, **RADII}) == "raisin"


def test_what_nobody_said_is_the_solvers_default(families: Families) -> None:
    assert chosen(families, {"te": 0.02, "gamma": 10.0}) == "thin"  # a raisin has that skin as well
    alone = Families(families.infos[:1], stored.base(SOLVER), lambda info: None)
    assert chosen(alone, {"te": 0.02, "gamma": 10.0}) == "raisin"  # a lone table stands for itself
    assert chosen(families.only("raisin"), {"te": 0.02, "gamma": 10.0}) is None  # but not one of several


def test_what_is_said_wins_over_the_preset(families: Families) -> None:
    assert chosen(families, {"te": 0.03}, "raisin") is None
    assert chosen(families, {"r4": 0.5}, "raisin") is None
    fit = families.choose({"te": 0.015}, 0.2, "raisin")
    assert fit is not None
    assert families.values({"te": 0.015}, "raisin")["te"] == 0.015


def test_how_a_run_was_done_counts_only_where_it_is_named(families: Families) -> None:
    assert chosen(families, {"mirrors": "xz"}, "raisin") == "raisin"
    assert chosen(families, {"mirrors": ""}, "raisin") is None
    assert chosen(families, {"seed": 7}, "raisin") is None
    assert stored.made(families.infos[0], SOLVER) == {"mirrors": "xz"}


def test_what_a_table_says_nothing_of_is_the_default(families: Families) -> None:
    """Tables made before a parameter was there, or of runs that write it only where it differs, go on to answer."""
    older = [
        dataclasses.replace(info, fixed={k: v for k, v in info.fixed.items() if not k.startswith(("light", "wx"))})
        for info in families.infos
    ]
    fewer = Families(older, stored.base(SOLVER), families._places)
    assert chosen(fewer, {}, "raisin") == "raisin"
    assert chosen(fewer, {"te": 0.035, "gamma": 20.0, "light": [0.0, 0.0, 0.0], "wx": 0.0}) == "sphere"
    assert chosen(fewer, {"te": 0.035, "gamma": 20.0, "light": [1.0, 0.0, 0.0]}) is None
    assert chosen(fewer, {"te": 0.035, "gamma": 20.0, "wx": 0.1}) is None
    [near, *_] = fewer.nearest({"te": 0.035, "gamma": 20.0, "light": [1.0, 0.0, 0.0]}, 0.2)
    assert [(miss.name, miss.held) for miss in near.misses] == [("light", (0.0, 0.0, 0.0))]


def test_of_several_the_one_with_the_closest_samples_answers_wherever_both_do(families: Families) -> None:
    for te in (0.03, 0.0301, 0.0319, 0.032):
        assert chosen(families, {"te": te, "gamma": 10.0}) == "sphere"
    raisin, sphere, thin = families.infos
    better = dataclasses.replace(thin, need={**thin.need, "quality": "fine"})
    assert chosen(again(families, raisin, sphere, better), {"te": 0.03, "gamma": 10.0}) == "thin"
    first = dataclasses.replace(thin, name="broad")
    assert chosen(again(families, raisin, sphere, first), {"te": 0.03, "gamma": 10.0}) == "sphere"
    named = dataclasses.replace(thin, name="default")
    assert chosen(again(families, raisin, sphere, named), {"te": 0.03, "gamma": 10.0}) == "default"


def again(families: Families, *infos: TableInfo) -> Families:
    """Return families of other tables with the same samples, those of one that is called otherwise like `thin`'s."""
    places = families._places
    base, thin = stored.base(SOLVER), families.infos[2]
    return Families(infos, base, lambda info: places(info if info.name in ("raisin", "sphere") else thin))


def test_which_family_answers_hangs_on_which_hold_the_fruit_alone() -> None:
    """In the package: a parameter that moves within what several hold leads from none to another."""
    known = stored.families(Store.open(starter.ROOT), SOLVER)
    rng, answers = np.random.default_rng(0), dict[frozenset[str], set[str | None]]()
    spheres = [info for info in known.infos if info.name.startswith(("default", "sphere", "stone", "prolate"))]
    edges = {name: sorted({x for i in spheres for x in i.axes.get(name, ())}) for name in ("te", "gamma", "rs1")}
    for _ in range(1500):
        te = rng.choice([*edges["te"], 0.01, 0.02, rng.uniform(0.01, 0.04)])
        gamma = rng.choice([10.0, 10.0, rng.uniform(10, 50)])
        rs1 = rng.choice([0.4, 0.4, *edges["rs1"], rng.uniform(0.3, 0.7)])
        said = {"te": float(te), "gamma": float(gamma), "rs1": float(rs1), "rs2": float(rng.choice([0.4, rs1]))}
        holding = frozenset(info.name for info in spheres if known.only(info.name).choose(said, 0.2) is not None)
        answers.setdefault(holding, set()).add(chosen(known, said))
    assert sum(len(holding) > 1 for holding in answers) >= 4
    assert all(len(found) == 1 for found in answers.values())


def test_naming_a_default_changes_no_answer() -> None:
    known = stored.families(Store.open(starter.ROOT), SOLVER)
    usual = {"gamma": 10.0, "rs1": 0.4, "rs2": 0.4, "r4": 1.0}
    for te in (0.01, 0.02, 0.03, 0.0374165, 0.0374166, 0.04):
        found = {chosen(known, {"te": te})}
        for name, value in usual.items():
            found |= {chosen(known, {"te": te, name: value}), chosen(known, {"te": te, name: value}, "sphere")}
        found.add(chosen(known, {"te": te, **usual}))
        assert len(found) == 1
        assert None not in found
    assert chosen(known, {}) == "default"


def test_axes_without_a_value_and_stages_out_of_reach(families: Families) -> None:
    fit = families.choose({"te": 0.035}, 0.2)
    assert fit is not None
    assert (fit.info.name, fit.missing) == ("sphere", ())
    assert families.filled(fit.info) == {"te": 0.04, "gamma": 10.0}
    assert families.filled(families.infos[0], "raisin")["te"] == 0.01
    # no default lies on an axis of stiff skins
    stiff = dataclasses.replace(fit.info, name="stiff", axes={**fit.info.axes, "gamma": (20.0, 30.0)})
    fit = Families([families.infos[0], stiff], stored.base(SOLVER), families._places).choose({"te": 0.035}, 0.2)
    assert fit is not None
    assert (fit.info.name, fit.missing) == ("stiff", ("gamma",))
    # a lone table asks for its axes
    fit = Families([families.infos[1]], stored.base(SOLVER), families._places).choose({"te": 0.035}, 0.2)
    assert fit is not None
    assert fit.missing == ("gamma",)
    assert families.choose({"te": 0.035, "gamma": 10.0}, 0.5) is None


def test_the_nearest_table_and_how_far(families: Families) -> None:
    fits = families.nearest({"te": 0.03}, 0.2, "raisin")
    assert [fit.info.name for fit in fits] == ["raisin", "sphere", "thin"]
    (miss,) = fits[0].misses
    assert (miss.name, miss.asked, miss.held, miss.reach) == ("te", 0.03, 0.02, (0.005, 0.02))
    assert fits[0].distance == pytest.approx(math.log(1.5))
    assert fits[1].distance > fits[0].distance
    refusal = stored.refusal(fits)
    assert isinstance(refusal, OutsideTable)
    assert "'raisin', 0.405 away in te = 0.03 (holds 0.005 to 0.02)" in str(refusal)
    assert families.presets_of(families.infos[0]) == ["raisin"]
    assert families.presets_of(families.infos[1]) == ["sphere"]


def test_who_names_a_preset_is_told_of_its_own_table_first(families: Families) -> None:
    fits = families.nearest({"te": 10.0}, 0.9, "raisin")
    assert [fit.info.name for fit in fits] == ["raisin", "sphere", "thin"]
    assert fits[1].distance < fits[0].distance
    refusal = stored.refusal(fits)
    assert "the preset's own is 'raisin', 6.31 away in te = 10 (holds 0.005 to 0.02)" in str(refusal)
    assert refusal.advice.startswith("The nearest fruit that it holds: Set te=0.02. Ask for the stage 0.3.")
    # without a preset there is nothing but the distance
    bare = families.nearest({"te": 10.0, **families.values({}, "raisin"), "gamma": 10.0}, 0.2)
    assert [fit.distance for fit in bare] == sorted(fit.distance for fit in bare)


def ellipse(r4: float) -> float:
    """Radius at 60 degrees from the equator of an ellipse with half-axes 1 and r4."""
    return 1 / math.hypot(math.cos(math.pi / 3) / r4, math.sin(math.pi / 3))


def test_parameters_that_go_together_are_one_axis() -> None:
    r4 = [0.6, 0.7, 0.8, 0.9]
    columns = {
        "te": [te for te in (0.02, 0.03) for _ in r4],
        "r2": [ellipse(x) for _ in range(2) for x in r4],
        "r4": [x for _ in range(2) for x in r4],
    }
    tied = ties.find(columns)
    assert list(tied) == ["r2"]
    tie = tied["r2"]
    assert tie.leader == "r4"
    assert [tie(x) for x in r4] == columns["r2"][:4]
    assert max(abs(tie(x) - ellipse(x)) for x in np.linspace(0.6, 0.9, 61)) < 3e-4
    assert (tie(0.1), tie(2.0)) == (columns["r2"][0], columns["r2"][3])
    line = {"r2": [ellipse(x) for x in r4], "r4": r4, "r6": [ellipse(x) for x in r4], "r8": r4}
    assert {name: tie.leader for name, tie in ties.find(line).items()} == {"r6": "r2", "r8": "r4"}
    line["r3"] = [x**2 for x in r4]
    assert {name: tie.leader for name, tie in ties.find(line).items()} == dict.fromkeys(("r2", "r4", "r6", "r8"), "r3")
    # equal ones lead in their order, and two that merely rise together in few samples are two axes
    assert ties.find({"rs1": [0.3, 0.4], "rs2": [0.3, 0.4]})["rs2"].leader == "rs1"
    assert ties.find({"te": [0.03, 0.04], "gamma": [10.0, 30.0]}) == {}


def test_past_its_ends_a_follower_is_known_where_that_is_no_guess(families: Families) -> None:
    r4 = [0.6, 0.7, 0.8, 0.9]
    line = {"r3": [1 - x / 2 for x in r4], "r4": r4, "r6": [ellipse(x) for x in r4], "r8": r4}
    tied = ties.find(line)
    assert {name: tie.leader for name, tie in tied.items()} == dict.fromkeys(("r3", "r6", "r8"), "r4")
    assert (tied["r8"].beyond(0.95), tied["r8"].beyond(0.1)) == (0.95, 0.1)
    assert tied["r3"].beyond(0.5) == pytest.approx(0.75)
    assert (tied["r6"].beyond(0.95), tied["r6"].beyond(0.59)) == (None, None)
    assert tied["r6"].beyond(0.9 + 1e-12) == ellipse(0.9)
    assert ties.find({"te": [0.1, 0.1, 0.2, 0.2], "gamma": [1, 1, 3, 3]})["te"].beyond(4) is None  # through two
    info = dataclasses.replace(families.infos[0], tied=tied)
    assert info.complete({"r4": 0.7})["r6"] == pytest.approx(ellipse(0.7))
    with pytest.raises(OutsideTable, match=r"r4 = 0\.95 is not known: .* r6 follow it from 0\.6 to 0\.9"):
        info.complete({"r4": 0.95})
    assert info.following({"r4": 0.95}, ["r6"]) == pytest.approx({"r3": 0.525, "r8": 0.95})


@pytest.mark.parametrize(
    ("said", "stage", "preset"),
    [
        ({"te": 0.03}, 0.2, "raisin"),
        ({"te": 0.03, "r4": 0.5, "rs1": 0.35}, 0.5, "raisin"),
        ({"seed": 3, "mirrors": "xyz"}, 0.2, "raisin"),
        ({"rs1": 0.31, "imperfection_kind": "mode", "imperfection": 1 / 3}, 0.2, None),
        ({}, 0.2, "plum2"),
        ({"te": 0.001, **RADII}, -0.1, None),
    ],
)
def test_advice_that_is_followed_leads_to_the_nearest(
    families: Families, said: dict[str, Any], stage: float, preset: str | None
) -> None:
    assert families.choose(said, stage, preset) is None
    fits = families.nearest(said, stage, preset)
    told = re.sub(r"\.(?= |$)", "", stored.refusal(fits).advice)
    for pair in re.findall(r"(\w+)=([^ ,]+)", told):
        said = {**said, pair[0]: pair[1] if pair[1].isalpha() else float(pair[1])}
    for at in re.findall(r"the stage (\S+)", told):
        stage = float(at)
    assert chosen(families, said, preset, stage) == fits[0].info.name


def test_a_table_of_spherical_stones_is_asked_by_one_radius(tmp_path: Path) -> None:
    store = Store.open(tmp_path / "store", create=True)
    for radius in (0.3, 0.4, 0.5):
        fill(store, te=[0.03, 0.04], gamma=[10.0], rs1=radius, rs2=radius)
    info = tables.build(store, SOLVER, "stones")
    assert (set(info.axes), info.tied["rs2"].leader) == ({"te", "rs1"}, "rs1")
    assert tables.info(store, "stones") == info
    table = ShapeTable.open(store, "stones", surfaces=registry.surface)
    shape = table.at({"te": 0.035, "rs1": 0.45}, 0.2)
    assert shape.parameters == pytest.approx({"te": 0.035, "rs1": 0.45, "rs2": 0.45})
    assert shape.inside
    assert table.at({"te": 0.035, "rs1": 0.45, "rs2": 0.45}, 0.2).nearest == shape.nearest
    with pytest.raises(OutsideTable, match=r"rs2 = 0\.3 is not in the table"):
        table.at({"te": 0.035, "rs1": 0.45, "rs2": 0.3}, 0.2)
    assert table.at_parameters({"te": 0.035, "rs1": 0.45})["stone"] == pytest.approx([0.45, 0.45])
    found = stored.families(store, SOLVER)
    assert found.choose({"te": 0.03, "rs1": 0.4, "rs2": 0.4}, 0.2) is not None
    assert found.choose({"te": 0.03, "rs1": 0.4, "rs2": 0.3}, 0.2) is None
    assert found.only("stones").choose({"te": 0.03, "rs1": 0.4}, 0.2) is not None
