"""Rooms of wall boxes beside Mitsuba's path tracer, and closed rooms under a sun outside.

Walls are boxes from 0.1 mm to 0.2 m thick, one- or double-sided, that touch along the edges of the room or
overlap there. All rooms are alike inside, so that one reference, of a room of six sheets, serves all. A room is
rendered twice more on a floor slab that goes on outside, with and without a sun of 300 W/m^2.
Columns: the mean over the reference's; the median and the 95th percentile of errors of blocks of 8x8 pixels,
all of the mean of two seeds; half of what blocks of the seeds differ by, root mean square; the mean with the
sun over that without it, of one seed, and the root mean square of what their blocks differ by over that of the
two seeds.
"""

import argparse
import itertools
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "mitsuba"), str(HERE.parent / "corners")]

import room  # noqa: E402: of the folder beside
import scene as scenes  # noqa: E402: needs the variant

SIDE, BLOCK, SEEDS = 96, 8, (1, 2)
PASS, RUSSIAN_ROULETTE_DEPTH = 128, 8
THICKNESSES = (0.0001, 0.001, 0.01, 0.05, 0.2)
UPPER = np.array((4.0, 2.5, 3.0))
CAMERAS = (("room", (0.4, 1.6, 0.4), (3.2, 0.9, 2.6), 70.0),)
SUN = (300.0, (0.5, -0.8, 0.3))
# How far the slab goes on outside, metres.
GROUND = 3.0


def main():
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where files go")
    parser.add_argument("--samples", type=int, default=1024, help="of a pixel of the reference")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    truth = reference(arguments)
    print("| walls | sides | edges | mean | median | 95th percentile | noise | mean by a sun outside | its difference |")
    print("|---|---|---|---|---|---|---|---|---|", flush=True)
    for thickness, double_sided, overlap in itertools.product(THICKNESSES, (True, False), (False, True)):
        report(arguments, truth, thickness, double_sided, overlap)


def report(arguments, truth, thickness, double_sided, overlap):
    """Prints the row of a kind of walls."""
    path = arguments.folder / "room.glb"

    def pictures(seeds, **outside):
        write(path, walls(thickness, overlap, **outside), double_sided)
        return [blocks(photoncard(arguments, path, seed)) for seed in seeds]

    found = pictures(SEEDS)
    mean, expected = np.mean(found, axis=0), blocks(truth)
    errors = 100.0 * np.abs(mean / expected - 1.0)
    noise = difference(*found)
    [dark] = pictures(SEEDS[:1], ground=GROUND)
    write(path, walls(thickness, overlap, ground=GROUND), double_sided, SUN)
    sunny = blocks(photoncard(arguments, path, SEEDS[0]))
    columns = [
        f"{1000.0 * thickness:g} mm",
        "double" if double_sided else "one",
        "overlap" if overlap else "touch",
        f"{mean.mean() / expected.mean():.4f}",
        *(f"{value:.1f} %" for value in (np.median(errors), np.percentile(errors, 95), 50.0 * noise)),
        f"{sunny.mean() / dark.mean():.4f}",
        f"{difference(sunny, dark) / noise:.1f}",
    ]
    print(f"| {' | '.join(columns)} |", flush=True)


def difference(first, second):
    """Root mean square of the relative differences of blocks."""
    return np.sqrt(np.mean(((first - second) / second) ** 2))


def walls(thickness, overlap, ground=0.0):
    """Triangles of six boxes around the room; the floor's goes on outside."""
    triangles = []
    beyond = thickness if overlap else 0.0
    for axis, is_upper in itertools.product(range(3), (False, True)):
        lower, upper = -np.full(3, beyond), UPPER + beyond
        lower[axis], upper[axis] = (UPPER[axis], UPPER[axis] + thickness) if is_upper else (-thickness, 0.0)
        if axis == 1 and not is_upper:
            lower[::2] -= ground
            upper[::2] += ground
        room.box(triangles, tuple(lower), tuple(upper))
    return triangles


def write(path, surfaces, double_sided, sun=None):
    """Writes a room with its lamp."""
    x, z, y = 2.0, 1.5, 2.49
    lamp = []
    room.quad(lamp, [(x - 0.3, y, z - 0.3), (x + 0.3, y, z - 0.3), (x + 0.3, y, z + 0.3), (x - 0.3, y, z + 0.3)])
    materials = [room.material([0.7, 0.65, 0.6], double_sided=double_sided), room.material([0.0] * 3, 10.0)]
    room.write_scene(path, {0: surfaces, 1: lamp}, materials, CAMERAS, sun)


def reference(arguments):
    """Mitsuba's picture of the room of sheets, rendered if it is missing."""
    kept = arguments.folder / f"reference-{arguments.samples}.npy"
    if not kept.exists():
        path, sheets = arguments.folder / "sheets.glb", []
        room.box(sheets, (0.0, 0.0, 0.0), tuple(UPPER), inward=True)
        write(path, sheets, False)
        scene = scenes.load(path, SIDE, SIDE, CAMERAS[0][0])
        integrator = mi.load_dict({"type": "path", "rr_depth": RUSSIAN_ROULETTE_DEPTH})
        passes = arguments.samples // PASS
        rendered = (mi.render(scene, integrator=integrator, spp=PASS, seed=seed) for seed in range(passes))
        np.save(kept, sum(np.array(picture).astype(np.float64) for picture in rendered) / passes)
    return np.load(kept).mean(axis=2)


def photoncard(arguments, path, seed):
    """A picture by the defaults."""
    output = arguments.folder / "picture.exr"
    command = [arguments.photoncard, "render", path, "--size", f"{SIDE}x{SIDE}", "--filter", "box"]
    command += ["--seed", seed, "--aov", "none", "--quiet", "-o", output]
    words = [str(word) for word in command]
    if subprocess.run(words, stdout=sys.stderr, check=False).returncode != 0:
        sys.exit(f"failed: {' '.join(words)}")
    bitmap = mi.Bitmap(str(output)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    return np.array(bitmap).mean(axis=2)


def blocks(picture):
    """The mean of each block of a picture."""
    count = SIDE // BLOCK
    return picture.reshape(count, BLOCK, count, BLOCK).mean(axis=(1, 3))


if __name__ == "__main__":
    main()
