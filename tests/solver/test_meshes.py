"""A mesh in a result comes back as it went in, whether its triangles stay or change."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from solver.meshes import Frame, changing, frame

_RANDOM = np.random.default_rng(1)


def _mesh(vertices: int, faces: int) -> Frame:
    return Frame(
        _RANDOM.normal(size=(vertices, 3)).astype(np.float32),
        _RANDOM.integers(0, vertices, (faces, 3)).astype(np.int32),
        {"rot": _RANDOM.random(vertices).astype(np.float32)},
    )


def _same(one: Frame, other: Frame) -> None:
    np.testing.assert_array_equal(one.vertices, other.vertices)
    np.testing.assert_array_equal(one.triangles, other.triangles)
    np.testing.assert_array_equal(one.fields["rot"], other.fields["rot"])


def test_changing_meshes_come_back() -> None:
    frames = [_mesh(5, 4), _mesh(9, 7), _mesh(3, 1)]
    result = xr.Dataset(changing(frames), {"stage": [0.0, 1.0, 2.0]})
    for index, mesh in enumerate(frames):
        _same(frame(result, index), mesh)
    _same(frame(result, -1), frames[-1])
    with pytest.raises(IndexError, match="3 stages"):
        frame(result, 3)


def test_kept_meshes_come_back() -> None:
    first = _mesh(6, 5)
    frames = [first, first._replace(vertices=2 * first.vertices)]
    data = {
        "mesh_position": (("stage", "vertex", "component"), [mesh.vertices for mesh in frames]),
        "triangle": (("face", "corner"), first.triangles),
        "rot": (("stage", "vertex"), [mesh.fields["rot"] for mesh in frames]),
    }
    result = xr.Dataset(data, {"stage": [0.0, 1.0]})
    for index, mesh in enumerate(frames):
        _same(frame(result, index), mesh)


def test_a_result_without_mesh() -> None:
    with pytest.raises(KeyError):
        frame(xr.Dataset(coords={"stage": [0.0]}), 0)
