"""Passes of a view layer, and the layers of photoncard that they come from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

_BACKGROUND_DEPTH = 1e10
_MOST_MATTE_PAIRS = 12


@dataclass(frozen=True)
class Pass:
    """A pass: its name, channels and type in Blender, and its channels in an EXR file."""

    name: str
    channels: str
    kind: str
    sources: tuple[str, ...]
    layer: str | None = None
    """Layer to ask for with `--aov`."""

    def pixels(self, channels: dict[str, np.ndarray]) -> np.ndarray:
        """Pixels of the shape (height, width, channels), the bottom line first."""
        height, width = next(iter(channels.values())).shape
        # A light group without sources has no layer, and an opaque picture no alpha.
        missing = np.full((height, width), 1.0 if self.name == "Combined" else 0.0, np.float32)
        planes = [channels.get(source, missing) for source in self.sources]
        stacked = np.stack(planes, axis=-1)[::-1]
        if self.name == "Depth":
            stacked = np.where(np.isfinite(stacked), stacked, _BACKGROUND_DEPTH)
        elif self.kind == "VECTOR":
            stacked = np.stack([stacked[..., 0], -stacked[..., 2], stacked[..., 1]], axis=-1)
        return np.ascontiguousarray(stacked, np.float32)


def passes_of(view_layer: Any, is_denoised: bool) -> list[Pass]:
    """Passes that a view layer asks for, *Combined* first."""
    own = view_layer.photoncard
    colour = "denoised." if is_denoised else ""
    passes = [_colour("Combined", colour, None, "A")]
    if is_denoised:
        passes.append(_colour("Noisy Image", "", None, "A"))
    stated = (
        (view_layer.use_pass_z, Pass("Depth", "Z", "VALUE", ("Z",), "Z")),
        (view_layer.use_pass_normal, Pass("Normal", "XYZ", "VECTOR", ("N.X", "N.Y", "N.Z"), "N")),
        (view_layer.use_pass_position, Pass("Position", "XYZ", "VECTOR", ("P.X", "P.Y", "P.Z"), "position")),
        (own.use_pass_direct, _colour("Direct", "direct.", "direct")),
        (own.use_pass_indirect, _colour("Indirect", "indirect.", "indirect")),
        (own.use_pass_caustics, _colour("Caustics", "caustic.", "caustic")),
        (own.use_pass_albedo, _colour("Denoising Albedo", "albedo.", "albedo")),
    )
    passes += [wanted for is_wanted, wanted in stated if is_wanted]
    levels = min(view_layer.pass_cryptomatte_depth, _MOST_MATTE_PAIRS)
    if view_layer.use_pass_cryptomatte_object:
        passes += _matte("CryptoObject", "object", levels)
    if view_layer.use_pass_cryptomatte_material:
        passes += _matte("CryptoMaterial", "material", levels)
    passes += [
        _colour(f"Combined_{group.name}", f"light_{group.name}.", None) for group in view_layer.lightgroups
    ]
    return passes


def _colour(name: str, prefix: str, layer: str | None, alpha: str = "") -> Pass:
    sources = tuple(f"{prefix}{channel}" for channel in "RGB") + ((alpha,) if alpha else ())
    return Pass(name, "RGBA" if alpha else "RGB", "COLOR", sources, layer)


def _matte(name: str, layer: str, levels: int) -> Iterator[Pass]:
    for index in range((levels + 1) // 2):
        sources = tuple(f"{name}{index:02}.{channel}" for channel in "rgba")
        yield Pass(f"{name}{index:02}", "RGBA", "COLOR", sources, layer)


def matte_fields(attributes: dict[str, bytes], view_layer: str) -> Iterator[tuple[str, str]]:
    """Fields of Cryptomatte in an EXR file, for Blender, whose mattes have the view layer in their names."""
    for name, value in attributes.items():
        if name.startswith("cryptomatte/"):
            text = value.decode("utf-8", "replace")
            yield name, f"{view_layer}.{text}" if name.endswith("/name") else text
