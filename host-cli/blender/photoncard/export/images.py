"""Pixels of Blender's images in linear light, and images of a glTF document."""

from __future__ import annotations

import hashlib
import os
import tempfile
from dataclasses import dataclass

import bpy
import numpy as np

from .. import png
from ..glb import Glb

_LARGEST_SIDE = 16384
"""Texels a side of tiles that are joined."""
_MISSING = (1.0, 0.0, 1.0, 1.0)
"""Colour of Cycles where there is no tile."""
_FORMATS = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}
_LINEAR = {"Non-Color", "Linear Rec.709", "Linear", "Raw", "Generic Data", "Utility - Raw"}


class Unreadable(Exception):
    """An image without pixels."""


def check_readable(image: bpy.types.Image) -> None:
    """Raises `Unreadable` for an image without pixels."""
    if 0 in image.size or not image.has_data and not len(image.pixels):
        raise Unreadable(f"the image {image.name} cannot be read: {image.filepath or 'it has no file'}")


def linear_pixels(image: bpy.types.Image) -> np.ndarray:
    """Pixels as float32 of the shape (height, width, 4), the bottom line first.

    Raises `Unreadable`.
    """
    check_readable(image)
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, 4)
    # Pixels of float images are linear, those of byte images as in the file.
    if not image.is_float and not is_linear(image):
        levels = np.rint(pixels[:, :, :3] * 255).astype(np.uint8)
        pixels[:, :, :3] = _SRGB_LEVELS[levels]
    return pixels


def is_linear(image: bpy.types.Image) -> bool:
    """True if an image's values are taken as they are."""
    return image.colorspace_settings.name in _LINEAR or image.colorspace_settings.is_data


def srgb_to_linear(values: np.ndarray) -> np.ndarray:
    """Decodes sRGB."""
    return np.where(values <= 0.04045, values / 12.92, ((np.maximum(values, 0) + 0.055) / 1.055) ** 2.4)


_SRGB_LEVELS = srgb_to_linear(np.arange(256, dtype=np.float32) / 255).astype(np.float32)


def linear_to_srgb(values: np.ndarray) -> np.ndarray:
    """Encodes sRGB."""
    return np.where(values <= 0.0031308, values * 12.92, 1.055 * np.maximum(values, 0) ** (1 / 2.4) - 0.055)


@dataclass(frozen=True)
class Tiles:
    """Tiles of an image (UDIM) side by side, from a first column and row of the plane of UV maps."""

    pixels: np.ndarray
    column: int
    row: int
    columns: int
    rows: int


def tiled_pixels(image: bpy.types.Image) -> Tiles | None:
    """The tiles of a tiled image, enlarged to the size of the largest; `None` if they are too large together.

    Raises `Unreadable`.
    """
    places = {tile.number: divmod(tile.number - 1001, 10)[::-1] for tile in image.tiles}
    columns, rows = zip(*places.values())
    column, row = min(columns), min(rows)
    across, up = max(columns) - column + 1, max(rows) - row + 1
    pixels = {number: _tile(image, number) for number in places}
    height, width = (max(each.shape[axis] for each in pixels.values()) for axis in (0, 1))
    if max(across * width, up * height) > _LARGEST_SIDE:
        return None
    joined = np.empty((up * height, across * width, 4), np.float32)
    joined[:] = _MISSING
    for number, (x, y) in places.items():
        enlarged = resized(pixels[number], (height, width))
        bottom, left = (y - row) * height, (x - column) * width
        joined[bottom : bottom + height, left : left + width] = enlarged
    return Tiles(joined, column, row, across, up)


def _tile(image: bpy.types.Image, number: int) -> np.ndarray:
    """Linear pixels of a tile. Of a tiled image Blender gives scripts those of the first tile alone."""
    row, column = divmod(number - 1001, 10)
    pattern = bpy.path.abspath(image.filepath, library=image.library)
    path = pattern.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}")
    packed = next((each for each in image.packed_files if each.tile_number == number), None)
    with tempfile.TemporaryDirectory(prefix="photoncard-tile-", dir=bpy.app.tempdir) as folder:
        if packed is not None:
            path = os.path.join(folder, os.path.basename(path))
            with open(path, "wb") as file:
                file.write(packed.packed_file.data)
        return _loaded(path, image)


def _loaded(path: str, like: bpy.types.Image) -> np.ndarray:
    """Linear pixels of a file in the encoding of another image."""
    try:
        loaded = bpy.data.images.load(path)
    except RuntimeError as error:
        raise Unreadable(f"a tile of the image {like.name} cannot be read: {path}") from error
    try:
        loaded.colorspace_settings.name = like.colorspace_settings.name
        loaded.alpha_mode = like.alpha_mode
        return linear_pixels(loaded)
    finally:
        bpy.data.images.remove(loaded)


def resized(texels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Texels in another size, each the nearest."""
    rows = np.arange(size[0]) * texels.shape[0] // size[0]
    columns = np.arange(size[1]) * texels.shape[1] // size[1]
    return texels[rows[:, None], columns]


class ImageStore:
    """Images of a document; equal ones are stored once."""

    def __init__(self, glb: Glb) -> None:
        self._glb = glb
        self._known: dict[bytes, int] = {}

    def add_file(self, image: bpy.types.Image) -> int | None:
        """Adds the file of an image as it is; `None` if glTF does not have its format, or it was changed."""
        if image.is_dirty or image.source != "FILE":
            return None
        encoded = _file_of(image)
        kind = next((kind for magic, kind in _FORMATS.items() if encoded.startswith(magic)), None)
        return self._add(encoded, kind, image.name) if kind else None

    def add_pixels(self, pixels: np.ndarray, is_colour: bool, name: str) -> int:
        """Adds linear pixels of 0 to 1, 1, 3 or 4 channels, the bottom line first, with 16 bits a channel."""
        pixels = np.clip(np.nan_to_num(pixels[::-1]), 0, 1)
        if is_colour:
            pixels = np.concatenate([linear_to_srgb(pixels[:, :, :3]), pixels[:, :, 3:]], axis=2)
        levels = np.rint(pixels * 65535).astype(np.uint16)
        # Images of 8 bits stay images of 8 bits.
        if not (levels % 257).any():
            levels = (levels // 257).astype(np.uint8)
        return self._add(png.encode(levels), "image/png", name)

    def _add(self, encoded: bytes, kind: str, name: str) -> int:
        key = hashlib.sha256(encoded).digest()
        if key not in self._known:
            self._known[key] = self._glb.image(encoded, kind, name)
        return self._known[key]


def _file_of(image: bpy.types.Image) -> bytes:
    if image.packed_file:
        return bytes(image.packed_file.data)
    path = bpy.path.abspath(image.filepath, library=image.library)
    if not os.path.isfile(path):
        return b""
    with open(path, "rb") as file:
        return file.read()
