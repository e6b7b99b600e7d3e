"""What a glTF 2.0 file says to photoncard: triangles in world space, materials, perspective cameras."""

import base64
import json
import struct
from pathlib import Path

import numpy as np

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
BINARY_MAGIC = b"glTF"
HEADER_BYTES, CHUNK_HEADER_BYTES = 12, 8


class Scene:
    """A scene with every instance resolved.

    `triangles` maps the index of a material to an array of (triangle, corner, axis), metres; `materials` are the file's;
    `cameras` are (name, matrix of the node, perspective).
    """

    def __init__(self, path):
        self.document, self.binary = read(Path(path))
        if any(view.get("byteStride") for view in self.document["bufferViews"]):
            raise ValueError(f"{path}: interleaved vertices are not read here")
        self.materials = self.document["materials"]
        self.cameras = []
        parts = {}
        for root in self.document["scenes"][self.document.get("scene", 0)]["nodes"]:
            self.place(root, np.eye(4), parts)
        self.triangles = {material: np.concatenate(parts[material]) for material in sorted(parts)}

    def place(self, index, parent, parts):
        """Adds a node, and those below it."""
        node = self.document["nodes"][index]
        world = parent @ local_transform(node)
        if "mesh" in node:
            for primitive in self.document["meshes"][node["mesh"]]["primitives"]:
                parts.setdefault(primitive["material"], []).append(self.corners(primitive, world))
        if "camera" in node:
            camera = self.document["cameras"][node["camera"]]
            self.cameras.append((camera.get("name"), world, camera["perspective"]))
        for child in node.get("children", []):
            self.place(child, world, parts)

    def corners(self, primitive, world):
        """The triangles of a primitive; a mirror turns the order of corners, so that fronts stay fronts."""
        positions = self.accessor(primitive["attributes"]["POSITION"]).astype(np.float64)
        placed = positions @ world[:3, :3].T + world[:3, 3]
        triangles = placed[self.accessor(primitive["indices"]).reshape(-1, 3)]
        return triangles[:, ::-1] if np.linalg.det(world[:3, :3]) < 0.0 else triangles

    def accessor(self, index):
        """The elements of an accessor."""
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        values = np.frombuffer(self.binary, COMPONENTS[accessor["componentType"]], accessor["count"] * width, start)
        return values.reshape(-1, 3) if width == 3 else values


def read(path):
    """The JSON of a file and the bytes of its only buffer."""
    data = path.read_bytes()
    if data[:4] != BINARY_MAGIC:
        document = json.loads(data)
        return document, base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    (length,) = struct.unpack_from("<I", data, HEADER_BYTES)
    start = HEADER_BYTES + CHUNK_HEADER_BYTES
    return json.loads(data[start : start + length]), data[start + length + CHUNK_HEADER_BYTES :]


def local_transform(node):
    """The matrix of a node for column vectors."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    if "rotation" in node:
        raise ValueError("nodes with a rotation are not read here: give their matrix")
    matrix = np.diag([*node.get("scale", [1.0, 1.0, 1.0]), 1.0])
    matrix[:3, 3] = node.get("translation", [0.0, 0.0, 0.0])
    return matrix
