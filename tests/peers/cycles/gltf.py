"""glTF files as one JSON document and one buffer: read with all that they refer to, changed, and written as GLB."""

import base64
import json
import struct
from pathlib import Path
from urllib.parse import unquote

import numpy as np

GLB_MAGIC, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942

# Extensions of materials that are removed as a whole by their short name.
EXTENSIONS = {
    name: [f"KHR_materials_{name}"]
    for name in (
        "anisotropy",
        "clearcoat",
        "dispersion",
        "emissive_strength",
        "ior",
        "iridescence",
        "sheen",
        "specular",
        "volume",
    )
}
# A volume has no effect without transmission, and is refraction with it.
EXTENSIONS["transmission"] = [f"KHR_materials_{name}" for name in ("transmission", "volume", "dispersion")]


class Document:
    """A glTF document whose buffers and images are in one buffer."""

    @classmethod
    def empty(cls):
        """A document with a scene of no nodes."""
        document = cls.__new__(cls)
        document.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": []}
        document.binary = bytearray()
        return document

    def __init__(self, path):
        path = Path(path)
        data = path.read_bytes()
        binary = b""
        if data[:4] == struct.pack("<I", GLB_MAGIC):
            text, binary = chunks(data)
        else:
            text = data
        self.json = json.loads(text)
        self.binary = bytearray()
        starts = [
            self.append(read_uri(path.parent, buffer["uri"]) if "uri" in buffer else binary)
            for buffer in self.json.get("buffers", [])
        ]
        for view in self.json.get("bufferViews", []):
            view["byteOffset"] = starts[view["buffer"]] + view.get("byteOffset", 0)
            view["buffer"] = 0
        for image in self.json.get("images", []):
            if "uri" in image:
                data = read_uri(path.parent, image.pop("uri"))
                image["bufferView"] = self.view(data)
                image["mimeType"] = "image/png" if data[:4] == b"\x89PNG" else "image/jpeg"

    def append(self, data):
        """Adds bytes to the buffer, aligned; where they start."""
        self.binary.extend(b"\0" * (-len(self.binary) % 4))
        start = len(self.binary)
        self.binary.extend(data)
        return start

    def view(self, data):
        """A buffer view of new bytes."""
        views = self.json.setdefault("bufferViews", [])
        views.append({"buffer": 0, "byteOffset": self.append(data), "byteLength": len(data)})
        return len(views) - 1

    def accessor(self, values, kind):
        """An accessor of new values: an array of float32 or uint32, a row for each element."""
        values = np.ascontiguousarray(values)
        component = {"float32": 5126, "uint32": 5125}[values.dtype.name]
        accessor = {"bufferView": self.view(values.tobytes()), "componentType": component}
        accessor |= {"count": len(values), "type": kind}
        if kind == "VEC3":
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", accessor)

    def add(self, kind, element):
        """Adds an element to one of the document's lists; its index."""
        self.json.setdefault(kind, []).append(element)
        return len(self.json[kind]) - 1

    def write(self, path):
        """Writes a GLB."""
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.binary) + b"\0" * (-len(self.binary) % 4)
        head = struct.pack("<III", GLB_MAGIC, 2, 12 + 8 + len(text) + 8 + len(binary))
        text = struct.pack("<II", len(text), JSON_CHUNK) + text
        Path(path).write_bytes(head + text + struct.pack("<II", len(binary), BINARY_CHUNK) + binary)

    def roots(self):
        """The nodes of the scene that is shown."""
        return self.json["scenes"][self.json.get("scene", 0)].setdefault("nodes", [])

    def nodes(self):
        """Each node of the scene with its matrix to the world."""
        waiting = [(index, np.eye(4)) for index in self.roots()]
        while waiting:
            index, parent = waiting.pop()
            node = self.json["nodes"][index]
            world = parent @ matrix(node)
            yield node, world
            waiting += [(child, world) for child in node.get("children", [])]

    def bounds(self):
        """The corners of the box around all meshes, skins as they rest."""
        corners = []
        for node, world in self.nodes():
            for primitive in self.json["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
                position = self.json["accessors"][primitive["attributes"]["POSITION"]]
                ends = np.array([position["min"], position["max"]])
                for corner in np.ndindex(2, 2, 2):
                    point = ends[corner, range(3)]
                    corners.append(world[:3, :3] @ point + world[:3, 3])
        return np.min(corners, axis=0), np.max(corners, axis=0)

    def remove(self, feature):
        """Takes a feature from all materials; whether any had it."""
        had = [remove(feature, material) for material in self.json.get("materials", [])]
        used = {name for material in self.json.get("materials", []) for name in material.get("extensions", {})}
        for key in ("extensionsUsed", "extensionsRequired"):
            kept = [name for name in self.json.get(key, []) if "KHR_materials" not in name or name in used]
            self.json.pop(key, None)
            if kept:
                self.json[key] = kept
        return any(had)


def remove(feature, material):
    """Takes a feature from a material; whether it had it."""
    pbr = material.setdefault("pbrMetallicRoughness", {})
    extensions = material.setdefault("extensions", {})
    before = json.dumps(material, sort_keys=True)
    if feature in EXTENSIONS:
        for name in EXTENSIONS[feature]:
            extensions.pop(name, None)
    elif feature == "normal":
        material.pop("normalTexture", None)
        extensions.get("KHR_materials_clearcoat", {}).pop("clearcoatNormalTexture", None)
    elif feature == "alpha":
        material.pop("alphaMode", None)
    elif feature == "blend":
        if material.get("alphaMode") == "BLEND":
            del material["alphaMode"]
    elif feature == "emission":
        for key in ("emissiveFactor", "emissiveTexture"):
            material.pop(key, None)
    elif feature == "base-texture":
        pbr.pop("baseColorTexture", None)
    elif feature == "roughness-texture":
        pbr.pop("metallicRoughnessTexture", None)
    elif feature == "metal":
        pbr["metallicFactor"] = 0.0
    elif feature == "one-sided":
        material["doubleSided"] = True
    elif feature == "gloss":
        pbr["metallicFactor"] = 0.0
        for name in ("clearcoat", "sheen", "iridescence", "anisotropy"):
            extensions.pop(f"KHR_materials_{name}", None)
        extensions["KHR_materials_specular"] = {"specularFactor": 0.0}
    else:
        raise ValueError(f"there is no feature {feature}; there are: {', '.join(FEATURES)}")
    return json.dumps(material, sort_keys=True) != before


# What `remove` takes away.
FEATURES = sorted(
    [*EXTENSIONS, "normal", "alpha", "blend", "emission", "base-texture", "roughness-texture", "metal", "one-sided", "gloss"]
)


def chunks(data):
    """The text and the binary chunk of a GLB."""
    text, binary, at = None, b"", 12
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        chunk = data[at + 8 : at + 8 + length]
        if kind == JSON_CHUNK and text is None:
            text = chunk
        elif kind == BINARY_CHUNK:
            binary = chunk
        at += 8 + length
    return text, binary


def read_uri(folder, uri):
    """The bytes of a data URI or of a file beside the document."""
    if uri.startswith("data:"):
        return base64.b64decode(uri.split(",", 1)[1])
    return (folder / unquote(uri)).read_bytes()


def matrix(node):
    """A node's matrix to its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    result = np.eye(4)
    result[:3, :3] = turn * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    result[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return result
