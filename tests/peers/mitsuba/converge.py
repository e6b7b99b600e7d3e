"""Renders a reference: many passes of Mitsuba's path tracer, each with a seed of its own, until blocks of 16 x 16 pixels have
converged.

Writes OUT.exr (half) and OUT.json: samples a pixel and the standard error of blocks over their means, by the scatter of
the passes. What has been rendered is kept in OUT.npz in the folder of work, and a later run goes on from there. Nothing is
clamped, and a path ends by Russian roulette from depth 8, or at the depth given.
"""

import argparse
import json
import os
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

import scene as scenes  # noqa: E402: needs the variant
from caustics import Caustics  # noqa: E402: needs the variant

BLOCK = 16
RUSSIAN_ROULETTE_DEPTH = 8


class Sums:
    """Sums over passes, and how many there were."""

    def __init__(self, path, shape):
        self.path = path
        self.passes = 0
        self.pixels = np.zeros(shape)
        blocks = (shape[0] // BLOCK, shape[1] // BLOCK)
        self.blocks, self.squares = np.zeros(blocks), np.zeros(blocks)
        if path.exists():
            kept = np.load(path)
            self.passes = int(kept["passes"])
            self.pixels, self.blocks, self.squares = kept["pixels"], kept["blocks"], kept["squares"]

    def add(self, picture):
        """Adds a pass."""
        means = block_means(picture)
        self.passes += 1
        self.pixels += picture
        self.blocks += means
        self.squares += means * means

    def keep(self):
        """Writes all of it; whole or not at all."""
        unfinished = self.path.with_suffix(".unfinished.npz")
        kept = {"pixels": self.pixels, "blocks": self.blocks, "squares": self.squares}
        np.savez(unfinished, passes=self.passes, **kept)
        os.replace(unfinished, self.path)

    def errors(self):
        """The standard error of the mean of each block, over it."""
        mean = self.blocks / self.passes
        variance = np.maximum(self.squares / self.passes - mean * mean, 0.0) / max(self.passes - 1, 1)
        return np.sqrt(variance) / np.maximum(mean, 1e-12)


def block_means(picture):
    """Means over the pixels and channels of each block."""
    rows, columns = (side // BLOCK for side in picture.shape[:2])
    whole = picture[: rows * BLOCK, : columns * BLOCK]
    return whole.reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3, 4))


def main():
    """See the module."""
    arguments = parse()
    width, height = (int(side) for side in arguments.size.split("x"))
    scene = scenes.load(arguments.scene, width, height, arguments.camera, arguments.environment)
    integrator = choose_integrator(arguments)
    arguments.work.mkdir(parents=True, exist_ok=True)
    sums = Sums(arguments.work / f"{arguments.output.stem}.npz", (height, width, 3))
    while sums.passes < arguments.passes and not has_converged(sums, arguments):
        seed = arguments.seed + sums.passes
        picture = np.array(mi.render(scene, integrator=integrator, spp=arguments.per_pass, seed=seed))
        if not np.isfinite(picture).all():
            raise ValueError(f"the pass of seed {seed} has pixels that are no numbers")
        sums.add(picture.astype(np.float64))
        if sums.passes % arguments.every == 0:
            sums.keep()
            write(sums, arguments)
            print(json.dumps(note(sums, arguments)), flush=True)
    if sums.passes == 0:
        sys.exit("nothing has been rendered")
    sums.keep()
    write(sums, arguments)


def choose_integrator(arguments):
    """What follows the paths."""
    if arguments.caustics:
        mi.register_integrator("caustics", Caustics)
        return mi.load_dict({"type": "caustics"})
    return path_tracer(arguments.scene, arguments.max_depth)


def path_tracer(scene, max_depth):
    """The integrator of a scene file's paths of at most that many segments; -1: no limit."""
    # Only the integrator of volumes lets light that is sampled at a lamp through holes in surfaces; the other finds it by
    # chance alone.
    kind = "volpath" if scenes.has_holes(scene) else "path"
    return mi.load_dict({"type": kind, "max_depth": max_depth, "rr_depth": RUSSIAN_ROULETTE_DEPTH})


def has_converged(sums, arguments):
    """Whether 95 of 100 blocks are as good as wanted; looked at now and then, by which chance picks less."""
    if sums.passes == 0 or sums.passes % arguments.every != 0:
        return False
    return np.percentile(sums.errors(), 95) < arguments.error


def note(sums, arguments):
    """What the picture is."""
    errors = sums.errors()
    return {
        "scene": Path(arguments.scene).name,
        "size": arguments.size,
        "max_depth": arguments.max_depth,
        "spp": sums.passes * arguments.per_pass,
        "block_error_median": round(float(np.median(errors)), 6),
        "block_error_p95": round(float(np.percentile(errors, 95)), 6),
        "block_error_max": round(float(errors.max()), 6),
    }


def write(sums, arguments):
    """Writes the picture and what it is."""
    mean = (sums.pixels / sums.passes).astype(np.float16)
    mi.Bitmap(mean).write(str(arguments.output))
    arguments.output.with_suffix(".json").write_text(json.dumps(note(sums, arguments), indent=1) + "\n")


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("--camera")
    parser.add_argument("--environment", help="an equirectangular map")
    parser.add_argument("--caustics", action="store_true", help="of the light of caustics alone")
    parser.add_argument("--size", default="256x256")
    parser.add_argument("--output", type=Path, required=True, help="the EXR")
    parser.add_argument("--work", type=Path, required=True, help="the folder of what has been rendered")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--max-depth", type=int, default=-1, help="segments of a path; -1: no limit")
    parser.add_argument("--per-pass", type=int, default=64, help="samples a pixel of a pass")
    parser.add_argument("--passes", type=int, default=4096, help="no more of them than this")
    parser.add_argument("--every", type=int, default=32, help="after how many passes it is looked whether they suffice")
    parser.add_argument("--error", type=float, default=0.003, help="of the mean of a block, in 95 of 100 of them")
    return parser.parse_args()


if __name__ == "__main__":
    main()
