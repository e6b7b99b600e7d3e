"""A landscape of as many triangles and texels as asked for: hills, rocks and cut-out leaves, lit by panels that shine through a
texture. All have normals and texture coordinates; rocks and bushes are instances of one mesh each."""

import json
import struct
import zlib

import numpy as np

import jpeg

FLOAT, UNSIGNED_INT = 5126, 5125
HALF = 20.0
ROCK, LEAVES = (16, 10), 64
# What share of the triangles they are.
ROCK_SHARE, LEAF_SHARE = 0.25, 0.25
CAMERA_HEIGHT = 4.0


class File:
    """A GLB in the making."""

    def __init__(self):
        self.binary = bytearray()
        self.document = {"asset": {"version": "2.0"}, "scene": 0, "extensionsUsed": ["KHR_materials_emissive_strength"]}
        for name in ("bufferViews", "accessors", "images", "textures", "materials", "meshes", "nodes", "cameras"):
            self.document[name] = []

    def add(self, name, value):
        """Adds an entry to a list; returns its index."""
        self.document[name].append(value)
        return len(self.document[name]) - 1

    def view(self, data):
        """Adds bytes."""
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        self.binary += data + bytes(-len(data) % 4)
        return self.add("bufferViews", view)

    def texture(self, mime_type, data):
        """Adds an image and a texture that repeats it."""
        image = self.add("images", {"bufferView": self.view(data), "mimeType": mime_type})
        return {"index": self.add("textures", {"source": image})}

    def accessor(self, values, component, kind):
        """Adds an array."""
        accessor = {"bufferView": self.view(values.tobytes()), "componentType": component, "count": len(values), "type": kind}
        if kind == "VEC3":
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", accessor)

    def mesh(self, positions, normals, coordinates, triangles, material):
        """Adds a mesh."""
        attributes = {
            "POSITION": self.accessor(positions.astype(np.float32), FLOAT, "VEC3"),
            "NORMAL": self.accessor(normals.astype(np.float32), FLOAT, "VEC3"),
            "TEXCOORD_0": self.accessor(coordinates.astype(np.float32), FLOAT, "VEC2"),
        }
        indices = self.accessor(triangles.reshape(-1).astype(np.uint32), UNSIGNED_INT, "SCALAR")
        primitive = {"attributes": attributes, "indices": indices, "material": self.add("materials", material)}
        return self.add("meshes", {"primitives": [primitive]})

    def bytes(self):
        """The whole file."""
        document = self.document | {
            "scenes": [{"nodes": list(range(len(self.document["nodes"])))}],
            "buffers": [{"byteLength": len(self.binary)}],
        }
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(self.binary), b"BIN\0") + self.binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def landscape(triangles, halvings):
    """The file of about so many triangles, and of 64 MB of decoded texels halved so often."""
    random = np.random.default_rng(1)
    file = File()
    # Sides of 2048 and 1024, one after the other halved.
    side = [2048 >> (halvings + 1) // 2, 2048 >> halvings // 2] if halvings >= 0 else [4096, 2048]
    half = [side[0], side[1] // 2]
    rock_instances = int(triangles * ROCK_SHARE) // (2 * ROCK[0] * ROCK[1])
    bushes = int(triangles * LEAF_SHARE) // (2 * LEAVES)
    cells = int(np.sqrt(triangles * (1.0 - ROCK_SHARE - LEAF_SHARE) / 2.0))
    ground = rough("ground", photograph(file, side, random), roughness(file, side, random))
    stone = rough("stone", photograph(file, half, random), roughness(file, half, random))
    file.add("nodes", {"mesh": hills(file, cells, ground)})
    scatter(file, rock(file, stone, random), rock_instances, 0.15, random)
    scatter(file, bush(file, leaf(file, half, random), random), bushes, 0.5, random)
    light(file, half, random)
    camera = {"type": "perspective", "perspective": {"aspectRatio": 1.0, "yfov": 0.9, "znear": 0.01}}
    matrix = [1, 0, 0, 0, 0, 0.96, -0.28, 0, 0, 0.28, 0.96, 0, 0, CAMERA_HEIGHT, 0.6 * HALF, 1]
    file.add("nodes", {"camera": file.add("cameras", camera), "matrix": matrix})
    return file.bytes()


def rough(name, base, metallic_roughness):
    """A textured material."""
    model = {"baseColorTexture": base, "metallicRoughnessTexture": metallic_roughness}
    return {"name": name, "pbrMetallicRoughness": model}


def photograph(file, size, random):
    """A JPEG with something in all frequencies that it has."""
    width, height = size
    columns, rows = np.meshgrid(np.arange(width // 8), np.arange(height // 8))
    waves = np.sin(columns * 0.11) + np.cos(rows * 0.07) + np.sin((columns + rows) * 0.031)
    scale = 24.0 / (1.0 + np.arange(jpeg.COEFFICIENTS))
    coefficients = random.normal(0.0, 0.25, (columns.size, 3, jpeg.COEFFICIENTS)) * scale
    coefficients[:, 0, 0] += 12.0 * waves.reshape(-1)
    coefficients[:, 1:] *= 0.3
    return file.texture("image/jpeg", jpeg.encode(width, height, np.rint(coefficients)))


def roughness(file, size, random):
    """A PNG of roughness in green and metal in blue."""
    width, height = size
    texels = np.zeros((height, width, 3), np.uint8)
    texels[..., 1] = 140 + 60 * np.sin(np.arange(width) * 0.02) + random.integers(0, 16, (height, width))
    texels[..., 2] = np.where(np.arange(height)[:, None] % 256 < 16, 255, 0)
    return file.texture("image/png", png(texels))


def leaf(file, size, random):
    """A material with holes: ellipses, 8 x 8 to an image."""
    width, height = size
    columns, rows = (np.arange(count) % (count // 8) / (count // 16) - 1.0 for count in (width, height))
    texels = np.zeros((height, width, 4), np.uint8)
    texels[..., 1] = 110 + random.integers(0, 64, (height, width))
    texels[..., 0] = texels[..., 1] // 2
    texels[..., 3] = np.clip(255 * 4 * (0.9 - columns**2 - 2.0 * rows[:, None] ** 2), 0, 255)
    model = {"baseColorTexture": file.texture("image/png", png(texels)), "metallicFactor": 0.0}
    return {"name": "leaf", "pbrMetallicRoughness": model, "alphaMode": "MASK", "doubleSided": True}


def png(texels):
    """A PNG whose rows are told as differences from the ones above."""
    height, width, channels = texels.shape
    rows = np.diff(texels.reshape(height, -1), axis=0, prepend=np.zeros((1, width * channels), np.uint8))
    body = zlib.compress(np.concatenate([np.full((height, 1), 2, np.uint8), rows], axis=1).tobytes(), 1)
    head = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", body), (b"IEND", b"")]
    framed = (struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(framed)


def height_at(x, z):
    """The hills, metres."""
    return 0.8 * np.sin(0.45 * x) * np.cos(0.38 * z) + 0.15 * np.sin(2.1 * x + 1.3 * z)


def hills(file, cells, material):
    """The ground."""
    x, z = np.meshgrid(*[np.linspace(-HALF, HALF, cells + 1)] * 2)
    step = 1e-3
    slopes = [(height_at(x + step, z) - height_at(x, z)) / step, (height_at(x, z + step) - height_at(x, z)) / step]
    normals = np.stack([-slopes[0], np.ones_like(x), -slopes[1]], axis=-1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    positions = np.stack([x, height_at(x, z), z], axis=-1).reshape(-1, 3)
    return file.mesh(positions, normals, positions[:, [0, 2]] * 0.2, grid(cells, cells), material)


def grid(columns, rows):
    """Two triangles to each cell of a grid, whose rows go towards the one who looks at their fronts."""
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    a, b, c, d = first, first + columns + 1, first + columns + 2, first + 1
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def rock(file, material, random):
    """A dented ball."""
    columns, rows = ROCK
    phi, theta = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, columns + 1), np.linspace(0.0, np.pi, rows + 1))
    normals = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1).reshape(-1, 3)
    dents = 1.0 + 0.2 * np.sin(normals @ random.normal(0.0, 3.0, 3))
    coordinates = np.stack([phi / np.pi, theta / np.pi], axis=-1).reshape(-1, 2)
    return file.mesh(normals * dents[:, None], normals, coordinates, grid(columns, rows), material)


def bush(file, material, random):
    """Leaves about a point, each a quadrilateral."""
    middles = random.normal(0.0, 0.4, (LEAVES, 1, 3)) + [0.0, 0.8, 0.0]
    axes = np.linalg.qr(random.normal(0.0, 1.0, (LEAVES, 3, 3)))[0]
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    positions = middles + 0.12 * corners @ axes[:, :2]
    normals = np.repeat(np.cross(axes[:, 0], axes[:, 1]), 4, axis=0)
    tiles = np.repeat(random.integers(0, 8, (LEAVES, 1, 2)), 4, axis=1)
    coordinates = (tiles + (corners * [1.0, -1.0] + 1.0) / 2.0) / 8.0
    quads = 4 * np.arange(LEAVES)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return file.mesh(positions.reshape(-1, 3), normals, coordinates.reshape(-1, 2), quads.reshape(-1, 3), material)


def scatter(file, mesh, count, size, random):
    """Places a mesh on the hills. The more there are the smaller they are, so that the picture stays much the same."""
    for x, z, scale, turn in random.uniform([-HALF, -HALF, 0.6, 0.0], [HALF, HALF, 1.4, 1.0], (count, 4)):
        scale *= size * np.sqrt(600.0 / count)
        rotation = [0.0, np.sin(np.pi * turn), 0.0, np.cos(np.pi * turn)]
        translation = [x, float(height_at(x, z)), z]
        file.add("nodes", {"mesh": mesh, "translation": translation, "rotation": rotation, "scale": [scale] * 3})


def light(file, size, random):
    """Four panels above that shine through one texture."""
    width, height = size
    texels = 160 + random.integers(0, 96, (height, width, 3)).astype(np.uint8)
    material = {
        "name": "panel",
        "emissiveFactor": [1.0, 1.0, 1.0],
        "emissiveTexture": file.texture("image/png", png(texels)),
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 20.0}},
    }
    positions = np.array([[-2.0, 0.0, -2.0], [2.0, 0.0, -2.0], [2.0, 0.0, 2.0], [-2.0, 0.0, 2.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = file.mesh(positions, np.tile([0.0, -1.0, 0.0], (4, 1)), positions[:, [0, 2]] / 4.0 + 0.5, triangles, material)
    for x, z in [(-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0)]:
        file.add("nodes", {"mesh": mesh, "translation": [x, 8.0, z]})
