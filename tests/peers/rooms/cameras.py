"""Cameras in a room that others made, beside Mitsuba's path tracer: errors of means over blocks of 12x12 pixels.

Mitsuba has the lens shift (principal point), the thin lens and the orthographic camera as its own sensors; a
panorama's rays are made here, by longitude and latitude. Columns as of `compare.py`.
"""

import argparse
import math
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

import drjit as dr  # noqa: E402: after the variant

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "mitsuba"))

import gltf  # noqa: E402: of the folder beside
import scene as scenes  # noqa: E402

BLOCK, DARK, LONG, SAMPLES = 12, 0.05, 192, 128
SHIFT = (0.15, -0.1)
# Parts of the distance that the middle of the picture has: the focus and the height of the parallel picture.
FOCUS, HEIGHT, APERTURE = 0.6, 0.3, 0.06


def main():
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="rooms [default: living-room]")
    parser.add_argument("--photoncard", type=Path, required=True, help="the command")
    parser.add_argument("--rooms", type=Path, required=True, help="the folder of the rooms' XML")
    parser.add_argument("--folder", type=Path, required=True, help="where files go")
    parser.add_argument("--seeds", type=int, default=4, help="pictures of photoncard [default: 4]")
    parser.add_argument("--passes", type=int, default=16, help=f"of {SAMPLES} samples of a reference [default: 16]")
    parser.add_argument("--camera", action="append", help="a camera; may be repeated [default: all]")
    words = sys.argv[1:]
    place = words.index("--") if "--" in words else len(words)
    arguments, options = parser.parse_args(words[:place]), words[place + 1 :]
    print("| room | camera | mean | median | 95th percentile | most | noise |\n|---|---|---|---|---|---|---|", flush=True)
    for name in arguments.names or ["living-room"]:
        room = convert(arguments, name)
        for camera, words, truth in cameras(room, arguments.passes):
            if camera not in (arguments.camera or [camera]):
                continue
            pictures = [render(arguments, room, camera, [*words, *options], seed) for seed in range(1, 1 + arguments.seeds)]
            report(arguments.folder, name, camera, pictures, truth())


def convert(arguments, name):
    """The glTF file of a room with Lambertian surfaces, made if it is missing."""
    path = arguments.folder / "lambertian" / f"{name}.glb"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        run([sys.executable, HERE / "to_gltf.py", arguments.rooms / name / "scene.xml", "--output", path, "--lambertian"])
    return path


def cameras(path, passes):
    """Name, options of photoncard and function of the reference of each camera."""
    source = gltf.Scene(path)
    camera = source.cameras[0]
    aspect = camera[2]["aspectRatio"]
    width, height = (LONG, round(LONG / aspect)) if aspect >= 1.0 else (round(LONG * aspect), LONG)
    sensor = scenes.sensor(camera, width, height)
    light = path.with_suffix(".exr")
    loaded = scenes.load(path, width, height, environment_path=light if light.exists() else None)
    distance = depth(loaded, sensor)
    size = ["--size", f"{width}x{height}"]

    def by(changed):
        return lambda: seen(loaded, mi.load_dict(changed), passes)

    yield "pinhole", size, by(sensor)
    longer = max(width, height)
    # Mitsuba's offset is to the right and to the bottom, in parts of the film's sides.
    shifted = {
        **sensor,
        "principal_point_offset_x": SHIFT[0] * longer / width,
        "principal_point_offset_y": -SHIFT[1] * longer / height,
    }
    yield "lens shift", [*size, "--shift", f"{SHIFT[0]},{SHIFT[1]}"], by(shifted)
    radius, focus = 0.5 * APERTURE * distance, FOCUS * distance
    lens = {**sensor, "type": "thinlens", "aperture_radius": radius, "focus_distance": focus}
    yield "thin lens", [*size, "--aperture", 2.0 * radius, "--focus", focus], by(lens)
    half = 0.5 * HEIGHT * distance
    scaled = np.array(sensor["to_world"].matrix, np.float64).copy()
    scaled[:3, :2] *= half * width / height
    parallel = {key: value for key, value in sensor.items() if key not in ("fov", "fov_axis")}
    parallel |= {"type": "orthographic", "to_world": mi.ScalarTransform4f(scaled)}
    yield "orthographic", [*size, "--orthographic", 2.0 * half], by(parallel)
    around = ["--size", f"{LONG}x{LONG // 2}", "--panorama", "360,180"]
    yield "panorama", around, lambda: panorama(loaded, sensor, passes)


def depth(loaded, sensor):
    """Distance of what the middle of the picture shows, metres."""
    to_world = sensor["to_world"]
    ray = mi.Ray3f(mi.Point3f(to_world @ mi.ScalarPoint3f(0)), mi.Vector3f(to_world @ mi.ScalarVector3f(0, 0, 1)))
    return float(np.array(loaded.ray_intersect(ray).t)[0])


def seen(loaded, sensor, passes):
    """What a sensor sees."""
    integrator = mi.load_dict({"type": "path", "max_depth": 64, "rr_depth": 16})
    total = 0.0
    for seed in range(passes):
        total = total + np.array(mi.render(loaded, sensor=sensor, integrator=integrator, spp=SAMPLES, seed=seed), np.float64)
    return total[..., :3] / passes


def panorama(loaded, sensor, passes):
    """All directions around the camera: columns are longitudes from its axis, to the right, rows latitudes."""
    width, height = LONG, LONG // 2
    integrator = mi.load_dict({"type": "path", "max_depth": 64, "rr_depth": 16})
    matrix = np.array(sensor["to_world"].matrix, np.float64)
    axes, origin = matrix[:3, :3], matrix[:3, 3]
    pixels = np.arange(width * height)
    total = np.zeros((height, width, 3))
    random = np.random.default_rng(1)
    for seed in range(passes * SAMPLES):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, width * height)
        longitude = 2.0 * np.pi * ((pixels % width + random.random(len(pixels))) / width - 0.5)
        latitude = np.pi * (0.5 - (pixels // width + random.random(len(pixels))) / height)
        # Mitsuba's sensors have x to the left.
        local = np.stack([-np.cos(latitude) * np.sin(longitude), np.sin(latitude), np.cos(latitude) * np.cos(longitude)])
        directions = (axes @ local).astype(np.float32)
        ray = mi.RayDifferential3f(
            mi.Point3f(*(mi.Float(np.full(len(pixels), value, np.float32)) for value in origin)),
            mi.Vector3f(*(mi.Float(axis) for axis in directions)),
        )
        light, _, _ = integrator.sample(loaded, sampler, ray)
        dr.eval(light)
        total += np.stack([np.array(channel) for channel in light], axis=1).reshape(height, width, 3)
    return total / (passes * SAMPLES)


def render(arguments, room, camera, options, seed):
    """A picture of photoncard."""
    output = arguments.folder / "camera.exr"
    light = room.with_suffix(".exr")
    words = [arguments.photoncard, "render", room, "--filter", "box", "--seed", seed, "-o", output, "--quiet", "--aov", "none"]
    run([*words, *(["--environment", light] if light.exists() else []), *options])
    bitmap = mi.Bitmap(str(output))
    names = [member.name for member in bitmap.struct_()]
    return np.array(bitmap).astype(np.float64)[..., [names.index(channel) for channel in "RGB"]]


def report(folder, name, camera, pictures, truth):
    """Prints the row of a camera, and leaves a PNG: reference and picture."""
    picture = np.mean(pictures, axis=0)
    found, expected = blocks(picture), blocks(truth)
    level = np.maximum(expected, DARK * expected.mean())
    errors = 100.0 * np.abs(found - expected) / level
    halves = [blocks(np.mean(pictures[first::2], axis=0)) for first in (0, 1)]
    noise = 100.0 * math.sqrt(np.mean(((halves[0] - halves[-1]) / level) ** 2)) / 2.0
    columns = [f"{value:.1f} %" for value in (np.median(errors), np.percentile(errors, 95), errors.max(), noise)]
    print(f"| {name} | {camera} | {picture.mean() / truth.mean():.4f} | {' | '.join(columns)} |", flush=True)
    exposure = 0.36 / np.exp(np.log(truth.mean(axis=2) + 1e-6).mean())
    tones = [(light * exposure / (1.0 + light * exposure)) ** (1.0 / 2.2) for light in np.maximum([truth, picture], 0.0)]
    pixels = (255.0 * np.concatenate(tones, axis=1)).astype(np.uint8)
    mi.Bitmap(np.ascontiguousarray(pixels)).write(str(folder / f"{name}-{camera.replace(' ', '-')}.png"))


def blocks(picture):
    """The mean colour of each whole block."""
    rows, columns = (side // BLOCK for side in picture.shape[:2])
    return picture[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3))


def run(command):
    """Runs a command, whose progress goes to the standard error."""
    words = [str(word) for word in command]
    if subprocess.run(words, stdout=sys.stderr, check=False).returncode != 0:
        sys.exit(f"failed: {' '.join(words)}")


if __name__ == "__main__":
    main()
