"""A room as a user of Blender makes it, rendered by photoncard from Blender's own export, and by Cycles in Blender.

Prints fireflies, and errors of blocks, against a converged picture of Cycles. See tests/peers/room.sh.
"""

import argparse
import hashlib
import json
import math
import os
import resource
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

import pictures
import render

HERE = Path(__file__).resolve().parent
RUNS = {
    "cached": "--spp 16 --irradiance-cache on",
    "every sample gathers": "--spp 8 --gather-rays 16",
}
LIMIT_S = 3600
# A firefly is as many times brighter than the median of its neighbourhood, of so many pixels each way; and brighter by the
# second factor than anything in that neighbourhood of the converged picture.
BRIGHTER, REACH, TRUTH = 3.0, 2, 2.0
GOLD = (1.0, 0.77, 0.34)


def main():
    """See the module."""
    arguments = parse()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    # The table alone goes to the standard output: Blender reports there too.
    arguments.table = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    scene_file = arguments.folder / "room.glb"
    build()
    scene = bpy.context.scene
    # The exported field of view depends on the picture's sides.
    render.settle(scene, arguments.size, 1)
    export(scene_file)
    render.shade(scene, "principled")
    reference = converged(scene, arguments)
    heads = "| picture | CPU s | mean | median block | 95th percentile | fireflies | of a million |\n|---|---|---|---|---|---|---|"
    print(heads, file=arguments.table, flush=True)
    shown, seconds = [], []
    for name, options in runs(arguments).items():
        cpu, picture = photoncard(arguments, scene_file, options)
        report(arguments.table, f"photoncard, {name}: `{options}`", cpu, picture, reference)
        shown.append(picture)
        seconds.append(cpu)
    for cpu in sorted(set(seconds)):
        samples = max(1, round(cpu * arguments.speed))
        taken, picture = cycles(scene, samples, 7, arguments.folder / "room-cycles.exr")
        report(arguments.table, f"Cycles, {samples} samples", taken, picture, reference)
        shown.append(picture)
    exposure = 0.18 / math.exp(np.log(reference.mean(axis=2) + 1e-6).mean())
    path = arguments.folder / "room.png"
    pictures.show([*shown, reference], path, exposure)
    print(f"\nSide by side, in this order and then the converged one: {path}", file=arguments.table)


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where pictures go")
    parser.add_argument("--size", type=int, default=192)
    parser.add_argument("--samples", type=int, default=512, help="samples a pixel of the converged picture")
    parser.add_argument("options", nargs="*", help="options of photoncard, instead of its own runs")
    return parser.parse_args()


def runs(arguments):
    """The options of each run of photoncard, by a name."""
    return {"own options": " ".join(arguments.options)} if arguments.options else RUNS


def build():
    """Sun through a window, a point light, glass, gold and a floor with a texture, in metres."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    plaster = material("plaster", (0.75, 0.72, 0.68))
    box("floor", (0, 0, -0.1), (4, 5, 0.2), floor_material())
    box("ceiling", (0, 0, 2.8), (4, 5, 0.2), plaster)
    box("back", (0, 2.6, 1.35), (4.4, 0.2, 3.1), plaster)
    box("front", (0, -2.6, 1.35), (4.4, 0.2, 3.1), plaster)
    box("right", (2.1, 0, 1.35), (0.2, 5, 3.1), material("red wall", (0.6, 0.15, 0.1)))
    # The window is what the four boxes of the left wall leave open.
    box("sill", (-2.1, 0, 0.4), (0.2, 5, 1.2), plaster)
    box("lintel", (-2.1, 0, 2.5), (0.2, 5, 0.8), plaster)
    box("pier", (-2.1, -1.5, 1.55), (0.2, 2, 1.1), plaster)
    box("pier", (-2.1, 1.9, 1.55), (0.2, 1.2, 1.1), plaster)
    box("table", (0.5, 1.0, 0.35), (1.8, 0.9, 0.7), material("paint", (0.1, 0.25, 0.35), Roughness=0.3))
    gold = material("gold", GOLD, Metallic=1.0, Roughness=0.2)
    ball("gold ball", (0.0, 1.0, 1.0), 0.3, gold)
    ball("gold on the floor", (-1.0, 0.6, 0.35), 0.35, gold)
    glass = {"Roughness": 0.0, "IOR": 1.45, "Transmission Weight": 1.0}
    ball("glass ball", (0.9, 0.9, 0.95), 0.25, material("glass", (1.0, 1.0, 1.0), **glass))
    steel = material("steel", (0.6, 0.6, 0.6), Metallic=1.0, Roughness=0.1)
    bpy.ops.mesh.primitive_torus_add(location=(0.1, -0.3, 0.1), major_radius=0.4, minor_radius=0.1, major_segments=64)
    finish("steel ring", steel)
    lights()


def lights():
    """The two lights, and the camera."""
    scene = bpy.context.scene
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy = 5.0
    place(scene, sun, (-5, 0, 5), (0.3, 0.8, 0.2))
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size = 40.0, 0.05
    place(scene, lamp, (1.2, -1.0, 2.3), None)
    camera = bpy.data.cameras.new("camera")
    camera.angle = math.radians(65.0)
    scene.camera = place(scene, camera, (0.3, -2.3, 1.5), (0.0, 1.0, 0.8))


def place(scene, data, where, towards):
    """An object at a place, whose -z is turned to another."""
    thing = bpy.data.objects.new(data.name, data)
    thing.location = where
    if towards is not None:
        thing.rotation_euler = (Vector(towards) - Vector(where)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(thing)
    return thing


def material(name, colour, **inputs):
    """A material of the Principled BSDF, what is not given as Blender has it."""
    result = bpy.data.materials.new(name)
    shader = result.node_tree.nodes["Principled BSDF"] if result.node_tree else principled(result)
    shader.inputs["Base Color"].default_value = (*colour, 1.0)
    for key, value in inputs.items():
        shader.inputs[key].default_value = value
    return result


def principled(result):
    """The shader of a material that has no nodes yet."""
    result.use_nodes = True
    return result.node_tree.nodes["Principled BSDF"]


def floor_material(side=512, boards=8):
    """Boards of wood, by an image."""
    rows, columns = np.mgrid[:side, :side]
    board = columns * boards // side
    tone = 0.45 + 0.25 * np.sin(board * 2.4) ** 2 + 0.05 * np.sin(rows / 9.0 + 5.0 * board + 2.0 * np.sin(columns / 7.0))
    tone[columns % (side // boards) < 2] = 0.1
    colours = np.stack([tone, 0.7 * tone, 0.45 * tone, np.ones_like(tone)], axis=-1)
    image = bpy.data.images.new("boards", side, side)
    image.pixels.foreach_set(colours.astype(np.float32).ravel())
    image.pack()
    result = material("boards", (1.0, 1.0, 1.0), Roughness=0.4)
    texture = result.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    shader = result.node_tree.nodes["Principled BSDF"]
    result.node_tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    return result


def box(name, middle, size, surface):
    """A box."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=middle)
    bpy.context.object.scale = size
    finish(name, surface, is_smooth=False)


def ball(name, middle, radius, surface):
    """A smooth ball."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=radius, location=middle)
    finish(name, surface)


def finish(name, surface, is_smooth=True):
    """Names the newest object and gives it its material."""
    thing = bpy.context.object
    thing.name = name
    thing.data.materials.append(surface)
    for face in thing.data.polygons:
        face.use_smooth = is_smooth


def export(path):
    """Blender's export with its defaults, cameras and lights ticked."""
    bpy.ops.export_scene.gltf(filepath=str(path), export_cameras=True, export_lights=True)


def converged(scene, arguments):
    """A picture of Cycles with many samples, kept for the next time.

    It is denoised, as caustics of small lights leave fireflies at any number of samples.
    """
    key = hashlib.sha256(f"{arguments.size} {arguments.samples}".encode())
    for part in ("room.py", "render.py"):
        key.update((HERE / part).read_bytes())
    stem = arguments.folder / f"room-converged-{key.hexdigest()[:12]}"
    output, note = stem.with_suffix(".exr"), stem.with_suffix(".json")
    if not note.exists():
        scene.cycles.use_denoising = True
        cpu, _ = cycles(scene, arguments.samples, 1, output)
        scene.cycles.use_denoising = False
        note.write_text(json.dumps({"samples_per_cpu_s": arguments.samples / cpu}))
    arguments.speed = json.loads(note.read_text())["samples_per_cpu_s"]
    return pictures.read(output)


def cycles(scene, samples, seed, output):
    """CPU seconds and picture of Cycles."""
    scene.cycles.samples = samples
    cpu = render.render(scene, seed, output)
    return cpu, pictures.read(output)


def photoncard(arguments, scene_file, options):
    """CPU seconds and picture of photoncard, in Blender's units."""
    output = arguments.folder / "room.exr"
    command = [arguments.photoncard, "render", scene_file, "--quality", "paper", "-o", output, "--size", f"{arguments.size}x{arguments.size}"]
    command += ["--aov", "none", "--card", "emulated:1", "--threads", "1", "--quiet", *options.split()]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([str(word) for word in command], check=False, timeout=LIMIT_S)
    if done.returncode != 0:
        sys.exit("photoncard failed")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, pictures.read(output)


def report(table, name, cpu, picture, reference):
    """Prints a row of the table."""
    difference = pictures.Difference(picture, reference, np.ones(picture.shape[:2], dtype=bool))
    count = int(fireflies(picture, reference).sum())
    columns = [f"{cpu:.0f}", f"{difference.mean:.3f}", f"{100 * difference.median():.1f} %", f"{100 * difference.high():.1f} %"]
    columns += [str(count), f"{1e6 * count / picture[..., 0].size:.0f}"]
    print(f"| {name} | {' | '.join(columns)} |", file=table, flush=True)


def fireflies(picture, reference):
    """Pixels far brighter than their surroundings that the converged picture does not show."""
    light, truth = picture.mean(axis=2), reference.mean(axis=2)
    return (light > BRIGHTER * np.median(around(light), axis=(2, 3))) & (light > TRUTH * around(truth).max(axis=(2, 3)))


def around(picture):
    """The neighbourhood of each pixel."""
    side = 2 * REACH + 1
    return np.lib.stride_tricks.sliding_window_view(np.pad(picture, REACH, mode="edge"), (side, side))


if __name__ == "__main__":
    main()
