"""A scene's file read by its own JSON: world positions of every instance's vertices."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from .._gltf import parsed

_KINDS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_MESHOPT = "EXT_meshopt_compression"


def array(document: dict[str, Any], binary: bytes, index: int) -> np.ndarray:
    """Return an accessor's values, as they count: normalized ones over their largest."""
    found = document["accessors"][index]
    view = document["bufferViews"][found["bufferView"]]
    if _MESHOPT in view.get("extensions", {}):
        data = _decoded(view["extensions"][_MESHOPT], binary)
        start = 0
    else:
        data, start = binary, view["byteOffset"]
    kind = np.dtype(_KINDS[found["componentType"]])
    columns = _COLUMNS[found["type"]]
    stride = view.get("byteStride", kind.itemsize * columns)
    start += found.get("byteOffset", 0)
    rows = np.ndarray((found["count"], columns), kind, data, start, (stride, kind.itemsize))
    if found.get("normalized"):
        return np.maximum(rows / np.iinfo(kind).max, -1)
    return rows


def _decoded(said: dict[str, Any], binary: bytes) -> bytes:
    from meshoptimizer import decoder

    data = binary[said["byteOffset"] :][: said["byteLength"]]
    if said["mode"] == "ATTRIBUTES":
        return decoder.decode_vertex_buffer(said["count"], said["byteStride"], data).tobytes()
    indices = decoder.decode_index_buffer(said["count"], 4, data)
    return indices.astype("<u2" if said["byteStride"] == 2 else "<u4").tobytes()


def placed(document: dict[str, Any], binary: bytes, node: dict[str, Any]) -> tuple[list[np.ndarray], np.ndarray]:
    """Return translations, rotations and scales of a node's instances, and in what way it mirrors all of them."""
    said = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
    if said is None:
        scale = np.array(node["scale"])
        mirror = np.sign(scale)
        turn = np.array(node["rotation"]) * [1, mirror[0], mirror[0], 1]  # of what is mirrored afterwards
        return [np.array([x]) for x in (np.array(node["translation"]) * mirror, turn, np.abs(scale))], mirror
    parts = [array(document, binary, said["attributes"][n]) for n in ("TRANSLATION", "ROTATION", "SCALE")]
    return parts, np.array(node.get("scale", [1, 1, 1]))


def instances(data: bytes) -> list[tuple[str, np.ndarray, np.ndarray, bool]]:
    """Return name, world positions (v, 3), triangles and whether it is a mirror image, of every instance."""
    document, binary = parsed(data)
    root = document["nodes"][document["scenes"][0]["nodes"][0]]
    found = []
    for number in root.get("children", []):
        node = document["nodes"][number]
        if "etag" not in document["meshes"][node["mesh"]].get("extras", {}):
            continue
        primitive = document["meshes"][node["mesh"]]["primitives"][0]
        points = array(document, binary, primitive["attributes"]["POSITION"]).astype(float)
        triangles = array(document, binary, primitive["indices"]).reshape(-1, 3).astype(int)
        parts, mirror = placed(document, binary, node)
        for move, turn, grow in zip(*parts, strict=True):
            world = (Rotation.from_quat(turn).apply(points * grow) + move) * mirror * root["scale"]
            found.append((node["name"], world, triangles, bool(mirror[0] < 0)))
    return found
