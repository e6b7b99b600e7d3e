"""Writes a scene of a given size: a terrain of triangles, a forest of instances, or a wall of textures.

    scenes.py triangles|instances|textures COUNT OUTPUT.glb

COUNT is the number of triangles, of trees, or of textures. All surfaces are Lambertian and two-sided; light is to come from an environment.
It is a command of its own, as the memory of a process counts as that of the programs that it starts.
"""

import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "cycles"))

import gltf  # noqa: E402: of the folder beside
import png  # noqa: E402: of the folder beside

# Half the side of the terrain, metres; waves that it is the sum of; length of the longest, metres.
REACH, WAVES, LONGEST = 50.0, 24, 60.0
# Boxes on the terrain: x, z and half the side, metres.
BOXES = ((-12.0, 10.0, 2.0), (3.0, 20.0, 1.5), (14.0, 0.0, 3.0))
# Leaves of a tree; half the sides of a leaf, and the radius of the crown, metres; area of ground for each tree, square metres.
LEAVES, LEAF, CROWN, AREA = 2000, (0.06, 0.04), 1.2, 25.0
# Side of a texture and of the squares that it consists of, texels.
SIDE, SQUARE = 4096, 32


def main():
    """See the module."""
    kind, count, output = sys.argv[1:]
    document = gltf.Document.empty()
    {"triangles": terrain, "instances": forest, "textures": wall}[kind](document, int(count))
    document.write(output)


def terrain(document, triangles):
    """A square of hills with some boxes on it, of the number of triangles to within the next square grid."""
    side = max(1, round(math.sqrt(triangles / 2)))
    along = np.linspace(-REACH, REACH, side + 1)
    x, z = (values.ravel() for values in np.meshgrid(along, along))
    height, normals = hills(x, z)
    soil = material(document, (0.4, 0.35, 0.3))
    points = np.stack([x, height, z], axis=1).astype(np.float32)
    place(document, mesh(document, points, normals, grid(side), soil))
    box = cube(document, soil)
    for x, z, half in BOXES:
        height = float(hills(np.array([x]), np.array([z]))[0][0])
        place(document, box, translation=(x, height + half, z), scale=(half, half, half))
    camera(document, (0.0, 20.0, 60.0), -0.35)


def hills(x, z):
    """Heights and unit normals of a smooth noise at points: waves of random directions, the shorter the lower."""
    random = np.random.default_rng(1)
    height, slope_x, slope_z = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for wave in range(WAVES):
        length = LONGEST * 0.8**wave
        angle, phase = random.uniform(0.0, 2.0 * math.pi, 2)
        across, along = (2.0 * math.pi / length * part for part in (math.cos(angle), math.sin(angle)))
        swell, argument = 0.02 * length, across * x + along * z + phase
        height += swell * np.sin(argument)
        steepness = swell * np.cos(argument)
        slope_x += steepness * across
        slope_z += steepness * along
    normals = np.stack([-slope_x, np.ones_like(x), -slope_z], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return height, normals.astype(np.float32)


def grid(side):
    """Corners of the triangles of a square grid of that many cells on a side."""
    first = (np.arange(side, dtype=np.uint32)[:, None] * (side + 1) + np.arange(side, dtype=np.uint32)).ravel()
    below = first + np.uint32(side + 1)
    return np.stack([first, below, first + 1, first + 1, below, below + 1], axis=1).astype(np.uint32)


def cube(document, surface):
    """A mesh of a cube from -1 to 1."""
    corners, normals = [], []
    for axis in range(3):
        for end in (-1.0, 1.0):
            normal = end * np.eye(3)[axis]
            u = np.eye(3)[(axis + 1) % 3]
            corners += quad(normal, u, np.cross(normal, u))
            normals += 4 * [normal]
    return mesh(document, np.array(corners, np.float32), np.array(normals, np.float32), quads(6), surface)


def quad(middle, u, v):
    """The corners of a parallelogram, counter-clockwise seen from `u x v`."""
    return [middle + s * u + t * v for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def quads(count):
    """Corners of the triangles of parallelograms of four vertices each."""
    return (4 * np.arange(count, dtype=np.uint32)[:, None] + np.array([0, 1, 2, 0, 2, 3], np.uint32)).astype(np.uint32)


def forest(document, trees):
    """A mesh of a tree's leaves, placed by a node for each tree on a square of ground."""
    random = np.random.default_rng(1)
    half = 0.5 * math.sqrt(AREA * trees)
    ground(document, half)
    tree = leaves(document, random)
    for _ in range(trees):
        x, z = random.uniform(-half, half, 2).tolist()
        angle, size = random.uniform(0.0, math.pi), random.uniform(0.7, 1.3)
        place(document, tree, translation=(x, 0.0, z), rotation=(0.0, math.sin(angle), 0.0, math.cos(angle)), scale=(size, size, size))
    camera(document, (0.0, 6.0, 1.2 * half), -0.2)


def ground(document, half):
    """A square of ground."""
    corners = quad(np.zeros(3), np.array([half, 0.0, 0.0]), np.array([0.0, 0.0, -half]))
    normals = np.tile(np.array([0.0, 1.0, 0.0], np.float32), (4, 1))
    place(document, mesh(document, np.array(corners, np.float32), normals, quads(1), material(document, (0.4, 0.35, 0.3))))


def leaves(document, random):
    """A mesh of rectangles with random directions in a ball."""
    middles = directions(random) * CROWN * random.uniform(0.0, 1.0, (LEAVES, 1)) ** (1.0 / 3.0) + (0.0, 2.2, 0.0)
    u = directions(random)
    v = np.cross(u, directions(random))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    corners = np.stack(quad(middles, LEAF[0] * u, LEAF[1] * v), axis=1).reshape(-1, 3)
    normals = np.repeat(np.cross(u, v), 4, axis=0)
    return mesh(document, corners.astype(np.float32), normals.astype(np.float32), quads(LEAVES), material(document, (0.25, 0.5, 0.15)))


def directions(random):
    """Random directions, one for each leaf."""
    result = random.standard_normal((LEAVES, 3))
    return result / np.linalg.norm(result, axis=1, keepdims=True)


def wall(document, textures):
    """Squares side by side with a texture each, that face the camera."""
    across = math.ceil(math.sqrt(textures))
    document.json["samplers"] = [{}]
    for number in range(textures):
        row, column = divmod(number, across)
        middle = np.array([column - 0.5 * (across - 1), 0.5 * (across - 1) - row, 0.0])
        corners = quad(middle, np.array([0.48, 0.0, 0.0]), np.array([0.0, 0.48, 0.0]))
        normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
        surface = material(document, (1.0, 1.0, 1.0), texture(document, number))
        place(document, mesh(document, np.array(corners, np.float32), normals, quads(1), surface, textured=True))
    camera(document, (0.0, 0.0, 1.25 * across), 0.0)


def texture(document, seed):
    """An image of random squares: small as a file, and large once it is decoded."""
    colours = np.random.default_rng(seed).integers(40, 220, (SIDE // SQUARE, SIDE // SQUARE, 3), dtype=np.uint8)
    pixels = colours.repeat(SQUARE, axis=0).repeat(SQUARE, axis=1)
    image = document.add("images", {"bufferView": document.view(png.encode(pixels)), "mimeType": "image/png"})
    return document.add("textures", {"source": image, "sampler": 0})


def material(document, colour, image=None):
    """A Lambertian surface."""
    surface = {"baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}
    if image is not None:
        surface["baseColorTexture"] = {"index": image}
    document.json["extensionsUsed"] = ["KHR_materials_specular"]
    extensions = {"KHR_materials_specular": {"specularFactor": 0.0}}
    return document.add("materials", {"pbrMetallicRoughness": surface, "doubleSided": True, "extensions": extensions})


def mesh(document, points, normals, corners, surface, textured=False):
    """A mesh of triangles; if textured, of one parallelogram."""
    attributes = {"POSITION": document.accessor(points, "VEC3"), "NORMAL": document.accessor(normals, "VEC3")}
    if textured:
        attributes["TEXCOORD_0"] = document.accessor(np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32), "VEC2")
    indices = document.accessor(corners.reshape(-1), "SCALAR")
    return document.add("meshes", {"primitives": [{"attributes": attributes, "indices": indices, "material": surface}]})


def place(document, shape, **transform):
    """Adds a node of a mesh to the scene."""
    document.roots().append(document.add("nodes", {"mesh": shape, **transform}))


def camera(document, place, tilt):
    """Adds the camera, which looks to -z, turned upward by an angle."""
    perspective = {"yfov": 0.8, "znear": 0.1, "aspectRatio": 1.0}
    index = document.add("cameras", {"type": "perspective", "perspective": perspective})
    rotation = (math.sin(0.5 * tilt), 0.0, 0.0, math.cos(0.5 * tilt))
    node = {"name": "camera", "camera": index, "translation": place, "rotation": rotation}
    document.roots().append(document.add("nodes", node))


if __name__ == "__main__":
    main()
