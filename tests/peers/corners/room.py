"""A closed Lambertian room in glTF, 6 m long, with one lamp and a camera for each kind of corner."""

import json
import math
import struct

import numpy as np

FLOAT = 5126
WALL, WOOD, LAMP = range(3)
LAMBERTIAN = {"KHR_materials_specular": {"specularFactor": 0.0}}
# Name, eye, what it looks at, vertical angle in degrees.
CAMERAS = (
    ("corner", (1.2, 1.2, 1.5), (-3.0, 0.0, 1.5), 8.0),
    ("edge", (-0.5, 1.4, 0.8), (1.0, 0.5, -3.0), 16.0),
    ("chair", (0.7, 1.0, 2.2), (-1.0, 0.12, 1.0), 18.0),
    ("shelf", (-0.3, 0.9, -0.6), (-0.7, 0.45, -2.85), 26.0),
    ("slot", (-2.2, 1.4, 1.6), (-2.96, 0.5, -0.05), 22.0),
)
NAMES = tuple(name for name, *_ in CAMERAS)


def write(path):
    """Writes the room's file."""
    triangles = {WALL: [], WOOD: [], LAMP: []}
    furnish(triangles)
    materials = [material([0.8, 0.78, 0.74]), material([0.6, 0.45, 0.3]), material([0.0] * 3, 1.0)]
    write_scene(path, triangles, materials, CAMERAS)


def write_scene(path, triangles, materials, cameras, sun=None):
    """Writes a scene: triangles by material, and the irradiance and the direction of a sun."""
    data = bytearray()
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": list(LAMBERTIAN),
        "bufferViews": [],
        "accessors": [],
        "meshes": [],
        "nodes": [],
        "cameras": [],
        "materials": materials,
    }
    for kind, corners in triangles.items():
        add_mesh(document, data, kind, np.array(corners, "<f4").reshape(-1, 3))
    for camera in cameras:
        add_camera(document, *camera)
    if sun is not None:
        add_sun(document, *sun)
    document["scenes"] = [{"nodes": list(range(len(document["nodes"])))}]
    document["buffers"] = [{"byteLength": len(data)}]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def furnish(triangles):
    """The room, a pillar in its corner, the lamp, a shelf, a cupboard 5 cm off the wall, and a chair."""
    box(triangles[WALL], (-3.0, 0.0, -3.0), (3.0, 3.0, 3.0), inward=True)
    box(triangles[WALL], (1.0, 0.0, -3.0), (3.0, 3.0, -1.0))
    lamp = [(-0.5, 2.99, -0.5), (0.5, 2.99, -0.5), (0.5, 2.99, 0.5), (-0.5, 2.99, 0.5)]
    quad(triangles[LAMP], lamp)
    wood = triangles[WOOD]
    for y in (0.0, 0.3, 0.6, 0.9):
        box(wood, (-1.0, y + 0.001, -2.999), (-0.4, y + 0.021, -2.7))
    for x in (-1.0, -0.42):
        box(wood, (x, 0.021, -2.999), (x + 0.02, 0.92, -2.7))
    box(wood, (-2.95, 0.001, -1.0), (-2.45, 1.0, 0.0))
    box(wood, (-1.2, 0.43, 0.8), (-0.8, 0.47, 1.2))
    for x in (-1.2, -0.84):
        for z in (0.8, 1.16):
            box(wood, (x, 0.0005, z), (x + 0.04, 0.43, z + 0.04))


def box(triangles, lower, upper, inward=False):
    """Adds the six sides of a box."""
    for side in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)):
        corners = [
            tuple((upper if corner >> axis & 1 else lower)[axis] for axis in range(3)) for corner in side
        ]
        quad(triangles, corners[::-1] if inward else corners)


def quad(triangles, corners):
    """Adds a square by its corners, anticlockwise from its front."""
    first, second, third, fourth = corners
    triangles.extend([(first, second, third), (first, third, fourth)])


def material(colour, emission=0.0, double_sided=False):
    """A Lambertian material."""
    return {
        "doubleSided": double_sided,
        "pbrMetallicRoughness": {"baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0},
        "emissiveFactor": [emission] * 3,
        "extensions": LAMBERTIAN,
        "name": "lamp" if emission else "surface",
    }


def add_mesh(document, data, kind, corners):
    """Adds a node with triangles of one material."""
    document["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": corners.nbytes})
    data.extend(corners.tobytes())
    document["accessors"].append(
        {
            "bufferView": len(document["bufferViews"]) - 1,
            "componentType": FLOAT,
            "count": len(corners),
            "type": "VEC3",
            "min": corners.min(axis=0).tolist(),
            "max": corners.max(axis=0).tolist(),
        }
    )
    primitive = {"attributes": {"POSITION": len(document["accessors"]) - 1}, "material": kind}
    document["nodes"].append({"mesh": len(document["meshes"])})
    document["meshes"].append({"primitives": [primitive]})


def add_camera(document, name, eye, target, angle):
    """Adds a node with a camera of square pictures."""
    matrix = looking(np.array(eye), np.array(target) - np.array(eye))
    document["nodes"].append({"name": name, "camera": len(document["cameras"]), "matrix": matrix})
    perspective = {"yfov": math.radians(angle), "aspectRatio": 1.0, "znear": 0.001}
    document["cameras"].append({"type": "perspective", "name": name, "perspective": perspective})


def add_sun(document, irradiance, direction):
    """Adds a node with a directional light."""
    document["extensionsUsed"].append("KHR_lights_punctual")
    lights = [{"type": "directional", "intensity": irradiance}]
    document["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    light = {"KHR_lights_punctual": {"light": 0}}
    document["nodes"].append({"extensions": light, "matrix": looking(np.zeros(3), np.array(direction))})


def looking(place, direction):
    """The matrix of a node whose -z has a direction, by columns."""
    forward = direction / np.linalg.norm(direction)
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    world = np.eye(4)
    world[:3, :3] = np.stack([right, np.cross(right, forward), -forward], axis=1)
    world[:3, 3] = place
    return world.T.ravel().tolist()
