"""Renders scenes with photoncard and with Mitsuba at several qualities, and prints what each took and how far off it is.

CPU seconds are user and system time of all threads. Those of photoncard are of the whole command: reading the scene, photons,
building, loading and the picture's file. Those of Mitsuba are of the rendering call alone, when kernels are compiled and
the scene is built, which favours Mitsuba.
"""

import argparse
import json
import math
import resource
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCENES = HERE.parent.parent.parent / "scenes"
SIZE = "512x512"
# A seed that no compared picture has.
REFERENCE_SEED = 1_000_000


class Comparison:
    """What is rendered of a scene."""

    def __init__(self, file, reference_spp, exclude, mitsuba_spp, settings):
        self.file = file
        # Samples of each of the two halves of the reference.
        self.reference_spp = reference_spp
        # Blocks of the reference that are brighter somewhere are left out: they see the lamp, whose noise at its edges
        # would outweigh all else.
        self.exclude = exclude
        self.mitsuba_spp = mitsuba_spp
        self.settings = settings


def cached(options):
    """Settings with the irradiance cache."""
    return f"--irradiance-cache on --ic-error 0.1 {options}"


COMPARISONS = {
    "cornell": Comparison(
        file="cornell.gltf",
        reference_spp=1024,
        exclude=1.0,
        mitsuba_spp=[16, 32, 64, 128],
        settings=[
            cached("--spp 1 --gather-rays 16 --photons 50000"),
            cached("--spp 1 --gather-rays 32 --photons 100000"),
            cached("--spp 2 --shadow-rays 4 --gather-rays 64 --photons 200000"),
        ],
    ),
    "atrium": Comparison(
        file="atrium.glb",
        reference_spp=1024,
        exclude=None,
        mitsuba_spp=[8, 16, 32, 64, 128],
        settings=[
            cached("--spp 1 --gather-rays 32 --photons 200000"),
            cached("--spp 4 --shadow-rays 2 --gather-rays 16 --photons 200000 --neighbors 16 --tile 32"),
            cached("--spp 16 --shadow-rays 1 --gather-rays 32 --photons 200000 --neighbors 16 --tile 32"),
            cached("--spp 16 --shadow-rays 1 --gather-rays 32 --photons 1000000 --neighbors 8 --tile 32"),
        ],
    ),
}


class Renderers:
    """The two programs."""

    def __init__(self, photoncard, folder):
        self.photoncard = photoncard
        self.folder = folder

    def mitsuba(self, comparison, samples, seed, names):
        """Renders with Mitsuba; the CPU seconds of each picture, and the pictures."""
        outputs = [self.folder / name for name in names]
        command = [sys.executable, HERE / "render.py", SCENES / comparison.file, "--size", SIZE, "--seed", seed]
        command += ["--spp", *samples, "--output", *outputs]
        lines = run(command).splitlines()
        return [json.loads(line)["cpu_s"] for line in lines], outputs

    def ours(self, comparison, settings, name):
        """Renders with photoncard; its CPU seconds, and the picture."""
        output = self.folder / name
        command = [self.photoncard, "render", SCENES / comparison.file, "--quality", "paper", "-o", output, "--size", SIZE, "--quiet"]
        command += ["--card", "emulated:1"]
        before = children_seconds()
        run([*command, *settings.split()])
        return children_seconds() - before, output

    def difference(self, comparison, reference, picture):
        """How far a picture is from another: `photoncard diff`."""
        command = [self.photoncard, "diff", reference, picture, "--block", 4]
        if comparison.exclude is not None:
            command += ["--exclude-above", comparison.exclude]
        return json.loads(run(command))

    def reference(self, name, comparison):
        """The converged picture: one that is there, or the mean of two that Mitsuba renders, and the RMSE that it has left."""
        path = self.folder / f"{name}-{SIZE}-reference.exr"
        note = path.with_suffix(".json")
        if not path.exists():
            halves = [f"{name}-half{half}.exr" for half in (0, 1)]
            for half, output in enumerate(halves):
                self.mitsuba(comparison, [comparison.reference_spp], REFERENCE_SEED * (half + 1), [output])
            first, second = (self.folder / half for half in halves)
            # Each half is off by its noise, their difference by both, and their mean by half of that.
            rmse = self.difference(comparison, first, second)["pixels"]["rmse"] / 2.0
            note.write_text(json.dumps({"spp": 2 * comparison.reference_spp, "rmse": rmse}))
            # Under its name when it is whole: what is there is not made again.
            unfinished = path.with_suffix(".unfinished.exr")
            run([sys.executable, HERE / "mean.py", unfinished, first, second])
            unfinished.replace(path)
        return path, json.loads(note.read_text()) if note.exists() else None


def main():
    """See the module."""
    arguments = parse()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    renderers = Renderers(arguments.photoncard, arguments.folder)
    for name in arguments.scenes or COMPARISONS:
        compare(renderers, name)


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(COMPARISONS)} [default: all]")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where pictures go")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.scenes if name not in COMPARISONS]
    if unknown:
        parser.error(f"no scene '{unknown[0]}'; there are {', '.join(COMPARISONS)}")
    return arguments


def compare(renderers, name):
    """Prints the table of a scene."""
    comparison = COMPARISONS[name]
    reference, note = renderers.reference(name, comparison)
    print(f"\n{name} {SIZE}, against {describe(note)}\n", flush=True)
    print("| program | settings | CPU s | RMSE | mean | Mitsuba for that RMSE, CPU s | times |")
    print("|---|---|---|---|---|---|---|")
    names = [f"{name}-mitsuba-{spp}.exr" for spp in comparison.mitsuba_spp]
    seconds, pictures = renderers.mitsuba(comparison, comparison.mitsuba_spp, 1, names)
    curve = []
    for spp, cpu, picture in zip(comparison.mitsuba_spp, seconds, pictures, strict=True):
        rmse, mean = measure(renderers.difference(comparison, reference, picture))
        curve.append((rmse, cpu))
        print(f"| Mitsuba | {spp} samples | {cpu:.2f} | {rmse:.5f} | {mean:.4f} | | |", flush=True)
    for index, settings in enumerate(comparison.settings):
        cpu, picture = renderers.ours(comparison, settings, f"{name}-{index}.exr")
        rmse, mean = measure(renderers.difference(comparison, reference, picture))
        peer, is_beyond = seconds_for(curve, rmse)
        mark = "about " if is_beyond else ""
        times = f"{peer / cpu:.1f}"
        print(f"| photoncard | `{settings}` | {cpu:.2f} | {rmse:.5f} | {mean:.4f} | {mark}{peer:.2f} | {times} |", flush=True)


def describe(note):
    """What the reference is."""
    if note is None:
        return "the picture that was there"
    return f"{note['spp']} samples a pixel of Mitsuba, which are off by an RMSE of {note['rmse']:.5f}"


def measure(difference):
    """The RMSE of the pixels, and the mean over the reference's."""
    return difference["pixels"]["rmse"], difference["mean_ratio"]


def seconds_for(curve, rmse):
    """The CPU seconds for an RMSE on a curve of (RMSE, seconds), between its points along a power law; beyond them by the
    law of independent samples, seconds as the inverse square. Also returns whether it is beyond."""
    for (worse, less), (better, more) in zip(curve, curve[1:]):
        if worse >= rmse >= better:
            share = math.log(worse / rmse) / math.log(worse / better)
            return less * (more / less) ** share, False
    nearest_rmse, nearest_seconds = curve[0] if rmse > curve[0][0] else curve[-1]
    return nearest_seconds * (nearest_rmse / rmse) ** 2, True


def run(command):
    """What a command prints."""
    words = [str(word) for word in command]
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"failed: {' '.join(words)}")
    return done.stdout


def children_seconds():
    """CPU seconds of commands that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
