"""Composites layers of photoncard in Blender, and compares them with what they must be.

    python3 compositor.py PLATE.exr WHOLE.exr BACKGROUND NAME...

PLATE is a transparent picture with `--aov object`, WHOLE the same picture with the background BACKGROUND, R,G,B. Alpha Over of PLATE on
the background must be WHOLE. The matte of each object NAME, by Blender's node Cryptomatte, must be the coverage that PLATE states for the
name. It needs the packages bpy 5.0, numpy and OpenEXR."""

import json
import os
import sys
import tempfile

import bpy
import numpy as np
import OpenEXR


def channels(path):
    file = OpenEXR.File(path, separate_channels=True)
    return file.header(), {name: channel.pixels for name, channel in file.channels().items()}


def composited(build, size):
    """Channels of the picture that the nodes of `build` make, by Blender's compositor."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.render.resolution_x, scene.render.resolution_y = size
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    tree = bpy.data.node_groups.new("compositor", "CompositorNodeTree")
    scene.compositing_node_group = tree
    tree.interface.new_socket(name="Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    tree.links.new(build(tree), tree.nodes.new("NodeGroupOutput").inputs[0])
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "composited.exr")
        bpy.ops.render.render(write_still=True)
        return channels(scene.render.filepath)[1]


def image(tree, path):
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(path)
    return next(output for output in node.outputs if output.name in ("Combined", "Image"))


def alpha_over(plate, background):
    def build(tree):
        over = tree.nodes.new("CompositorNodeAlphaOver")
        for entry in over.inputs:
            if entry.name == "Straight Alpha":
                entry.default_value = False
        over.inputs["Background"].default_value = (*background, 1.0)
        tree.links.new(image(tree, plate), over.inputs["Foreground"])
        return over.outputs[0]

    return build


def matte(plate, name):
    def build(tree):
        node = tree.nodes.new("CompositorNodeCryptomatteV2")
        node.source = "IMAGE"
        node.image = bpy.data.images.load(plate)
        node.layer_name = "CryptoObject"
        node.matte_id = name
        return node.outputs["Matte"]

    return build


def stated(header, plate, name):
    """Coverage of an object by the channels and the manifest of the file."""
    manifest = next(value for key, value in header.items() if key.endswith("/manifest") and "CryptoObject" in header[key[:-8] + "name"])
    bits = np.uint32(int(json.loads(manifest)[name], 16))
    shares = np.zeros_like(plate["A"])
    for level in range(6):
        for identifier, share in ("rg", "ba"):
            is_object = plate[f"CryptoObject{level:02}.{identifier}"].view(np.uint32) == bits
            shares += np.where(is_object, plate[f"CryptoObject{level:02}.{share}"], 0)
    return shares


def main():
    plate_path, whole_path, background, *names = sys.argv[1:]
    background = [float(value) for value in background.split(",")]
    header, plate = channels(plate_path)
    _, whole = channels(whole_path)
    height, width = plate["A"].shape
    over = composited(alpha_over(plate_path, background), (width, height))
    edges = (plate["A"] > 0) & (plate["A"] < 1)
    differences = np.stack([np.abs(over[name] - whole[name]) for name in "RGB"])
    brightest = max(whole[name][edges].max() for name in "RGB")
    print(f"Alpha Over: {edges.sum()} pixels of edges; greatest difference {differences.max():.2e}, at edges {differences[:, edges].max():.2e} "
          f"(edges are up to {brightest:.2f})")
    failed = differences[:, edges].max() > 1e-4 * brightest
    total = np.zeros_like(plate["A"])
    for name in names:
        expected = stated(header, plate, name)
        found = composited(matte(plate_path, name), (width, height))["R"]
        total += found
        difference = np.abs(found - expected).max()
        partly = ((expected > 0) & (expected < 1)).sum()
        print(f"matte of {name}: {(expected > 0).sum()} pixels, {partly} of them partly; greatest difference {difference:.2e}")
        failed |= difference > 1e-6 or not (expected > 0).any()
    difference = np.abs(total - plate["A"]).max()
    print(f"all mattes together against alpha: {difference:.2e}")
    failed |= difference > 1e-5
    sys.stdout.flush()
    # Blender's module may hang at the end of the process.
    os._exit(1 if failed else 0)


main()
