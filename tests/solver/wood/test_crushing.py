"""Rods that crush, against plasticity in one dimension and an elastic-plastic section in bending."""

import numpy as np
import pytest

from solver.contract import InvalidInput, Need, NotConverged
from solver.wood import SOLVER

E, STRONG, RADIUS, LENGTH = 10e9, 40e6, 0.005, 0.1
PLAIN = {"grain": {"strength": 0.0}, "stiffness": E, "compressive_strength": STRONG, "fracture": "none"}
AREA = np.pi * RADIUS**2


def pressed(rods: int, way: list[tuple[float, float]], **values: object):
    """Return a bundle between jaws, the far ones moved by (time, way) along it."""
    jaws = [
        {"low": (-1, -1, -1), "high": (1e-4, 1, 1)},
        {
            "low": (LENGTH - 1e-4, -1, -1), "high": (1, 1, 1),
            "path": [{"time": t, "shift": (x, 0, 0)} for t, x in way],
        },
    ]  # fmt: skip
    params = SOLVER.parse(
        {**PLAIN, "rods": rods, "vertices": 21, "unevenness": 0.0, "length": LENGTH, "radius": RADIUS, "clamp": "none",
         "grips": jaws, "damping": 2000.0, "mass_scaling": 100.0, **values}
    )  # fmt: skip
    times = tuple(np.linspace(0, way[-1][0], 61)[1:])
    names = ("grip_force", "grip_shift", "crushing_energy", "elastic_energy", "lost_energy", "work", "rod_crushed",
             "rod_strain")  # fmt: skip
    return SOLVER.solve(params, Need(stages=times, fields=names))


@pytest.mark.parametrize("rods", [1, 12])
def test_a_pressed_rod_bears_its_strength_and_unloads_as_it_was_loaded(rods):
    """Elastic, then a plateau of strength times area; back with E A / L; what is left is what was crushed."""
    most, crushes = 0.0016, STRONG / E * LENGTH
    found = pressed(rods, [(0, 0), (0.04, -most), (0.08, -most + 1.5 * crushes)])
    # both are means since the stage before
    gone, force = -found.grip_shift.values[:, 1, 0], -found.grip_force.values[:, 1, 0]
    turn = int(gone.argmax())
    elastic, plateau = gone[:turn] < 0.9 * crushes, gone[:turn] > 1.2 * crushes
    # jaws that set out at once send a wave through it
    assert np.polyfit(gone[:turn][elastic], force[:turn][elastic], 1)[0] == pytest.approx(E * AREA / LENGTH, rel=0.03)
    # damping holds back what jaws push along: 1.1 % more
    assert force[:turn][plateau] == pytest.approx(STRONG * AREA, rel=0.015)
    back = slice(turn + 3, None)
    assert np.polyfit(gone[back], force[back], 1)[0] == pytest.approx(E * AREA / LENGTH, rel=0.01)
    # drawn back farther than it springs, it is in tension before it is as long as it was
    left = (most / LENGTH - STRONG / E) * LENGTH
    assert force[-1] == pytest.approx(E * AREA * (gone[-1] - left) / LENGTH, abs=0.02 * STRONG * AREA)
    assert force[-1] < -0.4 * STRONG * AREA
    assert found.crushing_energy.values[-1] == pytest.approx(STRONG * AREA * (most - crushes), rel=0.01)
    # where along it is left to chance: nothing hardens
    assert found.rod_crushed.values[-1].mean() == pytest.approx(most / LENGTH - STRONG / E, rel=0.01)


def test_what_crushing_takes_is_missing_nowhere():
    """Energy balance: work, what is stored, what crushing took and what damping took."""
    found = pressed(12, [(0, 0), (0.04, -0.0016)])
    assert found.residual.values.max() < 0.003
    assert found.lost_energy.values[-1] >= found.crushing_energy.values[-1] > 0.5 * found.work.values[-1]


HIGH, WIDE = 0.02, 0.01


def section(bend: float) -> tuple[float, float]:
    """Return moment [N m] and depth [m] in tension of a section that bears STRONG in compression and any tension.

    bend [1/m]: curvature. k = curvature times height over the crushing strain; E k a^2 / 2 of tension, over height and
    strength, balances 1 - a - 1 / (2 k) of compression: a = (sqrt(2 k) - 1) / k, from k = 2 on.
    """
    strain = STRONG / E
    k = bend * HIGH / strain
    if k <= 2:
        return E * WIDE * HIGH**3 / 12 * bend, HIGH / 2
    a = (np.sqrt(2 * k) - 1) / k * HIGH
    edge = strain / bend
    moment = E * bend * (a**3 + edge**3) / 3 + STRONG * ((HIGH - a) ** 2 - edge**2) / 2
    return float(WIDE * moment), float(a)


def test_a_bent_stick_s_neutral_axis_moves_as_one_side_crushes():
    """Four-point bending: moment over curvature, and how deep it is drawn out, of the even part in the middle."""
    length, arm, over, rods = 0.3, 0.06, 8.0, 40
    bend = over * STRONG / E / HIGH
    # between the inner supports, 2 c apart, a circle; beyond them its slope goes on: enough to reach this curvature
    middle = length / 2 - arm - 0.01
    sag = bend * (middle * arm + arm**2 / 3)
    places = (0.01, 0.01 + arm, length - arm - 0.01, length - 0.01)
    time, near = 0.3, 0.0026
    grips = [
        {"low": (x - near, -1, -1 if n in (1, 2) else 0.007), "high": (x + near, 1, -0.007 if n in (1, 2) else 1),
         "holds": "z",
         "path": [] if n in (1, 2) else [{"time": 0}, {"time": time, "shift": (0, 0, -sag)}]}
        for n, x in enumerate(places)
    ]  # fmt: skip
    values = {
        **PLAIN, "length": length, "outline": [(-WIDE / 2, -HIGH / 2), (WIDE / 2, -HIGH / 2), (WIDE / 2, HIGH / 2),
        (-WIDE / 2, HIGH / 2)], "rods": rods, "vertices": 31, "unevenness": 0.0, "clamp": "none", "grips": grips,
        # nine hundredfold mass still moves as if at rest, and takes a third as many steps as a hundredfold one
        "damping": 50.0, "mass_scaling": 900,
    }  # fmt: skip
    fields = ("grip_force", "rod_position", "rod_strain")
    found = SOLVER.solve(SOLVER.parse(values), Need(stages=tuple(np.linspace(0, time, 41)[1:]), fields=fields))
    ends, strain = found.rod_position.values, found.rod_strain.values
    mid = np.abs(ends[0, :, 0, 0] - length / 2) < 0.4 * middle
    z = ends[0, :, :, 2].mean(-1)
    bends, means = np.array([np.polyfit(z[mid], s[mid], 1) for s in strain]).T
    # forces are means since the stage before
    bends, means = (bends[1:] + bends[:-1]) / 2, (means[1:] + means[:-1]) / 2
    # bent, supports are nearer to each other
    x = ends[1:, :, 0, 0]
    arms = [x[:, np.abs(ends[0, :, 0, 0] - at) < near].mean(1) for at in places]
    arms = (arms[1] - arms[0] + arms[3] - arms[2]) / 2
    moments = arms * np.abs(found.grip_force.values[1:, [0, 3], 2]).mean(1)
    crushed = np.abs(bends) * HIGH * E / STRONG
    assert crushed.max() > 6
    for level in (1.5, 3.0, 5.0):
        at = int(np.abs(crushed - level).argmin())
        moment, deep = section(abs(float(bends[at])))
        # what rods bear by their own bending does not crush: E A^2 / (4 pi) over their number
        own = E * (HIGH * WIDE) ** 2 / (4 * np.pi * rods) * abs(float(bends[at]))
        assert moments[at] == pytest.approx(moment + own, rel=0.04)
        assert HIGH / 2 + means[at] / abs(bends[at]) == pytest.approx(deep, abs=0.02 * HIGH)


def test_equilibria_crush_nothing_and_say_so():
    """A cantilever that bears its load elastically does; one that would crush is refused."""
    values = {**PLAIN, "rods": 30, "vertices": 21, "length": LENGTH, "radius": RADIUS, "mode": "static"}
    bears = STRONG * np.pi * RADIUS**3 / 4 / LENGTH
    SOLVER.solve(SOLVER.parse({**values, "tip_load": (0, 0, -0.8 * bears)}), Need(stages=(1.0,)))
    with pytest.raises(NotConverged, match="equilibria crush nothing"):
        SOLVER.solve(SOLVER.parse({**values, "tip_load": (0, 0, -1.5 * bears)}), Need(stages=(1.0,)))
    with pytest.raises(InvalidInput, match="compressive_strength"):
        SOLVER.parse({"compressive_strength": 0.0})
