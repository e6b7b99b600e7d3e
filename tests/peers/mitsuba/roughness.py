"""Compares the balls of scenes/roughness.glb with Mitsuba's by glTF's own model: for each ball the mean over the reference's, and
the RMSE of its pixels over their mean."""

import argparse
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

import gltf  # noqa: E402: beside this file
from light_paths import read  # noqa: E402

HERE = Path(__file__).resolve().parent
SCENE = HERE.parent.parent.parent / "scenes" / "roughness.glb"
WIDTH, HEIGHT = 384, 192
SETTINGS = "--spp 16 --gather-rays 16 --photons 300000".split()
# The radius of the disc whose pixels count, over the ball's: none at the edge.
WITHIN = 0.93


def main():
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where pictures go")
    arguments, options = parser.parse_known_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    size = ["--size", f"{WIDTH}x{HEIGHT}"]
    reference, output = (arguments.folder / f"{name}.exr" for name in ("roughness-reference", "roughness"))
    if not reference.exists():
        limit = ["--per-pass", "64", "--passes", "16", "--every", "16", "--work", arguments.folder]
        run([sys.executable, HERE / "converge.py", SCENE, *size, "--output", reference, *limit])
    run([arguments.photoncard, "render", SCENE, *size, "--quality", "paper", "-o", output, "--quiet", *(options or SETTINGS)])
    compare(read(output), read(reference))


def run(command):
    """Runs a command, whose progress goes to the standard error."""
    subprocess.run([str(word) for word in command], stdout=sys.stderr, check=True)


def compare(picture, reference):
    """Prints the table."""
    print("| ball | mean | relative RMSE |\n|---|---|---|")
    for name, pixels in balls(gltf.Scene(SCENE)):
        ours, expected = picture[pixels], reference[pixels]
        error = np.sqrt(((ours - expected) ** 2).mean()) / expected.mean()
        print(f"| {name} | {ours.mean() / expected.mean():.3f} | {error:.3f} |")


def balls(source):
    """The name of each ball, and which pixels see it."""
    _, world, perspective = source.cameras[0]
    half = np.tan(perspective["yfov"] / 2.0)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    rays = np.stack(
        [half * (2.0 * columns - WIDTH) / HEIGHT, half * (1.0 - 2.0 * rows / HEIGHT), -np.ones_like(rows)], axis=-1
    )
    rays = rays @ world[:3, :3].T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    balls = [node for node in source.document["nodes"] if "scale" in node]
    distances = np.stack([distance(rays, np.array(node["translation"]) - world[:3, 3]) for node in balls])
    # Of balls one before the other, the nearest along the way.
    near = np.argmin(distances, axis=0)
    for index, node in enumerate(balls):
        yield node["name"], (near == index) & (distances[index] < WITHIN * node["scale"][0])


def distance(rays, middle):
    """How far rays pass a point."""
    return np.linalg.norm(np.cross(rays, middle), axis=-1)


if __name__ == "__main__":
    main()
