"""A part between mirror planes does what the whole fruit does when it starts symmetric."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import registry
from solver.contract import Context, InvalidGeometry
from solver.dehydration import motion
from solver.dehydration.contact.data import HITS
from solver.dehydration.fresh.imperfection import heights
from solver.dehydration.fresh.mesh import build_mesh
from solver.dehydration.fresh.sector import cut, evened, mirrored
from solver.dehydration.kernel import build_layout, make_skin, march, new_state, positions
from solver.dehydration.path import Path
from solver.dehydration.settings import choose

SOLVER = registry.get("dehydration")


def _mesh(n, **more):
    params = SOLVER.parse({"te": 0.1, **more})
    return build_mesh(params, n, np.linspace(0, 1, 4))


@pytest.mark.parametrize("mirrors", ["x", "xz", "xyz"])
def test_images_put_the_whole_together(mirrors):
    mesh = _mesh(6)
    sector = cut(mesh, mirrors)
    assert sector.copies == 2 ** len(mirrors)
    assert len(sector.mesh.connectivity) * sector.copies == len(mesh.connectivity)
    part = sector.mesh.positions[sector.mesh.surface_nodes]
    np.testing.assert_allclose(sector.whole(part), mesh.positions[mesh.surface_nodes], atol=1e-12)


def test_without_mirrors_it_is_the_mesh_itself():
    mesh = _mesh(5)
    sector = cut(mesh, "")
    np.testing.assert_array_equal(sector.mesh.positions, mesh.positions)
    np.testing.assert_array_equal(sector.mesh.connectivity, mesh.connectivity)
    assert not len(sector.planes)
    assert sector.own.all()


def test_evened_heights_are_symmetric_and_as_rough():
    sphere = _mesh(24).sphere
    rough = heights(SOLVER.parse({}), sphere.directions, Context(), highest=24)
    even = evened(rough, cut(_mesh(24), "xyz"))
    order = np.lexsort(np.round(np.abs(sphere.directions), 6).T)
    away = (np.abs(sphere.directions) > 1e-6).all(axis=1)
    groups = even[order][away[order]].reshape(-1, 8)
    assert np.ptp(groups, axis=1).max() < 1e-12
    assert even.std() == pytest.approx(rough.std(), rel=0.3)


def test_a_pattern_that_is_symmetric_already_is_kept_as_it_is():
    sector, sphere = cut(_mesh(24), "xz"), _mesh(24).sphere
    x, y, z = sphere.directions.T
    pattern = np.cos(7 * x) * np.cos(5 * z) * (1 + y)
    assert np.allclose(mirrored(pattern, sector), pattern, rtol=0, atol=1e-12)
    # one that is not becomes so, and stays as high
    uneven = pattern + 0.3 * x
    found = mirrored(uneven, sector)
    assert np.abs(found).max() == pytest.approx(np.abs(uneven).max(), rel=1e-12)
    assert np.allclose(found / np.abs(found).max(), pattern / np.abs(pattern).max(), rtol=0, atol=1e-12)


@pytest.mark.parametrize("mirrors", ["x", "xyz"])
def test_a_step_with_walls_that_touch_across_a_plane(mirrors):
    """One deep groove on each mirror plane: forces, masses and contact of the part are those of the whole."""
    mesh = _mesh(16)
    depth = mesh.depth.copy()
    depth[-3:] = 1
    groove = np.exp(-((mesh.rays[:, ["xyz".index(name) for name in mirrors]] / 0.15) ** 2)).sum(axis=1)
    where = mesh.positions * (1 - 0.5 * np.clip(groove[:, None] * depth[None, :] ** 2, 0, 1)).reshape(-1, 1)
    steps, found = 4, {}
    for name in ("", mirrors):
        sector = cut(mesh, name)
        part = sector.mesh
        mu = np.where(part.is_exocarp, 10.0, 1.0)
        layout = build_layout(
            part.positions,
            part.connectivity,
            part.is_exocarp,
            mu,
            30 * mu,
            part.fixed,
            safety=4,
            mirrored=sector.planes,
        )
        skin = make_skin(
            layout, part.surface_nodes[sector.image], part.sphere.quads, 0.2,
            sign=sector.sign, own=sector.own, share=sector.share,
        )  # fmt: skip
        kept = np.repeat(sector.own, mesh.levels)
        state, velocity = new_state(layout, where[kept])
        touched = march(layout, state, velocity, steps, theta=(0.8, 0.8), damping=0.01, skin=skin)
        assert touched is not None
        assert touched.contact.counts[HITS] > 20
        found[name] = sector.whole(positions(state[part.surface_nodes])), touched.contact.counts[HITS]
        alone, quiet = new_state(layout, where[kept])
        march(layout, alone, quiet, steps, theta=(0.8, 0.8), damping=0.01)
        found[name] += (np.abs(positions(alone) - positions(state)).max(),)
    moved = np.abs(found[""][0] - where[mesh.surface_nodes]).max()
    assert found[""][2] > 0.02 * moved  # contact has a part in it
    assert found[mirrors][1] <= found[""][1]  # images alone are left to what they are images of
    assert np.abs(found[mirrors][0] - found[""][0]).max() < 1e-5 * moved


@pytest.mark.slow  # a whole fruit past its onset; the steps above compare the two at every run
def test_a_buckled_part_is_the_symmetric_whole(monkeypatch):
    """Past the onset of a thick skin: the whole fruit started from the part's bumps arrives at the same shape."""
    common = {"te": 0.06}
    params = {name: SOLVER.parse({**common, "mirrors": name}) for name in ("", "xyz")}
    settings = replace(choose(params["xyz"], "preview"), n=16, settle_steps=600)
    part = Path(params["xyz"], settings, Context())
    small = part.stage(0.13, 0.13)

    def even(*given, **more):
        whole = build_mesh(params[""], settings.n, settings.core)
        return evened(heights(*given, **more), cut(whole, "xyz"))

    monkeypatch.setattr(motion, "heights", even)
    whole = Path(params[""], replace(settings, copies=1), Context())
    assert whole.elements == 8 * part.elements
    large = whole.stage(0.13, 0.13)
    fresh = whole.mesh.positions[whole.mesh.surface_nodes]
    radial = np.einsum("ni,ni->n", large.surface - fresh, whole.mesh.rays)
    assert np.ptp(radial) > 0.02  # it has buckled
    assert np.linalg.norm(small.surface - large.surface, axis=1).max() < 0.02 * np.ptp(radial)
    assert small.energy == pytest.approx(large.energy, rel=1e-3)


@pytest.mark.parametrize(
    ("values", "word"),
    [
        ({"mirrors": "y", "radii": [1, 0.9, 0.8, 0.8, 0.8, 0.85, 1, 0.8]}, "ends of the fruit"),
        ({"mirrors": "xz", "wetness": [0, 0, 0.2]}, "leave z out"),
    ],
)
def test_what_is_not_symmetric_is_refused(values, word):
    with pytest.raises(InvalidGeometry, match=word):
        SOLVER.parse(values)


def test_runs_without_mirrors_keep_their_names():
    assert "mirrors" not in SOLVER.parse({}).model_dump_json()
    assert "mirrors" in SOLVER.parse({"mirrors": "x"}).model_dump_json()
