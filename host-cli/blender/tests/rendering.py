"""Renders in Blender, and reads the passes of its result."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from photoncard import exr, png  # noqa: E402


def passes(scene: bpy.types.Scene, engine: str, folder: Path) -> dict[str, np.ndarray]:
    """Renders a scene, and returns the channels of all passes by their names without the view layer."""
    scene.render.engine = engine
    bpy.ops.render.render()
    path = folder / f"{engine.lower()}.exr"
    settings = scene.render.image_settings
    if "media_type" in settings.bl_rna.properties:
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    if "use_exr_interleave" in settings.bl_rna.properties:
        settings.use_exr_interleave = True
    settings.color_depth = "32"
    settings.exr_codec = "ZIP"
    bpy.data.images["Render Result"].save_render(str(path), scene=scene)
    channels = exr.read(path).channels
    return {
        name.partition(".")[2] if name.count(".") > 1 else name: values for name, values in channels.items()
    }


def colour(channels: dict[str, np.ndarray], name: str = "Combined") -> np.ndarray:
    """A pass of the shape (height, width, 3)."""
    return np.stack([channels[f"{name}.{channel}"] for channel in "RGB"], axis=-1)


def use_cycles(scene: bpy.types.Scene, samples: int) -> None:
    """Settings of Cycles for a comparison of radiance."""
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = samples, False, False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 16
    cycles.blur_glossy = 0


def save_png(path: Path, *pictures: np.ndarray) -> None:
    """Writes pictures side by side as sRGB, with the exposure of the last."""
    path.write_bytes(png.encode(np.concatenate([shown(each, pictures[-1]) for each in pictures], axis=1)))


def shown(picture: np.ndarray, like: np.ndarray) -> np.ndarray:
    """A picture in sRGB of 8 bits, with an exposure by the median of another."""
    exposed = picture * (0.2 / max(float(np.median(like[like > 0])), 1e-6))
    encoded = np.where(
        exposed <= 0.0031308, exposed * 12.92, 1.055 * np.maximum(exposed, 0) ** (1 / 2.4) - 0.055
    )
    return np.rint(np.clip(encoded, 0, 1) * 255).astype(np.uint8)
