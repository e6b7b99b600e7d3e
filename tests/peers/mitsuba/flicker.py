"""Renders frames of a walk through the atrium with photoncard and with Mitsuba in the same CPU time, and prints how much each flickers.

The example `flicker` projects the pixels of each frame into the one before, by photoncard's depths and cameras for all
programs. Only the camera moves: Mitsuba has the scene that stands still, and the cameras of photoncard's frames. CPU seconds of
photoncard are those of the whole command over the number of frames; of Mitsuba those of the calls that render, with kernels
compiled and the scene built.
"""

import argparse
import json
from pathlib import Path

import mitsuba as mi
import numpy as np

from pictures import SCENES, children_seconds, run
from render import cpu_seconds, render

import scene as scenes  # Needs the variant, which `render` sets.

SIZE = 256
WALK, STATIC = "atrium-walk.glb", "atrium.glb"
SETTINGS = ["--irradiance-cache on", "--irradiance-cache off"]
# Corners of boxes of places: the frieze above the arcade, lit by sky and sun, and the wall behind it, lit by what they reflect. No
# edge is in them: what pixels at edges differ by is not noise.
STRIPS = {"frieze": "1,4.3,4.19,4,4.5,4.21", "wall behind": "5,0.6,7.79,6,3.2,7.81"}
FIRST_SEED = 1
# Samples a pixel by which Mitsuba's time for one is measured.
PILOT = 32


class Frames:
    """Pictures of the walk by one program, and the CPU seconds that one took."""

    def __init__(self, name, pictures, seconds):
        self.name = name
        self.pictures = pictures
        self.seconds = seconds

    def flicker(self, command, depths, within):
        """The error of frames against those before, %; places are those of other frames' depths."""
        pairs = [f"{depth}={picture}" for depth, picture in zip(depths.pictures, self.pictures, strict=True)]
        last = run([command, "--within", within, *pairs]).splitlines()[-1]
        return float(last.split()[-2])

    def mean(self):
        """The mean radiance of all frames."""
        return np.mean([radiance(picture).mean(dtype=np.float64) for picture in self.pictures])


class Mitsuba:
    """The scene that stands still, with a camera for each frame."""

    def __init__(self, arguments, frames):
        self.folder = arguments.folder
        self.scene = scenes.load(SCENES / STATIC, SIZE, SIZE)
        self.sensors = [mi.load_dict(sensor(picture)) for picture in frames.pictures]
        # Kernels do not depend on the number of samples.
        for index in range(len(self.sensors)):
            self.render(index, 1, FIRST_SEED)

    def samples_in(self, seconds):
        """Samples a pixel that take a frame's time."""
        before = cpu_seconds()
        self.render(0, PILOT, FIRST_SEED)
        return max(1, round(PILOT * seconds / (cpu_seconds() - before)))

    def frames(self, samples, name, seeds):
        """All frames, each by its seed."""
        before = cpu_seconds()
        rendered = [self.render(index, samples, seed) for index, seed in enumerate(seeds)]
        seconds = (cpu_seconds() - before) / len(rendered)
        pictures = [self.folder / f"mitsuba-{name}.{index:04}.exr" for index in range(len(rendered))]
        for picture, path in zip(rendered, pictures, strict=True):
            mi.Bitmap(picture).write(str(path))
        return Frames(f"Mitsuba, {samples} samples, {name} seed", pictures, seconds)

    def render(self, index, samples, seed):
        """A frame, computed."""
        integrator = mi.load_dict({"type": "path"})
        return render(self.scene, integrator, samples, seed, self.sensors[index])


def main():
    """See the module."""
    arguments = parse()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    ours = [photoncard(arguments, index, options) for index, options in enumerate(arguments.options or SETTINGS)]
    depths = ours[0]
    mitsuba = Mitsuba(arguments, depths)
    samples, count = mitsuba.samples_in(depths.seconds), len(depths.pictures)
    fixed = mitsuba.frames(samples, "fixed", [FIRST_SEED] * count)
    running = mitsuba.frames(samples, "running", range(FIRST_SEED + 1, FIRST_SEED + 1 + count))
    table([*ours, fixed, running], depths, arguments)


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--flicker", type=Path, required=True, help="the example")
    parser.add_argument("--folder", type=Path, required=True, help="where pictures go")
    parser.add_argument("--frames", default="96-103", help="FIRST-LAST")
    parser.add_argument("--within", help="corners of the box of places [default: two strips of wall]")
    parser.add_argument("--options", action="append", help="settings of photoncard; may be repeated")
    return parser.parse_args()


def photoncard(arguments, index, options):
    """The frames by photoncard."""
    first, last = (int(number) for number in arguments.frames.split("-"))
    before = children_seconds()
    command = [arguments.photoncard, "render", SCENES / WALK, "--frames", arguments.frames, "--size", f"{SIZE}x{SIZE}", "--quiet"]
    # Mitsuba's filter.
    command += ["--filter", "box", "-o", arguments.folder / f"photoncard-{index}.####.exr"]
    run([*command, *options.split()])
    pictures = [arguments.folder / f"photoncard-{index}.{frame:04}.exr" for frame in range(first, last + 1)]
    return Frames(f"photoncard, `{options}`", pictures, (children_seconds() - before) / len(pictures))


def sensor(picture):
    """Mitsuba's camera of a picture of photoncard."""
    view = json.loads(mi.Bitmap(str(picture)).metadata()["photoncard"])["view"]
    forward, up = np.array(view["forward"]), np.array(view["up"])
    world = np.eye(4)
    world[:3, :3] = np.stack([np.cross(forward, up), up, -forward], axis=1)
    world[:3, 3] = view["at"]
    return scenes.sensor((None, world, {"yfov": np.radians(view["fov"])}), SIZE, SIZE)


def radiance(picture):
    """The radiance of a picture, without other layers."""
    bitmap = mi.Bitmap(str(picture))
    names = [field.name for field in bitmap.struct_()]
    return np.array(bitmap)[..., [names.index(channel) for channel in "RGB"]]


def table(rows, depths, arguments):
    """Prints the rows; the last one is what all are compared with."""
    strips = {"places": arguments.within} if arguments.within else STRIPS
    boxes = ", ".join(f"{name} {within}" for name, within in strips.items())
    print(f"\n{WALK}, frames {arguments.frames}, {SIZE}x{SIZE}; {boxes}\n")
    print("| program | CPU s a frame | mean |", *(f"{name}, % | over Mitsuba's, running seed |" for name in strips))
    print("|---|---|---|" + "---|---|" * len(strips))
    mean = rows[-1].mean()
    references = [rows[-1].flicker(arguments.flicker, depths, within) for within in strips.values()]
    for row in rows:
        errors = [row.flicker(arguments.flicker, depths, within) for within in strips.values()]
        cells = (f"{error:.2f} | {error / reference:.2f} |" for error, reference in zip(errors, references, strict=True))
        print(f"| {row.name} | {row.seconds:.1f} | {row.mean() / mean:.4f} |", *cells)


if __name__ == "__main__":
    main()
