"""Furnished rooms by Blender's export, by photoncard and by Cycles: errors of blocks. See tests/peers/blender_rooms.sh."""

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np

import interiors
import materials
import pictures
import render
import room

HERE = Path(__file__).resolve().parent
KINDS = ("lambertian", "whole")
SEEDS = (1, 2)
BLOCK, DARK = 12, 0.05
LIMIT_S = 3600
HEADS = ("room", "picture", "CPU s", "mean", "median", "95th percentile", "most", "noise", "bias", "noise of Cycles")


def main():
    """See the module."""
    arguments = parse()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    # The table alone goes to the standard output: Blender reports there too.
    arguments.table = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    print(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}", file=arguments.table, flush=True)
    for name in arguments.names or interiors.INTERIORS:
        for kind in KINDS:
            if arguments.kind in (None, kind):
                compare(arguments, name, kind)


def parse():
    """The command's arguments; what follows -- goes to photoncard."""
    words, options = sys.argv[1:], []
    if "--" in words:
        place = words.index("--")
        words, options = words[:place], words[place + 1 :]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(interiors.INTERIORS)} [default: all]")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where files go")
    parser.add_argument("--kind", choices=KINDS, help="one version of each room [default: both]")
    parser.add_argument("--width", type=int, default=192, help="pixels; the height is 9/16 of it")
    parser.add_argument("--samples", type=int, default=512, help="samples a pixel of each picture of Cycles")
    arguments = parser.parse_args(words)
    for name in arguments.names:
        if name not in interiors.INTERIORS:
            parser.error(f"there is no room {name}")
    arguments.options = options
    return arguments


def compare(arguments, name, kind):
    """Prints the rows of a room, and leaves PNGs."""
    stem = arguments.folder / f"{name}-{kind}"
    scene_file = stem.with_suffix(".glb")
    build(arguments, name, kind)
    room.export(scene_file)
    truths = converged(arguments, name, stem)
    found = [photoncard(arguments, name, scene_file, seed) for seed in SEEDS]
    shown = [picture for _, picture in found]
    noise = deviation(*shown, np.mean(truths, axis=0))
    for seed, (cpu, picture) in zip(SEEDS, found, strict=True):
        report(arguments, f"| {name}, {kind} | seed {seed} | {cpu:.0f}", picture, truths, noise)
    both, truth = np.mean(shown, axis=0), np.mean(truths, axis=0)
    report(arguments, f"| | mean of both | {sum(cpu for cpu, _ in found):.0f}", both, truths, noise / 2**0.5)
    exposure = 0.36 / max(np.median(truth.mean(axis=2)), 1e-9)
    pictures.show([shown[0], truth], stem.with_suffix(".png"), exposure)


def build(arguments, name, kind):
    """The room in Blender, with the settings of its picture."""
    interiors.INTERIORS[name].build()
    scene = bpy.context.scene
    render.settle(scene, arguments.width, arguments.samples)
    scene.render.resolution_y = arguments.width * 9 // 16
    scene.cycles.seed = 0
    if kind == "lambertian":
        make_lambertian(scene)


def make_lambertian(scene):
    """Takes lobes, metals and glass from all materials, and panes from the windows."""
    for thing in list(scene.objects):
        if thing.type == "MESH" and thing.data.materials[0].name == interiors.PANE:
            bpy.data.objects.remove(thing)
    for principled in (node for node, _ in shaders()):
        for key in ("Metallic", "Specular IOR Level", "Transmission Weight"):
            principled.inputs[key].default_value = 0.0


def shaders():
    """Each Principled BSDF with its material."""
    for material in bpy.data.materials:
        for node in list(material.node_tree.nodes) if material.node_tree else []:
            if node.type == "BSDF_PRINCIPLED":
                yield node, material


def converged(arguments, name, stem):
    """Two pictures of Cycles, kept for the next time."""
    key = hashlib.sha256(f"{arguments.width} {arguments.samples}".encode())
    for part in ("interiors.py", "rooms.py", "render.py", "materials.py", "gltf.osl", "pane.osl"):
        key.update((HERE / part).read_bytes())
    outputs = [stem.with_name(f"{stem.name}-{key.hexdigest()[:12]}-{seed}.exr") for seed in SEEDS]
    if not all(output.exists() for output in outputs):
        shade(bpy.context.scene, interiors.INTERIORS[name].sky)
        cpu = [render.render(bpy.context.scene, seed, output) for seed, output in zip(SEEDS, outputs, strict=True)]
        print(json.dumps({"room": stem.name, "cpu_s_of_cycles": cpu}), file=sys.stderr, flush=True)
    return [pictures.read(output) for output in outputs]


def shade(scene, radiance):
    """Materials of glTF's specification, and the sky."""
    background = render.sky(scene, 0.0)
    if radiance is not None:
        background.inputs["Color"].default_value = (*radiance, 1.0)
    render.linear_textures()
    for principled, material in shaders():
        tree = material.node_tree
        surface = pane(scene, material, principled) or materials.lambertian(tree, principled)
        if surface:
            if material.use_backface_culling:
                surface = materials.front_only(tree, surface)
                material.cycles.emission_sampling = "FRONT"
            materials.put(tree, principled, surface)
    render.shade(scene, "gltf")


def pane(scene, material, principled):
    """A face of a window's pane, or nothing: no path of Cycles finds a sun without extent through glass that refracts."""
    if material.name != interiors.PANE:
        return None
    scene.cycles.shading_system = True
    script = render.script_node(material.node_tree, "pane.osl")
    materials.take(material.node_tree, principled.inputs["IOR"], script.inputs.new("NodeSocketFloat", "IOR"))
    return script.outputs.new("NodeSocketShader", "BSDF")


def photoncard(arguments, name, scene_file, seed):
    """CPU seconds and picture of photoncard, in Blender's units."""
    output = scene_file.with_name(f"{scene_file.stem}-photoncard-{seed}.exr")
    height = arguments.width * 9 // 16
    command = [arguments.photoncard, "render", scene_file, "-o", output, "--size", f"{arguments.width}x{height}"]
    command += ["--filter", "box", "--seed", seed, "--aov", "none", "--card", "emulated:1", "--threads", "1", "--quiet"]
    sky = interiors.INTERIORS[name].sky
    command += ["--environment", ",".join(map(str, sky))] if sky else []
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([str(word) for word in [*command, *arguments.options]], check=False, timeout=LIMIT_S)
    if done.returncode != 0:
        sys.exit("photoncard failed")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, pictures.read(output)


def report(arguments, head, picture, truths, noise):
    """Prints a row of the table."""
    truth = np.mean(truths, axis=0)
    expected = blocks(truth)
    errors = (blocks(picture) - expected) / level(expected)
    of_cycles = deviation(*truths, truth) / 2**0.5
    bias = max(0.0, np.mean(errors**2) - noise**2 - of_cycles**2) ** 0.5
    sizes = np.abs(errors)
    values = (np.median(sizes), np.percentile(sizes, 95), sizes.max(), noise, bias, of_cycles)
    columns = " | ".join(f"{100.0 * value:.1f} %" for value in values)
    print(f"{head} | {picture.mean() / truth.mean():.4f} | {columns} |", file=arguments.table, flush=True)


def deviation(first, second, truth):
    """The root mean square of the noise of blocks of one of two pictures of different seeds."""
    difference = (blocks(first) - blocks(second)) / level(blocks(truth))
    return np.sqrt(np.mean(difference**2) / 2.0)


def level(expected):
    """What errors of blocks are relative to."""
    return np.maximum(expected, DARK * expected.mean())


def blocks(picture):
    """The mean colour of each whole block."""
    rows, columns = (side // BLOCK for side in picture.shape[:2])
    return picture[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3))


if __name__ == "__main__":
    main()
