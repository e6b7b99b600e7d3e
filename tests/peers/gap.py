"""Illuminance in the gap of 4 cm behind the shelf of radiance.py's office of luminous panels, by photoncard and by Mitsuba.

    python3 gap.py PHOTONCARD FOLDER [--points N] [--rays N] [-- OPTION ..]

The Python has mitsuba (tests/peers/mitsuba/requirements.txt). Mitsuba's path tracer follows cosine-distributed rays from each point; photoncard has
`--spp 64`, then also `--near-distance 0`, then gather rays that all go on. Prints the mean, and the root mean square of the differences over Mitsuba's mean.
"""

import argparse
import math
import os
import sys

import mitsuba as mi
import numpy as np

import radiance

mi.set_variant("llvm_ad_rgb")
WEIGHTS = np.array([0.265, 0.670, 0.065])


def mesh(name, faces, folder):
    """File of a mesh of quadrilaterals whose triangles share no corner."""
    corners = [corner for a, b, c, d in faces for corner in (a, b, c, a, c, d)]
    shape = mi.Mesh(name, len(corners), len(corners) // 3)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.ravel(np.array(corners, dtype=np.float32))
    parameters["faces"] = np.arange(len(corners), dtype=np.uint32)
    parameters.update()
    path = os.path.join(folder, f"{name}.ply")
    shape.write_ply(path)
    return path


def scene(parts, folder):
    shapes = {"type": "scene"}
    for name, (albedo, emission, faces) in parts.items():
        shape = {"type": "ply", "filename": mesh(name, faces, folder), "face_normals": True}
        diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(albedo)}}
        shape["bsdf"] = diffuse if emission else {"type": "twosided", "side": diffuse}
        if emission:
            shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(emission)}}
        shapes[name] = shape
    return mi.load_dict(shapes)


def by_paths(place, integrator, point, rays, seed):
    """Illuminance at a point, lx."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, rays)
    frame = mi.Frame3f(mi.Vector3f(*point[3:]))
    direction = frame.to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
    light, _, _ = integrator.sample(place, sampler, mi.RayDifferential3f(mi.Ray3f(mi.Point3f(*point[:3]), direction)))
    return 179.0 * math.pi * float(np.array(light).mean(axis=1) @ WEIGHTS)


def main():
    arguments = sys.argv[1:]
    at = arguments.index("--") if "--" in arguments else len(arguments)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photoncard")
    parser.add_argument("folder")
    parser.add_argument("--points", type=int, default=1000, help="points in the whole office, of which those in the gap count")
    parser.add_argument("--rays", type=int, default=1 << 19)
    options, own = parser.parse_args(arguments[:at]), arguments[at + 1 :]
    os.makedirs(options.folder, exist_ok=True)
    parts = radiance.office(True)
    radiance.write_gltf(os.path.join(options.folder, "office.gltf"), parts, [])
    points = [point for point in radiance.points(options.points) if point[0] == 0.01 and point[1] < 2.0 and 0.5 < point[2] < 2.5]
    with open(os.path.join(options.folder, "points.txt"), "w") as file:
        file.writelines(" ".join(map(str, point)) + "\n" for point in points)
    place, integrator = scene(parts, options.folder), mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 50})
    expected = np.array([by_paths(place, integrator, point, options.rays, seed) for seed, point in enumerate(points)])
    print(f"{len(points)} points, Mitsuba: mean {expected.mean():.2f} lx")
    for near in ([], ["--near-distance", "0"], ["--near-distance", "100"]):
        words = ["--lumens-per-watt", "179", "--spp", "64", *near, *own]
        found, cpu, _ = radiance.photoncard(os.path.abspath(options.photoncard), options.folder, words)
        found = np.array(found)
        error = np.sqrt(np.mean((found - expected) ** 2)) / expected.mean()
        print(f"photoncard {' '.join(near)}: mean {found.mean():.2f} lx, root mean square {100 * error:.1f} %, {cpu:.1f} CPU s", flush=True)


if __name__ == "__main__":
    main()
