"""Rooms that others made, with and without a denoiser: photoncard beside Blender's Cycles and Mitsuba in equal CPU time.

The whole command is counted: reading the scene, photons or hierarchy, samples, denoiser. Cycles has adaptive sampling; it and Mitsuba have as many
samples as fit the time by the cost of two short renders; photoncard has `--time`. Each is compared with a converged picture of its own, not
denoised; the row `own` has what these differ by, which no time mends. Columns:

- relMSE: mean of squared errors of channels over the reference's square plus 1e-4 of its mean square, without the worst 0.1 % of the pixels;
- FLIP: NVIDIA's HDR-FLIP;
- median, 95th: errors of the means of 12x12 pixels and channels, %.
"""

import argparse
import json
import resource
import subprocess
import sys
from pathlib import Path

import flip_evaluator
import numpy as np

import compare

HERE = Path(__file__).resolve().parent
HEADS = ("room", "CPU s asked", "program", "CPU s", "relMSE", "FLIP", "mean", "median", "95th percentile")
WORST = 0.001
# Settings of photoncard's reference: many photons, and nothing that pixels share.
OWN = "--photons 8000000 --photons-for camera --gather-rays 4 --shadow-rays 2 --irradiance-cache off --adaptive off".split()
# Samples of the renders by which the cost of other programs is measured. Mitsuba compiles its kernels in the first of them.
SHORT = (1, 5)


def main():
    """See the module."""
    arguments = parse()
    print(f"| {' | '.join(HEADS)} |\n|{'---|' * len(HEADS)}", flush=True)
    for name in arguments.names or compare.NAMES:
        race(arguments, compare.convert(arguments, name))


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(compare.NAMES)} [default: all]")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--cycles", type=Path, required=True, help="Python with Blender's module")
    parser.add_argument("--rooms", type=Path, required=True, help="the folder of the rooms' XML")
    parser.add_argument("--folder", type=Path, required=True, help="where files go")
    parser.add_argument("--long", type=int, default=960, help="longer side of the pictures, pixels")
    parser.add_argument("--seconds", default="10,30,100", help="CPU seconds, with commas between them")
    parser.add_argument("--samples", type=int, default=2048, help="of Cycles's reference; photoncard's has an eighth, with 4 gather rays each")
    parser.add_argument("--skip-missing", action="store_true", help="leave out shapes whose files are absent")
    arguments = parser.parse_args()
    arguments.whole, arguments.map, arguments.furnace = True, False, False
    arguments.times = [float(time) for time in arguments.seconds.split(",")]
    compare.LONG = arguments.long
    return arguments


def race(arguments, scene):
    """Prints the rows of a room."""
    width, height = compare.size(scene)
    room = Room(arguments, scene, f"{width}x{height}")
    truths = room.references()
    show = room.folder / f"{scene.stem}.png"
    for peer in ("cycles", "mitsuba"):
        row(scene, "", f"own, by {peer}'s", 0.0, truths["photoncard"], truths[peer])
    samples = {denoise: samples_by_time(lambda count, denoise=denoise: room.cycles(count, denoise)[1]) for denoise in (False, True)}
    samples_of_mitsuba = samples_by_time(lambda count: room.mitsuba(count)[1])
    shown = [truths["cycles"]]
    for time in arguments.times:
        picture, cpu = room.mitsuba(samples_of_mitsuba(time))
        row(scene, time, "Mitsuba", cpu, picture, truths["mitsuba"])
        for denoise in (False, True):
            label = " + OIDN" if denoise else ""
            picture, cpu = room.cycles(samples[denoise](time), denoise)
            row(scene, time, f"Cycles{label}", cpu, picture, truths["cycles"])
            shown.append(picture)
            picture, cpu = room.photoncard(time, denoise)
            row(scene, time, f"photoncard{label}", cpu, picture, truths["photoncard"])
            shown.append(picture)
    compare.write_png(show, compare.shown_by(truths["cycles"], shown))


def samples_by_time(cost):
    """A function from CPU seconds to the number of samples that fit them, by the cost of two short renders."""
    first, last = (cost(count) for count in SHORT)
    of_sample = max((last - first) / (SHORT[1] - SHORT[0]), 1e-9)
    return lambda time: max(1, round(1 + (time - first) / of_sample))


class Room:
    """A room and the programs that render it."""

    def __init__(self, arguments, scene, size):
        self.arguments, self.scene, self.size = arguments, scene, size
        self.folder = arguments.folder / "denoised" / size
        self.folder.mkdir(parents=True, exist_ok=True)
        self.environment = compare.environment(arguments, scene)

    def path(self, name):
        """A file of this room."""
        return self.folder / f"{self.scene.stem}-{name}.exr"

    def references(self):
        """Converged pictures of the programs, rendered if they are missing."""
        theirs, mitsuba, ours = (self.path(name) for name in ("cycles", "mitsuba", "photoncard"))
        if not theirs.exists():
            self.run_cycles(theirs, self.arguments.samples, ["--reference", "--threads", 0, "--seed", 1000])
        if not mitsuba.exists():
            self.run_mitsuba(mitsuba, self.arguments.samples, seed=1000)
        if not ours.exists():
            spp = max(1, self.arguments.samples // 8)
            self.run_photoncard(ours, [*OWN, "--spp", spp, "--seed", 1000, "--aov", "none"])
        return {"cycles": compare.read(theirs), "mitsuba": compare.read(mitsuba), "photoncard": compare.read(ours)}

    def cycles(self, samples, denoise):
        """Picture and CPU seconds of Cycles."""
        output = self.path(f"cycles-{samples}{'-denoised' if denoise else ''}")
        cpu = self.run_cycles(output, samples, ["--denoise"] if denoise else [])
        return compare.read(output), cpu

    def run_cycles(self, output, samples, options):
        """CPU seconds of Cycles."""
        command = [self.arguments.cycles, HERE.parent / "cycles" / "race.py", self.scene, output]
        command += ["--size", self.size, "--samples", samples, *self.environment, *options]
        return seconds_of(command)

    def mitsuba(self, samples):
        """Picture and CPU seconds of Mitsuba."""
        output = self.path(f"mitsuba-{samples}")
        cpu = self.run_mitsuba(output, samples, seed=1)
        return compare.read(output), cpu

    def run_mitsuba(self, output, samples, seed):
        """CPU seconds of Mitsuba."""
        command = [sys.executable, HERE.parent / "mitsuba" / "race.py", self.scene, output, "--size", self.size]
        return seconds_of([*command, "--samples", samples, "--seed", seed, *self.environment])

    def photoncard(self, time, denoise):
        """Picture and CPU seconds of photoncard."""
        output = self.path(f"photoncard-{time:.0f}{'-denoised' if denoise else ''}")
        options = ["--time", f"{time:g}s", "--card", "emulated:1", "--threads", 1, "--seed", 1]
        cpu = self.run_photoncard(output, [*options, *(["--denoise"] if denoise else ["--aov", "none"])])
        return compare.read(output, "denoised" if denoise else None), cpu

    def run_photoncard(self, output, options):
        """CPU seconds of photoncard."""
        command = [self.arguments.photoncard, "render", self.scene, "-o", output, "--size", self.size, "--filter", "box", "--quiet"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        compare.run([*command, *self.environment, *options])
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def seconds_of(command):
    """The sum of the numbers in the last line that a command prints, a JSON object."""
    done = subprocess.run([str(word) for word in command], check=True, stdout=subprocess.PIPE)
    return sum(json.loads(done.stdout.splitlines()[-1]).values())


def row(scene, time, program, cpu, picture, truth):
    """Prints a row of the table."""
    found, expected = compare.blocks(picture), compare.blocks(truth)
    errors = 100.0 * np.abs(found - expected) / np.maximum(expected, compare.DARK * expected.mean())
    flip = flip_evaluator.evaluate(truth.astype(np.float32), picture.astype(np.float32), "HDR", applyMagma=False)[1]
    columns = [f"{cpu:.0f}", f"{relative(picture, truth):.4f}", f"{flip:.3f}", f"{picture.mean() / truth.mean():.4f}"]
    columns += [f"{np.median(errors):.1f} %", f"{np.percentile(errors, 95):.1f} %"]
    print(f"| {scene.stem} | {time} | {program} | {' | '.join(columns)} |", flush=True)


def relative(picture, truth):
    """relMSE; see the module."""
    errors = np.mean((picture - truth) ** 2 / (truth**2 + 1e-4 * np.mean(truth) ** 2 + 1e-12), axis=2).ravel()
    return np.sort(errors)[: max(1, round(len(errors) * (1.0 - WORST)))].mean()


if __name__ == "__main__":
    sys.exit(main())
