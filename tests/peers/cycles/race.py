"""Renders a room with Blender's Cycles as a user would: materials as Blender imports them, adaptive sampling, and a denoiser if wished.

    race.py SCENE OUTPUT --size 960x540 --samples N [--seed N] [--environment MAP|R,G,B] [--denoise] [--reference]

Settings are Blender's defaults but for those named here: bounces and caustics without limits or clamps, and the box filter, so that the picture
converges to the same light. A reference takes each sample of each pixel. Prints a line of JSON: CPU seconds (user and system) of the file's import and of
the call that renders.
"""

import argparse
import json
import resource
from pathlib import Path

import bpy

import quality
import render


def main():
    """See the module."""
    arguments = parse()
    width, height = (int(side) for side in arguments.size.split("x"))
    before = cpu()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(arguments.scene))
    scene = bpy.context.scene
    render.settle(scene, width, arguments.samples)
    scene.render.resolution_y = height
    if arguments.threads == 0:
        scene.render.threads_mode = "AUTO"
    scene.camera = scene.objects[quality.camera(arguments.scene)]
    if arguments.environment:
        quality.environment(scene, arguments.environment)
    cycles = scene.cycles
    cycles.use_adaptive_sampling = not arguments.reference
    cycles.use_denoising = arguments.denoise
    imported = cpu()
    render.render(scene, arguments.seed, arguments.output)
    print(json.dumps({"import_s": imported - before, "render_s": cpu() - imported}), flush=True)


def cpu():
    """CPU seconds of this process."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, help="a glTF file, seen by its first camera")
    parser.add_argument("output", type=Path)
    parser.add_argument("--size", required=True)
    parser.add_argument("--samples", type=int, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, choices=(0, 1), default=1, help="one, or 0 for one a core")
    parser.add_argument("--environment", help="R,G,B or an equirectangular map")
    parser.add_argument("--denoise", action="store_true", help="by Open Image Denoise, with albedo and normals")
    parser.add_argument("--reference", action="store_true", help="take all samples of every pixel")
    return parser.parse_args()


if __name__ == "__main__":
    main()
