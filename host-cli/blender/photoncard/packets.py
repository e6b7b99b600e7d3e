"""Reads the packets of tev's protocol by which photoncard shows finished tiles.

A packet has its length (`u32`, with these four bytes), the number of an operation (one byte) and arguments.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

_CREATE_IMAGE = 4
_UPDATE_IMAGE = 6
_LARGEST_PACKET = 1 << 30


class PacketError(Exception):
    """Bytes that are no packets."""


@dataclass
class Tile:
    """A rectangle of finished pixels; `y` counts from the top. Pixels have the shape (height, width)."""

    x: int
    y: int
    width: int
    height: int
    channels: dict[str, np.ndarray]


class PacketReader:
    """Assembles packets of bytes that arrive in pieces of any size."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def feed(self, data: bytes) -> Iterator[Tile]:
        """Takes more bytes, and yields the tiles that they complete."""
        self._bytes += data
        while len(self._bytes) >= 4:
            (length,) = struct.unpack_from("<I", self._bytes)
            if not 5 <= length <= _LARGEST_PACKET:
                raise PacketError(f"a packet states a length of {length} bytes")
            if len(self._bytes) < length:
                return
            packet = bytes(self._bytes[:length])
            del self._bytes[:length]
            if packet[4] == _UPDATE_IMAGE:
                yield _tile(packet)
            elif packet[4] != _CREATE_IMAGE:
                raise PacketError(f"a packet has the unknown operation {packet[4]}")


def _tile(packet: bytes) -> Tile:
    try:
        _, place = _text(packet, 6)
        (count,) = struct.unpack_from("<i", packet, place)
        place += 4
        names = []
        for _ in range(count):
            name, place = _text(packet, place)
            names.append(name)
        x, y, width, height = struct.unpack_from("<4i", packet, place)
        offsets = struct.unpack_from(f"<{count}q", packet, place + 16)
        strides = struct.unpack_from(f"<{count}q", packet, place + 16 + 8 * count)
        values = np.frombuffer(packet, "<f4", offset=place + 16 + 16 * count)
        pixels = np.arange(width * height)
        channels = {
            name: values[offset + stride * pixels].reshape(height, width)
            for name, offset, stride in zip(names, offsets, strides)
        }
    except (struct.error, ValueError, IndexError) as error:
        raise PacketError(f"a packet's contents do not fit its length: {error}") from error
    return Tile(x, y, width, height, channels)


def _text(packet: bytes, place: int) -> tuple[str, int]:
    end = packet.index(b"\0", place)
    return packet[place:end].decode("utf-8", "replace"), end + 1
