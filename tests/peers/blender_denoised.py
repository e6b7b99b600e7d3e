#!/usr/bin/env python3
"""The three scenes of the extension's tests in Blender, denoised: photoncard beside Cycles in equal CPU time.

    PHOTONCARD_OIDN=LIBRARY PYTHON tests/peers/blender_denoised.py PHOTONCARD FOLDER [NAME ..] [--width N] [--samples N]

PYTHON has the packages bpy and numpy; NAME is room, product or plan. photoncard renders the quality `good` with
`--denoise`; counted is the whole command, user and system: reading the scene, pilot, photons, samples, denoiser. Cycles
has as many samples as fit that time by the cost of two short renders, its own Open Image Denoise with albedo and normals, and
adaptive sampling; counted is the call that renders. Both have box filters of a pixel. Cycles clamps no light. Textures are
not interpolated: between texels of 8 bits Cycles interpolates encoded values, photoncard linear ones as glTF has it.

The reference is the mean of two pictures of Cycles that are not denoised, of --samples each. Columns: the mean over that
of the reference; the root of the mean square of relative errors, and its part in blocks of 8x8 pixels, where noise of pixels
vanishes. Errors are over the reference plus 5 % of its mean. The row `reference` has what its two pictures let expect
of their mean. PNGs in FOLDER show photoncard, Cycles and the reference, and below the errors of the first two,
red where they are brighter and blue where they are darker.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT / "host-cli/blender"), str(ROOT / "host-cli/blender/tests")]

import bpy  # noqa: E402
import numpy as np  # noqa: E402
import rendering  # noqa: E402
import scenes  # noqa: E402
from photoncard import command, exr, png  # noqa: E402
from photoncard.export.camera import frame_of  # noqa: E402
from photoncard.export.objects import export  # noqa: E402

NAMES = ("room", "product", "plan")
HEADS = ("scene", "picture", "CPU s", "mean", "RMS error", "in blocks")
BLOCK = 8
DARK = 0.05
SHORT = (8, 40)
"""Samples of the renders by which the cost of Cycles is measured."""
FULL_ERROR = 0.25
"""Relative error that is shown in full colour."""


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photoncard", type=Path, help="the command")
    parser.add_argument("folder", type=Path, help="where pictures go")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)} [default: all]")
    parser.add_argument("--width", type=int, default=320, help="pixels; the height is 9/16 of it")
    parser.add_argument("--samples", type=int, default=1024, help="of each of the reference's two pictures")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    bpy.ops.preferences.addon_enable(module="cycles")
    # The table alone goes to the standard output: Blender reports there too.
    table = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    print(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}", file=table, flush=True)
    for name in arguments.names or NAMES:
        for row in compare(arguments, name):
            print(f"| {name} | {row} |", file=table, flush=True)
    # The package bpy may hang when the interpreter ends.
    table.flush()
    os._exit(0)


def compare(arguments: argparse.Namespace, name: str) -> list[str]:
    """The rows of a scene; leaves its PNG."""
    scene = getattr(scenes, name)()
    scene.render.resolution_x, scene.render.resolution_y = arguments.width, arguments.width * 9 // 16
    rendering.use_cycles(scene, 1)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 1.0
    for material in bpy.data.materials:
        for node in material.node_tree.nodes:
            if node.bl_idname == "ShaderNodeTexImage":
                node.interpolation = "Closest"
    with tempfile.TemporaryDirectory() as folder:
        ours, seconds = photoncard(arguments.photoncard, scene, Path(folder))
        samples = samples_in(scene, seconds, Path(folder))
        theirs, seconds_of_cycles = cycles(scene, samples, True, 1, Path(folder))
        parts = [cycles(scene, arguments.samples, False, seed, Path(folder)) for seed in (2, 3)]
    truth = np.mean([picture for picture, _ in parts], axis=0)
    difference = (parts[0][0] - parts[1][0]) / 2
    errors = [relative(each - truth, truth) for each in (ours, theirs)]
    save(arguments.folder / f"{name}.png", [ours, theirs, truth], errors)
    return [
        row("photoncard", seconds, ours, truth, ours - truth),
        row(f"Cycles, {samples} samples", seconds_of_cycles, theirs, truth, theirs - truth),
        row("reference", sum(cpu for _, cpu in parts), truth, truth, difference),
    ]


def photoncard(program: Path, scene: bpy.types.Scene, folder: Path) -> tuple[np.ndarray, float]:
    """Denoised picture and CPU seconds of photoncard."""
    frame = frame_of(scene.render)
    scene_arguments = export(bpy.context.evaluated_depsgraph_get(), scene.camera, frame).write(str(folder))
    settings = command.Settings(frame.size, is_denoised=True, is_transparent=scene.render.film_transparent)
    output = folder / "photoncard.exr"
    line = [str(program), "render", *scene_arguments, *settings.arguments(), "--filter", "box", "-o", str(output)]
    before = cpu_seconds(resource.RUSAGE_CHILDREN)
    subprocess.run([*line, "--quiet"], check=True)
    seconds = cpu_seconds(resource.RUSAGE_CHILDREN) - before
    channels = exr.read(output).channels
    return np.stack([channels[f"denoised.{channel}"] for channel in "RGB"], axis=-1), seconds


def samples_in(scene: bpy.types.Scene, seconds: float, folder: Path) -> int:
    """Samples of Cycles that fit a time. The first render, which loads the kernels, does not count."""
    cycles(scene, 1, True, 1, folder)
    few, many = (cycles(scene, samples, True, 1, folder)[1] for samples in SHORT)
    of_sample = max((many - few) / (SHORT[1] - SHORT[0]), 1e-9)
    return max(1, round(SHORT[0] + (seconds - few) / of_sample))


def cycles(
    scene: bpy.types.Scene, samples: int, is_denoised: bool, seed: int, folder: Path
) -> tuple[np.ndarray, float]:
    """Picture and CPU seconds of Cycles."""
    settings = scene.cycles
    settings.samples, settings.seed, settings.use_denoising = samples, seed, is_denoised
    settings.use_adaptive_sampling, settings.adaptive_threshold = is_denoised, 0.0
    if is_denoised:
        settings.denoiser, settings.denoising_use_gpu = "OPENIMAGEDENOISE", False
        settings.denoising_input_passes, settings.denoising_prefilter = "RGB_ALBEDO_NORMAL", "ACCURATE"
    before = cpu_seconds(resource.RUSAGE_SELF)
    channels = rendering.passes(scene, "CYCLES", folder)
    return rendering.colour(channels), cpu_seconds(resource.RUSAGE_SELF) - before


def cpu_seconds(whose: int) -> float:
    """User and system time so far."""
    usage = resource.getrusage(whose)
    return usage.ru_utime + usage.ru_stime


def row(title: str, seconds: float, picture: np.ndarray, truth: np.ndarray, error: np.ndarray) -> str:
    """Columns of a picture with its error."""
    whole = np.sqrt(np.mean(relative(error, truth) ** 2))
    coarse = np.sqrt(np.mean(relative(blocks(error), blocks(truth)) ** 2))
    mean = picture.mean() / truth.mean()
    return f"{title} | {seconds:.1f} | {mean:.4f} | {100 * whole:.1f} % | {100 * coarse:.1f} %"


def relative(error: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Errors over the reference."""
    return error / (truth + DARK * truth.mean())


def blocks(picture: np.ndarray) -> np.ndarray:
    """The mean colour of each whole block."""
    rows, columns = (side // BLOCK for side in picture.shape[:2])
    whole = picture[: rows * BLOCK, : columns * BLOCK]
    return whole.reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3))


def save(path: Path, pictures: list[np.ndarray], errors: list[np.ndarray]) -> None:
    """Writes pictures side by side, the reference last, with errors below."""
    above = np.concatenate([rendering.shown(each, pictures[-1]) for each in pictures], axis=1)
    below = np.zeros_like(above)
    for place, error in enumerate(errors):
        level = np.rint(255 * np.clip(error.mean(axis=-1) / FULL_ERROR, -1, 1)).astype(int)
        tinted = np.stack([np.maximum(level, 0), np.zeros_like(level), np.maximum(-level, 0)], axis=-1)
        below[:, place * error.shape[1] : (place + 1) * error.shape[1]] = tinted
    path.write_bytes(png.encode(np.concatenate([above, below], axis=0)))


if __name__ == "__main__":
    main()
