"""Rooms that others made, beside Mitsuba's path tracer: errors of means over blocks of 12x12 pixels.

Two pictures of different seeds are rendered. Columns, in % and of channels apart, over the reference's block:

- median, p95, most: errors of the blocks of the pictures' mean;
- noise: root mean square of half of what the blocks of the two pictures differ by.

With --map the picture is the photon map's own estimate, by a plate of metal before the camera (`plate.py`),
its mean over more seeds. Surfaces are Lambertian; with --whole they have the gloss, metals and glass that their
files state, as glTF has them. With --furnace every surface is white under an even sky, and that estimate is 1
wherever light reaches: there is no reference, and rooms that are nearly closed are too noisy.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "mitsuba"))

import gltf  # noqa: E402: of the folder beside
import plate  # noqa: E402

NAMES = ("living-room", "staircase", "classroom", "dining-room", "living-room-2", "veach-lamp")
FURNACES = ("living-room",)
BLOCK, DARK, LONG = 12, 0.05, 192
# Settings of a view of the map, whose samples have nothing to average but the lobe.
MAP = "--photons 1000000 --neighbors 24 --spp 4 --gather-rays 1 --shadow-rays 2".split()
MAP += "--irradiance-cache off --adaptive off".split()
# An error of this share is shown as full red or blue.
SHOWN = 0.2


def main():
    """See the module."""
    arguments = parse()
    print("| room | mean | median | 95th percentile | most | noise |\n|---|---|---|---|---|---|", flush=True)
    for name in arguments.names or (FURNACES if arguments.furnace else NAMES):
        scene = convert(arguments, name)
        truth = None if arguments.furnace else reference(arguments, scene)
        pictures = [
            photoncard(arguments, scene, seed)
            for seed in range(1, 1 + (arguments.seeds or (8 if shows_map(arguments) else 2)))
        ]
        report(arguments, name, pictures, np.ones_like(pictures[0]) if truth is None else truth)


def parse():
    """The command's arguments; what follows -- goes to photoncard."""
    words, options = sys.argv[1:], []
    if "--" in words:
        place = words.index("--")
        words, options = words[:place], words[place + 1 :]
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)} [default: all]")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--rooms", type=Path, required=True, help="the folder of the rooms' XML")
    parser.add_argument("--folder", type=Path, required=True, help="where files go")
    parser.add_argument("--map", action="store_true", help="see above")
    parser.add_argument("--furnace", action="store_true", help="see above")
    parser.add_argument("--whole", action="store_true", help="see above")
    parser.add_argument("--skip-missing", action="store_true", help="leave out shapes whose files are absent")
    parser.add_argument("--seeds", type=int, help="pictures [default: 2, of a map 8]")
    parser.add_argument("--passes", type=int, default=16, help="of 128 samples of a reference, at most")
    arguments = parser.parse_args(words)
    arguments.options = options
    return arguments


def shows_map(arguments):
    """Whether the picture is that of the photon map alone."""
    return arguments.map or arguments.furnace


def kind(arguments):
    """The version of the rooms that is rendered, and the folder of its files."""
    return "furnace" if arguments.furnace else "whole" if arguments.whole else "lambertian"


def convert(arguments, name):
    """The glTF file of a room, made if it is missing."""
    path = arguments.folder / kind(arguments) / f"{name}.glb"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        options = {
            "furnace": ["--lambertian", "--furnace", "--flat", "--no-glass"],
            "lambertian": ["--lambertian"],
            "whole": ["--black-backs"],
        }
        run(
            [
                sys.executable,
                HERE / "to_gltf.py",
                arguments.rooms / name / "scene.xml",
                "--output",
                path,
                *options[kind(arguments)],
                *(["--skip-missing"] if arguments.skip_missing else []),
            ]
        )
    return path


def size(scene):
    """Sides of the picture, by the camera's aspect ratio."""
    aspect = gltf.read(scene)[0]["cameras"][0]["perspective"]["aspectRatio"]
    return (LONG, round(LONG / aspect)) if aspect >= 1.0 else (round(LONG * aspect), LONG)


def environment(arguments, scene):
    """The options for light from infinitely far."""
    if arguments.furnace:
        return ["--environment", "1,1,1"]
    path = scene.with_suffix(".exr")
    return ["--environment", path] if path.exists() else []


def reference(arguments, scene):
    """Mitsuba's picture, rendered if it is missing."""
    path = scene.parent / "references" / f"{scene.stem}.exr"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        width, height = size(scene)
        command = [
            sys.executable,
            HERE.parent / "mitsuba" / "converge.py",
            scene,
            "--size",
            f"{width}x{height}",
            *environment(arguments, scene),
        ]
        command += [
            "--per-pass",
            128,
            "--every",
            8,
            "--passes",
            arguments.passes,
            "--work",
            path.parent,
            "--output",
            path,
        ]
        run(command)
    return read(path)


def photoncard(arguments, scene, seed):
    """A picture."""
    width, height = size(scene)
    seen = scene
    if shows_map(arguments):
        seen = scene.with_name(f"{scene.stem}-plate.glb")
        plate.add(scene, seen)
    output = arguments.folder / "picture.exr"
    command = [
        arguments.photoncard,
        "render",
        seen,
        "--size",
        f"{width}x{height}",
        "--filter",
        "box",
        "--seed",
        seed,
        "-o",
        output,
        "--quiet",
    ]
    command += [
        "--aov",
        "none",
        *environment(arguments, scene),
        *(MAP if shows_map(arguments) else []),
        *arguments.options,
    ]
    run(command)
    picture = read(output)
    return picture[:, ::-1] if shows_map(arguments) else picture


def report(arguments, name, pictures, truth):
    """Prints the row of a room, and leaves a PNG."""
    picture = np.mean(pictures, axis=0)
    found, expected = blocks(picture), blocks(truth)
    level = np.maximum(expected, DARK * expected.mean())
    errors = 100.0 * np.abs(found - expected) / level
    halves = [blocks(np.mean(pictures[first::2], axis=0)) for first in (0, 1)]
    noise = 100.0 * np.sqrt(np.mean(((halves[0] - halves[-1]) / level) ** 2)) / 2.0
    columns = [
        f"{value:.1f} %" for value in (np.median(errors), np.percentile(errors, 95), errors.max(), noise)
    ]
    print(f"| {name} | {picture.mean() / truth.mean():.4f} | {' | '.join(columns)} |", flush=True)
    show(arguments.folder / f"{name}.png", picture, truth, ((found - expected) / level).mean(axis=2))


def blocks(picture):
    """The mean colour of each whole block."""
    rows, columns = (side // BLOCK for side in picture.shape[:2])
    return (
        picture[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3))
    )


def show(path, picture, truth, errors):
    """The reference, the picture, and the errors of blocks: too bright ones red, too dark ones blue."""
    signed = np.zeros_like(picture)
    fine = np.kron(errors, np.ones((BLOCK, BLOCK)))
    signed[: fine.shape[0], : fine.shape[1], 0] = np.clip(fine / SHOWN, 0.0, 1.0)
    signed[: fine.shape[0], : fine.shape[1], 2] = np.clip(-fine / SHOWN, 0.0, 1.0)
    write_png(path, [*shown_by(truth, [truth, picture]), signed])


def shown_by(truth, pictures):
    """Pictures with tones from 0 to 1, by the exposure of a reference."""
    exposure = 0.36 / np.exp(np.log(truth.mean(axis=2) + 1e-6).mean())
    return [(light * exposure / (1.0 + light * exposure)) ** (1.0 / 2.2) for light in np.maximum(pictures, 0.0)]


def write_png(path, pictures):
    """Writes pictures of tones from 0 to 1 side by side."""
    pixels = (255.0 * np.concatenate(pictures, axis=1)).astype(np.uint8)
    mi.Bitmap(np.ascontiguousarray(pixels)).write(str(path))


def read(path, layer=None):
    """Red, green and blue of a layer or of the unnamed one, rows from the top."""
    bitmap = mi.Bitmap(str(path))
    names = [member.name for member in bitmap.struct_()]
    channels = [f"{layer}.{channel}" if layer else channel for channel in "RGB"]
    return np.array(bitmap).astype(np.float64)[..., [names.index(channel) for channel in channels]]


def run(command):
    """Runs a command, whose progress goes to the standard error."""
    words = [str(word) for word in command]
    if subprocess.run(words, stdout=sys.stderr, check=False).returncode != 0:
        sys.exit(f"failed: {' '.join(words)}")


if __name__ == "__main__":
    main()
