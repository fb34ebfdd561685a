"""What skin has that is finer than a field, what rot of a species looks like, and what stands at the poles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from solver import registry
from solver.decay.dress.grain import creases, grain, spotted
from solver.decay.dress.peel import LESIONS, PEELS


def params(preset: str) -> dict:
    return registry.get("decay").parse({}, preset).model_dump()


def painted(preset: str, **fields: float):
    paint = registry.get("decay").looks.paint
    assert paint is not None
    known = {"rot": 0.0, "mould": 0.0, "mould_active": 0.0} | fields
    fields = {name: value if name == "water_lost" else np.full(1, value) for name, value in known.items()}
    return paint(fields, params(preset))


def test_a_plane_cuts_as_many_spots_as_the_density_says() -> None:
    x, z = np.meshgrid(np.arange(1000) * 0.006, np.arange(1000) * 0.006)
    places = np.stack([x.ravel(), np.full(x.size, 0.371), z.ravel()], axis=1)
    deep = spotted(places, 30.0, 0.03, 3).reshape(x.shape)
    assert deep.max() == 1
    assert deep.min() == 0
    _, count = ndimage.label(deep > 0)
    wanted = 30 * 36.0
    assert abs(count - wanted) < 5 * np.sqrt(wanted)  # the count is Poisson's, some touch
    assert np.array_equal(deep.ravel()[:5000], spotted(places[:5000], 30.0, 0.03, 3))  # it belongs to the place


def test_what_is_too_fine_is_left_out() -> None:
    ball = np.random.default_rng(0).standard_normal((200, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    assert set(grain(ball, 0.3, params("apple"))) == {"blush"}
    assert {"spot", "fluff", "edge", "shrivel", "blush"} == set(grain(ball, 0.005, params("apple")))
    assert grain(ball, 0.005, {}) == {}


def test_rot_has_the_colour_and_the_gloss_of_its_species() -> None:
    tan, dark, wet = (painted(name, rot=1.0) for name in ("apple", "apple-neofabraea", "peach"))
    assert dark.colour.sum() < 0.5 * tan.colour.sum()
    assert wet.roughness[0] < tan.roughness[0] < dark.roughness[0]
    citrus, fresh = painted("orange", rot=1.0).colour[0], painted("orange").colour[0]
    assert citrus[0] > 2 * tan.colour[0, 0]  # a citrus keeps much of its own colour
    assert citrus.sum() < fresh.sum()
    for preset, lesion in (("apple", "penicillium-expansum"), ("tomato", "rhizopus")):
        assert painted(preset, rot=1.0).roughness[0] == LESIONS[lesion].roughness
        assert painted(preset, rot=1.0, mould=1.0).roughness[0] == 1.0


def test_a_spot_of_bulls_eye_rot_is_dark_about_a_paler_middle_in_rings() -> None:
    """Brown to dark brown with a lighter brown to tan centre (WSU Tree Fruit)."""
    rim, middle = (painted("apple-neofabraea", rot=1.0, rot_age=days).colour[0] for days in (0.5, 16.0))
    assert middle.sum() > 2.5 * rim.sum()
    assert middle[0] > middle[1] > middle[2]
    light, dark = (painted("apple-neofabraea", rot=1.0, rot_age=days).colour[0].sum() for days in (16.0, 18.0))
    assert dark < 0.9 * light
    young, old = (painted("apple", rot=1.0, rot_age=days).colour[0] for days in (0.5, 16.0))
    assert np.array_equal(young, old)  # blue mould's has no such middle


def test_ripe_green_mould_is_olive_and_its_margin_white() -> None:
    ripe = painted("orange", rot=1.0, mould=1.0).colour[0]
    assert ripe[1] > 0.95 * ripe[0] > 1.5 * ripe[2]
    rim = painted("orange", rot=1.0, mould=0.2, mould_active=0.2).colour[0]
    assert rim.min() > 0.6
    paper = painted("orange-paper", rot=1.0, mould=1.0).colour[0]
    assert paper[2] > paper[1] > paper[0]  # grey-blue, as the paper draws it


def test_skin_browns_by_drying_too() -> None:
    fresh, dry = painted("pear"), painted("pear", water_lost=0.6)
    assert dry.colour.sum() < 0.7 * fresh.colour.sum()
    assert dry.colour[0, 0] > 1.5 * dry.colour[0, 1]
    assert dry.roughness[0] > fresh.roughness[0]


@pytest.mark.parametrize("fruit", sorted(PEELS))
def test_stems_and_calyces_are_whole(fruit: str) -> None:
    parts = registry.get("decay").looks.parts
    assert parts is not None
    found = {part.name: part for part in parts({"water_lost": 0.0}, params(fruit))}
    assert set(found) == {"stem"} | ({"calyx"} if PEELS[fruit].sepals else set())
    stem = found["stem"]
    assert np.isclose(stem.points[:, 1].max(), PEELS[fruit].stem)
    # closed but for the foot in the flesh: each edge once each way
    ends = np.sort(np.concatenate([stem.triangles[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    _, uses = np.unique(ends, axis=0, return_counts=True)
    assert np.count_nonzero(uses == 1) == 10
    assert uses.max() == 2
    a, b, c = (stem.points[stem.triangles[:, k]] for k in range(3))
    out = np.cross(b - a, c - a)
    middle = np.stack([0 * a[:, 1], a[:, 1], 0 * a[:, 1]], axis=1)
    outwards = np.einsum("ij,ij->i", out, a - middle)[
        stem.points[stem.triangles].max(axis=1)[:, 1] < 0.3 * PEELS[fruit].stem
    ]
    assert (outwards > 0).all()
    if "calyx" in found:
        wide = np.linalg.norm(found["calyx"].points[:, [0, 2]], axis=1).max()
        assert np.isclose(wide, PEELS[fruit].sepal, rtol=1e-6)
        withered = {p.name: p for p in parts({"water_lost": 0.5}, params(fruit))}["calyx"].colour
        assert not np.allclose(withered, found["calyx"].colour) or fruit in ("apple", "pear")


def test_a_mesh_of_one_s_own_and_a_heap_have_no_stem() -> None:
    parts = registry.get("decay").looks.parts
    assert parts is not None
    assert parts({}, params("apple") | {"mesh": {"points": []}}) == []
    assert parts({}, params("apple") | {"heap": {"fruits": 3}}) == []


@pytest.mark.parametrize(("lost", "joined"), [(0.05, 0.5), (0.10, 0.0), (0.12, 0.8)])
def test_fine_creases_hold_the_area_that_is_too_much(lost: float, joined: float) -> None:
    """A sheet's area with its heights on, by triangles, against the surplus of the skin over the flesh below it."""
    side = np.arange(0, 2, 0.004)
    x, z = np.meshgrid(side, side, indexing="ij")
    flat = np.stack([x.ravel(), np.full(x.size, 0.3), z.ravel()], axis=1)
    said = {**params("apple"), "skin": {"shrinkage": joined}}
    high = creases(grain(flat, 0.004, said)["shrivel"], np.array(lost), said)
    lifted = (flat + high[:, None] * [0, 1, 0]).reshape(*x.shape, 3)
    right, down = lifted[1:, :-1] - lifted[:-1, :-1], lifted[:-1, 1:] - lifted[:-1, :-1]
    area = np.linalg.norm(np.cross(right, down), axis=-1).sum() / 0.004**2 / right[..., 0].size
    surplus = (1 - joined) * (1 - (1 - lost) ** (1 / 3))
    # less what a sound skin takes up, and the next order of the slope
    assert area - 1 == pytest.approx(2 * (min(surplus, 0.035) - 0.003), rel=0.12)
    assert np.ptp(creases(np.linspace(-1, 1, 9), np.array(0.005), said)) == 0
