"""A courtyard of the size and kind of the Sponza atrium, by Blender's modifiers and curves and its own glTF export.

    courtyard.py SCENE.glb [--plain]

With --plain no material but the leaves' has images. Prints the triangles of the file, which are between 250,000 and 280,000. See
tests/peers/courtyard.sh.
"""

import argparse
import json
import math
import os
import struct
import sys
from pathlib import Path

import bpy
from mathutils import Vector

import building
import furnishing
import textures
from parts import add

MIN_TRIANGLES, MAX_TRIANGLES = 250_000, 280_000
TRIANGLES = 4


def main():
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path, help="the file to write")
    parser.add_argument("--plain", action="store_true", help="without images but the leaves'")
    arguments = parser.parse_args()
    path = arguments.scene
    path.parent.mkdir(parents=True, exist_ok=True)
    # The count alone goes to the standard output: Blender reports there too.
    report = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    surfaces = textures.all_materials()
    for part in (*building.PARTS, *furnishing.PARTS):
        part(surfaces)
    lights()
    if arguments.plain:
        textures.without_images(surfaces)
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 512
    # Several objects have modifiers, which are applied; tangents are those of faces with four corners or fewer.
    bpy.ops.export_scene.gltf(
        filepath=str(path), export_cameras=True, export_lights=True, export_apply=True, export_tangents=True
    )
    count = triangles(path)
    print(f"{path}: {count} triangles", file=report)
    if not MIN_TRIANGLES <= count <= MAX_TRIANGLES:
        sys.exit(f"{path}: {count} triangles are not between {MIN_TRIANGLES} and {MAX_TRIANGLES}")


def lights():
    """The sun through the opening, and a camera that looks along the court."""
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.color = 20.0, (1.0, 0.90, 0.75)
    aim(add("sun", sun), (-2.0, -5.0, 9.5), (0.0, 0.0, 0.0))
    camera = bpy.data.cameras.new("court")
    camera.angle = math.radians(68.0)
    thing = add("court", camera)
    aim(thing, (-9.8, -1.3, 2.1), (3.0, 0.5, 3.9))
    bpy.context.scene.camera = thing


def aim(thing, where, towards):
    """Puts an object at a place and turns its -z to another."""
    thing.location = where
    thing.rotation_euler = (Vector(towards) - Vector(where)).to_track_quat("-Z", "Y").to_euler()


def triangles(path):
    """The triangles of a file's nodes."""
    data = path.read_bytes()
    document = json.loads(data[20 : 20 + struct.unpack("<I", data[12:16])[0]])
    of_mesh = []
    for mesh in document["meshes"]:
        parts = [part for part in mesh["primitives"] if part.get("mode", TRIANGLES) == TRIANGLES]
        of_mesh.append(sum(document["accessors"][part["indices"]]["count"] // 3 for part in parts))
    return sum(of_mesh[node["mesh"]] for node in document["nodes"] if "mesh" in node)


if __name__ == "__main__":
    main()
