"""Three furnished rooms in Blender, in metres: a sunlit living room, an evening room, a kitchen with a bath."""

import math
from itertools import pairwise

import bmesh
import bpy
import numpy as np

import room

PLASTER, OAK = (0.75, 0.73, 0.7), (0.5, 0.3, 0.15)
BRASS, CHROME, STEEL = (0.9, 0.65, 0.25), (0.75, 0.77, 0.8), (0.62, 0.6, 0.57)
# The material of slabs that light passes straight, which Lambertian rooms do without.
PANE = "pane"


class Interior:
    """A room: what builds it, and the radiance of its sky."""

    def __init__(self, build, sky):
        self.build, self.sky = build, sky


def living_room():
    """Sun and sky through a window with panes, blinds before one of them, and a carpet of tufts."""
    begin((0.6, -2.3, 1.5), (-0.2, 0.8, 0.75), 68.0)
    plaster, oak = matt("plaster", PLASTER), matt("oak", OAK, roughness=0.5)
    cube("floor", (0, 0, -0.1), (4.4, 5.4, 0.2), matt("boards", (0.4, 0.25, 0.14), roughness=0.4))
    cube("ceiling", (0, 0, 2.7), (4.4, 5.4, 0.2), plaster)
    cube("back", (0, 2.6, 1.3), (4.4, 0.2, 2.6), plaster)
    cube("front", (0, -2.6, 1.3), (4.4, 0.2, 2.6), plaster)
    cube("right", (2.1, 0, 1.3), (0.2, 5, 2.6), matt("blue wall", (0.3, 0.4, 0.55)))
    cube("sill", (-2.1, 0, 0.4), (0.2, 5, 0.8), plaster)
    cube("lintel", (-2.1, 0, 2.35), (0.2, 5, 0.5), plaster)
    cube("pier", (-2.1, -1.5, 1.45), (0.2, 2, 1.3), plaster)
    cube("pier", (-2.1, 1.9, 1.45), (0.2, 1.2, 1.3), plaster)
    paint = matt("frame", (0.8, 0.8, 0.8))
    for y in (-0.48, 0.4, 1.28):
        cube("frame", (-2.1, y, 1.45), (0.06, 0.04, 1.3), paint)
    panes = glass(PANE, (1.0, 1.0, 1.0))
    for y in (-0.04, 0.84):
        cube("pane", (-2.1, y, 1.45), (0.006, 0.84, 1.3), panes)
    slat = turned_box((0.05, 0.84, 0.0015), math.radians(30.0))
    slats = [slat + (-1.95, -0.04, 0.85 + 0.05 * index) for index in range(25)]
    boxes("blinds", slats, matt("slats", (0.8, 0.75, 0.6), roughness=0.4))
    carpet()
    living_furniture(oak)
    sun = bpy.data.lights.new("sun", "SUN")
    # A sun with an extent is no point in the file.
    sun.energy, sun.angle = 5.0, 0.0
    room.place(bpy.context.scene, sun, (-5, -0.6, 4.4), (0.2, 0.7, 0.0))


def carpet(spacing=0.012, height=0.018):
    """A backing of 5 mm, and blades of three triangles each that lean at random."""
    wool = matt("wool", (0.6, 0.2, 0.12))
    cube("backing", (0.1, 0.4, 0.0025), (2.2, 1.8, 0.005), wool)
    random = np.random.default_rng(1)
    x, y = np.meshgrid(np.arange(-0.99, 1.2, spacing), np.arange(-0.49, 1.3, spacing))
    feet = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.005)], axis=1)
    feet[:, :2] += random.uniform(-0.3, 0.3, (len(feet), 2)) * spacing
    angle = random.uniform(0.0, 2.0 * math.pi, len(feet))
    width = 0.003 * np.stack([np.cos(angle), np.sin(angle), np.zeros(len(feet))], axis=1)
    lean = random.normal(0.0, 0.35, (len(feet), 3)) * height
    lean[:, 2] = height * random.uniform(0.7, 1.0, len(feet))
    corners = [feet - width, feet + width, feet - 0.8 * width + 0.4 * lean, feet + 0.8 * width + 0.4 * lean]
    tip = feet + lean + np.array([0.0, 0.0, -0.2]) * np.abs(lean)
    vertices = np.stack([*corners, tip], axis=1).reshape(-1, 3)
    first = 5 * np.arange(len(feet))[:, None, None]
    faces = (first + np.array([[0, 1, 3], [0, 3, 2], [2, 3, 4]])).reshape(-1, 3)
    mesh("tufts", vertices, faces, wool)


def living_furniture(oak):
    """A table with chrome legs and a lamp on the carpet, a sofa partly, and a shelf with books beside it."""
    cube("table", (0.2, 0.5, 0.42), (1.0, 0.6, 0.03), oak)
    chrome = metal("chrome", CHROME, 0.2)
    for x in (-0.25, 0.65):
        for y in (0.25, 0.75):
            rod("leg", (x, y, 0.005), (x, y, 0.405), 0.02, chrome)
    cloth = matt("cloth", (0.25, 0.4, 0.2))
    cube("seat", (1.45, 0.5, 0.28), (0.8, 1.8, 0.3), cloth)
    cube("rest", (1.85, 0.5, 0.6), (0.2, 1.8, 0.34), cloth)
    for y in (-0.45, 1.45):
        cube("arm", (1.45, y, 0.35), (0.8, 0.1, 0.45), cloth)
    for x in (1.1, 1.8):
        for y in (-0.4, 1.4):
            cube("foot", (x, y, 0.065), (0.06, 0.06, 0.13), oak)
    brass = metal("brass", BRASS, 0.25)
    rod("lamp foot", (-0.85, 1.15, 0.005), (-0.85, 1.15, 0.03), 0.14, brass)
    rod("lamp pole", (-0.85, 1.15, 0.03), (-0.85, 1.15, 1.45), 0.012, brass)
    room.ball("bulb", (-0.85, 1.15, 1.49), 0.04, emitter("bulb", (1.0, 0.75, 0.45), 150.0))
    bpy.ops.mesh.primitive_cone_add(
        vertices=48, radius1=0.2, radius2=0.12, depth=0.25, location=(-0.85, 1.15, 1.5), end_fill_type="NOTHING"
    )
    room.finish("shade", matt("paper", (0.85, 0.8, 0.7)))
    for z in (0.02, 0.5, 1.0, 1.5):
        cube("shelf", (-1.2, 2.35, z), (1.2, 0.3, 0.02), oak)
    for x in (-1.81, -0.59):
        cube("side", (x, 2.35, 0.78), (0.02, 0.3, 1.5), oak)
    random = np.random.default_rng(2)
    for z in (0.51, 1.01):
        for index in range(18):
            height, depth = random.uniform(0.2, 0.35), random.uniform(0.15, 0.22)
            book = matt(f"book {z} {index}", tuple(random.uniform(0.05, 0.7, 3)))
            middle = (-1.75 + 0.05 * index, 2.49 - depth / 2.0, z + height / 2.0)
            cube("book", middle, (random.uniform(0.02, 0.045), depth, height), book)


def evening_room():
    """A chandelier of glass drops and brass arms with six bulbs, candles, a table of glass, and a mirror."""
    begin((0.5, -2.3, 1.45), (-0.05, 0.8, 1.15), 70.0)
    plaster, red = matt("plaster", PLASTER), matt("red wall", (0.5, 0.12, 0.1))
    # Walls of boxes side by side, whose faces touch.
    for y in (-1.25, 1.25):
        cube("floor", (0, y, -0.1), (4.6, 2.5, 0.2), matt(f"floor {y}", (0.3, 0.2, 0.12), roughness=0.3))
        cube("ceiling", (0, y, 2.8), (4.6, 2.5, 0.2), plaster)
        cube("left", (-2.2, y, 1.35), (0.2, 2.5, 2.7), red)
        cube("right", (2.2, y, 1.35), (0.2, 2.5, 2.7), plaster)
    for x in (-1.15, 1.15):
        cube("back", (x, 2.6, 1.35), (2.3, 0.2, 2.7), plaster)
        cube("front", (x, -2.6, 1.35), (2.3, 0.2, 2.7), plaster)
    brass = metal("brass", BRASS, 0.2)
    chandelier(brass)
    cube("top", (0, 0.6, 0.756), (1.3, 0.8, 0.012), glass("table glass", (0.9, 1.0, 0.95)))
    for x in (-0.55, 0.55):
        for y in (0.3, 0.9):
            rod("leg", (x, y, 0.0), (x, y, 0.75), 0.02, brass)
    flame = emitter("flame", (1.0, 0.6, 0.25), 400.0)
    for x in (-0.2, 0.15):
        rod("candle", (x, 0.55, 0.762), (x, 0.55, 0.93), 0.015, matt("wax", (0.8, 0.75, 0.6)))
        room.ball("flame", (x, 0.55, 0.95), 0.012, flame)
    mirror = metal("mirror", (0.95, 0.95, 0.95), 0.0)
    cube("mirror", (-0.9, 2.485, 1.45), (1.2, 0.03, 1.0), mirror)
    oak = matt("oak", OAK, roughness=0.4)
    for x in (-1.53, -0.27):
        cube("frame", (x, 2.48, 1.45), (0.06, 0.04, 1.12), oak)
    for z in (0.92, 1.98):
        cube("frame", (-0.9, 2.48, z), (1.2, 0.04, 0.06), oak)
    cube("sideboard", (1.2, 2.25, 0.4), (1.4, 0.45, 0.8), oak)
    room.ball("vase", (1.2, 2.25, 0.95), 0.15, metal("copper", (0.95, 0.55, 0.4), 0.3))
    room.ball("night light", (1.75, 2.25, 0.86), 0.06, emitter("night light", (0.5, 0.7, 1.0), 6.0))
    for x in (-0.9, 0.9):
        cube("seat", (x, 0.6, 0.43), (0.45, 0.45, 0.05), oak)
        cube("rest", (x * 1.24, 0.6, 0.7), (0.03, 0.45, 0.6), oak)
        for dx in (-0.19, 0.19):
            for dy in (-0.19, 0.19):
                cube("leg", (x + dx, 0.6 + dy, 0.2025), (0.04, 0.04, 0.405), oak)


def chandelier(brass):
    """Six arms of brass with bulbs above their ends, and three rings of drops below."""
    crystal = glass("crystal", (1.0, 1.0, 1.0), ior=1.55)
    bulb = emitter("bulb", (1.0, 0.8, 0.55), 90.0)
    rod("rod", (0, 0.6, 2.7), (0, 0.6, 1.95), 0.012, brass)
    room.ball("hub", (0, 0.6, 1.95), 0.06, brass)
    for index in range(6):
        angle = math.pi * index / 3.0
        across = np.array([math.cos(angle), math.sin(angle), 0.0])
        sag = [(t, -0.12 * math.sin(math.pi * t)) for t in np.linspace(0, 1, 7)]
        points = [(0, 0.6, 1.95 + depth) + 0.42 * t * across for t, depth in sag]
        for start, end in pairwise(points):
            rod("arm", start, end, 0.01, brass)
        rod("cup", points[-1], points[-1] + (0, 0, 0.04), 0.03, brass)
        room.ball("bulb", points[-1] + (0, 0, 0.08), 0.03, bulb)
    for radius, height, count in ((0.42, 1.86, 24), (0.28, 1.76, 18), (0.14, 1.7, 10)):
        for index in range(count):
            angle = 2.0 * math.pi * (index + 0.5) / count
            drop((radius * math.cos(angle), 0.6 + radius * math.sin(angle), height), crystal)


def drop(where, crystal):
    """A drop of 20 facets, twice as high as wide."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=1, radius=0.02, location=where)
    bpy.context.object.scale = (1.0, 1.0, 2.0)
    room.finish("drop", crystal, is_smooth=False)


def kitchen():
    """Metal appliances, tiles with gaps of 2 mm, a frosted door, a bottle, shelves of sheets, a one-sided curtain."""
    begin((0.2, -1.9, 1.5), (-0.1, 0.9, 1.0), 72.0)
    plaster, grout = matt("plaster", PLASTER), matt("grout", (0.35, 0.34, 0.33))
    cube("floor", (0, 0, -0.1), (3.4, 4.4, 0.2), grout)
    cube("ceiling", (0, 0, 2.5), (3.4, 4.4, 0.2), plaster)
    cube("back", (0, 2.1, 1.2), (3.4, 0.2, 2.4), grout)
    cube("front", (0, -2.1, 1.2), (3.4, 0.2, 2.4), plaster)
    cube("right", (1.6, 0, 1.2), (0.2, 4.0, 2.4), plaster)
    cube("left", (-1.6, -0.85, 1.2), (0.2, 2.3, 2.4), plaster)
    cube("left", (-1.6, 1.55, 1.2), (0.2, 0.9, 2.4), plaster)
    cube("left", (-1.6, 0.7, 2.2), (0.2, 0.8, 0.4), plaster)
    tile = matt("tile", (0.75, 0.76, 0.72), roughness=0.25)
    floor = [(x, y, 0.004) for x in np.arange(-1.4, 1.5, 0.2) for y in np.arange(-1.9, 2.0, 0.2)]
    boxes("floor tiles", [turned_box((0.198, 0.198, 0.008), 0.0) + middle for middle in floor], tile)
    wall = [(x, 1.996, z) for x in np.arange(-1.425, 1.5, 0.15) for z in np.arange(0.083, 1.6, 0.15)]
    boxes("wall tiles", [turned_box((0.148, 0.008, 0.148), 0.0) + middle for middle in wall], tile)
    shower(matt("white", (0.8, 0.8, 0.8)))
    appliances()
    shelves()
    curtain()
    lamp = emitter("panel", (1.0, 0.95, 0.85), 12.0)
    lamp.use_backface_culling = True
    sheet = [(-0.3, -0.3, 2.39), (-0.3, 0.3, 2.39), (0.3, 0.3, 2.39), (0.3, -0.3, 2.39)]
    mesh("panel", sheet, [(0, 1, 2, 3)], lamp)


def shower(white):
    """A small room of its own light behind a door of frosted glass."""
    cube("shower", (-2.2, 0.7, -0.05), (1.0, 1.0, 0.1), white)
    cube("shower", (-2.2, 0.7, 2.45), (1.0, 1.0, 0.1), white)
    cube("shower", (-2.75, 0.7, 1.2), (0.1, 1.2, 2.6), white)
    cube("shower", (-2.2, 0.15, 1.2), (1.0, 0.1, 2.6), white)
    cube("shower", (-2.2, 1.25, 1.2), (1.0, 0.1, 2.6), white)
    cube("door", (-1.6, 0.7, 1.0), (0.01, 0.8, 2.0), glass("frosted", (0.9, 0.95, 1.0), roughness=0.5))
    room.ball("shower lamp", (-2.3, 0.7, 2.1), 0.1, emitter("shower lamp", (0.6, 0.8, 1.0), 12.0))


def appliances():
    """All of metal, on the tiles of the floor."""
    steel, chrome = metal("steel", STEEL, 0.3), metal("chrome", CHROME, 0.15)
    cube("fridge", (1.15, 1.64, 0.908), (0.68, 0.68, 1.8), steel)
    rod("handle", (0.9, 1.26, 0.7), (0.9, 1.26, 1.3), 0.012, chrome)
    for z in (0.72, 1.28):
        rod("handle", (0.9, 1.26, z), (0.9, 1.3, z), 0.008, chrome)
    cube("oven", (-0.2, 1.66, 0.433), (1.9, 0.6, 0.85), steel)
    cube("counter", (-0.2, 1.65, 0.873), (1.96, 0.66, 0.03), metal("worktop", STEEL, 0.4))
    room.ball("kettle", (0.35, 1.6, 1.0), 0.112, chrome)
    rod("pot", (-0.1, 1.65, 0.888), (-0.1, 1.65, 1.04), 0.13, metal("copper", (0.95, 0.55, 0.4), 0.25))
    bottle((-0.7, 1.6, 0.8885))


def bottle(foot):
    """Green glass, 4 mm thick, and a red liquid with a gap of air of half a millimetre."""
    outer = [(0.0, 0.0), (0.04, 0.0), (0.042, 0.004), (0.042, 0.17), (0.016, 0.22), (0.016, 0.3)]
    inner = [(0.012, 0.3), (0.012, 0.222), (0.038, 0.169), (0.038, 0.006), (0.0, 0.005)]
    turned("bottle", foot, [*outer, *inner], glass("green glass", (0.3, 0.8, 0.4)))
    liquid = [(0.0, 0.0055), (0.0375, 0.0065), (0.0375, 0.13), (0.0, 0.13)]
    turned("liquid", foot, liquid, glass("liquid", (0.8, 0.15, 0.1), ior=1.33))


def shelves():
    """Sheets of 1 mm on the wall, with cups."""
    enamel, cup = matt("enamel", (0.2, 0.45, 0.5)), matt("cup", (0.85, 0.82, 0.75), roughness=0.2)
    for z in (1.4, 1.6, 1.8):
        cube("sheet", (-0.5, 1.867, z), (1.2, 0.25, 0.001), enamel)
        for index in range(5):
            x = -0.95 + 0.2 * index
            rod("cup", (x, 1.87, z + 0.0006), (x, 1.87, z + 0.09), 0.035, cup)


def curtain(side=128, squares=16):
    """A wavy sheet seen from its front alone, with a texture of squares, along the right wall."""
    rows, columns = np.mgrid[:side, :side]
    is_dark = (rows * squares // side + columns * squares // side) % 2 == 1
    colours = np.where(is_dark[..., None], (0.1, 0.1, 0.4, 1.0), (0.8, 0.75, 0.6, 1.0))
    image = bpy.data.images.new("squares", side, side)
    image.pixels.foreach_set(colours.astype(np.float32).ravel())
    image.pack()
    cloth = matt("curtain", (1.0, 1.0, 1.0))
    cloth.use_backface_culling = True
    texture = cloth.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    socket = cloth.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    cloth.node_tree.links.new(texture.outputs["Color"], socket)
    across, up = 97, 9
    v, u = np.mgrid[0 : 1 : up * 1j, 0 : 1 : across * 1j]
    x = 1.3 + 0.05 * np.sin(2.0 * math.pi * 8.0 * u)
    vertices = np.stack([x, -0.8 + 1.6 * u, 0.05 + 2.2 * v], axis=-1).reshape(-1, 3)
    first = (across * np.arange(up - 1)[:, None] + np.arange(across - 1)).reshape(-1, 1)
    faces = first + np.array([0, across, across + 1, 1])
    thing = mesh("curtain", vertices, faces, cloth, is_smooth=True)
    layer = thing.data.uv_layers.new()
    corners = np.array([loop.vertex_index for loop in thing.data.loops])
    layer.data.foreach_set("uv", np.stack([u.ravel(), v.ravel()], axis=1)[corners].astype(np.float32).ravel())
    rod("rail", (1.3, -0.85, 2.27), (1.3, 0.85, 2.27), 0.01, metal("rail", BRASS, 0.3))


INTERIORS = {
    "living-room": Interior(living_room, (0.5, 0.7, 1.0)),
    "evening": Interior(evening_room, None),
    "kitchen": Interior(kitchen, None),
}


def begin(eye, towards, angle):
    """An empty scene with a camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    camera = bpy.data.cameras.new("camera")
    camera.angle = math.radians(angle)
    bpy.context.scene.camera = room.place(bpy.context.scene, camera, eye, towards)


def matt(name, colour, roughness=None):
    """Lambertian, or with a dielectric's lobe if a roughness is given; one for each name."""
    if name in bpy.data.materials:
        return bpy.data.materials[name]
    gloss = {"Specular IOR Level": 0.0} if roughness is None else {"Roughness": roughness}
    return room.material(name, colour, **gloss)


def metal(name, colour, roughness):
    """A metal; one for each name."""
    if name in bpy.data.materials:
        return bpy.data.materials[name]
    return room.material(name, colour, Metallic=1.0, Roughness=roughness)


def glass(name, colour, roughness=0.0, ior=1.45):
    """Glass, tinted at its faces."""
    return room.material(name, colour, Roughness=roughness, IOR=ior, **{"Transmission Weight": 1.0})


def emitter(name, colour, strength):
    """A black surface that emits."""
    light = {"Emission Color": (*colour, 1.0), "Emission Strength": strength}
    return room.material(name, (0.0, 0.0, 0.0), **{"Specular IOR Level": 0.0}, **light)


def mesh(name, vertices, faces, surface, is_smooth=False):
    """An object of a mesh."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(np.asarray(vertices).tolist(), [], np.asarray(faces).tolist())
    data.materials.append(surface)
    data.polygons.foreach_set("use_smooth", [is_smooth] * len(data.polygons))
    data.update()
    thing = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def cube(name, middle, size, surface):
    """A box."""
    boxes(name, [turned_box(size, 0.0) + middle], surface)


def turned_box(size, angle):
    """Corners of a box about the origin, turned about y."""
    corners = np.array(list(np.ndindex(2, 2, 2))) - 0.5
    x, y, z = (corners * size).T
    return np.stack([x * math.cos(angle) + z * math.sin(angle), y, z * math.cos(angle) - x * math.sin(angle)], axis=1)


def boxes(name, corners, surface):
    """Boxes as one mesh, by the corners of each."""
    sides = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    faces = (8 * np.arange(len(corners))[:, None, None] + sides).reshape(-1, 4)
    mesh(name, np.concatenate(corners), faces, surface)


def rod(name, start, end, radius, surface):
    """A cylinder from a point to another, smooth but for its ends."""
    start, end = np.array(start, dtype=float), np.array(end, dtype=float)
    along = end - start
    direction = room.Vector(along).to_track_quat("Z", "Y")
    bpy.ops.mesh.primitive_cylinder_add(
        vertices=32,
        radius=radius,
        depth=np.linalg.norm(along),
        location=(start + end) / 2.0,
        rotation=direction.to_euler(),
    )
    room.finish(name, surface)
    side_apart(bpy.context.object.data)


def side_apart(cylinder):
    """Gives the ends vertices of their own: Cycles averages the normals of faces that share a vertex, the file does not."""
    for face in cylinder.polygons:
        face.use_smooth = len(face.vertices) == 4
    whole = bmesh.new()
    whole.from_mesh(cylinder)
    rims = [edge for edge in whole.edges if len({face.smooth for face in edge.link_faces}) == 2]
    bmesh.ops.split_edges(whole, edges=rims)
    whole.to_mesh(cylinder)
    whole.free()


def turned(name, foot, profile, surface, count=48):
    """A closed body of revolution, by radii and heights from the axis outside and back to the axis."""
    vertices, rings = [], []
    for radius, height in profile:
        angles = 2.0 * math.pi * np.arange(count if radius > 0.0 else 1) / count
        rings.append(len(vertices) + np.arange(len(angles)))
        vertices += [np.add(foot, (radius * math.cos(angle), radius * math.sin(angle), height)) for angle in angles]
    faces = []
    for low, high in pairwise(rings):
        for index in range(count):
            after = index + 1
            ends = [low[index % len(low)], low[after % len(low)], high[after % len(high)], high[index % len(high)]]
            faces.append([int(end) for end in dict.fromkeys(ends)])
    data = bpy.data.meshes.new(name)
    data.from_pydata([tuple(vertex) for vertex in vertices], [], faces)
    data.materials.append(surface)
    data.update()
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, data))
