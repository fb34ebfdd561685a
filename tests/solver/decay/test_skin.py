"""The skin against the buckling of a shell on springs: when it wrinkles, and how wide."""

from dataclasses import replace

import numpy as np
import pytest

from solver.contract import Context, Need
from solver.decay import SOLVER
from solver.decay.body.body import Body
from solver.decay.body.flesh import Skin
from solver.decay.body.obstacles import Obstacles
from solver.decay.body.skin import Shell
from solver.decay.body.wrinkles import Wrinkles
from solver.decay.settings import choose
from solver.decay.surfaces.surface import lay
from solver.fruit import Fruit
from solver.shell import hinge_stiffness

THICKNESS, RADIUS, POISSON = 0.06, 1.06, 0.3


@pytest.fixture(scope="module")
def sphere():
    return lay(Fruit(exocarp_thickness=THICKNESS, stone=(0, 0)), 16)


def onset():
    """Return the critical shrinkage of a sphere's flesh and the wave number of its skin (flesh modulus 1).

    Shallow-shell buckling on springs k: k + E t / R^2 is what resists a wave, D = E t^3 / (12 (1 - nu^2)); the shell
    also stands off evenly by 2 N / (k R), which takes that share of the shrinkage.
    """
    skin = Skin()
    sheet, springs = skin.stiffness * THICKNESS, 1 / skin.depth
    bending = sheet * THICKNESS**2 / (12 * (1 - POISSON**2))
    resisting = springs + sheet / RADIUS**2
    force = 2 * np.sqrt(resisting * bending)
    shrinkage = force * (1 - POISSON) / sheet + 2 * force / (springs * RADIUS**2)
    return float(shrinkage), float((resisting / bending) ** 0.25)


def heights(sphere, shrinkage):
    """Return the wrinkles' rms height, over the thickness, and their mean wave number."""
    shell = Shell(sphere.points, sphere.faces, sphere.area, Skin(), THICKNESS)
    outward = sphere.points / RADIUS
    carried = (1 - shrinkage) * sphere.points
    found, residual, *_ = shell.wrinkled(carried, 1.0, carried + shell.uneven(outward, Context.generator(0)), 1e-5)
    assert residual <= 1e-5
    h = np.einsum("vi,vi->v", found - carried, outward)
    h -= sphere.mean(h)
    own = np.repeat(np.arange(len(h)), np.diff(sphere.start))
    slopes = np.sum(sphere.weight * (h[own] - h[sphere.near]) ** 2) / 2
    return np.sqrt(sphere.mean(h**2)) / THICKNESS, np.sqrt(slopes / sphere.total(h**2))


def test_a_skin_wrinkles_past_the_critical_shrinkage_with_the_width_of_theory(sphere):
    critical, wave = onset()
    assert heights(sphere, 0.85 * critical)[0] < 0.02
    tall, found = heights(sphere, 1.25 * critical)
    assert tall > 0.1
    assert found == pytest.approx(wave, rel=0.1)


def test_dimples_are_wide_where_the_flesh_holds_the_skin_loosely(sphere):
    """Wave numbers are as the fourth roots of what resists, k or k + E t / R^2; k is 0.1 or 1.9 times its mean.

    Loose folds are a third of the sphere wide, where shallow theory's curvature counts in part: between both roots.
    """
    firm = np.where(sphere.points[:, 1] > 0, 1.9, 0.1)
    shell = Shell(sphere.points, sphere.faces, sphere.area, Skin(), THICKNESS, firm)
    outward = sphere.points / RADIUS
    carried = (1 - 1.6 * onset()[0]) * sphere.points
    found, *_ = shell.wrinkled(carried, 1.0, carried + shell.uneven(outward, Context.generator(0)), 1e-4)
    h = np.einsum("vi,vi->v", found - carried, outward)
    own = np.repeat(np.arange(len(h)), np.diff(sphere.start))
    tall, waves = [], []
    for side in (1, -1):
        here = side * sphere.points[:, 1] > 0.2
        g = np.where(here, h - np.average(h[here], weights=sphere.area[here]), 0.0)
        both = here[own] & here[sphere.near]
        slopes = np.sum((sphere.weight * (g[own] - g[sphere.near]) ** 2)[both]) / 2
        tall.append(np.sqrt(np.sum(sphere.area * g**2)))
        waves.append(np.sqrt(slopes) / tall[-1])
    curved = Skin().stiffness * THICKNESS / RADIUS**2
    theory = ((1.9 / Skin().depth + curved) / (0.1 / Skin().depth + curved)) ** 0.25
    assert theory < waves[0] / waves[1] < 19**0.25


def test_a_skin_s_hold_differs_by_place_only_where_it_is_asked_for():
    """The same places on two meshes; without it keys and holds are what they were."""
    assert "uneven_hold" not in SOLVER.parse({"skin": {}}, "apple").model_dump_json()
    params = SOLVER.parse({"skin": {"uneven_hold": 0.8}, "body": "quasi-static"}, "apple")
    even = params.model_copy(update={"skin": Skin()})
    factors = []
    for cells in (8, 16):
        settings = replace(choose(params, "preview"), skin=cells)
        body = Body(params, lay(params, settings.cells), settings.cells, settings.layers, settings.balance)
        holds = [Wrinkles(each, each.skin, body, settings)._shell._hold for each in (params, even)]
        factors.append(holds[0] / holds[1])
    assert factors[1].min() < 0.4
    assert factors[1].max() > 1.6
    assert factors[1].mean() == pytest.approx(1, abs=0.2)
    points = [lay(params, cells).points for cells in (8, 16)]
    far = np.linalg.norm(points[0][:, None] - points[1][None], axis=2)
    near = far.min(axis=1) < 1e-9
    assert near.sum() > 100
    assert factors[0][near] == pytest.approx(factors[1][far.argmin(axis=1)[near]], abs=1e-9)


def test_a_skin_that_shrinks_with_its_body_stays_on_it(sphere):
    shell = Shell(sphere.points, sphere.faces, sphere.area, Skin(), THICKNESS)
    carried = 0.7 * sphere.points
    found, *_ = shell.wrinkled(carried, 0.7, carried + shell.uneven(sphere.points / RADIUS, Context.generator(0)), 1e-6)
    assert found == pytest.approx(carried, abs=1e-6)


def test_what_frames_learnt_saves_the_next_ones_steps_and_changes_no_balance(sphere):
    critical, _ = onset()
    shell = Shell(sphere.points, sphere.faces, sphere.area, Skin(), THICKNESS)
    height = shell.uneven(sphere.points / RADIUS, Context.generator(0))

    def frames(learning):
        carried = (1 - 1.5 * critical) * sphere.points
        found = shell.wrinkled(carried, 1.0, carried + height, 1e-4)
        steps = 0
        for k in range(1, 7):
            then = (1 - (1.5 + 0.002 * k) * critical) * sphere.points
            model = found.model if learning else None
            found = shell.wrinkled(then, 1.0, then + found.points - carried, 1e-4, model)
            carried = then
            steps += found.steps
            assert found.residual <= 1e-4
        return found.points - carried, steps

    (known, quick), (fresh, slow) = frames(True), frames(False)
    assert quick < 0.7 * slow
    assert np.abs(known - fresh).max() < 0.02 * np.abs(fresh).max()


def test_a_march_settles_each_stage_alike_whatever_else_is_asked_for():
    values = {
        "body": "quasi-static",
        "wounds": (),
        "te": 0.04,
        "skin": {"shrinkage": 0.0},
        "march": 1.0,
        "transpiration": 8.48,
    }

    def at(*days):
        need = Need(fields=("displacement",), stages=days, quality="preview", resolution=64)
        return SOLVER.solve(SOLVER.parse(values, "orange"), need)

    alone, among = at(2.5), at(0.7, 1.5, 2.5)
    assert np.array_equal(alone.displacement[-1], among.displacement[-1])
    # and from the march's last node it is fewer steps away than from the fresh fruit
    cold = SOLVER.solve(
        SOLVER.parse({**values, "march": None}, "orange"),
        Need(fields=("displacement",), stages=(2.5,), quality="preview", resolution=64),
    )
    assert int(alone.body_steps[-1]) < int(cold.body_steps[-1])


def test_wrinkles_come_on_top_of_the_body_and_only_with_a_skin():
    need = Need(fields=("displacement",), stages=(3.0,), quality="preview", resolution=64)
    values = {"body": "quasi-static", "wounds": (), "te": 0.04, "flesh": {"gravity": 0}, "transpiration": 8.48}
    bare = SOLVER.solve(SOLVER.parse(values, "orange"), need)
    skinned = SOLVER.solve(SOLVER.parse({**values, "skin": {"shrinkage": 0.0}}, "orange"), need)
    assert "skin_residual" not in bare
    assert (skinned.skin_residual <= 1e-3).all()
    apart = (skinned.displacement - bare.displacement).values
    assert 0.01 < np.abs(apart).max() < 0.3
    again = SOLVER.solve(SOLVER.parse({**values, "skin": {"shrinkage": 0.0}}, "orange"), need)
    assert np.array_equal(again.displacement, skinned.displacement)


def test_a_skin_rests_on_the_floor_and_on_its_neighbours():
    """Measured on what is handed over: the lattice and the vertices, against plane and balls as they were given."""
    beside = [{"position": (1.95, 0.1, 0.0), "radius": 0.95}]
    values = {"body": "quasi-static", "skin": {"shrinkage": 0.0}, "te": 0.03, "firmness": 5.0, "neighbours": beside}
    params = SOLVER.parse({**values, "stone": (0, 0), "temperature": 24.0}, "tomato")
    need = Need(fields=("position", "mesh_position", "mean_rot"), stages=(0.0, 3.0, 5.0), quality="preview")
    run = SOLVER.solve(params, need)
    theta = np.linspace(0, np.pi, 2001)
    floor = params.surface(theta, 0 * theta)[:, 1].min()
    assert run.mean_rot.values[-1] > 0.1
    for name in ("position", "mesh_position"):
        points = run[name].values.astype(float).reshape(3, -1, 3)
        assert points[..., 1].min() > floor - 1e-3
        assert (np.linalg.norm(points - beside[0]["position"], axis=2) - 0.95).min() > -1e-3
    # and it does rest on them
    assert (run.mesh_position.values[-1, :, 1] < floor + 5e-3).mean() > 0.005


def test_a_flat_skin_is_pushed_off_a_floor_in_balance(sphere):
    """A skin whose body lets it hang 0.05 through a floor: the energy's slope is that of differences, and it leaves."""
    shell = Shell(sphere.points, sphere.faces, sphere.area, Skin(), THICKNESS)
    height = float(sphere.points[:, 1].min()) + 0.05
    floor = Obstacles(height, np.empty((0, 4)))
    found, residual, *_ = shell.wrinkled(sphere.points, 1.0, sphere.points.copy(), 1e-5, obstacles=floor)
    assert residual <= 1e-5
    assert 0 < height - found[:, 1].min() < 1e-3
    assert floor.laid(found)[:, 1].min() >= height
    x = found + 1e-3 * np.random.default_rng(0).normal(size=found.shape)
    d = np.random.default_rng(1).normal(size=found.shape)
    g = shell._metric
    stiffness = hinge_stiffness(g, shell._mesh, shell._material.flexural)

    def slope(at):
        return shell._slope(at, sphere.points, g, stiffness, floor)

    differences = (slope(x + 1e-6 * d)[1] - slope(x - 1e-6 * d)[1]) / 2e-6
    assert np.sum(slope(x)[0] * d) == pytest.approx(differences, rel=1e-5)


def test_skin_over_collapsed_rot_shrinks_with_it():
    """Rot that takes a quarter of its lengths: a skin that joins has no more area than the flesh below by a little."""

    def excess(joining):
        values = {
            "body": "quasi-static",
            "skin": {"joining": joining, "shrinkage": 0.0},
            "te": 0.03,
            "flesh": {"gravity": 0},
        }
        params = SOLVER.parse({**values, "temperature": 24.0, "stone": (0, 0)}, "tomato")
        need = Need(fields=("mesh_position", "triangle"), stages=(4.0,), quality="preview")
        run = SOLVER.solve(params, need)
        bare = SOLVER.solve(params.model_copy(update={"skin": None}), need)
        faces = run.triangle.values

        def area(points):
            a, b, c = (points[faces[:, k]].astype(float) for k in range(3))
            return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()

        return area(run.mesh_position.values[0]) / area(bare.mesh_position.values[0])

    assert excess(1.0) < excess(0.0) - 0.01
    assert excess(1.0) < 1.05


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["apple", "orange", "peach", "pear", "tomato"])
def test_a_skin_settles_on_fruits_that_rot_and_dry_to_mummies(preset):
    """With no bound on what is left to fold, all five end in NotConverged between days 10 and 30."""
    values = {"body": "quasi-static", "te": 0.03, "skin": {}}
    need = Need(fields=("mesh_position", "triangle", "mass"), stages=(10.0, 20.0, 30.0), quality="preview")
    run = SOLVER.solve(SOLVER.parse(values, preset), need)
    assert float(run.mass[-1]) < 0.2
    assert (run.skin_residual <= 1e-3).all()
    # no triangle closed like a book: a crumpled skin had some at a thousandth of the mean
    points, faces = run.mesh_position.values[-1].astype(float), run.triangle.values
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert area.min() > 0.02 * area.mean()


def test_a_skin_folds_only_so_deep_as_its_slack():
    """Over a body at a share q of its lengths a skin that does not shrink keeps 1, at most q / (1 - slack)."""
    params = SOLVER.parse({"body": "quasi-static", "te": 0.04}, "orange")
    settings = choose(params, "preview")
    body = Body(params, lay(params, settings.cells), settings.cells, settings.layers, settings.balance)
    wrinkles = Wrinkles(params, Skin(shrinkage=0.0, joining=0.0, slack=0.2), body, settings)
    fresh = lay(params, settings.skin).points
    for share, wanted in ((0.9, 1.0), (0.8, 1.0), (0.6, 0.75), (0.4, 0.5)):
        assert wrinkles._share(share * fresh, share) == pytest.approx(wanted, abs=1e-12)
