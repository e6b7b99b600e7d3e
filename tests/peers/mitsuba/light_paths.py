"""Compares pictures of photoncard with path-traced references by means of blocks of 16 x 16 pixels.

Prints for each scene the mean over the reference's, and the median and 95th percentile of the blocks' relative errors.
Blocks in which caustics make a tenth of the light are told apart, as are those that see a lamp, whose edges would outweigh
all else. Ends with 1 if a target is missed; caustics have none.
"""

import argparse
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent
SCENES, REFERENCES = ROOT / "scenes", ROOT / "tests" / "references"
BLOCK = 16
# A block is one of caustics where they make more than this of its light.
CAUSTIC_SHARE = 0.1
TARGETS = {"mean": 0.01, "median": 0.02, "95th percentile": 0.06}


@dataclass
class Comparison:
    """What is rendered of a scene. Blocks with a pixel above `exclude` see a lamp."""

    file: str
    size: str
    exclude: float
    environment: str | None = None
    has_caustics: bool = False
    settings: list = field(default_factory=lambda: "--spp 16 --photons 1000000 --gather-rays 200".split())

    def common(self):
        """The options that both programs take."""
        environment = [] if self.environment is None else ["--environment", SCENES / self.environment]
        return [SCENES / self.file, "--size", self.size, *environment]


COMPARISONS = {
    "cornell-spheres": Comparison("cornell-spheres.glb", "256x256", exclude=5.0, has_caustics=True),
    "room": Comparison("room.glb", "320x240", exclude=5.0),
    "atrium-sky": Comparison("atrium-open.glb", "256x256", exclude=float("inf"), environment="sky.exr"),
}


def main():
    """See the module."""
    arguments = parse()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    print("| scene | blocks | mean | median | 95th percentile |")
    print("|---|---|---|---|---|")
    outcomes = [compare(name, arguments) for name in arguments.scenes or COMPARISONS]
    sys.exit(0 if all(outcomes) else 1)


def parse():
    """The command's arguments; what follows -- goes to photoncard."""
    words, options = sys.argv[1:], []
    if "--" in words:
        place = words.index("--")
        words, options = words[:place], words[place + 1 :]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(COMPARISONS)} [default: all]")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where pictures go")
    arguments = parser.parse_args(words)
    unknown = [name for name in arguments.scenes if name not in COMPARISONS]
    if unknown:
        parser.error(f"no scene '{unknown[0]}'; there are {', '.join(COMPARISONS)}")
    arguments.options = options
    return arguments


def compare(name, arguments):
    """Prints the rows of a scene; whether it meets the targets."""
    comparison = COMPARISONS[name]
    path = reference(comparison, REFERENCES / f"{name}.exr", arguments, [])
    expected = read(path)
    output = arguments.folder / f"{name}.exr"
    command = [arguments.photoncard, "render", *comparison.common(), "--quality", "paper", "-o", output, "--quiet"]
    run([*command, *(arguments.options or comparison.settings)])
    picture = read(output)
    greatest = np.nan_to_num(blocks(expected, np.max))
    pair = blocks(picture, np.mean), blocks(expected, np.mean)
    chosen = greatest <= comparison.exclude
    is_caustic = np.zeros_like(chosen)
    if comparison.has_caustics:
        caustics = reference(comparison, REFERENCES / f"{name}-caustics.exr", arguments, ["--caustics", "--passes", 64])
        is_caustic = blocks(read(caustics), np.mean) > CAUSTIC_SHARE * pair[1]
    errors = measure(pair, chosen & ~is_caustic)
    row(name, (chosen & ~is_caustic).sum(), errors)
    if (chosen & is_caustic).any():
        row(f"{name}, caustics", (chosen & is_caustic).sum(), measure(pair, chosen & is_caustic))
    return all(abs(errors[key]) <= target for key, target in TARGETS.items())


def reference(comparison, path, arguments, options):
    """A reference that is there, or one that Mitsuba renders."""
    if not path.exists():
        print(f"rendering {path}", file=sys.stderr, flush=True)
        command = [sys.executable, HERE / "converge.py", *comparison.common(), "--max-depth", 64, *options]
        run([*command, "--output", path, "--work", arguments.folder])
    return path


def read(path):
    """Red, green and blue; photoncard's files have more."""
    bitmap = mi.Bitmap(str(path))
    names = [member.name for member in bitmap.struct_()]
    return np.array(bitmap).astype(np.float64)[..., [names.index(channel) for channel in "RGB"]]


def blocks(picture, function):
    """A function of the pixels and channels of each block."""
    rows, columns = (side // BLOCK for side in picture.shape[:2])
    whole = picture[: rows * BLOCK, : columns * BLOCK]
    return function(whole.reshape(rows, BLOCK, columns, BLOCK, 3), axis=(1, 3, 4))


def measure(pair, chosen):
    """The errors of the chosen blocks."""
    picture, expected = (means[chosen] for means in pair)
    relative = np.abs(picture / expected - 1.0)
    return {
        "mean": picture.sum() / expected.sum() - 1.0,
        "median": np.median(relative),
        "95th percentile": np.percentile(relative, 95),
    }


def row(name, count, errors):
    """A row of the table."""
    print(f"| {name} | {count} | " + " | ".join(f"{100.0 * errors[key]:.2f} %" for key in TARGETS) + " |", flush=True)


def run(command):
    """Runs a command, whose progress goes to the standard error."""
    words = [str(word) for word in command]
    if subprocess.run(words, stdout=sys.stderr, check=False).returncode != 0:
        sys.exit(f"failed: {' '.join(words)}")


if __name__ == "__main__":
    main()
