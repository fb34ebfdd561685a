"""Rot and mould as colours, and colours in the renderer."""

import io

import numpy as np
import xarray as xr
from matplotlib.image import imread

from solver import registry
from solver.contract import Need
from solver.fruit import directions, lattice
from sweeps import outputs
from sweeps.formats import Made
from sweeps.pictures import colours
from sweeps.pictures.render import View, render


def test_a_picture_takes_the_colours_of_its_surface() -> None:
    ball = directions(*lattice(24))
    paint = np.zeros((24, 48, 3))
    paint[:12] = [0.0, 0.6, 0.0]
    paint[12:] = [0.0, 0.0, 0.6]
    image = render(ball, pixels=96, view=View(elevation=0, extent=1.2), colour=paint).astype(float)
    top, bottom = image[20:40, 40:56], image[56:70, 40:56]
    assert top[..., 1].min() > 1.5 * top[..., 2].max()
    assert bottom[..., 2].min() > 1.5 * bottom[..., 1].max()


def layered(rot: float, mould: float, active: float) -> np.ndarray:
    params = registry.get("decay").parse({}, "orange")
    maps = {"rot": rot, "mould": mould, "mould_active": active}
    fields = {name: (("stage", "colatitude", "azimuth"), np.full((1, 4, 8), value)) for name, value in maps.items()}
    skin = colours.of_run(xr.Dataset(fields, attrs={"solver": "decay", "params": params.model_dump_json()}), 0)
    assert skin is not None
    assert skin.colour.shape == (4, 8, 3)
    return skin.colour[0, 0]


def test_fresh_skin_rot_rim_and_spores() -> None:
    params = registry.get("decay").parse({}, "orange")
    assert np.allclose(layered(0, 0, 0), params.skin_colour)
    rotten, rim, spores = layered(1, 0, 0), layered(1, 0.2, 0.2), layered(1, 0.9, 0.9)
    assert rotten.sum() < 0.8 * sum(params.skin_colour)  # a citrus rots in its own colour, duller
    assert rotten[0] > rotten[1] > rotten[2]
    assert rim.min() > 0.6
    assert np.allclose(spores, params.mould_colour, atol=0.06)
    assert np.allclose(layered(1, 0.9, 0.0), spores)


def test_a_run_without_maps_has_no_colours() -> None:
    assert colours.of_run(xr.Dataset({"mean_rot": ("stage", [0.0])}), 0) is None


def test_a_solved_run_is_drawn_with_its_mould() -> None:
    solver = registry.get("decay")
    need = Need(quality="preview", resolution=24, stages=(0.0,), fields=("position", "rot", "mould", "mould_active"))
    params = solver.parse({"wounds": [{"colatitude": 60, "azimuth": 35, "radius": 0.6}]}, "apple-paper")
    result = solver.solve(params, need)
    shapes = [outputs.of_result(result, {}, 0)]
    drawn = []
    for run in (result, None):
        encoder = outputs.suffixes(True)[".png"]
        assert encoder is not None
        drawn.append(imread(io.BytesIO(encoder.encode(Made(shapes, {}, "apple", run=run, stage_symbol="t")))))
    assert np.abs(drawn[0] - drawn[1]).max() > 0.3
