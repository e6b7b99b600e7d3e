"""Scenes of the tests, built in Python."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Vector

WIDTH, HEIGHT = 160, 90


def clear() -> bpy.types.Scene:
    """An empty scene with the test's size."""
    for collection in (
        bpy.data.objects,
        bpy.data.meshes,
        bpy.data.materials,
        bpy.data.lights,
        bpy.data.cameras,
        bpy.data.images,
        bpy.data.worlds,
        bpy.data.curves,
    ):
        for item in list(collection):
            collection.remove(item)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("world")
    use_nodes(scene.world)
    world_input(scene, "Color").default_value = (0, 0, 0, 1)
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    scene.render.film_transparent = False
    scene.render.use_border = False
    for _ in list(bpy.context.view_layer.lightgroups):
        bpy.ops.scene.view_layer_remove_lightgroup()
    return scene


def use_nodes(owner: bpy.types.ID) -> None:
    """Gives a material or a world nodes; since Blender 5.0 they have them."""
    if bpy.app.version < (5, 0, 0):
        owner.use_nodes = True


def world_input(scene: bpy.types.Scene, name: str) -> bpy.types.NodeSocket:
    """An input of the world's background."""
    return scene.world.node_tree.nodes["Background"].inputs[name]


def material(name: str, colour: tuple[float, float, float], **inputs: object) -> bpy.types.Material:
    """A material of a Principled BSDF; `Emission_Strength=2` sets the input *Emission Strength*."""
    made = bpy.data.materials.new(name)
    use_nodes(made)
    node = made.node_tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (*colour, 1)
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    return made


def matte(name: str, colour: tuple[float, float, float]) -> bpy.types.Material:
    """A Lambertian material."""
    return material(name, colour, Specular_IOR_Level=0.0, Roughness=1.0)


def mesh(name: str, vertices: list, faces: list, *materials: bpy.types.Material) -> bpy.types.Object:
    """An object of a mesh."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    for each in materials:
        data.materials.append(each)
    return placed(name, data)


def placed(
    name: str, data: bpy.types.ID, location: tuple = (0, 0, 0), turn: tuple = (0, 0, 0)
) -> bpy.types.Object:
    """An object of some data."""
    ob = bpy.data.objects.new(name, data)
    ob.location, ob.rotation_euler = location, turn
    bpy.context.scene.collection.objects.link(ob)
    return ob


def box(name: str, low: tuple, high: tuple, made: bpy.types.Material) -> bpy.types.Object:
    """A closed box."""
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh(name, corners, faces, made)


def quad(name: str, corners: list, made: bpy.types.Material) -> bpy.types.Object:
    """A quadrilateral with a UV map."""
    ob = mesh(name, corners, [(0, 1, 2, 3)], made)
    layer = ob.data.uv_layers.new(name="UVMap")
    for loop, uv in zip(layer.uv, ((0, 0), (1, 0), (1, 1), (0, 1))):
        loop.vector = uv
    return ob


def sphere(name: str, centre: tuple, radius: float, made: bpy.types.Material) -> bpy.types.Object:
    """A smooth sphere."""
    across, down = 32, 16
    points = [(0, 0, -radius)]
    for row in range(1, down):
        height, ring = -math.cos(math.pi * row / down), math.sin(math.pi * row / down)
        for column in range(across):
            turn = 2 * math.pi * column / across
            points.append((radius * ring * math.cos(turn), radius * ring * math.sin(turn), radius * height))
    points.append((0, 0, radius))
    at = lambda row, column: 1 + (row - 1) * across + column % across  # noqa: E731
    faces = [(0, at(1, c + 1), at(1, c)) for c in range(across)]
    faces += [
        (at(r, c), at(r, c + 1), at(r + 1, c + 1), at(r + 1, c))
        for r in range(1, down - 1)
        for c in range(across)
    ]
    faces += [(len(points) - 1, at(down - 1, c), at(down - 1, c + 1)) for c in range(across)]
    ob = mesh(name, points, faces, made)
    ob.location = centre
    ob.data.polygons.foreach_set("use_smooth", [True] * len(ob.data.polygons))
    return ob


def lamp(
    name: str, kind: str, location: tuple, turn: tuple = (0, 0, 0), **properties: object
) -> bpy.types.Object:
    """A light."""
    light = bpy.data.lights.new(name, kind)
    for key, value in properties.items():
        setattr(light, key, value)
    return placed(name, light, location, turn)


def camera(location: tuple, target: tuple, **properties: object) -> bpy.types.Object:
    """The scene's camera, which looks at a point."""
    data = bpy.data.cameras.new("camera")
    for key, value in properties.items():
        setattr(data, key, value)
    turn = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = placed("camera", data, location, tuple(turn))
    return bpy.context.scene.camera


def image(name: str, pixels: np.ndarray, is_float: bool = False, is_data: bool = False) -> bpy.types.Image:
    """A generated image of pixels of the shape (height, width, 4), the bottom line first."""
    height, width, _ = pixels.shape
    made = bpy.data.images.new(name, width, height, alpha=True, float_buffer=is_float, is_data=is_data)
    made.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).reshape(-1))
    made.pack()
    return made


def texture(made: bpy.types.Material, picture: bpy.types.Image, socket: str) -> bpy.types.Node:
    """Feeds an input of a Principled BSDF by an image."""
    tree = made.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = picture
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs[socket])
    return node


def checker() -> np.ndarray:
    """A board of two colours."""
    board = np.indices((64, 64)).sum(axis=0) // 8 % 2
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = np.where(board[..., None], (0.8, 0.7, 0.5), (0.2, 0.15, 0.1))
    return pixels


def environment(scene: bpy.types.Scene, strength: float, turn: float = 0.0) -> None:
    """A sky with a bright patch, turned about Z."""
    pixels = np.ones((64, 128, 4), np.float32)
    pixels[..., :3] = (0.3, 0.4, 0.6)
    pixels[:32, :, :3] = (0.2, 0.18, 0.15)
    pixels[36:52, 20:44, :3] = (6.0, 5.0, 4.0)
    tree = scene.world.node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image("sky", pixels, is_float=True)
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value[2] = turn
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    world_input(scene, "Strength").default_value = strength


def room() -> bpy.types.Scene:
    """A furnished room: sun through a window, area lamps, glass, brass, a sky."""
    scene = clear()
    white, red = matte("white", (0.75, 0.75, 0.72)), matte("red", (0.6, 0.12, 0.1))
    floor = material("floor", (0.8, 0.8, 0.8), Roughness=0.5)
    texture(floor, image("board", checker()), "Base Color")
    quad("floor", [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], floor)
    quad("ceiling", [(-2, 2, 2.5), (2, 2, 2.5), (2, -2, 2.5), (-2, -2, 2.5)], white)
    quad("back", [(-2, 2, 0), (2, 2, 0), (2, 2, 2.5), (-2, 2, 2.5)], white)
    quad("left", [(-2, -2, 0), (-2, 2, 0), (-2, 2, 2.5), (-2, -2, 2.5)], red)
    # The right wall has a window.
    for index, (y0, y1, z0, z1) in enumerate(
        ((-2, 2, 0, 0.9), (-2, 2, 2, 2.5), (-2, -0.5, 0.9, 2), (1, 2, 0.9, 2))
    ):
        quad(f"right{index}", [(2, y1, z0), (2, y0, z0), (2, y0, z1), (2, y1, z1)], white)
    box(
        "table",
        (-0.9, 0, 0),
        (0.5, 0.9, 0.7),
        material("wood", (0.35, 0.2, 0.1), Roughness=0.4, Coat_Weight=0.3),
    )
    sphere(
        "glass",
        (-0.5, 0.4, 0.95),
        0.25,
        material("glass", (1, 1, 1), Transmission_Weight=1.0, Roughness=0.0, IOR=1.45),
    )
    sphere("brass", (0.15, 0.4, 0.9), 0.2, material("brass", (0.9, 0.7, 0.3), Metallic=1.0, Roughness=0.25))
    lamp("sun", "SUN", (4, 0, 4), (0, math.radians(50), math.radians(10)), energy=6, angle=math.radians(2))
    lamp("panel", "AREA", (-0.5, 0.5, 2.4), (0, 0, 0), energy=40, size=0.6, color=(1, 0.8, 0.6))
    lamp(
        "disk",
        "AREA",
        (-1.8, -1, 1.5),
        (0, math.radians(-90), 0),
        energy=15,
        shape="ELLIPSE",
        size=0.3,
        size_y=0.6,
    )
    environment(scene, 1.0, math.radians(120))
    camera((0.4, -1.9, 1.5), (-0.3, 1, 0.9), lens=18)
    return scene


def product() -> bpy.types.Scene:
    """A product shot: softboxes, depth of field, a transparent film."""
    scene = clear()
    plastic = material("plastic", (0.1, 0.25, 0.6), Roughness=0.3, Coat_Weight=1.0, Coat_Roughness=0.05)
    sphere("ball", (0, 0, 0.5), 0.5, plastic)
    box("plinth", (-0.8, -0.8, -0.2), (0.8, 0.8, 0), matte("stone", (0.5, 0.5, 0.5)))
    sphere("far", (1.4, 2.5, 0.4), 0.4, material("chrome", (0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.1))
    lamp(
        "key",
        "AREA",
        (-2, -2, 2.5),
        (math.radians(55), 0, math.radians(-45)),
        energy=150,
        shape="RECTANGLE",
        size=1,
        size_y=1.5,
    )
    lamp(
        "rim",
        "AREA",
        (2, 1.5, 2),
        (math.radians(-60), math.radians(20), math.radians(-40)),
        energy=80,
        size=0.8,
        color=(0.7, 0.8, 1),
    )
    lamp("fill", "POINT", (2, -3, 1), energy=60, shadow_soft_size=0.2)
    world_input(scene, "Color").default_value = (0.1, 0.12, 0.15, 1)
    scene.render.film_transparent = True
    view = camera((0, -4, 1.6), (0, 0, 0.4), lens=60)
    view.data.dof.use_dof = True
    view.data.dof.focus_object = bpy.data.objects["ball"]
    view.data.dof.aperture_fstop = 0.5
    return scene


def plan() -> bpy.types.Scene:
    """An orthographic plan, by a camera that is moved and shifted, with an instance and a text."""
    scene = clear()
    quad("ground", [(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], matte("ground", (0.6, 0.6, 0.55)))
    house = box("house", (-1, -0.7, 0), (1, 0.7, 1), matte("house", (0.7, 0.3, 0.2)))
    other = placed("other", house.data, (1.8, 1.4, 0), (0, 0, 0.5))
    other.scale = (0.6, 0.6, 1.5)
    label = bpy.data.curves.new("label", "FONT")
    label.body = "N"
    label.extrude = 0.05
    label.materials.append(matte("ink", (0.05, 0.05, 0.05)))
    placed("label", label, (-2.5, 0.5, 0.06))
    lamp("sun", "SUN", (0, 0, 5), (math.radians(35), math.radians(20), 0), energy=3, angle=math.radians(0.5))
    lamp(
        "spot",
        "SPOT",
        (-1.5, -1.2, 3),
        energy=300,
        spot_size=math.radians(50),
        spot_blend=0.4,
        shadow_soft_size=0.0,
    )
    world_input(scene, "Color").default_value = (0.2, 0.25, 0.3, 1)
    camera((0.3, -0.2, 8), (0.3, -0.2, 0), type="ORTHO", ortho_scale=7, shift_x=0.05)
    return scene
