"""Many fruits in one run: forces, gaps, what goes over from one to the other, and the air between them."""

from itertools import combinations

import numpy as np
import pytest

from solver.contract import InvalidInput, Need
from solver.decay import SOLVER
from solver.decay.body.body import Body
from solver.decay.heap.air import between
from solver.decay.heap.touching import planes
from solver.decay.settings import choose
from solver.geometry.nearest import nearest

#: Two oranges on the floor that just touch, and one on top of them.
PILE = ((-1.04, 1.04, 0.0), (1.04, 1.04, 0.0), (0.0, 2.85, 0.0))


def heap(values=None, **more):
    base = {"places": PILE, "bowl": 0.0, "spread": 0.0, "infected": [0], "step": 0.5}
    given = {"body": "quasi-static", "wounds": [{"position": (1.04, 1.81, 0.0)}], **more}
    return SOLVER.parse({**given, "heap": {**base, **(values or {})}}, "orange")


@pytest.fixture(scope="module")
def run():
    # soft ones, that sag; the first is wounded where the upper one lies on it
    params = heap({"infection": 20.0}, firmness=8)
    return SOLVER.solve(params, Need(stages=(0.0, 3.0, 8.0), quality="preview", fields=SOLVER.fields[2:]))


def surfaces(run, stage):
    points = run["mesh_position"].values[stage].astype(float)
    return [points[run["fruit"].values == b] for b in range(int(run["fruit"].values.max()) + 1)]


def test_no_fruit_is_in_another_or_below_the_floor(run):
    """Distances of all vertices to the nearest triangle of every other fruit: none is inside by more than 1e-3."""
    size = len(surfaces(run, 0)[0])
    faces = run["triangle"].values[: 2 * size - 4].astype(np.int64)
    for stage in range(run.sizes["stage"]):
        fruits = surfaces(run, stage)
        assert min(fruit[:, 1].min() for fruit in fruits) > -1e-3
        for i, j in [*combinations(range(3), 2), (1, 0), (2, 0), (2, 1)]:
            found = nearest(fruits[i], fruits[j], faces)
            a, b, c = fruits[j][faces[found.face]].transpose(1, 0, 2)
            out = np.cross(b - a, c - a)
            place = np.einsum("vk,vkc->vc", found.shares, fruits[j][faces[found.face]])
            inside = np.einsum("vc,vc->v", fruits[i] - place, out) < 0
            assert not (inside & (found.distance > 1e-3)).any()
    assert run["overlap"].values.max() < 1e-5


def test_weight_is_closed_and_shapes_are_at_rest(run):
    closed = run["mass"] + run["water_lost"] + run["juice_lost"] + run["respired"]
    np.testing.assert_allclose(closed.values, 1.0, atol=1e-6)
    assert run["body_residual"].values.max() <= choose(heap(), "preview").balance
    assert run["converged"].values.all()
    assert run["least_jacobian"].values.min() > 0


def test_the_upper_fruit_comes_down_as_those_below_shrink(run):
    tops = [surfaces(run, stage)[2].mean(axis=0)[1] for stage in range(run.sizes["stage"])]
    assert tops[0] > tops[1] > tops[2]
    # and do not roll apart below it
    aside = [surfaces(run, stage)[0].mean(axis=0)[0] for stage in range(run.sizes["stage"])]
    assert max(aside) - min(aside) < 0.05


def test_rot_goes_over_where_fruits_touch_and_not_without_infection(run):
    rotten = run["fruit_rotten"].values
    assert (rotten[0] == 0).all()
    assert (rotten[-1][[0, 2]] > 0).all()
    assert rotten[1][1] == 0  # it touches what is sound until then
    none = SOLVER.solve(heap({"infection": 0.0}, body="none"), Need(stages=(8.0,), quality="preview"))
    assert none["fruit_rotten"].values[0, 0] > 0
    assert (none["fruit_rotten"].values[0, 1:] == 0).all()


def test_rot_starts_where_the_other_fruit_is(run):
    """The first fruit's wound faces the upper one, which rots on the side that faces the first."""
    rot = run["rot"].values[-1][run["fruit"].values == 2]
    first, _, upper = surfaces(run, 2)
    way = first.mean(axis=0) - upper.mean(axis=0)
    towards = (upper - upper.mean(axis=0)) @ way / np.linalg.norm(way)
    assert np.average(towards, weights=rot) > 0.5


def test_a_stage_does_not_depend_on_others():
    need = {"quality": "preview", "fields": ("mesh_position", "rot", "mould")}
    params = heap({"infection": 20.0}, firmness=8)
    both = SOLVER.solve(params, Need(stages=(0.7, 1.3), **need))
    last = SOLVER.solve(params, Need(stages=(1.3,), **need))
    for name in ("mesh_position", "rot", "mould", "fruit_damp"):
        assert np.array_equal(both[name].values[-1], last[name].values[-1]), name


def test_planes_are_pushed_alike_from_both_sides():
    draw = np.random.default_rng(3)
    ahead, behind = draw.uniform(-1, 0.3, (4, 50)), draw.uniform(-0.2, 1, (4, 60))[:, :50]
    stiff = draw.uniform(0.5, 2, (5, 50))
    first, second = np.array([0, 1, 2, 3]), np.array([4, 3, 1, 0])
    place, push = np.empty(4), np.empty(4)
    planes(ahead, behind, stiff, first, second, place, push)
    for c in range(4):
        one = np.sum(stiff[first[c]] * np.maximum(ahead[c] - place[c], 0))
        other = np.sum(stiff[second[c]] * np.maximum(place[c] - behind[c], 0))
        assert one == pytest.approx(other, rel=1e-12)
        assert push[c] == pytest.approx(one, rel=1e-12)


def test_the_lower_fruits_carry_the_upper_one():
    """What the floor pushes up is the weight of all three."""
    from solver.decay.heap import bodies as of
    from solver.decay.heap.kinds import sorted_out
    from solver.decay.heap.lying import lie

    params = heap(firmness=8)
    settings = choose(params, "preview")
    lot = sorted_out(params, params.model_copy(update={"heap": None}), settings.cells)
    surface = lot.surfaces[0]
    heaped = of.Bodies(params, lie(params, lot), lot, settings)
    fresh = heaped.state(0, 0.0, np.zeros(len(surface.points)))
    found = heaped.settled([fresh] * 3, None).found
    assert found is not None
    single = Body(params.model_copy(update={"heap": None}), surface, settings.cells, settings.layers, settings.balance)
    weight = single._pressure * float(np.sum(single.solid.volume))
    up = float(np.sum(heaped._contact * found.met.depth))
    assert up == pytest.approx(3 * weight, rel=3e-3)
    # each of the two pushes from below carries half of the upper one, along a way 60 degrees from the level or so
    assert (found.met.push > 0).sum() >= 2


def test_vapour_of_two_fruits_by_hand_and_of_none():
    """Two alike: E = G (wet - dry) / (1 + G h), h = still R T / (4 pi D r), which is the fixed point of both laws."""
    apart = np.array([[0.0, 0, 0], [0.1, 0, 0]])
    g, wet, dry, full = 1e-8 * np.ones(2), 2600.0, 1300.0, 2650.0
    alone = between(apart, np.full(2, 0.03), g, 22.0, (wet, dry, full), 0.0)
    assert (alone.dries == 1).all()
    assert (alone.damp == 0).all()
    found = between(apart, np.full(2, 0.03), g, 22.0, (wet, dry, full), 1.0)
    raised = 461.53e-3 * 295.15 / (4 * np.pi * 2.545e-5 * 0.1)
    np.testing.assert_allclose(found.dries, 1 / (1 + 1e-8 * raised), rtol=1e-12)
    lost = found.dries * 1e-8 * (wet - dry)
    np.testing.assert_allclose(found.damp, 100 * raised * lost / full, rtol=1e-12)


def test_what_a_heap_cannot_be_is_refused():
    with pytest.raises(InvalidInput, match="numbered 0 to 2"):
        heap({"infected": [3]})
    with pytest.raises(InvalidInput, match="neighbours"):
        heap(neighbours=[{"position": (3, 0, 0)}])
    with pytest.raises(InvalidInput, match="no skin"):
        heap(skin={})
    with pytest.raises(InvalidInput, match="do not fit"):
        SOLVER.solve(
            SOLVER.parse({"heap": {"fruits": 60, "bowl": 1.6}}, "orange"), Need(stages=(0.1,), quality="preview")
        )


def test_as_many_fruits_as_places_or_none_are_named():
    assert SOLVER.parse({"heap": {"places": PILE}}).heap.count == len(PILE)
    assert SOLVER.parse({"heap": {"places": PILE, "fruits": len(PILE)}}).heap.count == len(PILE)
    with pytest.raises(InvalidInput, match=f"{len(PILE)} places and 20 fruits"):
        SOLVER.parse({"heap": {"places": PILE, "fruits": 20}})
