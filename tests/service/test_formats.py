"""Every file format, read back by a reader that is not ours."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from service.errors import InvalidQuery, NotAcceptable
from service.formats import FORMATS, gltf, negotiate, write
from service.formats import mesh as topology
from solver import lattice

from ._shapes import ABOUT, HALF_AXES, ellipsoid, polyhedron_volume


def load(data: bytes, kind: str) -> trimesh.Trimesh:
    mesh = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False)
    closed = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    closed.merge_vertices()
    return closed


@pytest.mark.parametrize("kind", ["obj", "glb"])
@pytest.mark.parametrize("n", [4, 5, 32])
def test_meshes_are_closed_and_enclose_the_right_volume(kind: str, n: int) -> None:
    mesh = load(write(ellipsoid(n), kind, ABOUT), kind)
    assert len(mesh.vertices) == 2 * n * n + 2
    assert len(mesh.faces) == 4 * n * n
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert mesh.volume == pytest.approx(polyhedron_volume(n) * HALF_AXES.prod(), rel=1e-5)


def test_volume_converges_to_the_sphere_in_second_order() -> None:
    exact = 4 / 3 * np.pi
    errors = [exact - load(write(ellipsoid(n, np.ones(3)), "glb"), "glb").volume for n in (16, 32, 64)]
    assert errors[-1] / exact < 2e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.05)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.05)


def test_normals_are_those_of_the_ellipsoid() -> None:
    blob = ellipsoid(64)
    exact = blob.position / HALF_AXES**2
    exact /= np.linalg.norm(exact, axis=-1, keepdims=True)
    lattice_normals, poles = blob.normals, blob.pole_normals
    off = np.degrees(np.arccos(np.clip(np.einsum("ijk,ijk->ij", lattice_normals, exact), -1, 1))).max(axis=1)
    assert off[4:-4].max() < 0.6
    # triangles beside a pole lie on its other side half as wide: their mean by area leans away by a share of a cell
    assert off.max() < 180 / 64
    assert np.allclose(poles, [[0, 1, 0], [0, -1, 0]], atol=1e-5)


def test_a_texture_is_laid_out_as_latitude_and_longitude() -> None:
    """Of a map of n rows the i-th texel's middle, (i + 1/2) / n from the top, is the i-th colatitude over pi."""
    n = 6
    uv = topology.texture(n)[: n * (2 * n + 1)].reshape(n, 2 * n + 1, 2)
    assert np.allclose(uv[..., 1], (lattice.colatitudes(n) / np.pi)[:, None], atol=1e-7)
    assert np.allclose(uv[:, :-1, 0], lattice.azimuths(n) / (2 * np.pi), atol=1e-7)


def test_the_seam_repeats_the_closed_mesh() -> None:
    n = 6
    assert np.array_equal(topology.seam(n)[topology.seam_triangles(n)], topology.triangles(n))
    uv = topology.texture(n)
    spans = np.ptp(uv[topology.seam_triangles(n)][..., 0], axis=1)
    assert spans.max() <= 1 / (2 * n) + 1e-6  # no triangle runs back across the whole picture
    assert topology.triangles(n) is topology.triangles(n)
    assert topology.triangles(n).dtype == np.uint32


def chunks(data: bytes) -> tuple[dict, bytes]:
    magic, version, total = struct.unpack_from("<4sII", data)
    assert (magic, version, total) == (b"glTF", 2, len(data))
    length, kind = struct.unpack_from("<I4s", data, 12)
    assert (length % 4, kind) == (0, b"JSON")
    size, kind = struct.unpack_from("<I4s", data, 20 + length)
    assert (size % 4, kind) == (0, b"BIN\0")
    assert 28 + length + size == total
    return json.loads(data[20 : 20 + length]), data[28 + length :]


@pytest.mark.parametrize(("n", "component"), [(7, 5123), (179, 5123), (180, 5125)])
def test_glb_accessors_say_what_the_buffer_holds(n: int, component: int) -> None:
    document, binary = chunks(write(ellipsoid(n), "glb", ABOUT))
    assert document["buffers"] == [{"byteLength": len(binary)}]
    primitive = document["meshes"][0]["primitives"][0]
    kinds = {5126: "<f4", 5123: "<u2", 5125: "<u4"}
    arrays = {}
    for name, index in {**primitive["attributes"], "indices": primitive["indices"]}.items():
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        arrays[name] = np.frombuffer(
            binary[view["byteOffset"] :][: view["byteLength"]], kinds[accessor["componentType"]]
        ).reshape(accessor["count"], -1)
    count = n * (2 * n + 1) + 4 * n
    assert {name: a.shape for name, a in arrays.items()} == {
        "POSITION": (count, 3),
        "NORMAL": (count, 3),
        "TEXCOORD_0": (count, 2),
        "indices": (12 * n * n, 1),
    }
    position = document["accessors"][primitive["attributes"]["POSITION"]]
    assert position["min"] == arrays["POSITION"].min(axis=0).tolist()
    assert position["max"] == arrays["POSITION"].max(axis=0).tolist()
    assert document["accessors"][primitive["indices"]]["componentType"] == component
    assert arrays["indices"].max() == count - 1
    assert np.allclose(np.linalg.norm(arrays["NORMAL"], axis=1), 1, atol=1e-5)
    assert arrays["TEXCOORD_0"].min() >= 0
    assert arrays["TEXCOORD_0"].max() <= 1


def test_glb_says_where_it_comes_from() -> None:
    document, _ = chunks(write(ellipsoid(4), "glb", ABOUT))
    assert document["asset"]["version"] == "2.0"
    assert document["asset"]["generator"].startswith("wizen")
    extras = document["nodes"][0]["extras"]
    assert extras["params"] == {"te": 0.04, "gamma": 10.0}
    assert extras["stage"] == {"symbol": "s", "value": 0.25}
    assert extras["units"] == {"length": "r1", "te": "r1"}


def test_obj_keeps_every_digit_and_has_texture_and_normals() -> None:
    blob = ellipsoid(12)
    text = write(blob, "obj", ABOUT).decode()
    words = [line.split() for line in text.splitlines()]
    read = np.float32([w[1:] for w in words if w[0] == "v"])
    assert np.array_equal(read[:-2].reshape(blob.position.shape), blob.position)
    uv = np.float32([w[1:] for w in words if w[0] == "vt"])
    assert np.allclose(uv[:, 1], 1 - topology.texture(12)[:, 1])
    corners = np.array([[c.split("/") for c in w[1:]] for w in words if w[0] == "f"], dtype=int) - 1
    assert np.array_equal(corners[..., 0], topology.triangles(12))
    assert np.array_equal(corners[..., 1], topology.seam_triangles(12))
    assert np.array_equal(corners[..., 2], corners[..., 0])
    assert any(w[:2] == ["#", "params:"] for w in words)


def test_npz_is_read_without_pickle_and_is_reproducible() -> None:
    blob = ellipsoid(6)
    data = write(blob, "npz", ABOUT)
    assert data == write(blob, "npz", ABOUT)
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        for name in ("position", "displacement", "poles", "colatitude", "azimuth"):
            assert np.array_equal(archive[name], getattr(blob, name))
        about = json.loads(str(archive["about"]))
    assert about["params"] == {"te": 0.04, "gamma": 10.0}
    assert about["units"]["length"] == "r1"


@pytest.mark.parametrize(
    ("accept", "name"),
    [
        (None, "json"),
        ("", "json"),
        ("*/*", "json"),
        ("model/gltf-binary", "glb"),
        ("Model/GLTF-Binary", "glb"),
        ("model/*", "glb"),
        ("model/*;q=0.5, model/obj", "obj"),
        ("application/json;q=0.2, application/x-npz;q=0.8, */*;q=0.1", "npz"),
        ("text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8", "json"),
        ("application/json;q=0, model/gltf-binary;q=0.1", "glb"),
    ],
)
def test_accept_chooses(accept: str | None, name: str) -> None:
    assert negotiate(accept).name == name


def test_explicit_goes_before_accept() -> None:
    assert negotiate("application/json", "obj") is FORMATS["obj"]


@pytest.mark.parametrize("accept", ["image/png", "application/json;q=0", "nonsense"])
def test_nothing_acceptable(accept: str) -> None:
    with pytest.raises(NotAcceptable, match="model/gltf-binary"):
        negotiate(accept)


def test_unknown_format_is_told_the_nearest() -> None:
    with pytest.raises(InvalidQuery, match="Did you mean 'glb'"):
        write(ellipsoid(4), "glbb")


def test_json_has_numbers_with_units_and_no_surface() -> None:
    document = json.loads(write(ellipsoid(4), "json", ABOUT))
    assert document["descriptors"]["roughness"] | {"long_name": ""} == {"value": 0.01, "units": "1", "long_name": ""}
    assert document["weights"] == {"ab": 0.75, "cd": 0.25}
    assert (document["nearest"], document["exact"], document["digest"]) == (0.5, False, "abc")
    assert (document["lattice"]["colatitude"], document["lattice"]["azimuth"]) == (4, 8)
    assert document["volume"] == pytest.approx(polyhedron_volume(4) * HALF_AXES.prod(), rel=1e-6)


def test_a_mesh_without_positions_is_refused() -> None:
    with pytest.raises(ValueError, match="look the shape up with"):
        write(replace(ellipsoid(4), position=None), "glb")


def test_every_view_of_a_buffer_starts_on_four_bytes() -> None:
    buffer = gltf.Buffer()
    given = [bytes(range(n)) for n in (3, 4, 5, 1, 8)]
    for data in given:
        buffer.raw(data)
    whole = b"".join(buffer.parts)
    assert len(whole) == buffer.length
    for view, data in zip(buffer.views, given, strict=True):
        assert view["byteOffset"] % 4 == 0
        assert whole[view["byteOffset"] :][: view["byteLength"]] == data
