"""Writes PNG images."""

from __future__ import annotations

import struct
import zlib

import numpy as np

_COLOUR_TYPES = {1: 0, 3: 2, 4: 6}


def encode(pixels: np.ndarray) -> bytes:
    """Encodes uint8 or uint16 pixels of the shape (height, width, channels), the top line first."""
    height, width, channels = pixels.shape
    depth = 8 * pixels.dtype.itemsize
    lines = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(">")))
    lines = lines.view(np.uint8).reshape(height, -1)
    filtered = np.zeros((height, lines.shape[1] + 1), np.uint8)
    filtered[:, 1:] = lines
    # Filter "Up": differences from the line above.
    filtered[1:, 0] = 2
    filtered[1:, 1:] -= lines[:-1]
    header = struct.pack(">IIBBBBB", width, height, depth, _COLOUR_TYPES[channels], 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        _chunk(kind, data)
        for kind, data in (
            (b"IHDR", header),
            (b"IDAT", zlib.compress(filtered.tobytes(), 1)),
            (b"IEND", b""),
        )
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
