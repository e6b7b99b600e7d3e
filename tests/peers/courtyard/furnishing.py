"""Cloth, vases, plants, lanterns, doors and reliefs of the courtyard."""

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector

from building import COURT, GALLERY, HALF_TURN, OUTER, UPPER, grid
from parts import add, bake, body, box, copies, empty, join, modify, project, rod, turned


def cloths(surfaces):
    """Curtains in bays of the lower arcade, folded, subdivided and displaced; live modifiers, which the export applies."""
    clouds = bpy.data.textures.new("folds", "CLOUDS")
    clouds.noise_scale = 0.6
    columns, rows = 29, 12
    bays = [(x, side) for side in (-1, 1) for x in (-6.0, -3.0, 3.0, 6.0, 9.0)]
    for index, (x, side) in enumerate(bays):
        colour = ("red", "green", "blue")[(index + (side > 0)) % 3]
        u, v = np.meshgrid(np.linspace(-1.0, 1.0, columns), np.linspace(0.0, 1.0, rows))
        fold = 0.10 * (0.35 + 0.65 * v) * np.sin(2 * math.pi * (3.5 + 0.5 * (index % 3)) * u + index)
        gather = 1.0 - 0.22 * np.sin(math.pi * v) ** 2
        points = np.dstack([1.05 * u * gather, fold, -3.0 * v])
        cloth = grid("curtain", points, surfaces[f"cloth-{colour}"])
        uv = cloth.data.uv_layers.active.uv
        for corner, loop in zip(uv, cloth.data.loops, strict=True):
            row, column = divmod(loop.vertex_index, columns)
            corner.vector = (column / (columns - 1), 1.5 * row / (rows - 1))
        modify(cloth, "SUBSURF", levels=1, render_levels=1)
        modify(cloth, "DISPLACE", texture=clouds, texture_coords="GLOBAL", strength=0.12, mid_level=0.5)
        cloth.location, cloth.rotation_euler.z = (x, side * (COURT[1] + 0.05), 3.55), 0.0 if side < 0 else HALF_TURN
        rod("curtain rail", [(x - 1.3, side * (COURT[1] + 0.05), 3.58), (x + 1.3, side * (COURT[1] + 0.05), 3.58)], 0.025, surfaces["bronze"])


def vases(surfaces):
    """Vases with soil and a plant along the court, and a basin in its middle."""
    outer = [
        (0.0, 0.0), (0.20, 0.0), (0.22, 0.04), (0.15, 0.09), (0.14, 0.13), (0.22, 0.22), (0.32, 0.38),
        (0.37, 0.55), (0.36, 0.70), (0.30, 0.82), (0.28, 0.88), (0.34, 0.94), (0.37, 0.97),
    ]
    inner = [(0.33, 0.97), (0.26, 0.90), (0.26, 0.84), (0.0, 0.84)]
    vase = modify(turned("vase", outer + inner, 16, surfaces["terracotta"]), "SUBSURF", levels=1, render_levels=1)
    bake(vase)
    vase = join("vase", [vase, turned("soil", [(0.0, 0.80), (0.27, 0.80), (0.2, 0.87), (0.0, 0.88)], 16, surfaces["soil"])])
    spots = [((x, side * (COURT[1] - 1.0), 0.0), 0.3 * x) for side in (-1, 1) for x in (-7.5, -1.5, 4.5)]
    copies(vase, spots, empty("vases"))
    copies(plant(surfaces["leaves"], 201), [((x, y, 0.85), 1.7 * index) for index, ((x, y, _), _) in enumerate(spots)], empty("plants"))
    rim = [
        (0.0, 0.0), (1.30, 0.0), (1.32, 0.05), (1.22, 0.10), (1.16, 0.16), (1.14, 0.40), (1.20, 0.46),
        (1.26, 0.50), (1.26, 0.56), (1.20, 0.60), (1.06, 0.60), (1.02, 0.56), (1.0, 0.30), (0.0, 0.28),
    ]
    foot = [
        (0.0, 0.28), (0.22, 0.28), (0.20, 0.36), (0.12, 0.42), (0.10, 0.70), (0.14, 0.78), (0.16, 0.95),
        (0.40, 1.05), (0.52, 1.14), (0.50, 1.17), (0.38, 1.10), (0.0, 1.06),
    ]
    basin = join("basin", [turned("basin", rim, 64, surfaces["marble"]), turned("foot", foot, 40, surfaces["marble"])])
    basin.location = (1.5, 0.0, 0.0)


def card(vertices, faces, uv, frame, length, width, bend):
    """Adds a bent card of three quads, with the texture from its foot to its tip."""
    first = len(vertices)
    for row in range(4):
        t = row / 3
        for side in (-0.5, 0.5):
            vertices.append(frame @ Vector((side * width, bend * length * t * t, length * t)))
    for row in range(3):
        a = first + 2 * row
        faces.append((a, a + 1, a + 3, a + 2))
        uv += [(0.0, row / 3), (1.0, row / 3), (1.0, (row + 1) / 3), (0.0, (row + 1) / 3)]


def foliage(name, frames, surface, rng):
    """Leaves on cards at frames, cut out by their texture."""
    vertices, faces, uv = [], [], []
    for frame in frames:
        length = 0.30 + 0.25 * rng.random()
        card(vertices, faces, uv, frame, length, 0.75 * length, 0.5 * rng.random())
    thing = bake(body(name, vertices, faces, surface), is_closed=False)
    layer = thing.data.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", np.array(uv, dtype=np.float32).ravel())
    return thing


def plant(surface, seed):
    """A bush of cards that point outwards and up."""
    rng = np.random.default_rng(seed)
    frames = []
    for _ in range(130):
        turn = Matrix.Rotation(2 * math.pi * rng.random(), 4, "Z")
        lean = Matrix.Rotation(-1.2 * rng.random(), 4, "X")
        frames.append(turn @ Matrix.Translation((0.0, 0.12 * rng.random(), 0.35 * rng.random())) @ lean @ Matrix.Rotation(rng.normal(), 4, "Z"))
    return foliage("plant", frames, surface, rng)


def ivy(surfaces):
    """Ivy that hangs from balustrades of the upper storey."""
    rng = np.random.default_rng(301)
    for index, (x, side) in enumerate(((-4.5, -1), (4.5, -1), (-7.5, 1), (1.5, 1), (7.5, 1))):
        frames = []
        for _ in range(260):
            across, down = 0.9 * rng.normal(), rng.exponential(0.55)
            position = (x + across * math.exp(-0.5 * down), side * (COURT[1] - 0.42 - 0.12 * rng.random()), UPPER + 0.85 - down)
            turn = Matrix.Rotation(0.0 if side > 0 else HALF_TURN, 4, "Z") @ Matrix.Rotation(rng.normal() * 0.6, 4, "Z")
            frames.append(Matrix.Translation(position) @ turn @ Matrix.Rotation(math.radians(115.0 + 35.0 * rng.random()), 4, "X"))
        foliage(f"ivy {index}", frames, surfaces["leaves"], rng)


def lanterns(surfaces):
    """Lanterns on chains in the galleries: a wire cage around a glowing ball."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=0.10)
    ball = bpy.context.object
    ball.name, ball.location = "flame", (0.0, 0.0, 0.0)
    ball.data.materials.append(surfaces["flame"])
    bake(ball)
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=0.20)
    cage = bpy.context.object
    cage.data.materials.append(surfaces["bronze"])
    cage = bake(modify(cage, "WIREFRAME", thickness=0.018), project)
    bpy.ops.mesh.primitive_torus_add(major_segments=10, minor_segments=5, major_radius=0.035, minor_radius=0.008, rotation=(HALF_TURN / 2, 0.0, 0.0))
    chain = bpy.context.object
    bpy.ops.object.transform_apply(rotation=True)
    chain.data.materials.append(surfaces["bronze"])
    modify(chain, "ARRAY", count=9, use_relative_offset=False, use_constant_offset=True, constant_offset_displace=(0.0, 0.0, 0.062))
    bake(chain, project)
    for vertex in chain.data.vertices:
        vertex.co.z += 0.22
    lantern = join("lantern", [ball, cage, chain])
    x, y = (half + GALLERY / 2 for half in COURT)
    spots = [(a, side * y, 3.25) for side in (-1, 1) for a in (-9.0, -3.0, 3.0, 9.0)] + [(side * x, 0.0, 3.25) for side in (-1, 1)]
    copies(lantern, [(spot, 0.0) for spot in spots], empty("lanterns"))


def doors(surfaces):
    """Doors of bevelled planks in the walls of both storeys."""
    plank = box("plank", (-0.11, -0.05, 0.0), (0.11, 0.05, 2.3), surfaces["wood"], 0.015, 1)
    modify(plank, "ARRAY", count=6, use_relative_offset=False, use_constant_offset=True, constant_offset_displace=(0.225, 0.0, 0.0))
    bake(plank)
    parts = [plank]
    for low, high, bottom, top in ((-0.33, -0.13, 0.0, 2.3), (1.25, 1.45, 0.0, 2.3), (-0.40, 1.52, 2.3, 2.55)):
        parts.append(box("frame", (low, -0.1, bottom), (high, 0.1, top), surfaces["ashlar"], 0.03))
    door = join("door", parts)
    middle, wall = 0.56, OUTER[1] - 0.06
    spots = [((x - middle, -wall, z), 0.0) for z in (0.0, UPPER) for x in (-6.0, 0.0, 6.0)]
    spots += [((-x, -y, z), HALF_TURN) for (x, y, z), _ in spots]
    copies(door, spots, empty("doors"))


def reliefs(surfaces):
    """A face in relief at the end of the court, by many small triangles, and again opposite, as a mirrored node."""
    side = 73
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, side), np.linspace(-1.0, 1.0, side))
    radius, angle = np.hypot(u, v), np.arctan2(v, u)
    blob = lambda x, y, a, b: np.exp(-(((u - x) / a) ** 2 + ((v - y) / b) ** 2))
    mane = 0.10 * np.cos(22 * angle + 5 * radius) * np.exp(-(((radius - 0.68) / 0.14) ** 2))
    face = 0.55 * np.exp(-((radius / 0.62) ** 4)) + 0.22 * blob(0, -0.08, 0.13, 0.30) + 0.14 * blob(0, -0.30, 0.26, 0.16)
    eyes = sum(0.10 * blob(x, 0.16, 0.16, 0.07) - 0.14 * blob(x, 0.10, 0.09, 0.05) for x in (-0.26, 0.26))
    depth = (mane + face + eyes - 0.10 * blob(0, -0.46, 0.20, 0.04) + 0.30 * np.exp(-((radius / 0.85) ** 8))) * (radius < 1.0) + 0.02
    depth[0] = depth[-1] = depth[:, 0] = depth[:, -1] = 0.0
    x = OUTER[0] - 0.01
    lion = grid("relief", np.dstack([1.15 * u, -0.55 * depth, 1.15 * v]), surfaces["marble"])
    lion.parent = empty("relief", (x, 0.0, 1.9), -HALF_TURN / 2)
    add("relief", lion.data).parent = empty("mirrored relief", (-x, 0.0, 1.9), -HALF_TURN / 2, (1.0, -1.0, 1.0))


PARTS = (cloths, vases, ivy, lanterns, doors, reliefs)
