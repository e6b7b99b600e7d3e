"""Mitsuba's scene of a glTF file, by photoncard's conventions: surfaces are one-sided unless `doubleSided`, emissive
triangles are Lambertian area lights, and there is nothing else but an environment that may be given."""

import math

import drjit as dr
import mitsuba as mi
import numpy as np

import environment
import gltf
import materials


def load(path, width, height, camera_name=None, environment_path=None):
    """The scene that the file's first camera sees, or the named one."""
    source = gltf.Scene(path)
    chosen = [camera for camera in source.cameras if camera_name in (None, camera[0])]
    if not chosen:
        raise ValueError(f"{path} has no camera '{camera_name}'")
    parts = {"type": "scene", "sensor": sensor(chosen[0], width, height)}
    for index, part in enumerate(source.parts):
        parts[f"part{index}"] = mesh(source, part)
    if environment_path is not None:
        parts["environment"] = environment.emitter(environment_path)
    return mi.load_dict(parts)


def has_holes(path):
    """Whether surfaces are cut out or blended."""
    return any(material.get("alphaMode", "OPAQUE") != "OPAQUE" for material in gltf.Scene(path).materials)


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


def mesh(source, part):
    """All triangles of a part, each with corners of its own."""
    material = source.materials[part.material]
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(materials.reflection(source, material, part))
    emission = materials.emission(source, material)
    if emission is not None:
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": emission})
    # Flat triangles without normals of their own.
    properties["face_normals"] = part.normals is None
    count = 3 * len(part.positions)
    has_normals, has_coordinates = part.normals is not None, part.coordinates is not None
    shape = mi.Mesh(material["name"], count, count // 3, properties, has_normals, has_coordinates)
    if part.colours is not None:
        shape.add_attribute(materials.VERTEX_COLOUR, 3, flat(part.colours[..., :3]))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = flat(part.positions)
    parameters["faces"] = dr.arange(mi.UInt32, count)
    if has_normals:
        parameters["vertex_normals"] = flat(part.normals)
    if has_coordinates:
        parameters["vertex_texcoords"] = flat(part.coordinates)
    parameters.update()
    return shape


def flat(values):
    """Values one after the other, as Mitsuba holds them."""
    return mi.Float(values.reshape(-1).astype(np.float32))
