"""An office of ten luminaires measured by photoncard and by Radiance: illuminance at 1,000 points.

    python3 radiance.py PHOTONCARD FOLDER [--points N] [--ies]

The luminaires are luminous panels or, with --ies, points with a photometric file, which Radiance's ies2rad makes small spheres of.

Radiance is that of the package pyradiance. Walls, desks and shelves are Lambertian in both programs, with the weights and the
lumens per watt of Radiance. Prints differences of the points, errors and CPU seconds.
"""

import argparse
import base64
import json
import math
import os
import random
import resource
import struct
import subprocess
import sys
import time

WHITE, GREY, WOOD, FLOOR = (0.8, 0.8, 0.78), (0.5, 0.5, 0.55), (0.45, 0.3, 0.2), (0.25, 0.22, 0.2)
PANEL = (30.0, 28.0, 24.0)
SIZE = (8.0, 3.0, 5.0)
FINE = ["-ab", "12", "-aa", "0", "-ad", "{rays}", "-lw", "1e-9", "-lr", "-12", "-ds", "0.02", "-dj", "0.7", "-dt", "0", "-dc", "1"]


def box(low, high):
    """Faces of a box, counter-clockwise from outside."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return [
        [(x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0)], [(x1, y0, z1), (x1, y0, z0), (x1, y1, z0), (x1, y1, z1)],
        [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)], [(x0, y1, z1), (x1, y1, z1), (x1, y1, z0), (x0, y1, z0)],
        [(x1, y0, z0), (x0, y0, z0), (x0, y1, z0), (x1, y1, z0)], [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
    ]


def places():
    """Corners of the luminaires."""
    return [(0.6 + 1.5 * column, SIZE[1] - 0.02, 1.0 + 2.2 * row) for column in range(5) for row in range(2)]


def office(has_panels):
    """Materials with their faces: name -> (albedo, emission, faces)."""
    width, height, depth = SIZE
    room = [face[::-1] for face in box((0, 0, 0), SIZE)]
    parts = {
        "walls": (WHITE, None, room[:2] + room[3:]),
        "floor": (FLOOR, None, room[2:3]),
        "desks": (WOOD, None, []),
        "shelves": (GREY, None, []),
        "panels": ((0.0, 0.0, 0.0), PANEL, []),
    }
    for column in range(3):
        for row in range(2):
            x, z = 1.2 + 2.4 * column, 1.0 + 2.2 * row
            parts["desks"][2].extend(box((x, 0.7, z), (x + 1.6, 0.74, z + 0.8)))
            for leg in (x + 0.05, x + 1.5):
                parts["shelves"][2].extend(box((leg, 0, z + 0.3), (leg + 0.05, 0.699, z + 0.5)))
    parts["shelves"][2].extend(box((0.05, 0.001, 0.5), (0.4, 2.0, 2.5)))
    for x, y, z in places():
        parts["panels"][2].append([(x, y, z), (x + 0.9, y, z), (x + 0.9, y, z + 0.3), (x, y, z + 0.3)])
    if not has_panels:
        del parts["panels"]
    return parts


def centres():
    """Places of the luminaires with photometric files, below the ceiling, and the turn of each about its axis, degrees."""
    return [((x + 0.45, y - 0.05, z + 0.15), 20 * index) for index, (x, y, z) in enumerate(places())]


def write_ies(path):
    """A batwing with different wings along and across, of 5 degrees by 22.5 degrees."""
    angles, planes = [5 * index for index in range(19)], [22.5 * index for index in range(5)]
    lines = ["IESNA:LM-63-2002", "[TEST] batwing", "[LAMPCAT] LED", "TILT=NONE", f"1 -1 1 {len(angles)} {len(planes)} 1 2 0.3 1.2 0", "1 1 40"]
    lines += [" ".join(map(str, angles)), " ".join(map(str, planes))]
    for plane in planes:
        wing = 300 + 700 * math.sin(math.radians(plane)) ** 2
        candelas = [(600 + wing * math.sin(2 * math.radians(angle)) ** 2) * math.cos(math.radians(angle)) for angle in angles]
        lines.append(" ".join(f"{value:.2f}" for value in candelas))
    with open(path, "w") as file:
        file.write("\n".join(lines) + "\n")


def luminaires():
    """Nodes of the scene: -z of each points down."""
    nodes = []
    for place, turn in centres():
        half = math.radians(turn) / 2
        down, about = (-math.sqrt(0.5), 0, 0, math.sqrt(0.5)), (0, math.sin(half), 0, math.cos(half))
        nodes.append({"translation": place, "rotation": product(about, down), "extensions": {"EXT_lights_ies": {"light": 0}}})
    return nodes


def product(a, b):
    """Product of two quaternions x, y, z, w."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz,
    )


def write_gltf(path, parts, lights):
    data, accessors, views, materials, primitives = b"", [], [], [], []
    for index, (name, (albedo, emission, faces)) in enumerate(parts.items()):
        corners = [corner for a, b, c, d in faces for corner in (a, b, c, a, c, d)]
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": 12 * len(corners)})
        data += b"".join(struct.pack("<3f", *corner) for corner in corners)
        low, high = ([pick(corner[axis] for corner in corners) for axis in range(3)] for pick in (min, max))
        accessors.append({"bufferView": index, "componentType": 5126, "count": len(corners), "type": "VEC3", "min": low, "max": high})
        material = {"name": name, "pbrMetallicRoughness": {"baseColorFactor": [*albedo, 1], "metallicFactor": 0}}
        material["extensions"] = {"KHR_materials_specular": {"specularFactor": 0}}
        if emission:
            strength = max(emission)
            material["emissiveFactor"] = [value / strength for value in emission]
            material["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
        materials.append(material)
        primitives.append({"attributes": {"POSITION": index}, "material": index})
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    used = ["KHR_materials_specular", "KHR_materials_emissive_strength"]
    scene = {
        "asset": {"version": "2.0"}, "extensionsUsed": used, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}], "materials": materials, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(data), "uri": uri}],
    }
    if lights:
        scene["nodes"] += lights
        scene["scenes"][0]["nodes"] += range(1, len(lights) + 1)
        scene["extensionsUsed"].append("EXT_lights_ies")
        scene["extensions"] = {"EXT_lights_ies": {"lights": [{"uri": "lamp.ies"}]}}
    with open(path, "w") as file:
        json.dump(scene, file)


def write_rad(path, parts):
    with open(path, "w") as file:
        for name, (albedo, emission, faces) in parts.items():
            kind, numbers = ("light", [3, *emission]) if emission else ("plastic", [5, *albedo, 0, 0])
            file.write(f"void {kind} {name}\n0\n0\n{' '.join(map(str, numbers))}\n")
            for index, face in enumerate(faces):
                corners = " ".join(f"{value:.9g}" for corner in face for value in corner)
                file.write(f"{name} polygon {name}.{index}\n0\n0\n12 {corners}\n")


def radiance_luminaires(folder, programs):
    """Writes the luminaires for Radiance, as spheres of 1 cm; returns the file's name."""
    environment = {**os.environ, "RAYPATH": ".:" + os.path.join(programs, "..", "lib"), "PATH": programs + ":" + os.environ["PATH"]}
    run([os.path.join(programs, "ies2rad"), "-dm", "-i", "0.01", "-o", "lamp", "lamp.ies"], cwd=folder, env=environment)
    text = b""
    for (x, y, z), turn in centres():
        turned = ["-rx", "-90", "-ry", str(turn), "-t", str(x), str(y), str(z)]
        text += run([os.path.join(programs, "xform"), *turned, "./lamp.rad"], cwd=folder, env=environment)[0]
    with open(os.path.join(folder, "lamps.rad"), "wb") as file:
        file.write(text)
    return "lamps.rad"


def points(count):
    """Points on desks' height, the floor and the walls, each with the normal of its plane."""
    rng, width, height, depth = random.Random(1), *SIZE
    made = []
    while len(made) < count:
        x, y, z = (rng.uniform(0.1, side - 0.1) for side in SIZE)
        walls = [(0.01 if x < 4 else 7.99, y, z, 1 if x < 4 else -1, 0, 0), (x, y, 0.01, 0, 0, 1)]
        point = rng.choice([(x, 0.85, z, 0, 1, 0), (x, 0.01, z, 0, 1, 0), *walls])
        if is_outside(point):
            made.append(point)
    return made


def run(command, **options):
    """Output of a command, and its CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.time()
    output = subprocess.run(command, check=True, stdout=subprocess.PIPE, **options).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return output, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, time.time() - begun


def radiance(folder, programs, rays, lines):
    command = [os.path.join(programs, "rtrace"), "-I", "-h", "-n", "2", *(part.format(rays=rays) for part in FINE), "-u+", "office.oct"]
    environment = {**os.environ, "RAYPATH": ".:" + os.path.join(programs, "..", "lib")}
    text = "".join(" ".join(map(str, line)) + "\n" for line in lines).encode()
    output, cpu, wall = run(command, input=text, cwd=folder, env=environment)
    weights = (0.265, 0.670, 0.065)
    values = [[float(number) for number in line.split()] for line in output.decode().splitlines()]
    return [179 * sum(weight * value for weight, value in zip(weights, line)) for line in values], cpu


def photoncard(program, folder, options):
    command = [program, "measure", "office.gltf", "--points", "points.txt", "--weights", "0.265,0.670,0.065"]
    output, cpu, wall = run([*command, "--quiet", "-o", "-", *options], cwd=folder)
    rows = [line.split(",") for line in output.decode().splitlines()[1:]]
    return [float(row[6]) for row in rows], cpu, [float(row[9]) for row in rows]


def is_outside(point):
    """False inside furniture, where both programs find darkness."""
    x, y, z = point[:3]
    desks = [(1.2 + 2.4 * column, 1.0 + 2.2 * row) for column in range(3) for row in range(2)]
    legs = [(x + leg, x + leg + 0.05, 0, 0.7, z + 0.3, z + 0.5) for x, z in desks for leg in (0.05, 1.5)]
    inside = [(0.05, 0.4, 0.001, 2.0, 0.5, 2.5), *legs]
    return not any(x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1 for x0, x1, y0, y1, z0, z1 in inside)


def differences(found, expected):
    """Relative differences, sorted: median, 95th percentile, most. Points darker than 1 % of the mean count by that."""
    least = 0.01 * sum(expected) / len(expected)
    sorted_ones = sorted(abs(a - b) / max(b, least) for a, b in zip(found, expected))
    return " ".join(f"{name} {100 * sorted_ones[at]:.2f} %" for name, at in (("median", len(expected) // 2), ("95th", len(expected) * 95 // 100), ("most", -1)))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photoncard")
    parser.add_argument("folder")
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--ies", action="store_true", help="luminaires with photometric files")
    parser.add_argument("--reference-rays", type=int, default=2048, help="ambient divisions of Radiance's reference")
    arguments = parser.parse_args()
    import pyradiance

    programs = os.path.join(os.path.dirname(pyradiance.__file__), "bin")
    os.makedirs(arguments.folder, exist_ok=True)
    parts = office(not arguments.ies)
    write_ies(os.path.join(arguments.folder, "lamp.ies"))
    write_gltf(os.path.join(arguments.folder, "office.gltf"), parts, luminaires() if arguments.ies else [])
    write_rad(os.path.join(arguments.folder, "office.rad"), parts)
    lines = points(arguments.points)
    with open(os.path.join(arguments.folder, "points.txt"), "w") as file:
        file.writelines(" ".join(map(str, line)) + "\n" for line in lines)
    files = ["office.rad"]
    units = ["--lumens-per-watt", "179"]
    if arguments.ies:
        # The file's candelas are the lumens of glTF's lights.
        units = ["--lumens-per-watt", "1"]
        files.append(radiance_luminaires(arguments.folder, programs))
    octree = run([os.path.join(programs, "oconv"), *files], cwd=arguments.folder)[0]
    with open(os.path.join(arguments.folder, "office.oct"), "wb") as file:
        file.write(octree)
    program = os.path.abspath(arguments.photoncard)

    reference, cpu = radiance(arguments.folder, programs, arguments.reference_rays, lines)
    print(f"reference: rtrace -ad {arguments.reference_rays}, {cpu:.0f} CPU s, mean {sum(reference) / len(reference):.2f} lx")
    for rays in (16, 64, 256):
        found, cpu = radiance(arguments.folder, programs, rays, lines)
        print(f"rtrace -ad {rays}: {differences(found, reference)}, {cpu:.1f} CPU s")
    for options in ([], ["--spp", "64"], ["--spp", "64", "--photons", "2000000"]):
        found, cpu, errors = photoncard(program, arguments.folder, [*units, *options])
        stated = (sum((error / value) ** 2 for error, value in zip(errors, found)) / len(found)) ** 0.5
        print(
            f"photoncard {' '.join(options)}: {differences(found, reference)}, mean {100 * (sum(found) / sum(reference) - 1):+.2f} %, "
            f"stated error {100 * stated:.2f} %, {cpu:.1f} CPU s"
        )
    sys.stdout.flush()


if __name__ == "__main__":
    main()
