"""Mitsuba's scene of a glTF file, by photoncard's conventions: flat triangles, one-sided unless `doubleSided`, emissive
triangles as Lambertian area lights, nothing else."""

import math

import drjit as dr
import mitsuba as mi
import numpy as np

import gltf


def load(path, width, height, camera_name=None):
    """The scene that the file's first camera sees, or the named one."""
    source = gltf.Scene(path)
    chosen = [camera for camera in source.cameras if camera_name in (None, camera[0])]
    if not chosen:
        raise ValueError(f"{path} has no camera '{camera_name}'")
    parts = {"type": "scene", "sensor": sensor(chosen[0], width, height)}
    for index, triangles in source.triangles.items():
        parts[f"material{index}"] = mesh(source.materials[index], triangles)
    return mi.load_dict(parts)


def sensor(camera, width, height):
    """glTF's cameras look along -z and hold the vertical angle; Mitsuba's look along z, with x to the left."""
    _, world, perspective = camera
    axes = world[:3, :3] / np.linalg.norm(world[:3, :3], axis=0)
    to_world = np.eye(4)
    to_world[:3, :3] = axes * [-1.0, 1.0, -1.0]
    to_world[:3, 3] = world[:3, 3]
    return {
        "type": "perspective",
        "fov_axis": "y",
        "fov": math.degrees(perspective["yfov"]),
        "near_clip": 1e-3,
        "far_clip": 1e4,
        "to_world": mi.ScalarTransform4f(to_world),
        "sampler": {"type": "independent"},
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
    }


def mesh(material, triangles):
    """All triangles of a material, each with corners of its own."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(reflection(material))
    emission = np.array(material.get("emissiveFactor", [0.0, 0.0, 0.0]))
    emission *= extension(material, "KHR_materials_emissive_strength").get("emissiveStrength", 1.0)
    if emission.any():
        if material.get("doubleSided"):
            raise ValueError("Mitsuba's area lights have one side")
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": colour(emission)})
    count = len(triangles)
    shape = mi.Mesh(material["name"], 3 * count, count, props=properties)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = mi.Float(triangles.reshape(-1).astype(np.float32))
    parameters["faces"] = dr.arange(mi.UInt32, 3 * count)
    parameters.update()
    return shape


def reflection(material):
    """The reflection of a material: Lambertian, and the Phong lobe that it may state."""
    diffuse = material["pbrMetallicRoughness"]["baseColorFactor"][:3]
    phong = material.get("extras", {}).get("photoncard", {}).get("phong")
    if phong is None:
        front = {"type": "diffuse", "reflectance": colour(diffuse)}
    else:
        # Imported here, as the variant must have been chosen before a BSDF is derived.
        from phong import PhongLobe

        mi.register_bsdf("phong_lobe", PhongLobe)
        front = {
            "type": "phong_lobe",
            "diffuse": mi.ScalarColor3f(diffuse),
            "specular": mi.ScalarColor3f(phong["specular"]),
            "exponent": float(phong["exponent"]),
        }
    return {"type": "twosided", "front": front} if material.get("doubleSided") else front


def colour(values):
    """Linear RGB."""
    return {"type": "rgb", "value": [float(value) for value in values]}


def extension(material, name):
    """An extension of a material, or nothing."""
    return material.get("extensions", {}).get(name, {})
