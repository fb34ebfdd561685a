"""What is said of a wood run before it begins: cuts, notches and grips that meet nothing, and wood that is no wood."""

from __future__ import annotations

import time
import tomllib
from pathlib import Path
from typing import Any

import pytest

from solver.contract import Context, InvalidGeometry, InvalidInput, Need, NotConverged, Unstable
from solver.wood import SOLVER, run
from solver.wood.stepping.stability import longest_step

ROOT = Path(__file__).parents[3]
FINE = {"fracture": "none", "rods": 20, "vertices": 12}
ROUND = "from 0 to 0.15 m along x, -0.01 to 0.01 m along y and -0.01 to 0.01 m along z"


def cut(low: tuple[float, float, float], high: tuple[float, float, float]) -> dict[str, Any]:
    return {"cuts": [{"low": low, "high": high}]}


def remarks(values: dict[str, Any], **need_: Any) -> str:
    need = SOLVER.settle(Need.model_validate({"stages": [1.0], **need_}))
    assert SOLVER.remarks is not None
    return SOLVER.remarks(SOLVER.parse({**FINE, **values}), need)


@pytest.mark.parametrize(
    ("values", "meets"),
    [
        (cut((0.06, -1, 0), (0.06, 1, 1)), True),
        (cut((0.06, -1, 0.0099), (0.06, 1, 1)), True),
        (cut((0.06, -1, 0.0102), (0.06, 1, 1)), False),
        (cut((0.06, -1, -1), (0.06, 1, -0.0102)), False),
        (cut((0.06, -1, -1), (0.06, 1, -0.0099)), True),
        # in the square about the round section, and beside it
        (cut((0.06, 0.008, 0.008), (0.06, 1, 1)), False),
        (cut((0.06, 0.005, 0.005), (0.06, 1, 1)), True),
        (cut((0.2, -1, -1), (0.2, 1, 1)), False),
        # a cut at the very end cuts nothing off
        (cut((0.0, -1, -1), (0.0, 1, 1)), False),
        (cut((0.15, -1, -1), (0.15, 1, 1)), False),
        (cut((-1, -1, -1), (0.15, 1, 1)), True),
        # where it tapers to half there is nothing left so far up
        ({**cut((0.14, -1, 0.006), (0.15, 1, 1)), "taper": 0.5}, False),
        ({**cut((0.1, -1, 0.006), (0.15, 1, 1)), "taper": 0.5}, True),
        # an outline's centroid becomes the axis
        ({**cut((0.06, -1, 0.006), (0.06, 1, 1)), "outline": [(0, 0), (0.02, 0), (0.02, 0.01), (0, 0.01)]}, False),
        ({**cut((0.06, -1, 0.004), (0.06, 1, 1)), "outline": [(0, 0), (0.02, 0), (0.02, 0.01), (0, 0.01)]}, True),
    ],
)
def test_a_cut_that_meets_nothing_is_told_of(values: dict[str, Any], meets: bool) -> None:
    said = remarks(values)
    assert ("cuts[0] meets nothing of the branch" in said) is not meets, said
    if "outline" not in values and not meets:
        assert ROUND in said
        assert "move its box into it" in said


def test_it_is_said_before_work_and_stays_with_the_result() -> None:
    """Also of a cut that is in the branch and passes between rods, which is known when they are laid."""
    told: list[str] = []
    values = {
        "cuts": [{"low": (0.2, -1, -1), "high": (0.2, 1, 1)}, {"low": (0.06, 0, 0), "high": (0.0601, 1e-9, 1e-9)}]
    }
    params = SOLVER.parse({**FINE, **values})
    run = SOLVER.solve(params, Need(stages=(0.0,), fields=("work",)), Context(lambda _, what: told.append(what)))
    assert "cuts[0] meets nothing of the branch" in told[0]
    assert told[1].startswith("cuts[1] passes between the ")
    assert "larger box" in told[1]
    assert run.attrs["note"] == f"{told[0]}; {told[1]}"
    whole = SOLVER.solve(
        SOLVER.parse({**FINE, **cut((0.06, -1, 0), (0.06, 1, 1))}), Need(stages=(0.0,), fields=("work",))
    )
    assert "note" not in whole.attrs


def test_no_more_than_five_are_told_of_one_by_one() -> None:
    said = remarks({"cuts": [{"low": (0.2, -1, -1), "high": (0.2, 1, 1)}] * 9})
    assert said.count("meets nothing") == 5
    assert said.endswith("the same goes for 4 more")


@pytest.mark.parametrize(
    ("notch", "more", "said"),
    [
        ({"depth": 0.5}, {}, ""),
        ({"depth": 0.5}, {"fracture": "none"}, "notches[0] does nothing, as nothing breaks"),
        ({"depth": 0.0}, {}, "notches[0] has no depth"),
        # 29 edges of 5.2 mm, eight places each
        ({"depth": 0.5, "width": 6.6e-4}, {}, ""),
        ({"depth": 0.5, "width": 6.4e-4}, {}, "strengths are known every 0.647 mm, so that it misses some rods"),
        ({"depth": 0.5}, {"fracture": "vertex"}, "strengths are known every 5.17 mm"),
    ],
)
def test_a_notch_that_weakens_nothing_is_told_of(notch: dict[str, Any], more: dict[str, Any], said: str) -> None:
    # one rod, of whose edges nothing else is said
    values = {"rods": 1, "vertices": 30, "fracture": "stress", "notches": [{"position": 0.05, **notch}], **more}
    found = remarks(values)
    assert (said in found) if said else not found
    if "misses" in said:
        # and as many vertices as it says do
        enough = int(found.split("or ")[-1].split(" ")[0])
        assert enough == 31
        assert not remarks({**values, "vertices": enough})


def test_a_grip_beside_the_branch_is_refused_before_it_is_laid() -> None:
    with pytest.raises(InvalidGeometry, match="grip 0 holds no vertex") as caught:
        remarks({"grips": [{"low": (0.2, -1, -1), "high": (1, 1, 1)}]})
    assert ROUND in caught.value.advice
    assert not remarks({"grips": [{"low": (0.15, -1, -1), "high": (1, 1, 1)}]})


def test_equilibria_of_a_stiffness_that_is_no_wood_s_are_told_of_and_what_would_do() -> None:
    values = {"mode": "static", "radius": 0.005, "tip_load": (0, 0, -5.0), "stiffness": 1e3, "shear": 70.0}
    said = remarks({**values, "transverse": 50.0})
    # 5 N on 78.5 mm2: a tenth at 0.64 MPa
    assert "by 64 of its length" in said
    assert "a stiffness of 6.4e+05 Pa or more" in said
    assert not remarks({**values, "stiffness": 6.5e5})
    assert "by 0.64 of" in remarks({**values, "stiffness": 4e5, "taper": 0.5, "transverse": 50.0})
    # weight hangs on the thick end
    assert "by 0.88 of" in remarks({"mode": "static", "gravity": 9.81, "stiffness": 1e3, "taper": 0.05})
    assert "by 64 of its length" in remarks({**values, "mode": "explicit"})
    # what nothing holds, loads do not stretch
    assert not remarks({**values, "mode": "explicit", "clamp": "none"})
    params = SOLVER.parse({**FINE, **values, "transverse": 50.0, "vertices": 6})
    with pytest.raises(NotConverged, match="no equilibrium was found") as caught:
        SOLVER.solve(params, Need(stages=(1.0,), fields=("work",)))
    assert "a greater stiffness" in caught.value.advice


def test_what_auto_chooses_is_told_at_every_door() -> None:
    assert "masses scaled" in remarks({"mode": "auto", "bodies": SOLVER.presets["press"]["bodies"], "clamp": "none"})


def test_masses_scaled_by_hand_beyond_the_loads_rate_are_told_of() -> None:
    """A plank over a knee in .1 s on masses scaled 100 times: the knee bore 170 N where real masses have 131 N."""
    knee = tomllib.loads((ROOT / "examples" / "wood" / "knee.toml").read_text())
    said = remarks({**knee, "fracture": "none"})
    assert "off by some 30 %" in said
    assert "mode auto" in said
    slow = [
        {**grip, "path": [{**point, "time": 20 * point["time"]} for point in grip["path"]]} for grip in knee["grips"]
    ]
    assert not remarks({**knee, "fracture": "none", "grips": slow})
    assert not remarks({**knee, "fracture": "none", "mass_scaling": 1})
    # auto says its own error, once
    auto = {key: value for key, value in knee.items() if key != "mass_scaling"}
    assert "too fast for masses scaled" not in remarks({**auto, "mode": "auto"})


def moved(time: float, far: float = -0.02, **more: Any) -> dict[str, Any]:
    """Return a body that moves from above through the branch within a time [s]."""
    path = [{"time": 0.0, "position": (0.1, 0, 0.0205)}, {"time": time, "position": (0.1, 0, far)}]
    return {"bodies": [{"size": (0.01, 0.06, 0.02), "path": path, **more}]}


def test_what_is_past_the_wood_between_two_steps_is_refused() -> None:
    """It met nothing, broke nothing, and its energy balanced."""
    for found in (lambda v: remarks(v), lambda v: SOLVER.solve(SOLVER.parse({**FINE, **v}), Need(stages=(1e-3,)))):
        with pytest.raises(InvalidInput, match=r"bodies\.0 moves by") as caught:
            found(moved(1e-8))
        assert "times as long or more" in caught.value.advice
        jump = [{"time": 0}, {"time": 1e-9, "shift": (0, 0, -1)}]
        with pytest.raises(InvalidInput, match=r"grips\.0 moves by"):
            found({"grips": [{"low": (0.14, -1, -1), "high": (1, 1, 1), "path": jump}]})
    assert not remarks(moved(1e-3))
    # the fastest part of a path counts
    rests = moved(1e-3)
    rests["bodies"][0]["path"] += [
        {"time": 1.0, "position": (0.1, 0, -0.02)},
        {"time": 1 + 1e-8, "position": (0.1, 0, 1)},
    ]
    with pytest.raises(InvalidInput, match=r"bodies\.0 moves by"):
        remarks(rests)


def test_the_run_knows_its_step_better_than_what_is_said_before() -> None:
    """How long steps are is known when rods are laid; as slow as it is told to be then, the body meets the wood."""
    quick = moved(1e-6)
    assert not remarks(quick)
    with pytest.raises(InvalidInput, match="past what is") as caught:
        SOLVER.solve(SOLVER.parse({**FINE, **quick}), Need(stages=(1e-3,)))
    times = int(caught.value.advice.split(" times")[0].split(" ")[-1])
    assert times >= 2
    slow = SOLVER.parse({**FINE, **moved(times * 1e-6)})
    assert abs(float(SOLVER.solve(slow, Need(stages=(times * 1e-6 / 2,))).body_impulse[0, 0, 2])) > 0


def test_steps_without_end_are_refused() -> None:
    """A body of next to no mass, for which steps got as short; at 1e-300 kg a division by 0 was all that was said."""
    for mass in (1e-20, 1e-300):
        body = {"size": (0.01, 0.06, 0.01), "mass": mass, "path": [{"time": 0, "position": (0.1, 0, 0.0155)}]}
        with pytest.raises(InvalidInput, match="no steps longer than") as caught:
            SOLVER.solve(SOLVER.parse({**FINE, "bodies": [body]}), Need(stages=(1e-2,)))
        assert "heavier bodies" in caught.value.advice


def test_steps_that_were_asked_for_count() -> None:
    """A step a million times too short is dear, and where it never ends it is the step that is named."""
    need = Need(stages=(0.01,), quality="preview")
    usual, short = SOLVER.parse(FINE), SOLVER.parse({**FINE, "step": 1e-9})
    assert SOLVER.cost(short, need).seconds > 100 * SOLVER.cost(usual, need).seconds
    assert SOLVER.cost(SOLVER.parse({**FINE, "step": 1.0}), need) == SOLVER.cost(usual, need)
    with pytest.raises(InvalidInput, match="steps of 1e-14 s are too many") as caught:
        SOLVER.solve(SOLVER.parse({**FINE, "step": 1e-14}), need)
    assert "Leave step out, give 1e-12 or more" in caught.value.advice


def test_a_run_that_blows_up_names_what_is_there() -> None:
    """A load that no rod bears was told of a contact where nothing touched."""
    values = {**FINE, "tip_load": (0, 0, -1e7)}
    assert "give loads 32 times smaller" in remarks(values)
    with pytest.raises(Unstable) as caught:
        SOLVER.solve(SOLVER.parse(values), Need(stages=(2e-3,)))
    assert "smaller loads" in caught.value.advice
    assert "contact" not in caught.value.advice


def test_a_run_that_blows_up_begins_again_with_half_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """As some presses do whose rods touch. A step that was given is kept; what blows up with half as well, ends."""
    values, need = {**FINE, "tip_load": (0, 0, -1.0)}, Need(stages=(0.0, 1e-3, 5e-3), quality="preview")
    times: list[tuple[str, float]] = []
    calm = SOLVER.solve(SOLVER.parse(values), need)
    share = calm.attrs["step"] / calm.attrs["longest_stable_step"]

    def too_long(factor: float) -> None:
        monkeypatch.setattr(run, "longest_step", lambda wood, contact: factor / share * longest_step(wood, contact))

    too_long(1.6)
    found = SOLVER.solve(SOLVER.parse(values), need, Context(lambda _, what: times.append((what, time.perf_counter()))))
    # the seconds of a stage are those of both tries
    again = next(at for what, at in times if "begun again" in what)
    assert found["seconds"].values.min() > again - times[0][1]
    assert found.attrs["step"] == pytest.approx(0.8 * calm.attrs["longest_stable_step"])
    assert "begun again with steps half as long" in found.attrs["note"]
    assert found["tip_position"].values == pytest.approx(calm["tip_position"].values, rel=1e-3)
    with pytest.raises(Unstable):
        SOLVER.solve(SOLVER.parse({**values, "step": 1.6 * calm.attrs["longest_stable_step"]}), need)
    too_long(5.0)
    with pytest.raises(Unstable):
        SOLVER.solve(SOLVER.parse(values), need)


def test_equilibria_under_a_share_of_their_loads_are_told_of() -> None:
    """The stages that are usual end at 20 ms, where loads have a fiftieth of what they are."""
    loaded = {"mode": "static", "tip_load": (0, 0, -1.0)}
    assert "at 0.02 s, has 2 % of them: name stages up to 1" in remarks(loaded, stages=[])
    assert "has 50 % of them" in remarks({**loaded, "mode": "auto"}, stages=[0.25, 0.5])
    assert "of them" not in remarks({**loaded, "mode": "explicit"}, stages=[0.5])
    assert not remarks(loaded, stages=[0.5, 1.0])


def test_a_part_of_a_surface_is_refused_before_the_run() -> None:
    with pytest.raises(InvalidInput, match="no colatitude"):
        remarks({}, region={"colatitude": [0, 90], "azimuth": [0, 90]})
