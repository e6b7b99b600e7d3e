"""Light in corners beside Mitsuba's path tracer: errors of blocks of 4x4 pixels by their distance from the
nearest other surface.

That distance is the least of 64 rays over the hemisphere. Columns of a distance: the mean of its blocks over
the reference's, less 1, with the standard error by seeds; the root mean square of the errors of blocks
without their noise, with that of the reference; the number of blocks. Options after -- are names with a value
each, and replace those of SETTINGS.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "mitsuba"))

import room  # noqa: E402: of this folder
import scene as scenes  # noqa: E402: needs the variant

SIDE, BLOCK, RAYS = 48, 4, 64
PASS, RUSSIAN_ROULETTE_DEPTH = 128, 8
# Bounds of the distances, metres.
BOUNDS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5, np.inf)
# A pilot's choice for the whole room, and samples enough to see the bias.
SETTINGS = {
    "--photons": "500000",
    "--neighbors": "24",
    "--irradiance-cache": "off",
    "--adaptive": "off",
    "--spp": "8",
    "--gather-rays": "16",
    "--aov": "none",
}


def main():
    """See the module."""
    words, options = sys.argv[1:], []
    if "--" in words:
        options = words[words.index("--") + 1 :]
        words = words[: words.index("--")]
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(room.NAMES)} [default: all]")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--folder", type=Path, required=True, help="where files go")
    parser.add_argument("--seeds", type=int, default=6, help="pictures, 2 or more [default: 6]")
    parser.add_argument("--samples", type=int, default=1024, help="of a pixel of the reference")
    arguments = parser.parse_args(words)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    path = arguments.folder / "room.glb"
    room.write(path)
    names = arguments.names or room.NAMES
    pictures = {name: [] for name in names}
    for seed in range(1, 1 + arguments.seeds):
        render(arguments, path, seed, pictures, options)
    spans = [f"to {high} m" if high < np.inf else "beyond" for high in BOUNDS[1:]]
    print(f"| view | mean | {' | '.join(spans)} |\n|{'---|' * (2 + len(spans))}")
    for name in names:
        report(name, reference(arguments, path, name), distances(path, name), np.stack(pictures[name]))


def render(arguments, path, seed, pictures, options):
    """Adds a picture of each camera, by one photon map."""
    card, output = arguments.folder / "room.card", arguments.folder / "picture.exr"
    settings = SETTINGS | dict(zip(options[::2], options[1::2], strict=True))
    words = [word for setting in settings.items() for word in setting]
    run([arguments.photoncard, "prepare", path, "-o", card, "--seed", seed, "--quiet", *words])
    for name, found in pictures.items():
        command = [arguments.photoncard, "render", "--prepared", card, "--camera", name, "--quiet"]
        run([*command, "--size", f"{SIDE}x{SIDE}", "--filter", "box", "--aov", "none", "-o", output])
        bitmap = mi.Bitmap(str(output)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
        found.append(blocks(np.array(bitmap).mean(axis=2)))


def reference(arguments, path, name):
    """Blocks of Mitsuba's picture, rendered if it is missing."""
    kept = arguments.folder / f"{name}-{arguments.samples}.npy"
    if not kept.exists():
        integrator = mi.load_dict({"type": "path", "rr_depth": RUSSIAN_ROULETTE_DEPTH})
        scene = scenes.load(path, SIDE, SIDE, name)
        passes = arguments.samples // PASS
        rendered = (mi.render(scene, integrator=integrator, spp=PASS, seed=seed) for seed in range(passes))
        np.save(kept, sum(np.array(picture).astype(np.float64) for picture in rendered) / passes)
    return blocks(np.load(kept).mean(axis=2))


def distances(path, name):
    """Distance of each block from the nearest surface that rays meet, metres."""
    scene = scenes.load(path, SIDE, SIDE, name)
    pixels = np.arange(SIDE * SIDE)
    place = [((axis + 0.5) / SIDE).astype(np.float32) for axis in (pixels % SIDE, pixels // SIDE)]
    middle = mi.Point2f(0.5, 0.5)
    eye, _ = scene.sensors()[0].sample_ray(
        mi.Float(0), mi.Float(0.5), mi.Point2f(*map(mi.Float, place)), middle
    )
    seen = scene.ray_intersect(eye)
    least = np.full(SIDE * SIDE, np.inf)
    for point in np.random.default_rng(1).random((RAYS, 2)):
        direction = mi.warp.square_to_cosine_hemisphere(mi.Point2f(*map(float, point)))
        met = scene.ray_intersect(seen.spawn_ray(seen.sh_frame.to_world(direction)))
        least = np.minimum(least, np.array(met.t))
    return blocks(least.reshape(SIDE, SIDE))


def report(name, expected, distance, found):
    """Prints the row of a view."""
    columns = [f"{found.mean() / expected.mean():.4f}"]
    errors = 100.0 * (found.mean(axis=0) / expected - 1.0)
    noise = 100.0 * found.std(axis=0, ddof=1) / expected / np.sqrt(len(found))
    for low, high in zip(BOUNDS, BOUNDS[1:], strict=False):
        here = (low <= distance) & (distance < high)
        if here.sum() < 2:
            columns.append("")
            continue
        means = 100.0 * (found[:, here].sum(axis=1) / expected[here].sum() - 1.0)
        of_mean = means.std(ddof=1) / np.sqrt(len(found))
        bias = np.sqrt(max(np.mean(errors[here] ** 2 - noise[here] ** 2), 0.0))
        columns.append(f"{means.mean():+.1f} ± {of_mean:.1f} %, {bias:.1f} %, {here.sum()}")
    print(f"| {name} | {' | '.join(columns)} |", flush=True)


def blocks(picture):
    """The mean of each block of a picture."""
    count = SIDE // BLOCK
    return picture.reshape(count, BLOCK, count, BLOCK).mean(axis=(1, 3))


def run(command):
    """Runs a command, whose progress goes to the standard error."""
    words = [str(word) for word in command]
    if subprocess.run(words, stdout=sys.stderr, check=False).returncode != 0:
        sys.exit(f"failed: {' '.join(words)}")


if __name__ == "__main__":
    main()
