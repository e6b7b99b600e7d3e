"""Renders a scene of `tests/peers/quality.sh` with Blender's Cycles: a picture for each seed.

    quality.py SCENE --size 256x256 --samples N --seeds 1001 2001 --outputs A.exr B.exr [--environment MAP|R,G,B]

Settings are those of `render.py`. Prints a line of JSON: CPU seconds (user and system) of each call that renders and writes a picture,
after a first one of a sample, for which the scene is built and shaders are compiled; without the file's import.
"""

import argparse
import json
import math
from pathlib import Path

import bpy

import gltf
import materials
import render
import room


def main():
    """See the module."""
    arguments = parse()
    width, height = (int(side) for side in arguments.size.split("x"))
    if arguments.built:
        room.build()
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.import_scene.gltf(filepath=str(arguments.scene))
    scene = bpy.context.scene
    render.settle(scene, width, 1)
    scene.render.resolution_y = height
    if arguments.built:
        render.shade(scene, "principled")
    else:
        furnish(scene, arguments)
    # Shaders and scene of the first picture are kept for the others.
    scene.render.use_persistent_data = True
    bpy.ops.render.render()
    scene.cycles.samples = arguments.samples
    seconds = [render.render(scene, seed, output) for seed, output in zip(arguments.seeds, arguments.outputs, strict=True)]
    print(json.dumps({"cpu_s": seconds}), flush=True)


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, help="a glTF file, seen by its first camera")
    parser.add_argument("--size", required=True)
    parser.add_argument("--samples", type=int, required=True, help="samples a pixel of each picture")
    parser.add_argument("--seeds", type=int, nargs="+", required=True)
    parser.add_argument("--outputs", type=Path, nargs="+", required=True)
    parser.add_argument("--environment", help="an equirectangular map, or a radiance: R,G,B")
    parser.add_argument("--built", action="store_true", help="the scene that `room.py` builds, in place of the file, its export")
    return parser.parse_args()


def furnish(scene, arguments):
    """Camera, environment and materials of an imported file."""
    scene.camera = scene.objects[camera(arguments.scene)]
    if arguments.environment:
        environment(scene, arguments.environment)
    render.linear_textures()
    render.scaled_normals()
    materials.make_native(scene)
    render.shade(scene, "gltf")


def camera(path):
    """The name of the node of a file's first camera."""
    return next(node["name"] for node in gltf.Document(path).json["nodes"] if "camera" in node)


def environment(scene, light):
    """Light from infinitely far, as photoncard takes it: a radiance, or a map with glTF's -z, Blender's y, in its middle, whose texels have no
    gradients."""
    background = render.sky(scene, 1.0)
    if not Path(light).is_file():
        background.inputs["Color"].default_value = (*(float(value) for value in light.split(",")), 1.0)
        return
    tree = scene.world.node_tree
    texture, mapping = tree.nodes.new("ShaderNodeTexEnvironment"), tree.nodes.new("ShaderNodeMapping")
    direction = tree.nodes.new("ShaderNodeTexCoord")
    texture.image = bpy.data.images.load(str(light))
    texture.image.colorspace_settings.name = "Non-Color"
    texture.interpolation = "Closest"
    # Cycles has x in the middle.
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, -math.pi / 2.0)
    tree.links.new(direction.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])


if __name__ == "__main__":
    main()
