"""A heap of several kinds: each has its own flesh and looks, and catches only what can live on it."""

from itertools import permutations

import numpy as np
import pytest

from solver import registry
from solver.contract import InvalidInput, Need
from solver.decay import SOLVER
from solver.decay.fields.rates import daily
from solver.decay.fields.system import System
from solver.decay.heap.kinds import sorted_out
from solver.decay.presets import FRUITS, SPECIES
from solver.geometry.nearest import nearest

#: Kinds of the row, the wounded one in the middle.
ROW = ("pear", "apple", "orange")
MASSES = ("fruit_mass", "fruit_water_lost", "fruit_juice_lost", "fruit_respired")


def row(names, values=None, **more):
    """Fruits side by side on the floor, each touching the next, the middle one wounded on both sides."""
    kinds = [{"preset": name} for name in names]
    bare = SOLVER.parse({"heap": {"kinds": kinds}}, names[1])
    lot = sorted_out(bare, bare.model_copy(update={"heap": None}), 16)
    # half as wide as along x, and how far the lowest point is below the middle
    wide = [s * surface.points[:, 0].max() for s, surface in zip(lot.scale, lot.surfaces, strict=True)]
    low = [-s * surface.points[:, 1].min() for s, surface in zip(lot.scale, lot.surfaces, strict=True)]
    places = ((-wide[0] - wide[1], low[0], 0.0), (0.0, low[1], 0.0), (wide[1] + wide[2], low[2], 0.0))
    wounds = [{"colatitude": 90, "azimuth": 0}, {"colatitude": 90, "azimuth": 180}]
    base = {"kinds": kinds, "places": places, "bowl": 0.0, "spread": 0.0, "infected": [1], "infection": 50.0}
    return SOLVER.parse({"wounds": wounds, "heap": {**base, "step": 0.5, **(values or {})}, **more}, names[1])


@pytest.fixture(scope="module")
def run():
    params = row(ROW, body="quasi-static", firmness=20)
    return SOLVER.solve(params, Need(stages=(0.0, 6.0), quality="preview", fields=SOLVER.fields[2:]))


def surfaces(run, stage):
    points = run["mesh_position"].values[stage].astype(float)
    return points.reshape(run.sizes["fruit_number"], -1, 3)


def test_blue_mould_goes_over_to_a_pear_and_not_to_an_orange(run):
    """P. expansum is no pathogen of sound oranges, nor P. digitatum of apples."""
    rotten = run["fruit_rotten"].values[-1]
    assert rotten[0] > 0
    assert rotten[1] > 0
    assert rotten[2] == 0
    assert run["fruit_species"].values[-1].tolist() == [1, 1, -1]
    back = SOLVER.solve(row(("apple", "orange", "orange")), Need(stages=(7.0,), quality="preview"))
    assert back["fruit_rotten"].values[0, 1] > 0
    assert back["fruit_rotten"].values[0, 2] > 0
    assert back["fruit_rotten"].values[0, 0] == 0


def test_each_fruits_weight_is_closed_and_differs_by_kind(run):
    closed = sum(run[name].values for name in MASSES)
    np.testing.assert_allclose(closed, 1.0, atol=1e-6)
    share = FRUITS["pear"]["weight"] * run["fruit_mass"].values[-1, 0]
    share += FRUITS["apple"]["weight"] * run["fruit_mass"].values[-1, 1]
    share += FRUITS["orange"]["weight"] * run["fruit_mass"].values[-1, 2]
    whole = sum(FRUITS[name]["weight"] for name in ROW)
    assert run["mass"].values[-1] == pytest.approx(share / whole, rel=1e-6)
    # the orange's skin lets ten times as much through as the apple's
    lost = run["fruit_water_lost"].values[-1]
    assert lost[2] > 1.5 * lost[1]
    assert run["converged"].values.all()


def test_sizes_are_those_of_weights_at_one_density(run):
    faces = run["triangle"].values[: 2 * len(surfaces(run, 0)[0]) - 4].astype(np.int64)
    volumes = []
    for points in surfaces(run, 0):
        a, b, c = points[faces].transpose(1, 0, 2)
        volumes.append(np.sum(a * np.cross(b, c)) / 6)
    found = np.array(volumes) / volumes[1]
    wanted = np.array([FRUITS[name]["weight"] / FRUITS["apple"]["weight"] for name in ROW])
    # they sag a little, and facets cut balls and pears differently
    np.testing.assert_allclose(found, wanted, rtol=0.01)


def test_no_fruit_is_in_another_or_below_the_floor(run):
    faces = run["triangle"].values[: 2 * len(surfaces(run, 0)[0]) - 4].astype(np.int64)
    for stage in range(run.sizes["stage"]):
        fruits = surfaces(run, stage)
        assert fruits[..., 1].min() > -1e-3
        for i, j in permutations(range(3), 2):
            found = nearest(fruits[i], fruits[j], faces)
            a, b, c = fruits[j][faces[found.face]].transpose(1, 0, 2)
            place = np.einsum("vk,vkc->vc", found.shares, fruits[j][faces[found.face]])
            inside = np.einsum("vc,vc->v", fruits[i] - place, np.cross(b - a, c - a)) < 0
            assert not (inside & (found.distance > 1e-3)).any()


def test_one_kind_by_name_is_the_heap_of_the_parameters_to_the_byte():
    places = ((-1.04, 1.04, 0.0), (1.04, 1.04, 0.0), (0.0, 2.85, 0.0))
    heap = {"places": places, "bowl": 0.0, "infection": 20.0, "infected": [0]}
    given = {"body": "quasi-static", "wounds": [{"position": (1.04, 1.81, 0.0)}]}
    need = Need(stages=(2.0,), quality="preview", fields=SOLVER.fields[2:])
    plain = SOLVER.solve(SOLVER.parse({**given, "heap": heap}, "orange"), need)
    named = {**heap, "kinds": [{"preset": "orange", "fruits": 3}]}
    kinds = SOLVER.solve(SOLVER.parse({**given, "heap": named}, "orange"), need)
    for name in plain.data_vars:
        if name != "seconds":
            assert plain[name].values.tobytes() == kinds[name].values.tobytes(), name


def test_what_a_fruit_catches_grows_as_it_does_on_that_fruit():
    """A sound pear that Rhizopus comes to has Rhizopus' rates on a pear, and its budget stays closed."""
    peach, pear = (SOLVER.parse({"wounds": ()}, name) for name in ("peach", "pear"))
    system = System(pear, 16, True)
    slow = system.rot.rates.mobility
    system.taken_by(peach.rot, peach.mould)
    quick = pear.model_copy(update={"rot": peach.rot, "mould": peach.mould})
    assert system.rot.rates == daily(peach.rot, quick, system.skin.radius)
    assert system.rot.rates.mobility > 5 * slow
    system.caught(0.0, np.array([0.0, 1.0, 0.0]), 0.15)
    assert np.isfinite(system.next_root(system.start, 10.0))
    state = system.advance(system.root(system.start), 0.0, 0.05)
    assert system.rot.budget_error(state.rot) < 1e-12
    assert state.rot.added > 0


def test_each_kind_is_painted_as_it_is_alone(run):
    looks = registry.get("decay").looks
    params = row(ROW).model_dump(mode="json")
    fields = {name: run[name].values[1] for name in looks.layers if name in run}
    skin = looks.paint(fields, params)
    fur = looks.fur(fields, params)
    for b, (skinned, rotted) in enumerate((("pear", "apple"), ("apple", "apple"), ("orange", "orange"))):
        there = run["fruit"].values == b
        own = {name: values[there] for name, values in fields.items() if name[:4] in ("rot", "moul")}
        lost = run["fruit_water_lost"].values[1, b]
        alone = SOLVER.parse({}, skinned).model_dump(mode="json")
        alone |= {name: FRUITS[rotted][name] for name in ("hyphae", "lesion", "mould_colour")}
        one = looks.paint({**own, "water_lost": np.float32(lost)}, alone)
        np.testing.assert_allclose(skin.colour[there], one.colour, atol=1e-6)
        assert (fur.width[there] == FRUITS[rotted]["hyphae"]["width"]).all()
    assert not np.allclose(skin.colour[run["fruit"].values == 2].mean(axis=0), skin.colour.mean(axis=0), atol=0.05)


def test_what_lives_on_a_fruit_gives_its_lesion_and_felt():
    """Skin is the kind's; an apple that took bull's eye rot from another is as dark as that one where it rots."""
    paint, fur = SOLVER.looks.paint, SOLVER.looks.fur
    mixed = [{"preset": "apple", "fruits": 1}, {"preset": "apple-neofabraea", "fruits": 1}]
    told = SOLVER.parse({"body": "quasi-static", "heap": {"kinds": mixed}}, "apple").model_dump()
    both, none = np.ones(2), np.zeros(2)
    fields = {
        "rot": both,
        "mould": none,
        "mould_active": none,
        "kind": none,
        "living": np.array([0.0, 1.0]),
        "lost": none,
    }
    found, standing = paint(fields, told).colour, fur({**fields, "mould": both}, told)
    for place, name in enumerate(("apple", "apple-neofabraea")):
        alone = SOLVER.parse({}, name).model_dump() | {"skin_colour": FRUITS["apple"]["skin_colour"]}
        alone["peel"] = FRUITS["apple"]["peel"]
        one = {"rot": both, "mould": none, "mould_active": none, "water_lost": 0.0}
        np.testing.assert_allclose(found[place], paint(one, alone).colour[0], rtol=1e-12)
        np.testing.assert_allclose(standing.length[place], fur({**one, "mould": both}, alone).length[0], rtol=1e-12)
    assert found[1].sum() < 0.6 * found[0].sum()


def test_stems_stand_on_their_fruits_and_end_before_the_next_one(run):
    parts = registry.get("decay").looks.parts
    params = row(ROW).model_dump(mode="json")
    stage = {name: run[name].values for name in registry.get("decay").looks.constants if name in run}
    stage |= {"fruit_water_lost": run["fruit_water_lost"].values[0]}
    found = parts(stage, params)
    assert [part.name for part in found].count("stem") == 3
    top = surfaces(run, 0)
    for part in found:
        fruit, vertex = divmod(part.vertex, len(top[0]))
        height = top[fruit][:, 1]
        assert height[vertex] == (height.max() if part.pole == 0 else height.min())
    # what stands below another fruit has no room for a stem
    stage["fruit_headroom"] = np.array([0.01, 0.2, 10.0])
    tall = {p.vertex: np.ptp(p.points[:, 1]) for p in parts(stage, params) if p.name == "stem"}
    assert len(tall) == 2
    assert tall[stage["pole_vertex"][1, 0]] < 0.3
    bowl = [part for part in parts(stage, {**params, "heap": {**params["heap"], "bowl": 4.0}}) if part.pole < 0]
    a, b, c = (bowl[0].points[bowl[0].triangles[:, k]] for k in range(3))
    # caps of two spheres about one middle, cut at the height of the rim
    inner, outer, rim = 4.48, 4.63, 4.63 - np.sqrt(4.48**2 - 4.0**2)
    low = 4.63 - rim
    middle = np.pi * ((2 * outer**3 - 3 * outer**2 * low + low**3) - (2 * inner**3 - 3 * inner**2 * low + low**3)) / 3
    assert np.sum(a * np.cross(b, c)) / 6 == pytest.approx(middle, rel=0.05)


def test_headroom_is_what_planes_leave():
    from solver.decay.heap.bodies import headroom
    from solver.decay.heap.lying import Lying
    from solver.decay.surfaces.surface import geodesic

    rays, _ = geodesic(16)
    # the next fruit that one may meet is half of r1 away
    points = np.stack([rays + np.array(middle) for middle in ((0, 1.0, 0), (0, 3.5, 0), (5.0, 1.0, 0))])
    lying = Lying(np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1)), np.ones(3), None, np.ones(3))
    pole = int(np.argmax(rays[:, 1]))
    room = headroom(points, lying, pole)
    assert room[0] == pytest.approx(0.5)
    assert room[1] == np.inf
    assert room[2] == np.inf
    turned = headroom(points, lying, int(np.argmin(rays[:, 1])))
    assert turned == pytest.approx([0.0, 0.5, 0.0])


def test_what_kinds_cannot_be_is_refused():
    with pytest.raises(InvalidInput, match="take one of apple"):
        SOLVER.parse({"heap": {"kinds": [{"preset": "aple"}]}})
    with pytest.raises(InvalidInput, match="2 fruits and not 5"):
        SOLVER.parse({"heap": {"fruits": 5, "kinds": [{"preset": "apple", "fruits": 2}]}})
    with pytest.raises(InvalidInput, match="1 places for 2 fruits"):
        SOLVER.parse({"heap": {"places": [(0, 1, 0)], "kinds": [{"preset": "apple", "fruits": 2}]}})
    with pytest.raises(InvalidInput, match="80 fruits together"):
        SOLVER.parse({"heap": {"kinds": [{"preset": "apple", "fruits": 40}, {"preset": "pear", "fruits": 40}]}})
    assert set(SPECIES) == set(FRUITS)
