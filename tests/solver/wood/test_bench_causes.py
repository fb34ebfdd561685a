"""What the bench and the tables of cracks rest on: load on faces, Weibull's size, meshes."""

import numpy as np
import pytest

from benchmarks.wood.bench import SPECIES, bending, bent, size_share
from benchmarks.wood.objectivity import beyond, meshes
from benchmarks.wood.rupture import fibre
from solver.wood.model.grain import weibull_modulus
from solver.wood.params import Grain


def test_a_stick_bears_what_the_weakest_of_its_cells_does():
    """Cells of a correlation volume, each of its own strength after Weibull, stressed as by three-point bending."""
    drawn, m = np.random.default_rng(1), weibull_modulus(0.1)
    along, up, wide = 18, 8, 8
    half = np.outer((np.arange(along) + 0.5) / along, (np.arange(up) + 0.5) / up)
    # both halves of the span, and of the height the half that is pulled
    stress = np.repeat(np.concatenate([half, half])[:, :, None], wide, 2)
    own = drawn.weibull(m, (2000, *stress.shape))
    found = (own / stress).min((1, 2, 3)).mean() / own.mean()
    cells = Grain(strength=0.1, along=0.36 / (2 * along), across=0.025 / np.sqrt(2 * up * wide))
    assert found == pytest.approx(size_share(cells), rel=0.03)
    assert size_share() == pytest.approx(0.9, abs=0.005)


def test_a_load_on_the_whole_section_strains_the_lowest_fibre_more():
    """It cannot warp there; where the load lies on top it can. Stiff in shear, there is nothing to warp."""
    spruce = SPECIES["spruce"]
    assert fibre(spruce, False) == pytest.approx(1.2, abs=0.04)
    assert fibre(spruce, True) == pytest.approx(1.0, abs=0.03)
    assert fibre({**spruce, "shear": 10 * spruce["shear"]}, False) < 1.05


def test_even_sticks_pressed_on_their_faces_break_near_the_published_rupture():
    """Without grain nothing is left of the law of size; bonds and the mesh take the rest."""
    spruce = {**SPECIES["spruce"], "grain": {"strength": 0.0, "stiffness": 0.0}}
    spruce["strain_limit"] *= size_share()
    run = bending(spruce, 1)
    assert bent(run["way"], run["force"])[1] == pytest.approx(70e6, rel=0.12)


def test_meshes_are_compared_beyond_their_seeds_and_from_the_same_cut():
    assert beyond(1.0, [0.9, 1.1]) == 0.0
    assert beyond(1.2, [0.9, 1.1]) == pytest.approx(0.1)
    assert beyond(0.7, [0.9, 1.1]) == pytest.approx(0.2)
    plain = {"test": "DCB", "rods": 24, "by_area": 250.0}
    seeds = [{**plain, "vertices": 33, "cut": 0.08, "area": area} for area in (3.9e-4, 4.1e-4)]
    fine = {**plain, "vertices": 65, "cut": 0.08, "area": 4.5e-4, "by_area": 240.0}
    first, second = meshes([*seeds, fine])
    assert first["first"]
    assert first["spread"] == pytest.approx(0.025)
    assert second["area"] == pytest.approx(1.125)
    assert second["energy"] == pytest.approx(1.08)
    assert second["missed"] == pytest.approx(0.1)
    with pytest.raises(ValueError, match="different cuts"):
        meshes([*seeds, {**fine, "cut": 0.079}])
