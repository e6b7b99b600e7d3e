"""Puts a plate of white, nearly smooth metal before a glTF scene's camera, which is turned to look into it.

Gather rays of the plate's lobe end on what is seen: the picture, left and right exchanged, is the
photon map's own estimate, without a final gather in between.
"""

import json
import struct
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "mitsuba"))

import gltf  # noqa: E402: of the folder beside

ROUGHNESS = 0.02
# Distance of the plate from the camera, metres, and its half side over that.
DISTANCE, REACH = 0.004, 4.0
FLOAT, UNSIGNED = 5126, 5125


def add(source, output):
    """Writes the scene with the plate."""
    document, data = gltf.read(source)
    data = bytearray(data[: document["buffers"][0]["byteLength"]])
    data += bytes(-len(data) % 4)
    node = next(node for node in document["nodes"] if "camera" in node)
    world = gltf.local_transform(node)
    right, up, forward, eye = world[:3, 0], world[:3, 1], -world[:3, 2], world[:3, 3]
    half = REACH * DISTANCE
    middle = eye + DISTANCE * forward
    corners = np.array(
        [middle + half * (x * right + y * up) for x, y in ((1, -1), (-1, -1), (-1, 1), (1, 1))]
    )
    plate(document, data, corners)
    # The mirror's image of this camera is the one of before.
    turned = np.eye(4)
    turned[:3, :3] = np.stack([-right, up, forward], axis=1)
    turned[:3, 3] = eye + 2.0 * DISTANCE * forward
    node["matrix"] = turned.T.ravel().tolist()
    document["buffers"] = [{"byteLength": len(data)}]
    output.write_bytes(binary(document, data))


def plate(document, data, corners):
    """Adds the plate, whose front is where its corners turn to the left."""
    indices = np.array([0, 1, 2, 0, 2, 3], np.uint32)
    positions = corners.astype(np.float32)
    views = [view(document, data, values.tobytes()) for values in (positions, indices)]
    limits = {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    first = len(document["accessors"])
    document["accessors"] += [
        {"bufferView": views[0], "componentType": FLOAT, "count": 4, "type": "VEC3", **limits},
        {"bufferView": views[1], "componentType": UNSIGNED, "count": 6, "type": "SCALAR"},
    ]
    metal = {"metallicFactor": 1.0, "roughnessFactor": ROUGHNESS}
    document["materials"].append({"name": "plate", "pbrMetallicRoughness": metal})
    primitive = {
        "attributes": {"POSITION": first},
        "indices": first + 1,
        "material": len(document["materials"]) - 1,
    }
    document["meshes"].append({"name": "plate", "primitives": [primitive]})
    document["nodes"].append({"name": "plate", "mesh": len(document["meshes"]) - 1})
    document["scenes"][document.get("scene", 0)]["nodes"].append(len(document["nodes"]) - 1)


def view(document, data, values):
    """The view of some bytes."""
    document["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": len(values)})
    data += values
    return len(document["bufferViews"]) - 1


def binary(document, data):
    """The bytes of a .glb."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(data), b"BIN\0")
        + bytes(data)
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
