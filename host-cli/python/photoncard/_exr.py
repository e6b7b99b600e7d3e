"""Reads the OpenEXR files that photoncard writes: one part of scanlines, without compression or with ZIP."""

from __future__ import annotations

import os
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn, Union

import numpy as np
import numpy.typing as npt

from ._errors import Error

Array = npt.NDArray[np.float32]
Channel = npt.NDArray[Union[np.float32, np.uint32]]

_MAGIC = b"v/1\x01"
_LONG_NAMES = 0x400
_SAMPLES = (np.dtype("<u4"), np.dtype("<f2"), np.dtype("<f4"))
#: Rows of a block by compression: none, ZIP of single rows, ZIP of sixteen.
_ROWS = {0: 1, 2: 1, 3: 16}
_COMPRESSIONS = ("none", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB")
_MAX_BYTES = 1 << 36


@dataclass(frozen=True)
class Exr:
    """Contents of an EXR file."""

    #: Samples by the names of the channels: ``float32``, or ``uint32`` of channels of whole numbers.
    channels: dict[str, Channel]
    #: First column and row, and last column and row, of the samples in the full picture.
    data_window: tuple[int, int, int, int]
    display_window: tuple[int, int, int, int]
    #: Attributes of type ``string``.
    texts: dict[str, str]


def read_exr(path: Union[str, os.PathLike[str]]) -> Exr:
    """Reads an EXR file.

    Raises:
        Error: if the file cannot be read, is damaged, or has another form than photoncard's.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except OSError as reason:
        raise Error(f"cannot read {path}: {reason.strerror}", "check the path") from reason
    return _Reader(path, content).read()


class _Reader:
    def __init__(self, path: Path, content: bytes) -> None:
        self._path = path
        self._content = content
        self._at = 0

    def read(self) -> Exr:
        if self._take(4) != _MAGIC:
            self._refuse("it is no OpenEXR file")
        (version,) = struct.unpack("<I", self._take(4))
        if version & ~_LONG_NAMES != 2:
            self._refuse("it has tiles, several parts or deep samples")
        attributes = self._attributes()
        window = self._window(attributes, "dataWindow")
        display = self._window(attributes, "displayWindow")
        types = self._channels(attributes)
        compression = self._value(attributes, "compression", "compression")[0]
        if compression not in _ROWS:
            name = _COMPRESSIONS[compression] if compression < len(_COMPRESSIONS) else str(compression)
            self._refuse(f"it has the compression {name}, and ZIP or none is read")
        channels = self._pixels(types, window, compression)
        texts = {
            name: value.decode("utf-8", "replace")
            for name, (kind, value) in attributes.items()
            if kind == "string"
        }
        return Exr(channels, window, display, texts)

    def _refuse(self, reason: str) -> NoReturn:
        raise Error(f"{self._path} cannot be read as a picture: {reason}", "render or copy it again")

    def _take(self, count: int) -> bytes:
        taken = self._content[self._at : self._at + count]
        if count < 0 or len(taken) != count:
            self._refuse("it is truncated")
        self._at += count
        return taken

    def _text(self) -> str:
        end = self._content.find(b"\0", self._at, self._at + 256)
        if end < 0:
            self._refuse("a name in its head has no end")
        text = self._content[self._at : end]
        self._at = end + 1
        return text.decode("utf-8", "replace")

    def _attributes(self) -> dict[str, tuple[str, bytes]]:
        attributes: dict[str, tuple[str, bytes]] = {}
        while True:
            name = self._text()
            if not name:
                return attributes
            kind = self._text()
            (size,) = struct.unpack("<i", self._take(4))
            attributes[name] = (kind, self._take(size))

    def _value(self, attributes: dict[str, tuple[str, bytes]], name: str, kind: str) -> bytes:
        found, value = attributes.get(name, ("", b""))
        if found != kind or not value:
            self._refuse(f"its head has no {name}")
        return value

    def _window(self, attributes: dict[str, tuple[str, bytes]], name: str) -> tuple[int, int, int, int]:
        value = self._value(attributes, name, "box2i")
        if len(value) != 16:
            self._refuse(f"its {name} has {len(value)} bytes")
        left, top, right, bottom = struct.unpack("<4i", value)
        if right < left or bottom < top:
            self._refuse(f"its {name} is empty")
        return left, top, right, bottom

    def _channels(self, attributes: dict[str, tuple[str, bytes]]) -> list[tuple[str, np.dtype]]:
        head = _Reader(self._path, self._value(attributes, "channels", "chlist"))
        channels = []
        while True:
            name = head._text()
            if not name:
                return channels
            sample, _, across, down = struct.unpack("<iiii", head._take(16))
            if not 0 <= sample < len(_SAMPLES):
                self._refuse(f"the channel {name} has samples of type {sample}")
            if (across, down) != (1, 1):
                self._refuse(f"the channel {name} has a sample for {across} x {down} pixels")
            channels.append((name, _SAMPLES[sample]))

    def _pixels(
        self, types: list[tuple[str, np.dtype]], window: tuple[int, int, int, int], compression: int
    ) -> dict[str, Channel]:
        left, top, right, bottom = window
        width, height = right - left + 1, bottom - top + 1
        row_bytes = width * sum(sample.itemsize for _, sample in types)
        if row_bytes * height > _MAX_BYTES:
            self._refuse(f"it states {width} x {height} pixels")
        together = _ROWS[compression]
        count = -(-height // together)
        offsets = struct.unpack(f"<{count}Q", self._take(8 * count))
        content = np.empty((height, row_bytes), np.uint8)
        seen = set()
        for self._at in offsets:
            row, size = struct.unpack("<ii", self._take(8))
            first = row - top
            if first % together or not 0 <= first < height or first in seen:
                self._refuse(f"a block begins at the row {row}")
            seen.add(first)
            rows = min(together, height - first)
            block = self._block(self._take(size), rows * row_bytes, compression)
            content[first : first + rows] = block.reshape(rows, row_bytes)
        return dict(_split(types, content, width))

    def _block(self, data: bytes, size: int, compression: int) -> npt.NDArray[np.uint8]:
        if len(data) == size:
            return np.frombuffer(data, np.uint8)
        if compression == 0 or len(data) > size:
            self._refuse(f"a block has {len(data)} bytes in place of {size}")
        unpacker = zlib.decompressobj()
        try:
            packed = unpacker.decompress(data, size)
            more = b"" if unpacker.eof else unpacker.decompress(unpacker.unconsumed_tail, 1)
        except zlib.error as reason:
            self._refuse(f"a block is damaged ({reason})")
        if len(packed) != size or more:
            self._refuse("a block has another size than its rows")
        return _unpredicted(packed)


def _unpredicted(packed: bytes) -> npt.NDArray[np.uint8]:
    """Undoes the differences between bytes, and the division into even and odd bytes."""
    differences = np.frombuffer(packed, np.uint8).copy()
    differences[1:] ^= 128
    summed = np.cumsum(differences, dtype=np.uint8)
    half = (len(summed) + 1) // 2
    block = np.empty_like(summed)
    block[0::2] = summed[:half]
    block[1::2] = summed[half:]
    return block


def _split(
    types: list[tuple[str, np.dtype]], content: npt.NDArray[np.uint8], width: int
) -> list[tuple[str, Channel]]:
    channels: list[tuple[str, Channel]] = []
    start = 0
    for name, sample in types:
        end = start + width * sample.itemsize
        samples = np.ascontiguousarray(content[:, start:end]).view(sample)
        channels.append((name, samples.astype(np.uint32 if sample.kind == "u" else np.float32)))
        start = end
    return channels
