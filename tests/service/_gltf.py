"""Binary glTF read by its own JSON."""

from __future__ import annotations

import json
import struct

import numpy as np


def parsed(data: bytes) -> tuple[dict, bytes]:
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def accessor(document: dict, binary: bytes, index: int) -> np.ndarray:
    found = document["accessors"][index]
    view = document["bufferViews"][found["bufferView"]]
    kind = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[found["componentType"]]
    values = np.frombuffer(binary[view["byteOffset"] :][: view["byteLength"]], kind)
    return values.reshape(found["count"], -1)
