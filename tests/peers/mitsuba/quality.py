"""Renders scenes at each quality and by a grid of settings, and prints the errors of the pictures over the CPU seconds that they took.

Two pictures of different seeds are rendered at each setting. Columns of the CSV, in % of the reference's mean:

- noise: root mean square of what the two differ by, over sqrt(2), of pixels and channels;
- bias: root mean square over blocks of 16x16 pixels of what both are off by, the reference's own error included;
- error: of both, sqrt(noise^2 + bias^2);
- median, p95: relative errors of the blocks of one picture;

and mean, of the pictures over the reference. Pictures have a box filter, as the references. CPU seconds of photoncard are those of
the whole command; of Mitsuba those of the call that renders, with kernels compiled and the scene built.
"""

import argparse
import csv
import json
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

from pictures import children_seconds, run

mi.set_variant("scalar_rgb")

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent
BLOCK, FILLED, DARK = 16, 0.25, 0.05
# The sky around a staged file (cycles/stage.py).
STAGE_SKY = "0.2,0.2,0.2"
QUALITIES = ["draft", "good", "final"]
# Settings of a sweep: samples, shadow rays, gather rays and photons.
SWEEP = [
    f"--spp {samples} --shadow-rays {shadow_rays} --gather-rays {gather_rays} --photons {photons}"
    for samples, shadow_rays, gather_rays, photons in (
        (16, 4, 128, 300_000),
        (32, 1, 128, 300_000),
        (32, 2, 128, 300_000),
        (32, 2, 256, 300_000),
        (64, 1, 128, 300_000),
        (64, 2, 400, 600_000),
    )
]
MITSUBA_SAMPLES = 64


class Scene:
    """A scene, its converged picture, and the view of it."""

    def __init__(self, file, references, size="256x256", environment=None, exclude=None, mask=None):
        self.file = file
        # Pictures whose mean is the converged one.
        self.references = references
        self.size = size
        self.environment = environment
        # Blocks of the converged picture that are brighter somewhere are left out: they see the lamp.
        self.exclude = exclude
        # A file of the pixels that count; None for all.
        self.mask = mask
        self.options = ["--environment", environment] if environment else []

    def reference(self):
        """The converged picture, and which pixels count."""
        pictures = [read(path) for path in self.references]
        picture = sum(pictures) / len(pictures)
        counts = np.load(self.mask) if self.mask else np.ones(picture.shape[:2], dtype=bool)
        if self.exclude:
            for block in squares(counts.shape):
                if picture[block].max() > self.exclude:
                    counts[block] = False
        return picture, counts


def scenes(peers):
    """The scenes by their names, with the files that `light_paths.sh`, `surfaces.sh` and `room.sh` leave in the folder of peers."""
    shipped, kept = ROOT / "scenes", ROOT / "tests" / "references"
    found = {
        "cornell": Scene(shipped / "cornell.gltf", [kept / "cornell.exr"], exclude=5.0),
        "cornell-glossy": Scene(shipped / "cornell-glossy.gltf", [kept / "cornell-glossy-032.exr"], exclude=5.0),
        "cornell-spheres": Scene(shipped / "cornell-spheres.glb", [kept / "cornell-spheres.exr"], exclude=5.0),
        "room": Scene(shipped / "room.glb", [kept / "room.exr"], size="320x240"),
        "atrium": Scene(shipped / "atrium.glb", [peers / "references" / "atrium.exr"]),
        "atrium-open": Scene(
            shipped / "atrium-open.glb", [kept / "atrium-sky.exr"], environment=shipped / "sky.exr"
        ),
    }
    for name in ("DamagedHelmet", "flight-helmet", "camera"):
        masks = sorted((peers / "surfaces").glob(f"{name}-cycles-*.npy"), key=lambda path: path.stat().st_mtime)
        if masks:
            halves = [masks[-1].with_name(f"{masks[-1].stem}-{half}.exr") for half in (1, 2)]
            staged = peers / "surfaces" / f"{name}.glb"
            found[name] = Scene(staged, halves, environment=STAGE_SKY, mask=masks[-1])
    for path in sorted((peers / "room").glob("room-converged-*.exr")):
        found["blender-room"] = Scene(peers / "room" / "room.glb", [path], size="192x192")
    return found


def main():
    """See the module."""
    arguments = parse()
    known = scenes(arguments.peers)
    unknown = [name for name in arguments.scenes if name not in known]
    if unknown:
        sys.exit(f"no scene '{unknown[0]}'; there are {', '.join(known)}")
    columns = ["scene", "settings", "cpu_s", "noise", "bias", "error", "mean", "median", "p95"]
    table = csv.writer(sys.stdout, lineterminator="\n")
    table.writerow(columns)
    for name in arguments.scenes or known:
        scene = known[name]
        settings = arguments.options or [*(f"--quality {quality}" for quality in QUALITIES), *(SWEEP if arguments.sweep else [])]
        for options in settings:
            pictures, seconds = photoncard(arguments, scene, options)
            write(table, name, options, seconds, measure(scene, pictures))
        if arguments.mitsuba and scene.file.parent == ROOT / "scenes":
            pictures, seconds = mitsuba(arguments, scene)
            write(table, name, f"Mitsuba, {MITSUBA_SAMPLES} samples", seconds, measure(scene, pictures))


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--peers", type=Path, required=True, help="the folder of peers, below cargo's target folder")
    parser.add_argument("--sweep", action="store_true", help="also render by a grid of settings")
    parser.add_argument("--mitsuba", action="store_true", help="also render shipped scenes with Mitsuba")
    parser.add_argument("--options", action="append", default=[], help="settings instead of the qualities; may be repeated")
    return parser.parse_args()


def photoncard(arguments, scene, options):
    """Two pictures, and the mean CPU seconds of one."""
    pictures, before = [], children_seconds()
    for seed in (1, 2):
        output = arguments.peers / f"quality-{seed}.exr"
        command = [arguments.photoncard, "render", scene.file, "-o", output, "--size", scene.size, "--aov", "none"]
        run([*command, "--seed", seed, "--filter", "box", "--quiet", *scene.options, *options.split()])
        pictures.append(read(output))
    return pictures, (children_seconds() - before) / 2.0


def mitsuba(arguments, scene):
    """Two pictures, and the mean CPU seconds in which one is rendered."""
    pictures, seconds = [], []
    for seed in (1001, 2001):
        output = arguments.peers / f"quality-{seed}.exr"
        command = [sys.executable, HERE / "render.py", scene.file, "--size", scene.size, "--seed", seed]
        command += ["--spp", MITSUBA_SAMPLES, "--output", output]
        if scene.environment:
            command += ["--environment", scene.environment]
        seconds.append(json.loads(run(command))["cpu_s"])
        pictures.append(read(output))
    return pictures, sum(seconds) / 2.0


def measure(scene, pictures):
    """The columns from noise on."""
    reference, counts = scene.reference()
    first, second = pictures
    level = reference[counts].mean()
    noise = np.sqrt(np.mean((first - second)[counts] ** 2) / 2.0) / level
    ours, others, truth = (blocks(picture, counts) for picture in (first, second, reference))
    bias = np.sqrt(max(np.mean((ours - truth) * (others - truth)), 0.0)) / level
    of_block = np.maximum(truth.mean(axis=1), DARK * truth.mean())
    errors = np.abs(ours.mean(axis=1) - truth.mean(axis=1)) / of_block
    mean = (first + second)[counts].mean() / 2.0 / level
    shares = [noise, bias, np.hypot(noise, bias)]
    return [*(100.0 * share for share in shares), mean, 100.0 * np.median(errors), 100.0 * np.percentile(errors, 95)]


def write(table, name, options, seconds, columns):
    """Writes a row."""
    noise, bias, error, mean, median, p95 = columns
    shares = [f"{share:.2f}" for share in (noise, bias, error)]
    table.writerow([name, options, f"{seconds:.2f}", *shares, f"{mean:.4f}", f"{median:.2f}", f"{p95:.2f}"])
    sys.stdout.flush()


def squares(shape):
    """The blocks of a picture."""
    for row in range(0, shape[0], BLOCK):
        for column in range(0, shape[1], BLOCK):
            yield np.s_[row : row + BLOCK, column : column + BLOCK]


def blocks(picture, counts):
    """The mean colour of each block over the pixels that count, for blocks with enough of them."""
    filled = [block for block in squares(counts.shape) if counts[block].sum() >= FILLED * BLOCK * BLOCK]
    return np.array([picture[block][counts[block]].mean(axis=0) for block in filled])


def read(path):
    """An EXR picture, rows from the top."""
    bitmap = mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    return np.array(bitmap).astype(float)


if __name__ == "__main__":
    main()
