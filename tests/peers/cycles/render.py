"""Renders a staged glTF file with Blender's Cycles: a picture for each seed, and which pixels see the model.

    render.py SCENE.glb --samples N --seeds 1 2 --outputs A.exr B.exr --mask MASK.npy

Light is neither clamped nor denoised, paths have up to 64 bounces, and a pixel is the mean over its square. Prints a line of JSON:
CPU seconds of each picture, and materials that keep a model of Blender's own.
"""

import argparse
import functools
import hashlib
import json
import resource
import sys
import tempfile
from pathlib import Path

import bpy
import _cycles  # isort: skip: a part of bpy
import numpy as np
from mathutils import Vector

import stage

HERE = Path(__file__).resolve().parent
# Parameters of gltf.osl: the kind of their sockets, and the Principled BSDF's names.
PARAMETERS = {
    "BaseColor": ("Color", "Base Color"),
    "Metallic": ("Float", "Metallic"),
    "Roughness": ("Float", "Roughness"),
    "Alpha": ("Float", "Alpha"),
    "IOR": ("Float", "IOR"),
    "Specular": ("Float", "Specular IOR Level"),
    "SpecularTint": ("Color", "Specular Tint"),
    "Normal": ("Vector", "Normal"),
    "Coat": ("Float", "Coat Weight"),
    "CoatRoughness": ("Float", "Coat Roughness"),
    "CoatNormal": ("Vector", "Coat Normal"),
    "EmissionColor": ("Color", "Emission Color"),
    "EmissionStrength": ("Float", "Emission Strength"),
}
# Inputs of the Principled BSDF for models of its own, which gltf.osl does not have.
OWN_MODELS = ("Transmission Weight", "Sheen Weight", "Anisotropic", "Thin Film Thickness", "Subsurface Weight")


def main():
    """See the module."""
    arguments = parse()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(arguments.scene))
    scene = bpy.context.scene
    settle(scene, arguments.size, arguments.samples)
    scene.camera = next(thing for thing in scene.objects if thing.type == "CAMERA")
    sky(scene, stage.SKY)
    lamp(bpy.data.materials[stage.LAMP])
    linear_textures()
    scaled_normals()
    own = shade(scene, arguments.model)
    if arguments.mask:
        np.save(arguments.mask, seen(scene))
    seconds = [render(scene, seed, output) for seed, output in zip(arguments.seeds, arguments.outputs, strict=True)]
    print(json.dumps({"cpu_s": seconds, "own_models": own}), flush=True)


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--samples", type=int, required=True, help="samples a pixel of each picture")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--seeds", type=int, nargs="+", required=True)
    parser.add_argument("--outputs", type=Path, nargs="+", required=True)
    parser.add_argument("--mask", type=Path)
    parser.add_argument("--model", choices=("gltf", "principled"), default="gltf", help="reflection model of common materials")
    return parser.parse_args()


def settle(scene, size, samples):
    """Settings of a picture without bias, on one thread."""
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.dither_intensity = 0.0
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = samples, False, False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 64
    cycles.transmission_bounces = cycles.transparent_max_bounces = 64
    cycles.light_sampling_threshold = 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0


def sky(scene, radiance):
    """The same radiance from everywhere, by the node that is returned."""
    scene.world = bpy.data.worlds.new("sky")
    tree = scene.world.node_tree
    background = tree.nodes.get("Background") or tree.nodes.new("ShaderNodeBackground")
    output = tree.nodes.get("World Output") or tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs["Background"], output.inputs["Surface"])
    background.inputs["Color"].default_value = (radiance, radiance, radiance, 1.0)
    background.inputs["Strength"].default_value = 1.0
    return background


def lamp(material):
    """An emitter whose back is dark: imported ones emit to both sides."""
    tree = material.node_tree
    tree.nodes.clear()
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    front, side = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeNewGeometry")
    front.operation = "MULTIPLY_ADD"
    tree.links.new(side.outputs["Backfacing"], front.inputs[0])
    front.inputs[1].default_value, front.inputs[2].default_value = -stage.LAMP_RADIANCE, stage.LAMP_RADIANCE
    tree.links.new(front.outputs[0], emission.inputs["Strength"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])


def linear_textures():
    """Replaces images of sRGB by linear ones: glTF's texels are decoded before they are interpolated, Cycles's after."""
    decoded = {}
    for material in bpy.data.materials:
        for node in material.node_tree.nodes:
            if node.type == "TEX_IMAGE" and node.image and node.image.colorspace_settings.name == "sRGB":
                if node.image not in decoded:
                    decoded[node.image] = decode(node.image)
                node.image = decoded[node.image]


def decode(image):
    """A linear image of one of sRGB."""
    texels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(texels)
    colours = texels.reshape(-1, image.channels)[:, :3]
    colours[:] = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    result = bpy.data.images.new(image.name, *image.size, alpha=True, float_buffer=True, is_data=True)
    result.alpha_mode = "CHANNEL_PACKED"
    result.pixels.foreach_set(texels)
    result.update()
    return result


def scaled_normals():
    """Scales x and y of normal textures by glTF's scale: Blender's strength mixes the unit normals instead."""
    for material in bpy.data.materials:
        tree = material.node_tree
        for node in [node for node in tree.nodes if node.type == "NORMAL_MAP"]:
            strength, colour = node.inputs["Strength"], node.inputs["Color"]
            scale, strength.default_value = strength.default_value, 1.0
            if scale == 1.0 or not colour.is_linked:
                continue
            scaled = tree.nodes.new("ShaderNodeVectorMath")
            scaled.operation = "MULTIPLY_ADD"
            tree.links.new(colour.links[0].from_socket, scaled.inputs[0])
            # The texture's 0.5 stands for 0.
            scaled.inputs[1].default_value = (scale, scale, 1.0)
            scaled.inputs[2].default_value = (0.5 - 0.5 * scale, 0.5 - 0.5 * scale, 0.0)
            tree.links.new(scaled.outputs[0], colour)


def shade(scene, model):
    """Makes imported materials those of glTF's specification where Cycles can; the names of the others."""
    for thing in scene.objects:
        if thing.type == "MESH":
            thing.shadow_terminator_geometry_offset = thing.shadow_terminator_normal_offset = 0.0
            thing.shadow_terminator_shading_offset = 0.0
    own = []
    for material in bpy.data.materials:
        material.cycles.use_bump_map_correction = False
        for node in list(material.node_tree.nodes):
            if node.type != "BSDF_PRINCIPLED":
                continue
            node.distribution = "GGX"
            if model == "principled" or any(is_used(node.inputs[name]) for name in OWN_MODELS):
                own.append(material.name)
            else:
                scene.cycles.shading_system = True
                replace(material, node)
    return sorted(set(own))


def is_used(socket):
    """If an input of a node is not at its zero."""
    return socket.is_linked or socket.default_value != 0.0


def replace(material, principled):
    """Puts gltf.osl in the place of a Principled BSDF."""
    tree = material.node_tree
    script = script_node(tree, "gltf.osl")
    for name, (kind, original) in PARAMETERS.items():
        target, source = script.inputs.new(f"NodeSocket{kind}", name), principled.inputs[original]
        if source.is_linked:
            tree.links.new(source.links[0].from_socket, target)
        elif kind != "Vector":
            target.default_value = source.default_value
    # How the importer keeps that a material is one-sided.
    script.inputs.new("NodeSocketFloat", "OneSided").default_value = float(material.use_backface_culling)
    closure = script.outputs.new("NodeSocketShader", "BSDF")
    for link in list(principled.outputs["BSDF"].links):
        tree.links.new(closure, link.to_socket)


def script_node(tree, file):
    """A node of a shader beside this file, without sockets."""
    script = tree.nodes.new("ShaderNodeScript")
    script.mode = "INTERNAL"
    script.bytecode = bytecode(file)
    script.bytecode_hash = hashlib.md5(script.bytecode.encode()).hexdigest()
    return script


@functools.cache
def bytecode(file):
    """A shader, compiled. The operator that Blender's nodes have for it needs a module that `bpy` lacks."""
    with tempfile.TemporaryDirectory() as folder:
        compiled = Path(folder) / "compiled.oso"
        if not _cycles.osl_compile(str(HERE / file), str(compiled)):
            sys.exit(f"{HERE / file} does not compile")
        return compiled.read_text()


def seen(scene):
    """Which pixels see the model at all of four points near their corners."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    eye, turn = scene.camera.matrix_world.translation, scene.camera.matrix_world.to_3x3()
    size = scene.render.resolution_x
    half = np.tan(scene.camera.data.angle / 2.0)

    def meets(x, y):
        along = turn @ Vector((half * (2.0 * x / size - 1.0), half * (1.0 - 2.0 * y / size), -1.0))
        return scene.ray_cast(depsgraph, eye, along.normalized())[0]

    mask = np.zeros((size, size), dtype=bool)
    for row, column in np.ndindex(size, size):
        mask[row, column] = all(meets(column + dx, row + dy) for dx in (0.05, 0.95) for dy in (0.05, 0.95))
    return mask


def render(scene, seed, output):
    """Renders a picture; its CPU seconds."""
    scene.cycles.seed = seed
    scene.render.filepath = str(output)
    before = resource.getrusage(resource.RUSAGE_SELF)
    bpy.ops.render.render(write_still=True)
    after = resource.getrusage(resource.RUSAGE_SELF)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
