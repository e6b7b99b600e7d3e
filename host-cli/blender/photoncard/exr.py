"""Reads and writes OpenEXR files of one part with scan lines: what photoncard writes, and what it reads.

Compressions `NONE`, `ZIPS` and `ZIP` are read. Files are written without compression.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

_MAGIC = 20000630
_LINES = {0: 1, 2: 1, 3: 16}
_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
_FLOAT = 2
_NOT_PLAIN = 0x200 | 0x800 | 0x1000


class ExrError(Exception):
    """A file that is no such OpenEXR file, with the reason."""


@dataclass
class Picture:
    """Pixels of the data window, the top line first."""

    width: int
    height: int
    channels: dict[str, np.ndarray]
    attributes: dict[str, bytes]

    def text(self, attribute: str) -> str:
        """Value of an attribute of type string."""
        return self.attributes[attribute].decode("utf-8", "replace")


def read(path: str | os.PathLike[str], wanted: Iterable[str] | None = None) -> Picture:
    """Reads the channels `wanted`, by default all of them, as float32 of the shape (height, width).

    Raises `ExrError`, or `OSError` if the file cannot be read.
    """
    with open(path, "rb") as file:
        data = file.read()
    try:
        return _read(data, None if wanted is None else set(wanted))
    except (struct.error, zlib.error, ValueError, KeyError, IndexError) as error:
        raise ExrError(f"{os.fspath(path)} is no complete OpenEXR file with scan lines: {error}") from error


def _read(data: bytes, wanted: set[str] | None) -> Picture:
    magic, version = struct.unpack_from("<II", data)
    if magic != _MAGIC or version & _NOT_PLAIN:
        raise ValueError("it has another format, several parts or tiles")
    attributes, place = _attributes(data)
    compression = attributes["compression"][0]
    if compression not in _LINES:
        raise ValueError(f"compression {compression} is not supported")
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    if width < 1 or height < 1:
        raise ValueError(f"its data window has {width}x{height} pixels")
    listed = _channel_list(attributes["channels"])
    lines = _LINES[compression]
    offsets = struct.unpack_from(f"<{-(-height // lines)}Q", data, place)
    names = [name for name, _ in listed if wanted is None or name in wanted]
    channels = {name: np.empty((height, width), np.float32) for name in names}
    for offset in offsets:
        first, size = struct.unpack_from("<iI", data, offset)
        first -= top
        rows = min(lines, height - first)
        length = rows * width * sum(dtype.itemsize for _, dtype in listed)
        block = data[offset + 8 : offset + 8 + size]
        raw = block if size == length or compression == 0 else _unzip(block)
        if len(raw) != length:
            raise ValueError(f"a block has {len(raw)} bytes in place of {length}")
        _place_block(raw, first, rows, width, listed, channels)
    return Picture(width, height, channels, attributes)


def _attributes(data: bytes) -> tuple[dict[str, bytes], int]:
    attributes = {}
    place = 8
    while data[place] != 0:
        end = data.index(b"\0", place)
        name = data[place:end].decode("utf-8", "replace")
        begin = data.index(b"\0", end + 1) + 1
        (size,) = struct.unpack_from("<I", data, begin)
        attributes[name] = data[begin + 4 : begin + 4 + size]
        place = begin + 4 + size
    return attributes, place + 1


def _channel_list(data: bytes) -> list[tuple[str, np.dtype]]:
    listed = []
    place = 0
    while data[place] != 0:
        end = data.index(b"\0", place)
        kind, _, across, down = struct.unpack_from("<iIii", data, end + 1)
        if (across, down) != (1, 1):
            raise ValueError("a channel is subsampled")
        listed.append((data[place:end].decode("utf-8", "replace"), _TYPES[kind]))
        place = end + 17
    return listed


def _unzip(block: bytes) -> bytes:
    """Undoes ZIP: deflate, differences of bytes, and the separation of even and odd ones."""
    differences = np.frombuffer(zlib.decompress(block), np.uint8).copy()
    differences[1:] -= 128
    separated = np.cumsum(differences, dtype=np.uint8)
    half = (len(separated) + 1) // 2
    raw = np.empty_like(separated)
    raw[0::2], raw[1::2] = separated[:half], separated[half:]
    return raw.tobytes()


def _place_block(
    raw: bytes,
    first: int,
    rows: int,
    width: int,
    listed: list[tuple[str, np.dtype]],
    channels: dict[str, np.ndarray],
) -> None:
    lines = np.frombuffer(raw, np.uint8).reshape(rows, -1)
    begin = 0
    for name, dtype in listed:
        end = begin + width * dtype.itemsize
        if name in channels:
            values = np.ascontiguousarray(lines[:, begin:end]).view(dtype)
            channels[name][first : first + rows] = values
        begin = end


def write(path: str | os.PathLike[str], pixels: np.ndarray) -> None:
    """Writes float32 pixels of the shape (height, width, 3), the top line first, as R, G and B."""
    height, width, _ = pixels.shape
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    chlist = b"".join(name + struct.pack("<BiIii", 0, _FLOAT, 0, 1, 1) for name in (b"B", b"G", b"R"))
    header = struct.pack("<II", _MAGIC, 2) + b"".join(
        name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value
        for name, kind, value in (
            (b"channels", b"chlist", chlist + b"\0"),
            (b"compression", b"compression", b"\0"),
            (b"dataWindow", b"box2i", window),
            (b"displayWindow", b"box2i", window),
            (b"lineOrder", b"lineOrder", b"\0"),
            (b"pixelAspectRatio", b"float", struct.pack("<f", 1.0)),
            (b"screenWindowCenter", b"v2f", struct.pack("<2f", 0.0, 0.0)),
            (b"screenWindowWidth", b"float", struct.pack("<f", 1.0)),
        )
    )
    header += b"\0"
    line_bytes = 12 * width
    start = len(header) + 8 * height
    offsets = start + np.arange(height, dtype="<u8") * (8 + line_bytes)
    heads = np.empty((height, 2), "<i4")
    heads[:, 0], heads[:, 1] = np.arange(height), line_bytes
    planes = np.asarray(pixels, "<f4")[:, :, ::-1].transpose(0, 2, 1).reshape(height, -1)
    lines = np.concatenate([heads.view(np.uint8), np.ascontiguousarray(planes).view(np.uint8)], axis=1)
    with open(path, "wb") as file:
        file.write(header)
        file.write(offsets.tobytes())
        file.write(lines.tobytes())
