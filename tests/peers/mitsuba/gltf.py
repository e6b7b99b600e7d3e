"""What a glTF 2.0 file says to photoncard: triangles in world space with what their corners have, materials, textures,
perspective cameras."""

import base64
import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = 4, 5, 6
WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
BINARY_MAGIC = b"glTF"
HEADER_BYTES, CHUNK_HEADER_BYTES = 12, 8


@dataclass
class Part:
    """Triangles of one material. Arrays are (triangle, corner, axis); without normals the triangles are flat."""

    material: int
    positions: np.ndarray
    normals: np.ndarray | None
    coordinates: np.ndarray | None
    colours: np.ndarray | None

    @classmethod
    def joined(cls, parts):
        """One part of several that have the same attributes."""
        arrays = {}
        for name in ("positions", "normals", "coordinates", "colours"):
            values = [getattr(part, name) for part in parts]
            arrays[name] = None if values[0] is None else np.concatenate(values)
        return cls(parts[0].material, **arrays)


@dataclass
class Texture:
    """An image as it lies on a surface: `coordinates' = matrix @ coordinates + offset`."""

    image: bytes
    wrap: tuple
    matrix: np.ndarray
    offset: np.ndarray


class Scene:
    """A scene with every instance resolved.

    `parts` are the triangles by material and attributes; `materials` are the file's; `cameras` are (name, matrix of the
    node, perspective).
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
        self.parts = [Part.joined(parts[key]) for key in sorted(parts)]

    def place(self, index, parent, parts):
        """Adds a node, and those below it."""
        node = self.document["nodes"][index]
        world = parent @ local_transform(node)
        if "mesh" in node:
            for primitive in self.document["meshes"][node["mesh"]]["primitives"]:
                part = self.part(primitive, world)
                key = (part.material, *(getattr(part, name) is None for name in ("normals", "coordinates", "colours")))
                parts.setdefault(key, []).append(part)
        if "camera" in node:
            camera = self.document["cameras"][node["camera"]]
            self.cameras.append((camera.get("name"), world, camera["perspective"]))
        for child in node.get("children", []):
            self.place(child, world, parts)

    def part(self, primitive, world):
        """The triangles of a primitive; a mirror turns the order of corners, so that fronts stay fronts."""
        attributes = primitive["attributes"]
        linear = world[:3, :3]
        positions = self.accessor(attributes["POSITION"]) @ linear.T + world[:3, 3]
        corners = self.corners(primitive, len(positions))
        if np.linalg.det(linear) < 0.0:
            corners = corners[:, ::-1]
        normals = None
        if "NORMAL" in attributes:
            normals = self.accessor(attributes["NORMAL"]) @ np.linalg.inv(linear)
            normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True))[corners]
        coordinates, colours = (
            self.accessor(attributes[name])[corners] if name in attributes else None for name in ("TEXCOORD_0", "COLOR_0")
        )
        return Part(primitive["material"], positions[corners], normals, coordinates, colours)

    def corners(self, primitive, count):
        """The vertices of each triangle of a primitive."""
        indices = self.accessor(primitive["indices"]).astype(np.int64) if "indices" in primitive else np.arange(count)
        mode = primitive.get("mode", TRIANGLES)
        if mode == TRIANGLES:
            return indices.reshape(-1, 3)
        if mode == TRIANGLE_STRIP:
            # glTF 2.0, 3.7.2.1: every other triangle is turned.
            order = [(i, i + 1 + i % 2, i + 2 - i % 2) for i in range(len(indices) - 2)]
        elif mode == TRIANGLE_FAN:
            order = [(i + 1, i + 2, 0) for i in range(len(indices) - 2)]
        else:
            raise ValueError(f"primitives of mode {mode} are not read here")
        return indices[np.array(order)]

    def accessor(self, index):
        """The elements of an accessor."""
        accessor = self.document["accessors"][index]
        if accessor.get("normalized"):
            raise ValueError("normalised integers are not read here")
        view = self.document["bufferViews"][accessor["bufferView"]]
        width = WIDTHS[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        values = np.frombuffer(self.binary, COMPONENTS[accessor["componentType"]], accessor["count"] * width, start)
        return values.astype(np.float64).reshape(-1, width) if width > 1 else values

    def texture(self, info):
        """The texture that a material refers to."""
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        if info.get("texCoord", 0) != 0 or "texCoord" in transform:
            raise ValueError("a second set of texture coordinates is not read here")
        texture = self.document["textures"][info["index"]]
        sampler = self.document["samplers"][texture["sampler"]] if "sampler" in texture else {}
        view = self.document["bufferViews"][self.document["images"][texture["source"]]["bufferView"]]
        start = view.get("byteOffset", 0)
        cosine, sine = np.cos(transform.get("rotation", 0.0)), np.sin(transform.get("rotation", 0.0))
        # KHR_texture_transform: translation * rotation * scale.
        matrix = np.array([[cosine, sine], [-sine, cosine]]) @ np.diag(transform.get("scale", [1.0, 1.0]))
        return Texture(
            image=self.binary[start : start + view["byteLength"]],
            wrap=tuple(WRAPS[sampler.get(name, 10497)] for name in ("wrapS", "wrapT")),
            matrix=matrix,
            offset=np.array(transform.get("offset", [0.0, 0.0])),
        )


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
