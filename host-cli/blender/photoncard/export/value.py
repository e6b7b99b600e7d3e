"""A value of a shader node: the same everywhere, or given by the texels of an image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import bpy
import numpy as np

from .images import linear_pixels, resized
from .nodes import Unsupported


@dataclass(frozen=True)
class Mapping:
    """Texture coordinates: a UV map, by default the active one, and glTF's transform of it."""

    uv_map: str = ""
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    wrap: str = "REPEAT"
    is_nearest: bool = False


@dataclass(frozen=True)
class Value:
    """A colour with alpha, or a number in all four: linear."""

    stated: np.ndarray | None
    """Texels; `None` for those of the image, unchanged."""
    mapping: Mapping | None = None
    image: bpy.types.Image | None = None
    """The one image that the texels are computed from."""
    colours: str | None = None
    """Colour attribute that is a factor of the value."""

    @cached_property
    def texels(self) -> np.ndarray:
        """Of the shape (4,), or (height, width, 4) with the bottom line first."""
        return linear_pixels(self.image) if self.stated is None else self.stated

    @property
    def is_plain(self) -> bool:
        """True for an image's colours as they are."""
        return self.stated is None

    @property
    def is_constant(self) -> bool:
        """True for a value that is the same everywhere."""
        return self.mapping is None and self.colours is None

    @property
    def number(self) -> float:
        """A constant as a number."""
        return float(self.texels[..., 0].mean())

    @property
    def colour(self) -> tuple[float, float, float]:
        """A constant as a colour; of a texture the mean."""
        red, green, blue = self.texels[..., :3].reshape(-1, 3).mean(axis=0).tolist()
        return red, green, blue

    def map(self, function: Callable[[np.ndarray], np.ndarray]) -> Value:
        """The value of a function of the texels."""
        return replace(self, stated=function(self.texels))


def constant(value: object) -> Value:
    """A constant of a number or of a tuple of three or four."""
    numbers = np.atleast_1d(np.array(value, np.float32))
    if len(numbers) == 1:
        numbers = np.repeat(numbers, 4)
    elif len(numbers) == 3:
        numbers = np.append(numbers, np.float32(1))
    return Value(numbers)


def mappings_of(*values: Value) -> set[Mapping]:
    """The mappings of the textures among values."""
    return {value.mapping for value in values if value.mapping is not None}


def combine(node: bpy.types.Node, function: Callable[..., np.ndarray], *values: Value) -> Value:
    """The value of a function of several values, of which textures have one mapping.

    Raises `Unsupported`.
    """
    mappings = mappings_of(*values)
    if any(value.colours is not None for value in values):
        raise Unsupported(node, "it changes a colour attribute")
    if len(mappings) > 1:
        raise Unsupported(node, "it joins textures of different mappings")
    texels = function(*of_one_size(*values))
    images = [value.image for value in values if value.image is not None]
    return Value(
        texels.astype(np.float32), next(iter(mappings), None), images[0] if len(images) == 1 else None
    )


def of_one_size(*values: Value) -> list[np.ndarray]:
    """Texels of values, those of textures in the size of the largest."""
    sizes = [value.texels.shape[:2] for value in values if value.texels.ndim == 3]
    if not sizes:
        return [value.texels for value in values]
    size = (max(height for height, _ in sizes), max(width for _, width in sizes))
    return [_resized(value.texels, size) for value in values]


def _resized(texels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    if texels.ndim == 1 or texels.shape[:2] == size:
        return texels
    return resized(texels, size)


def grey(values: np.ndarray) -> np.ndarray:
    """Numbers as colours with alpha."""
    return np.repeat(np.asarray(values, np.float32)[..., None], 4, axis=-1)


def with_alpha(colour: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Colours with another alpha."""
    alpha = np.broadcast_to(alpha, colour.shape[:-1])
    return np.concatenate([colour[..., :3], alpha[..., None]], axis=-1)
