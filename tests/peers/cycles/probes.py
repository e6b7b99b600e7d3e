"""Makes a glTF file for each feature of materials: four balls of increasing roughness before a striped wall.

    probes.py FOLDER

writes FOLDER/probe-NAME.glb for each probe.
"""

import copy
import sys
from pathlib import Path

import numpy as np

import gltf
import png

ROUGHNESSES = (0.1, 0.3, 0.6, 1.0)
PLACES = ((-1.1, 1.1), (1.1, 1.1), (-1.1, -1.1), (1.1, -1.1))
GOLD, GREY, BLACK = (1.0, 0.77, 0.34, 1.0), (0.5, 0.5, 0.5, 1.0), (0.0, 0.0, 0.0, 1.0)
WHITE, GREEN, HALF_RED = (1.0, 1.0, 1.0, 1.0), (0.6, 0.9, 0.6, 1.0), (0.8, 0.2, 0.1, 0.5)


def dielectric(base=GREY, **extensions):
    """A material that is no metal, with extensions by their short names."""
    material = {"pbrMetallicRoughness": {"baseColorFactor": list(base), "metallicFactor": 0.0}}
    if extensions:
        material["extensions"] = {f"KHR_materials_{name}": value for name, value in extensions.items()}
    return material


def metal(base=GOLD, **extensions):
    """A metal, with extensions by their short names."""
    material = dielectric(base, **extensions)
    material["pbrMetallicRoughness"]["metallicFactor"] = 1.0
    return material


# Materials without their roughness; "normal" stands for the texture of bumps, with its scale.
PROBES = {
    "metal": metal(),
    "dielectric": dielectric(),
    "black": dielectric(BLACK),
    "half-metal": dielectric() | {"pbrMetallicRoughness": {"baseColorFactor": list(GOLD), "metallicFactor": 0.5}},
    "bumps": dielectric() | {"normal": 1.0},
    "bumps-lambert": dielectric(specular={"specularFactor": 0.0}) | {"normal": 1.0},
    "bumps-metal": metal() | {"normal": 1.0},
    "bumps-weak": dielectric() | {"normal": 0.3},
    # Backs of one-sided surfaces are not seen in glTF, and are in Blender.
    "blend": dielectric(HALF_RED) | {"alphaMode": "BLEND", "doubleSided": True},
    "blend-lambert": dielectric(HALF_RED, specular={"specularFactor": 0.0}) | {"alphaMode": "BLEND", "doubleSided": True},
    "specular-tint": dielectric(BLACK, specular={"specularColorFactor": [1.0, 0.3, 0.1]}),
    "specular-high": dielectric(BLACK, ior={"ior": 1000.0}, specular={"specularColorFactor": [0.6, 0.3, 0.1]}),
    "specular-half": dielectric(specular={"specularFactor": 0.5}),
    "ior": dielectric(BLACK, ior={"ior": 2.0}),
    "coat": dielectric((0.6, 0.1, 0.1, 1.0), clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.05}),
    "coat-metal": metal(clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.2}),
    "sheen": dielectric((0.1, 0.1, 0.4, 1.0), sheen={"sheenColorFactor": [0.9, 0.9, 0.9], "sheenRoughnessFactor": 0.4}),
    "anisotropy": metal(anisotropy={"anisotropyStrength": 0.8}),
    "thin": dielectric(GREEN, transmission={"transmissionFactor": 1.0}),
    "glass": dielectric(WHITE, transmission={"transmissionFactor": 1.0}, volume={"thicknessFactor": 1.0}),
    "glass-tint": dielectric(GREEN, transmission={"transmissionFactor": 1.0}, volume={"thicknessFactor": 1.0}),
    "iridescence": metal(iridescence={"iridescenceFactor": 1.0, "iridescenceThicknessMaximum": 400.0}),
}


def main():
    """See the module."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, material in PROBES.items():
        make(copy.deepcopy(material)).write(folder / f"probe-{name}.glb")


def make(material):
    """The document of a probe."""
    document = gltf.Document.empty()
    if "normal" in material:
        image = document.add("images", {"mimeType": "image/png", "bufferView": document.view(png.encode(bumps()))})
        texture = document.add("textures", {"source": image})
        material["normalTexture"] = {"index": texture, "scale": material.pop("normal")}
    document.json["extensionsUsed"] = list(material.get("extensions", {}))
    shape = ball(document)
    for roughness, (x, y) in zip(ROUGHNESSES, PLACES, strict=True):
        own = copy.deepcopy(material)
        own["name"] = f"roughness {roughness}"
        own["pbrMetallicRoughness"]["roughnessFactor"] = roughness
        primitive = shape | {"material": document.add("materials", own)}
        put(document, own["name"], primitive, (x, y, 0.0))
    wall(document)
    return document


def put(document, name, primitive, place):
    """A node with a mesh of one primitive."""
    mesh = document.add("meshes", {"name": name, "primitives": [primitive]})
    document.roots().append(document.add("nodes", {"name": name, "mesh": mesh, "translation": list(place)}))


def ball(document, columns=96, rows=48):
    """A unit ball with smooth normals and coordinates of textures, as a primitive."""
    v, u = np.mgrid[0 : rows + 1, 0 : columns + 1]
    around, down = 2.0 * np.pi * u.ravel() / columns, np.pi * v.ravel() / rows
    points = np.stack([np.sin(down) * np.sin(around), np.cos(down), np.sin(down) * np.cos(around)], axis=1)
    places = np.stack([u.ravel() / columns * 4.0, v.ravel() / rows * 2.0], axis=1)
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below = corner + columns + 1
    triangles = np.concatenate([np.stack([corner, below, below + 1], 1), np.stack([corner, below + 1, corner + 1], 1)])
    # Two triangles of each column have no area, at the poles.
    sides = points[triangles]
    area = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1)
    attributes = {"POSITION": points, "NORMAL": points, "TEXCOORD_0": places}
    kinds = {3: "VEC3", 2: "VEC2"}
    return {
        "attributes": {
            name: document.accessor(values.astype(np.float32), kinds[values.shape[1]]) for name, values in attributes.items()
        },
        "indices": document.accessor(triangles[area > 1e-9].astype(np.uint32).ravel(), "SCALAR"),
    }


def wall(document, side=5.0, depth=-1.6, stripes=10):
    """A Lambertian wall of dark and bright stripes."""
    materials = []
    for value in (0.05, 0.8):
        material = dielectric((value, value, value, 1.0), specular={"specularFactor": 0.0}) | {"doubleSided": True}
        materials.append(document.add("materials", material | {"name": f"stripe {value}"}))
    used = document.json["extensionsUsed"]
    used += [] if "KHR_materials_specular" in used else ["KHR_materials_specular"]
    edges = np.linspace(-side / 2.0, side / 2.0, stripes + 1)
    for index, (left, right) in enumerate(zip(edges, edges[1:])):
        low, high = -side / 2.0, side / 2.0
        corners = [(left, low, depth), (right, low, depth), (right, high, depth), (left, high, depth)]
        primitive = {
            "attributes": {"POSITION": document.accessor(np.array(corners, dtype=np.float32), "VEC3")},
            "indices": document.accessor(np.array([0, 1, 2, 0, 2, 3], dtype=np.uint32), "SCALAR"),
            "material": materials[index % 2],
        }
        put(document, f"stripe {index}", primitive, (0.0, 0.0, 0.0))


def bumps(side=256, waves=8, height=0.035):
    """A normal texture of waves in both directions."""
    y, x = (np.mgrid[:side, :side] + 0.5) / side
    turn = 2.0 * np.pi * waves
    slope_x = height * turn * np.cos(turn * x) * np.sin(turn * y)
    slope_y = height * turn * np.sin(turn * x) * np.cos(turn * y)
    # Rows go down, the texture's green axis up.
    normals = np.stack([-slope_x, slope_y, np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.round((normals * 0.5 + 0.5) * 255.0)


if __name__ == "__main__":
    main()
