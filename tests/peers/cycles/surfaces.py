"""Renders glTF files with photoncard and with Blender's Cycles in the same surroundings, and prints by how much they differ."""

import argparse
import hashlib
import json
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np

import gltf
import pictures
import stage

HERE = Path(__file__).resolve().parent
SIZE = 256
SETTINGS = "--spp 32 --gather-rays 8 --shadow-rays 2 --photons 300000".split()
LIMIT_S = 1800


class Renderers:
    """The two programs."""

    def __init__(self, arguments):
        self.photoncard = arguments.photoncard
        self.folder = arguments.folder
        self.samples = arguments.samples
        self.model = arguments.model
        self.options = arguments.options or SETTINGS

    def cycles(self, scene):
        """Two pictures of half the samples, which pixels count, and what Cycles reports."""
        key = hashlib.sha256(scene.read_bytes())
        for part in ("render.py", "gltf.osl", "stage.py"):
            key.update((HERE / part).read_bytes())
        key.update(f"{self.samples} {self.model} {SIZE}".encode())
        stem = self.folder / f"{scene.stem}-cycles-{key.hexdigest()[:12]}"
        outputs = [Path(f"{stem}-{half}.exr") for half in (1, 2)]
        note, mask = Path(f"{stem}.json"), Path(f"{stem}.npy")
        if not note.exists():
            command = [sys.executable, HERE / "render.py", scene, "--size", SIZE, "--samples", self.samples // 2]
            command += ["--model", self.model, "--seeds", 1, 2, "--outputs", *outputs, "--mask", mask]
            note.write_text(run(command).splitlines()[-1])
        return [pictures.read(output) for output in outputs], np.load(mask), json.loads(note.read_text())

    def ours(self, scene):
        """Two pictures of different seeds, and CPU seconds of both."""
        result, before = [], children_seconds()
        for seed in (1, 2):
            output = self.folder / f"{scene.stem}-{seed}.exr"
            light = ",".join([str(stage.SKY)] * 3)
            command = [self.photoncard, "render", scene, "--quality", "paper", "-o", output, "--size", f"{SIZE}x{SIZE}", "--aov", "none"]
            command += ["--environment", light, "--camera", stage.CAMERA, "--seed", seed, "--card", "emulated:1"]
            run([*command, "--threads", 1, "--quiet", *self.options])
            result.append(pictures.read(output))
        return result, children_seconds() - before


def main():
    """See the module."""
    arguments = parse()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    renderers = Renderers(arguments)
    print("| file | mean | median block | 95th percentile | noise of Cycles | noise of photoncard | CPU s | Cycles, CPU s |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for file in arguments.files:
        name, _, path = file.rpartition("=")
        path = Path(path)
        name = name or path.stem
        compare(renderers, name, path, arguments.without)
        if arguments.each:
            for feature in features(path):
                compare(renderers, f"{name} without {feature}", path, [*arguments.without, feature])


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", metavar="[NAME=]FILE", help="glTF files, .gltf or .glb")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where pictures go")
    parser.add_argument("--samples", type=int, default=512, help="samples a pixel of Cycles")
    parser.add_argument("--model", choices=("gltf", "principled"), default="gltf", help="reflection model of Cycles")
    parser.add_argument(
        "--without", type=lambda text: text.split(","), default=[], help=f"features to remove: {','.join(gltf.FEATURES)}"
    )
    parser.add_argument("--each", action="store_true", help="also without each feature that the file has")
    parser.add_argument("--options", type=str.split, help=f"of photoncard, instead of '{' '.join(SETTINGS)}'")
    arguments = parser.parse_args()
    unknown = [feature for feature in arguments.without if feature not in gltf.FEATURES]
    if unknown:
        parser.error(f"there is no feature {unknown[0]}; there are {', '.join(gltf.FEATURES)}")
    return arguments


def features(path):
    """The features that a file has."""
    return [feature for feature in gltf.FEATURES if gltf.Document(path).remove(feature)]


def compare(renderers, name, path, without):
    """Prints a row of the table, and writes the pictures."""
    scene = renderers.folder / f"{name.replace(' ', '-')}.glb"
    document = gltf.Document(path)
    for feature in without:
        document.remove(feature)
    stage.put(document)
    document.write(scene)
    theirs, mask, note = renderers.cycles(scene)
    try:
        ours, seconds = renderers.ours(scene)
    except Refused as error:
        print(f"| {name} | {error} | | | | | | |", flush=True)
        return
    picture, reference = sum(ours) / 2.0, sum(theirs) / 2.0
    difference = pictures.Difference(picture, reference, mask)
    # Two halves are apart by twice the error of their mean.
    noises = [pictures.Difference(pair[0], pair[1], mask) for pair in (theirs, ours)]
    columns = [f"{difference.mean:.3f}", percent(difference.median()), percent(difference.high())]
    columns += [f"{percent(noise.median() / 2.0)}, {percent(noise.high() / 2.0)}" for noise in noises]
    columns += [f"{seconds:.0f}", f"{sum(note['cpu_s']):.0f}"]
    print(f"| {name} | {' | '.join(columns)} |", flush=True)
    if note["own_models"]:
        print(f"{name}: Blender's own models for {', '.join(note['own_models'])}", file=sys.stderr)
    apart = np.abs(picture - reference) * mask[..., None]
    pictures.show([picture, apart, reference], scene.with_suffix(".png"))


def percent(share):
    """A share for the table."""
    return f"{100.0 * share:.1f} %"


class Refused(Exception):
    """photoncard does not render a file."""


def run(command):
    """What a command prints."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    if done.returncode != 0:
        if words[0] != sys.executable:
            raise Refused(next((line for line in done.stderr.splitlines() if line.startswith("error")), "photoncard failed"))
        sys.exit(f"failed: {' '.join(words)}\n{done.stderr}")
    return done.stdout


def children_seconds():
    """CPU seconds of commands that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
