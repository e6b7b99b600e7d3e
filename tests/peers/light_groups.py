"""Compares the light groups of a picture by photoncard with those of Cycles.

    python3 light_groups.py make FOLDER
    python3 light_groups.py compare FOLDER PICTURE.exr

`make` builds a room with two lamps, a point light and a window to a constant sky, each in a light group, exports it to FOLDER/room.glb
with the groups as custom properties, and renders FOLDER/cycles.exr. `compare` prints, for each group and for the whole, the mean of the
picture over that of Cycles, and the median and the 95th percentile of the relative errors of blocks of 20 x 20 pixels. It also checks that
the picture is the sum of its groups, bit for bit. It needs the packages bpy 5.0, numpy and OpenEXR."""

import math
import os
import sys

import numpy as np
import OpenEXR

SKY = (0.3, 0.45, 0.8)
SIZE = (320, 240)
SAMPLES = 1024
BLOCK = 20
GROUPS = ("key", "fill", "point", "sky")


def build():
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene

    def material(name, colour, emission=None):
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        nodes = made.node_tree.nodes
        principled = nodes["Principled BSDF"]
        principled.inputs["Base Color"].default_value = (*colour, 1)
        principled.inputs["Roughness"].default_value = 1
        principled.inputs["Specular IOR Level"].default_value = 0
        if emission:
            principled.inputs["Emission Color"].default_value = (*emission[0], 1)
            principled.inputs["Emission Strength"].default_value = emission[1]
        return made

    def mesh(name, faces, made, group=None):
        vertices = [vertex for face in faces for vertex in face]
        data = bpy.data.meshes.new(name)
        data.from_pydata(vertices, [], [tuple(range(4 * index, 4 * index + 4)) for index in range(len(faces))])
        data.materials.append(made)
        placed = bpy.data.objects.new(name, data)
        scene.collection.objects.link(placed)
        state(placed, group)
        return placed

    def state(placed, group):
        if group:
            placed.lightgroup = group
            placed["photoncard"] = {"light_group": group}

    for group in GROUPS:
        bpy.context.view_layer.lightgroups.add(name=group)
    white, red, green = (material(name, colour) for name, colour in
                         (("white", (0.7, 0.7, 0.7)), ("red", (0.6, 0.1, 0.1)), ("green", (0.1, 0.5, 0.15))))
    # A room of 6 x 5 x 3 m, open in front of the camera's back; the right wall has a window.
    mesh("floor", [[(-3, -2.5, 0), (3, -2.5, 0), (3, 2.5, 0), (-3, 2.5, 0)]], white)
    mesh("ceiling", [[(-3, 2.5, 3), (3, 2.5, 3), (3, -2.5, 3), (-3, -2.5, 3)]], white)
    mesh("back", [[(-3, 2.5, 0), (3, 2.5, 0), (3, 2.5, 3), (-3, 2.5, 3)]], white)
    mesh("front", [[(3, -2.5, 0), (-3, -2.5, 0), (-3, -2.5, 3), (3, -2.5, 3)]], white)
    mesh("left", [[(-3, -2.5, 0), (-3, 2.5, 0), (-3, 2.5, 3), (-3, -2.5, 3)]], red)
    mesh("right", [
        [(3, 2.5, 0), (3, -2.5, 0), (3, -2.5, 1), (3, 2.5, 1)], [(3, 2.5, 2.2), (3, -2.5, 2.2), (3, -2.5, 3), (3, 2.5, 3)],
        [(3, 2.5, 1), (3, 1, 1), (3, 1, 2.2), (3, 2.5, 2.2)], [(3, -1, 1), (3, -2.5, 1), (3, -2.5, 2.2), (3, -1, 2.2)],
    ], green)
    bpy.ops.mesh.primitive_cube_add(size=1, location=(-1, 1, 0.5), rotation=(0, 0, 0.4))
    bpy.context.object.data.materials.append(white)
    # Both lamps share one material: their groups are those of the objects.
    lamp = material("lamp", (0, 0, 0), ((1, 0.8, 0.5), 6))
    mesh("ceiling lamp", [[(-1.5, 0.5, 2.98), (-1.5, -0.5, 2.98), (-0.5, -0.5, 2.98), (-0.5, 0.5, 2.98)][::-1]], lamp, "key")
    mesh("wall lamp", [[(-2.98, -1.5, 1), (-2.98, -0.9, 1), (-2.98, -0.9, 1.6), (-2.98, -1.5, 1.6)]], lamp, "fill")
    data = bpy.data.lights.new("bulb", "POINT")
    data.energy, data.color, data.shadow_soft_size, data.use_soft_falloff = 60, (0.5, 0.7, 1), 0, False
    bulb = bpy.data.objects.new("bulb", data)
    bulb.location = (1.5, 1.2, 1.2)
    scene.collection.objects.link(bulb)
    state(bulb, "point")
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*SKY, 1)
    world.lightgroup = "sky"
    scene.world = world
    data = bpy.data.cameras.new("camera")
    data.angle = math.radians(75)
    camera = bpy.data.objects.new("camera", data)
    camera.location, camera.rotation_euler = (0.5, -2.3, 1.5), (math.radians(88), 0, math.radians(4))
    scene.collection.objects.link(camera)
    scene.camera = camera
    (scene.render.resolution_x, scene.render.resolution_y) = SIZE
    return scene


def make(folder):
    import bpy

    scene = build()
    bpy.ops.export_scene.gltf(filepath=os.path.join(folder, "room.glb"), export_lights=True, export_cameras=True, export_extras=True)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising = SAMPLES, False, False
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 64
    scene.cycles.sample_clamp_indirect = 0
    scene.render.filter_size = 0.01
    settings = scene.render.image_settings
    # Blender 5 has a kind of media before the format.
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = os.path.join(folder, "cycles.exr")
    bpy.ops.render.render(write_still=True)
    sys.stdout.flush()
    # Blender's module may hang at the end of the process.
    os._exit(0)


def channels(path):
    """Channels of all parts of a file."""
    parts = OpenEXR.File(path, separate_channels=True).parts
    return {name: channel.pixels for part in parts for name, channel in part.channels.items()}


def compare(folder, picture):
    own, theirs = channels(picture), channels(os.path.join(folder, "cycles.exr"))

    def colour(of, end):
        names = [next(name for name in of if name == f"{end}{part}" or name.endswith(f".{end}{part}")) for part in "RGB"]
        return np.stack([of[name] for name in names], axis=-1).astype(np.float32)

    total = None
    for group in sorted(GROUPS):
        light = colour(own, f"light_{group}.")
        total = light if total is None else total + light
    whole = colour(own, "")
    is_sum = np.array_equal(total, whole)
    print(f"the picture is the sum of its groups: {is_sum}")
    failed = not is_sum
    for name in (*GROUPS, "all"):
        found = whole if name == "all" else colour(own, f"light_{name}.")
        expected = colour(theirs, "Combined." if name == "all" else f"Combined_{name}.")

        def blocks(image):
            rows, columns = (side // BLOCK for side in image.shape[:2])
            return image[:rows * BLOCK, :columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3, 4))

        errors = np.abs(blocks(found) / blocks(expected) - 1)
        mean = found.mean() / expected.mean()
        print(f"{name:6} mean {mean:.4f}, median block {np.median(errors):.4f}, 95 % {np.percentile(errors, 95):.4f}")
        failed |= abs(mean - 1) > 0.02
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    make(sys.argv[2]) if sys.argv[1] == "make" else compare(sys.argv[2], sys.argv[3])
