"""Writes glTF 2.0 in binary form (.glb). Knows nothing of Blender."""

from __future__ import annotations

import json
import os
import struct
from typing import Any, BinaryIO

import numpy as np

GENERATOR = "photoncard-blender"

_ARRAY_BUFFER = 34962
_ELEMENT_ARRAY_BUFFER = 34963
_COMPONENTS = {"float32": 5126, "uint32": 5125, "uint16": 5123, "uint8": 5121}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_LARGEST_FILE = 2**32 - 1


class TooLarge(Exception):
    """A scene whose data exceed the 4 GiB of a .glb file."""


class Glb:
    """A glTF document under construction, with its binary data."""

    def __init__(self) -> None:
        self.root: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": GENERATOR},
            "scene": 0,
            "scenes": [{"nodes": []}],
        }
        self._extensions: set[str] = set()
        self._data: list[memoryview] = []
        self._length = 0

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Appends an item to a list of the root, and returns its index."""
        items = self.root.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def add_node(self, node: dict[str, Any]) -> int:
        """Appends a node to the scene."""
        index = self.add("nodes", node)
        self.root["scenes"][0]["nodes"].append(index)
        return index

    def add_light(self, light: dict[str, Any]) -> int:
        """Appends a light of `KHR_lights_punctual`."""
        self.use("KHR_lights_punctual")
        extension = self.root.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})
        extension["lights"].append(light)
        return len(extension["lights"]) - 1

    def use(self, extension: str) -> None:
        """Names an extension as used."""
        self._extensions.add(extension)

    def attribute(self, values: np.ndarray, with_bounds: bool = False) -> int:
        """Adds an accessor of vertices, whose rows are float32. Positions need bounds."""
        accessor = self._accessor(values, _ARRAY_BUFFER)
        if with_bounds:
            accessor["min"] = values.min(axis=0).tolist()
            accessor["max"] = values.max(axis=0).tolist()
        return self.add("accessors", accessor)

    def indices(self, values: np.ndarray) -> int:
        """Adds an accessor of indices."""
        return self.add("accessors", self._accessor(values, _ELEMENT_ARRAY_BUFFER))

    def image(self, encoded: bytes, mime_type: str, name: str) -> int:
        """Adds an encoded image."""
        view = self._view(memoryview(encoded), None)
        return self.add("images", {"bufferView": view, "mimeType": mime_type, "name": name})

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the file.

        Raises `TooLarge`, or `OSError` if the file cannot be written.
        """
        root = dict(self.root)
        if self._extensions:
            root["extensionsUsed"] = sorted(self._extensions)
        if self._length:
            root["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(root, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + (8 + self._length if self._length else 0)
        if total > _LARGEST_FILE:
            raise TooLarge(f"the scene has {total} bytes, and a .glb file at most {_LARGEST_FILE}")
        with open(path, "wb") as file:
            self._write_chunks(file, text, total)

    def _write_chunks(self, file: BinaryIO, text: bytes, total: int) -> None:
        file.write(struct.pack("<4sII", b"glTF", 2, total))
        file.write(struct.pack("<I4s", len(text), b"JSON"))
        file.write(text)
        if self._length:
            file.write(struct.pack("<I4s", self._length, b"BIN\0"))
            for part in self._data:
                file.write(part)
                file.write(b"\0" * (-part.nbytes % 4))

    def _accessor(self, values: np.ndarray, target: int) -> dict[str, Any]:
        values = np.ascontiguousarray(values)
        width = values.shape[1] if values.ndim == 2 else 1
        view = self._view(memoryview(values).cast("B") if values.size else memoryview(b""), target)
        return {
            "bufferView": view,
            "componentType": _COMPONENTS[values.dtype.name],
            "count": len(values),
            "type": _TYPES[width],
        }

    def _view(self, data: memoryview, target: int | None) -> int:
        view = {"buffer": 0, "byteOffset": self._length, "byteLength": data.nbytes}
        if target is not None:
            view["target"] = target
        self._data.append(data)
        self._length += data.nbytes + -data.nbytes % 4
        return self.add("bufferViews", view)
