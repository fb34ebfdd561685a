"""body=table: decay says how dry, the table that comes with wizen says how that looks."""

import numpy as np
import pytest

from solver import registry
from solver.contract import Context, InvalidInput, Need
from solver.decay import SOLVER
from solver.decay.surfaces.dried import at_rays
from solver.decay.surfaces.surface import geodesic
from solver.fruit import directions, lattice
from store import starter
from store.lookup import ShapeTable
from store.store import Store
from sweeps import tabled
from sweeps.planning.plan import job
from sweeps.running.work import Task, work

FRUIT = {"body": "table", "transpiration": 14.1, "weight": 87.0, "water_content": 88.0, "wounds": []}


def solve(values=None, context=None, **need):
    chosen = {"fields": ("position", "water_lost"), "stages": (1.0, 2.0), "resolution": 32, **need}
    return SOLVER.solve(SOLVER.parse(FRUIT | (values or {})), Need(**chosen), context or Context(shapes=tabled.shape))


def test_the_shape_is_the_table_s_at_the_water_lost():
    run = solve(resolution=48)
    assert run.attrs["path"] == "closed-form"
    for k in range(2):
        s = 1 - (1 - float(run.water_lost[k])) ** (1 / 3)
        assert 0.05 < s < 0.3
        table = ShapeTable.open(starter.ROOT, surfaces=registry.surface)
        theirs = table.at({"te": 0.04, "gamma": 50}, s, resolution=48).position
        assert np.abs(run.position[k].values - theirs).max() < 1e-5


def test_skin_and_its_thickness_choose_the_sample():
    soft, hard = (solve({"skin": {"stiffness": g}}, stages=(2.0,)).position.values for g in (10, 50))
    assert np.abs(soft - hard).max() > 0.01


def test_a_mesh_is_moved_as_the_lattice_is():
    run = solve(fields=("mesh_position", "triangle", "volume", "position"), stages=(2.0,), quality="preview")
    points, faces = run.mesh_position[0].values, run.triangle.values
    a, b, c = (points[faces[:, k]].astype(float) for k in range(3))
    assert float(run.volume[0]) == pytest.approx(np.sum(a * np.cross(b, c)) / 6, rel=1e-5)
    assert 0.4 < float(run.volume[0]) / (4 / 3 * np.pi * 1.04**3) < 0.75


def test_vectors_of_the_lattice_come_back_at_rays():
    field = np.stack(
        [f(directions(*lattice(32))) for f in (lambda d: d[..., 0] * d[..., 1], *2 * [lambda d: d[..., 2]])]
    )
    rays = geodesic(8)[0]
    found = at_rays(np.moveaxis(field, 0, -1), rays)
    assert np.abs(found[:, 0] - rays[:, 0] * rays[:, 1]).max() < 1e-3
    assert np.abs(found[:, 2] - rays[:, 2]).max() < 1e-3


@pytest.mark.parametrize(
    ("values", "need", "said"),
    [
        ({"stone": (0, 0)}, {}, "rs1"),
        ({"radii": (1, 1.1, 1.1, 1.1, 1.1, 1.1, 1, 1.1)}, {}, "not in the table"),
        ({"exocarp_thickness": 0.05}, {}, "te = 0.05 lies outside"),
        ({}, {"stages": (1.0, 9.0)}, "by day 9 .* stage = .* lies outside"),
        ({}, {"fields": ("least_jacobian",)}, "no flesh"),
        ({"march": 1.0}, {}, "cannot march"),
    ],
)
def test_what_the_table_does_not_hold_is_refused_before_any_step(values, need, said):
    with pytest.raises(InvalidInput, match=said):
        solve(values, **need)


def test_without_a_table_it_says_so():
    with pytest.raises(InvalidInput, match="there is none here"):
        solve(context=Context())


def test_a_job_finds_the_table_too(tmp_path):
    store = Store.open(tmp_path / "store", create=True)
    params = SOLVER.parse(FRUIT)
    need = SOLVER.settle(Need(fields=("position",), stages=(1.0,), resolution=16))
    spec = job(SOLVER, params, need)
    store.ledger.want([spec], "test")
    claimed = store.ledger.claim("tester", 60)
    assert claimed is not None
    assert work(Task(store.root, claimed, 60.0)).state == "done"
    theirs = solve(fields=("position",), stages=(1.0,), resolution=16).position.values
    assert np.array_equal(store.get(spec.key)["position"].values, theirs)
