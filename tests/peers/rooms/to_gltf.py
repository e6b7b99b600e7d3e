"""Converts a room of Mitsuba's XML to a .glb, and beside it an .exr of its light from infinitely far, if any.

Emission is radiometric. A `twosided` material is double-sided, others have one side. Bumps are left out. A
`ward` that reflects nothing diffusely is a metal. Files of shapes that are absent are named on the standard
error, and end the conversion unless `--skip-missing` is given.
"""

import argparse
import json
import math
import struct
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

import mitsuba_xml
import sky

FLOAT, UNSIGNED = 5126, 5125
GLASS = ("dielectric", "thindielectric", "roughdielectric")
METALS = ("conductor", "roughconductor")
# Reflectance of a metal as a Lambertian surface.
GREY = 0.5
# How far behind a lamp its black back is, over the diagonal of its bounding box.
BEHIND = 1e-3
MEDIA = {".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".png": "image/png"}


def main():
    """See the module."""
    arguments = parse()
    scene = mitsuba_xml.Scene(arguments.scene)
    for name in scene.missing:
        print(f"{arguments.scene}: the file of {name} is absent", file=sys.stderr)
    if scene.missing and not arguments.skip_missing:
        sys.exit(f"{arguments.scene}: not converted; --skip-missing leaves out such shapes")
    writer = Writer()
    for shape in scene.shapes:
        if not is_left_out(shape, arguments):
            writer.add(shape, arguments)
            if arguments.black_backs and shape.radiance is not None and not arguments.furnace:
                writer.add(black_back(shape), arguments)
    writer.camera(scene.sensor)
    writer.write(arguments.output)
    picture = sky.bake(scene)
    if picture is not None and not arguments.furnace:
        mi.Bitmap(picture.astype(np.float32)).write(str(arguments.output.with_suffix(".exr")))


def parse():
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path, help="the XML")
    parser.add_argument("--output", type=Path, required=True, help="the .glb")
    parser.add_argument("--lambertian", action="store_true", help="all but glass reflects diffusely")
    parser.add_argument("--no-glass", action="store_true", help="leave out glass")
    parser.add_argument("--flat", action="store_true", help="leave out smooth normals")
    parser.add_argument("--one-sided", action="store_true", help="nothing is double-sided")
    parser.add_argument(
        "--furnace",
        action="store_true",
        help="all but glass is white and diffuse: under an even sky every surface has its radiance",
    )
    parser.add_argument(
        "--black-backs",
        action="store_true",
        help="black surfaces close behind lamps: Blender's import has lamps shine to both sides",
    )
    parser.add_argument("--skip-missing", action="store_true", help="leave out shapes whose files are absent")
    parser.add_argument("--no-textures", action="store_true", help="the mean colour instead of textures")
    parser.add_argument(
        "--without", nargs="+", default=[], help="leave out materials or shapes of these names"
    )
    return parser.parse_args()


def is_left_out(shape, arguments):
    """Whether the options leave out a shape."""
    is_glass = shape.material.kind in GLASS
    return is_glass and arguments.no_glass or {shape.name, shape.material.name} & set(arguments.without)


def black_back(shape):
    """What is close behind a lamp, faces the other way, and reflects nothing."""
    corners = shape.positions[shape.corners]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ways = np.zeros_like(shape.positions)
    for corner in range(3):
        np.add.at(ways, shape.corners[:, corner], normals)
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-12)
    positions = shape.positions - BEHIND * np.linalg.norm(np.ptp(shape.positions, axis=0)) * ways
    black = mitsuba_xml.Bsdf("black back", "diffuse", values={"reflectance": np.zeros(3)})
    return mitsuba_xml.Shape(
        f"{shape.name} back", positions, shape.corners[:, ::-1], None, None, black, None
    )


class Writer:
    """A document and its buffer."""

    def __init__(self):
        self.buffer = bytearray()
        self.images = {}
        self.materials = {}
        self.document = {
            "asset": {"version": "2.0", "generator": "photoncard, tests/peers/rooms"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            **{
                name: []
                for name in (
                    "nodes",
                    "meshes",
                    "accessors",
                    "bufferViews",
                    "materials",
                    "textures",
                    "images",
                    "cameras",
                )
            },
        }

    def add(self, shape, arguments):
        """A shape as a node of its own."""
        attributes = {"POSITION": self.accessor(shape.positions, "VEC3", FLOAT)}
        if shape.normals is not None and not arguments.flat:
            attributes["NORMAL"] = self.accessor(shape.normals, "VEC3", FLOAT)
        if shape.coordinates is not None:
            # Mitsuba's coordinates begin below, glTF's above.
            attributes["TEXCOORD_0"] = self.accessor(
                shape.coordinates * [1.0, -1.0] + [0.0, 1.0], "VEC2", FLOAT
            )
        primitive = {
            "attributes": attributes,
            "indices": self.accessor(shape.corners.reshape(-1, 1), "SCALAR", UNSIGNED),
        }
        primitive["material"] = self.material(shape, arguments)
        mesh = self.append("meshes", {"name": shape.name, "primitives": [primitive]})
        self.document["scenes"][0]["nodes"].append(self.append("nodes", {"name": shape.name, "mesh": mesh}))

    def append(self, kind, item):
        """The index of a new item."""
        self.document[kind].append(item)
        return len(self.document[kind]) - 1

    def accessor(self, values, kind, component):
        """The accessor of an array."""
        stored = values.astype(np.float32 if component == FLOAT else np.uint32)
        item = {
            "bufferView": self.view(stored.tobytes()),
            "componentType": component,
            "count": len(stored),
            "type": kind,
        }
        if kind == "VEC3":
            item |= {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
        return self.append("accessors", item)

    def view(self, data):
        """The view of some bytes, at a multiple of four."""
        start = len(self.buffer)
        self.buffer += data + bytes(-len(data) % 4)
        return self.append("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data)})

    def material(self, shape, arguments):
        """The index of a shape's material."""
        radiance = None if shape.radiance is None else tuple(shape.radiance)
        key = (shape.material.name, radiance, shape.coordinates is None)
        if key not in self.materials:
            self.materials[key] = self.append("materials", self.describe(shape, arguments))
        return self.materials[key]

    def describe(self, shape, arguments):
        """glTF's material of a shape."""
        bsdf = shape.material
        # Mitsuba's lamps shine from their fronts.
        item = {
            "name": bsdf.name,
            "doubleSided": bsdf.is_twosided and shape.radiance is None and not arguments.one_sided,
        }
        if shape.radiance is not None and not arguments.furnace:
            strength = float(max(shape.radiance))
            item["emissiveFactor"] = (shape.radiance / max(strength, 1e-12)).tolist()
            item["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        surface, extensions = self.surface(bsdf, shape.coordinates is not None, arguments)
        item["pbrMetallicRoughness"] = surface
        item["extensions"] = {**item.get("extensions", {}), **extensions}
        if isinstance(bsdf.opacity, Path):
            item |= {"alphaMode": "MASK", "alphaCutoff": 0.5}
        elif bsdf.opacity is not None:
            item["alphaMode"] = "BLEND"
            surface["baseColorFactor"] = [
                *surface.get("baseColorFactor", [1.0] * 4)[:3],
                float(np.mean(bsdf.opacity)),
            ]
        return item

    def surface(self, bsdf, has_coordinates, arguments):
        """Metallic-roughness parameters, and extensions."""
        values = bsdf.values
        if bsdf.kind in GLASS and not is_black(values.get("specularTransmittance")):
            extensions = {
                "KHR_materials_transmission": {"transmissionFactor": 1.0},
                "KHR_materials_ior": {"ior": ior(values)},
            }
            if bsdf.kind != "thindielectric":
                extensions["KHR_materials_volume"] = {"thicknessFactor": 1.0}
            return {"metallicFactor": 0.0, "roughnessFactor": roughness(bsdf)}, extensions
        if arguments.furnace:
            return {"metallicFactor": 0.0, "baseColorFactor": [1.0] * 4}, {
                "KHR_materials_specular": {"specularFactor": 0.0}
            }
        if is_metal(bsdf):
            if arguments.lambertian:
                return {"metallicFactor": 0.0, "baseColorFactor": [GREY] * 3 + [1.0]}, {
                    "KHR_materials_specular": {"specularFactor": 0.0}
                }
            return {
                "metallicFactor": 1.0,
                "roughnessFactor": roughness(bsdf),
                "baseColorFactor": [*metal(bsdf), 1.0],
            }, {}
        reflectance = values.get(
            "diffuseReflectance", values.get("reflectance", np.full(3, 0.0 if bsdf.kind in GLASS else 0.5))
        )
        surface = {"metallicFactor": 0.0, **self.base(reflectance, has_coordinates, arguments)}
        if arguments.lambertian or bsdf.kind in ("diffuse", "roughdiffuse"):
            return surface, {"KHR_materials_specular": {"specularFactor": 0.0}}
        return {**surface, "roughnessFactor": max(roughness(bsdf), 0.1)}, {
            "KHR_materials_ior": {"ior": ior(values)}
        }

    def base(self, reflectance, has_coordinates, arguments):
        """The base colour, a factor or a texture."""
        if not isinstance(reflectance, Path):
            return {"baseColorFactor": [*np.asarray(reflectance).tolist(), 1.0]}
        if not has_coordinates or arguments.no_textures:
            return {"baseColorFactor": [*mean_colour(reflectance), 1.0]}
        if reflectance not in self.images:
            view = self.view(reflectance.read_bytes())
            source = self.append(
                "images", {"bufferView": view, "mimeType": MEDIA[reflectance.suffix.lower()]}
            )
            self.images[reflectance] = self.append("textures", {"source": source})
        return {"baseColorTexture": {"index": self.images[reflectance]}}

    def camera(self, sensor):
        """The camera: glTF's looks along -z with x to the right, Mitsuba's along z with x to the left."""
        across = math.radians(sensor.fov)
        aspect = sensor.width / sensor.height
        yfov = 2.0 * math.atan(math.tan(across / 2.0) / aspect)
        camera = self.append(
            "cameras",
            {"type": "perspective", "perspective": {"yfov": yfov, "aspectRatio": aspect, "znear": 0.01}},
        )
        matrix = np.eye(4)
        axes = sensor.to_world[:3, :3] / np.linalg.norm(sensor.to_world[:3, :3], axis=0) * [-1.0, 1.0, -1.0]
        # A mirrored camera is turned into one that is not.
        matrix[:3, :3] = axes * [np.sign(np.linalg.det(axes)), 1.0, 1.0]
        matrix[:3, 3] = sensor.to_world[:3, 3]
        node = self.append("nodes", {"name": "camera", "camera": camera, "matrix": matrix.T.ravel().tolist()})
        self.document["scenes"][0]["nodes"].append(node)

    def write(self, path):
        """Writes the .glb."""
        document = {key: value for key, value in self.document.items() if value != []}
        document["buffers"] = [{"byteLength": len(self.buffer)}]
        used = {name for item in document["materials"] for name in item.get("extensions", {})}
        document["extensionsUsed"] = sorted(used)
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.buffer) + bytes(-len(self.buffer) % 4)
        chunks = (
            struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
        )
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def is_black(colour):
    """Whether a colour is given, and black."""
    return colour is not None and not np.any(colour)


def is_metal(bsdf):
    """Whether a material is a metal, such as a Ward lobe alone."""
    lobe = bsdf.kind == "ward" and is_black(bsdf.values.get("diffuseReflectance"))
    return lobe or bsdf.kind in METALS


def ior(values):
    """The index of refraction."""
    return float(values.get("intIOR", 1.5)) / float(values.get("extIOR", 1.0))


def roughness(bsdf):
    """glTF's roughness: its square is alpha, which Ward's lobe has in common with Beckmann's."""
    if bsdf.kind != "ward" and not bsdf.kind.startswith("rough"):
        return 0.0
    alpha = float(bsdf.values.get("alpha", 0.1))
    return math.sqrt(math.sqrt(bsdf.values.get("alphaU", alpha) * bsdf.values.get("alphaV", alpha)))


def metal(bsdf):
    """Reflectance of a metal straight on; smooth ones are white, as Mitsuba has no Schlick mirror."""
    if bsdf.kind == "conductor":
        return [1.0, 1.0, 1.0]
    scale = bsdf.values.get("specularReflectance", np.ones(3))
    if "eta" not in bsdf.values:
        return np.asarray(scale).tolist()
    eta, k = bsdf.values["eta"], bsdf.values["k"]
    return (scale * ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)).tolist()


def mean_colour(path):
    """The mean of a texture, linear."""
    picture = mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    return np.array(picture).mean(axis=(0, 1)).tolist()


if __name__ == "__main__":
    main()
