"""Thickness from place to place, against beams of two thicknesses, a sheet twice as thick, and differences."""

from dataclasses import replace

import numpy as np
import pytest

from solver import shell
from solver.contract import Context, InvalidInput
from solver.growth.engine import Engine
from solver.growth.params import GrowthParams
from solver.growth.settling.energy import StepEnergy
from solver.growth.settling.loads import compressed
from solver.growth.settling.stage import force_unit
from solver.growth.settling.tangent import Tangent

from ._differences import differences

EVERYWHERE = {"kind": "everywhere"}
#: Beams bend as wide plates do where Poisson's ratio is 0.
STRIP = {"shape": "strip", "aspect": 4, "thickness": 0.1, "poisson": 0.0, "gravity": [0, 0, -1e-6]}
CLAMPED = [{"where": {"kind": "band", "along": "x", "low": -1.6, "high": -2.0}}]


def engine(vertices: int = 300, **values) -> Engine:
    return Engine(GrowthParams.parse({"imperfection": 0, "tools": []} | values), vertices, 1e-4, history=False)


def sag(**values) -> float:
    """How far the tip of a clamped strip hangs down under a small weight."""
    params = GrowthParams.parse({"imperfection": 0, "tools": [], "attached": CLAMPED} | STRIP | values)
    state = Engine(params, 400, 1e-4, history=False).reach(0.05, Context())
    return -float(state.x[:, 2].min())


def beam(thickness) -> float:
    """Tip of a cantilever of that relative thickness at x under its own weight: w'' = M / (D h^3) in series."""
    x = np.linspace(-1.8, 2.0, 4001)
    h, dx = thickness(x), x[1] - x[0]
    shear = np.cumsum(h[::-1])[::-1] * dx
    moment = np.cumsum(shear[::-1])[::-1] * dx
    return float((1e-6 * moment / h**3 * (2.0 - x)).sum() * dx / (0.1**2 / 6))


@pytest.mark.parametrize(("low", "high", "times"), [(0.05, -0.05, 2.0), (-1.0, 1.5, 0.5)], ids=["root", "tip"])
def test_a_strip_of_two_thicknesses_sags_as_the_beam_in_series(low: float, high: float, times: float):
    """Bending by mean curvature makes no beam: a saddle costs it nothing (Poisson's ratio 1)."""

    def thickness(x):
        v = np.clip((x - low) / (high - low), 0, 1)
        return 1 + (times - 1) * v * v * (3 - 2 * v)

    part = {"where": {"kind": "band", "along": "x", "low": low, "high": high}, "times": times}
    found = sag(thicknesses=[part]) / sag()
    assert found == pytest.approx(beam(thickness) / beam(np.ones_like), rel=0.05)


def both(vertices: int = 200, **values):
    """Return a rough sheet twice as thick by its map, and by `thickness`: energies, and where."""
    rough = engine(vertices, shape="disc", thickness=0.1, thicknesses=[{"where": EVERYWHERE, "times": 2}]).state
    plain = replace(rough, matter={})
    x = rough.x + 0.1 * rough.length * np.random.default_rng(0).normal(size=rough.x.shape)
    return (
        StepEnergy(rough, shell.Material(0.1), 0.0, (), Tangent(rough.mesh), **values),
        StepEnergy(plain, shell.Material(0.2), 0.0, (), Tangent(plain.mesh), **values),
        x,
    )


@pytest.mark.parametrize("bending", ["hinges", "mean_curvature"])
def test_a_map_of_two_is_a_sheet_twice_as_thick(bending: str):
    """Energies are over mu l^2 of the sheet, which has half the other's mu: twice all, to rounding."""
    mapped, thick, x = both(bending=bending, gravity=(0, 0, 0.1), pushing=0.3)
    mapped.follow(x)
    thick.follow(x)
    assert mapped(x)[0] == pytest.approx(2 * thick(x)[0], rel=1e-13)
    assert np.abs(mapped(x)[1] - 2 * thick(x)[1]).max() < 1e-13 * np.abs(mapped(x)[1]).max()
    assert np.abs(mapped.load).max() > 0
    assert force_unit(mapped.state, mapped.material) == pytest.approx(2 * force_unit(thick.state, thick.material))
    if bending == "hinges":
        assert np.abs(mapped.hessian(x).toarray() - 2 * thick.hessian(x).toarray()).max() < 1e-12


def test_derivatives_are_those_of_differences_where_thickness_varies():
    band = {"kind": "band", "along": "x", "low": -0.8, "high": 0.8}
    state = engine(60, shape="disc", thickness=0.5, thicknesses=[{"where": band, "times": 3.0}]).state
    assert np.ptp(state.matter["thick"]) > 1.5
    x = state.x + 0.1 * state.length * np.random.default_rng(0).normal(size=state.x.shape)
    energy = StepEnergy(state, shell.Material(0.5), 0.0, (), Tangent(state.mesh), gravity=(0.0, 0.0, 0.1))
    matrix, gradient = energy.hessian(x).toarray(), energy(x)[1].ravel()
    slopes, columns = differences(energy, x)
    assert np.abs(matrix - columns).max() <= 1e-7 * np.abs(columns).max()
    assert np.abs(gradient - slopes).max() <= 1e-6 * np.abs(gradient).max()


def test_compression_pushes_as_much_as_a_place_is_thick():
    state = engine(200, shape="sphere").state
    thick = np.linspace(0.5, 2.0, len(state.mesh.triangles))
    one = [compressed(state.x, state.mesh.triangles[[k]], 1.2 * state.g[[k]], 1.0) for k in (0, len(thick) - 1)]
    for k, plain in zip((0, len(thick) - 1), one, strict=True):
        found = compressed(state.x, state.mesh.triangles[[k]], 1.2 * state.g[[k]], 1.0, thick[[k]])
        assert np.abs(plain).max() > 0
        assert found == pytest.approx(thick[k] * plain)


def test_thickness_rides_on_the_material_through_cuts():
    """Twofold growth everywhere: what is at x was at x / 2, and is as thick as it was there."""
    grow = {"kind": "surface", "where": EVERYWHERE, "stretch": [2.0, 2.0]}
    band = {"kind": "band", "along": "x", "low": -1.0, "high": 1.0}
    state = engine(shape="disc", tools=[grow], thicknesses=[{"where": band, "times": 3.0}]).reach(1.0, Context())
    assert len(state.x) > 500, "nothing was cut"
    v = np.clip((state.x[:, 0] - state.x[:, 0].mean()) / 4 + 0.5, 0, 1)
    away = state.matter["thick"] - (1 + 2 * v * v * (3 - 2 * v))
    # where it is stiffer the disc's own middle is not the mean of its vertices
    assert np.abs(away).max() < 0.08


def test_parts_keep_the_largest_thickness_and_unevenness_is_that_of_the_place():
    values = {"shape": "disc", "thickness": 0.02, "imperfection": 0.1}
    rim = [{"where": {"kind": "rim", "width": 0.3}, "times": 4.0}]
    mapped, plain = engine(thicknesses=rim, **values), engine(**values)
    assert mapped._way.watch(mapped.state).distance == pytest.approx(0.08)
    assert plain._way.watch(plain.state).distance == 0.02
    assert mapped.state.x[:, 2] == pytest.approx(mapped.state.matter["thick"] * plain.state.x[:, 2], abs=1e-15)


def test_without_a_map_nothing_is_asked_otherwise():
    assert "thicknesses" not in GrowthParams.parse({}).model_dump(mode="json")
    mapped = GrowthParams.parse({"thicknesses": [{"where": EVERYWHERE, "times": 2}]})
    assert GrowthParams.model_validate(mapped.model_dump(mode="json")) == mapped
    assert "thick" not in engine(shape="disc").state.matter


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"times": 0.0}, "0.05"),
        ({"times": -1.0}, "0.05"),
        ({"times": float("nan")}, "times"),
        ({"times": 2.0, "thick": 1}, "thick"),
        ({}, "times"),
        ({"times": 2.0, "where": {"kind": "vein"}}, "kind"),
        ({"times": 2.0, "where": {"kind": "painted", "values": [float("nan")]}}, "values"),
    ],
)
def test_what_is_no_thickness_is_refused(part, said: str):
    with pytest.raises(InvalidInput, match=said):
        GrowthParams.parse({"thicknesses": [{"where": EVERYWHERE} | part]})


def test_a_map_of_another_mesh_and_one_too_thin_are_refused():
    with pytest.raises(InvalidInput, match="3 values are painted on"):
        engine(thicknesses=[{"where": {"kind": "painted", "values": [0, 0.5, 1]}, "times": 2}])
    with pytest.raises(InvalidInput, match=r"0\.01 to 0\.01 times"):
        engine(thicknesses=2 * [{"where": EVERYWHERE, "times": 0.1}])
