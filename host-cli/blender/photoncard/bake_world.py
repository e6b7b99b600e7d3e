"""Renders a world as an equirectangular map, in Blender without a window.

Arguments: the library, the name of its world, and the file to write.
"""

from __future__ import annotations

import math
import os
import sys
import traceback

import bpy

_WIDTH = 2048
_SAMPLES = 16


def bake(library: str, name: str, output: str) -> None:
    """Renders the world of a library."""
    bpy.ops.preferences.addon_enable(module="cycles")
    with bpy.data.libraries.load(library) as (_, wanted):
        wanted.worlds = [name]
    scene = bpy.context.scene
    for ob in list(scene.collection.all_objects):
        bpy.data.objects.remove(ob)
    scene.world = wanted.worlds[0]
    data = bpy.data.cameras.new("camera")
    data.type = "PANO"
    (data if hasattr(data, "panorama_type") else data.cycles).panorama_type = "EQUIRECTANGULAR"
    camera = bpy.data.objects.new("camera", data)
    # The middle of a map is +x.
    camera.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
    scene.collection.objects.link(camera)
    scene.camera = camera
    _set_up(scene, output)
    bpy.ops.render.render(write_still=True)


def _set_up(scene: bpy.types.Scene, output: str) -> None:
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = _WIDTH, _WIDTH // 2, 100
    render.filepath, render.use_file_extension = output, False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.image_settings.exr_codec = "ZIP"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = (
        _SAMPLES,
        False,
        False,
    )
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0
    scene.cycles.pixel_filter_type = "BOX"


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    try:
        bake(*arguments)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    # The package bpy may hang when the interpreter ends.
    os._exit(0)
