"""Tools of Blender as functions: bodies, modifiers, texture coordinates, copies."""

import math

import bmesh
import bpy
import numpy as np
from mathutils import Matrix

# Metres that a repeat of a texture covers.
REPEAT = 2.4
# Edges between faces that differ by more are sharp in smooth meshes.
SHARP = math.radians(38.0)


def body(name, vertices, faces, surface, edges=()):
    """An object of a mesh that is given."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, vertex)) for vertex in vertices], list(edges), list(faces))
    mesh.materials.append(surface)
    return add(name, mesh)


def add(name, data):
    """An object in the scene."""
    result = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(result)
    return result


def modify(thing, kind, **settings):
    """Gives an object a modifier of Blender."""
    modifier = thing.modifiers.new(kind.lower(), kind)
    for key, value in settings.items():
        setattr(modifier, key, value)
    return thing


def bake(thing, unwrap=None, is_smooth=True, is_closed=True):
    """Applies the modifiers, turns the faces of a closed body outwards, and gives it texture coordinates."""
    mesh = bpy.data.meshes.new_from_object(thing.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    mesh.name = thing.name
    if thing.type != "MESH":
        surfaces = list(thing.data.materials)
        name = thing.name
        bpy.data.objects.remove(thing)
        thing = add(name, mesh)
        if not mesh.materials:
            mesh.materials.append(surfaces[0])
    thing.modifiers.clear()
    thing.data = mesh
    if is_closed:
        shape = bmesh.new()
        shape.from_mesh(mesh)
        bmesh.ops.recalc_face_normals(shape, faces=shape.faces)
        shape.to_mesh(mesh)
        shape.free()
    mesh.polygons.foreach_set("use_smooth", [is_smooth] * len(mesh.polygons))
    if is_smooth:
        mesh.set_sharp_from_angle(angle=SHARP)
    if unwrap:
        unwrap(mesh)
    return thing


def corners(mesh):
    """Of each corner of the faces: the vertex's place, its number, and the face's normal."""
    places = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", places)
    numbers = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", numbers)
    sides = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", sides)
    normals = np.empty(3 * len(mesh.polygons), dtype=np.float32)
    mesh.polygons.foreach_get("normal", normals)
    return places.reshape(-1, 3)[numbers], sides, np.repeat(normals.reshape(-1, 3), sides, axis=0)


def coordinates(mesh, uv):
    """Sets the texture coordinates of the corners."""
    layer = mesh.uv_layers.active or mesh.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", np.ascontiguousarray(uv, dtype=np.float32).ravel())


def project(mesh):
    """Texture coordinates by projection along the axis that is nearest to the face's normal."""
    places, _, normals = corners(mesh)
    axis = np.abs(normals).argmax(axis=1)
    across, up = np.choose(axis, [1, 0, 0]), np.choose(axis, [2, 2, 1])
    rows = np.arange(len(places))
    coordinates(mesh, np.column_stack([places[rows, across], places[rows, up]]) / REPEAT)


def wrap(mesh):
    """Texture coordinates of a body that is turned around z: the angle and the height."""
    places, sides, _ = corners(mesh)
    angle = np.arctan2(places[:, 1], places[:, 0]) / (2 * np.pi)
    # A face at the seam goes on beyond it.
    first = np.repeat(np.cumsum(sides) - sides, sides)
    angle += np.round(angle[first] - angle)
    radius = np.hypot(places[:, 0], places[:, 1])
    repeats = max(1.0, round(2 * math.pi * float(radius.max()) / REPEAT))
    coordinates(mesh, np.column_stack([repeats * angle, (places[:, 2] + 0.5 * radius) / REPEAT]))


def box(name, low, high, surface, bevel=0.0, segments=2):
    """A box between two corners, with rounded edges."""
    vertices = [[(low, high)[index >> axis & 1][axis] for axis in range(3)] for index in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    result = body(name, vertices, faces, surface)
    if bevel:
        modify(result, "BEVEL", width=bevel, segments=segments, limit_method="ANGLE")
    return bake(result, project, is_smooth=bevel > 0.0)


def sheet(name, points, surface):
    """A rectangle by its corners, seen from where they go round to the left."""
    return bake(body(name, points, [(0, 1, 2, 3)], surface), project, is_smooth=False, is_closed=False)


def turned(name, profile, steps, surface):
    """A body turned around z from a profile of radii and heights, with its ends on the axis."""
    vertices = [(radius, 0.0, height) for radius, height in profile]
    result = body(name, vertices, [], surface, [(index, index + 1) for index in range(len(profile) - 1)])
    modify(result, "SCREW", steps=steps, render_steps=steps, use_merge_vertices=True, merge_threshold=1e-4)
    return bake(result, wrap)


def rod(name, points, radius, surface, is_cyclic=False, sides=3):
    """A bar with a round section along a line of points, by a curve with a bevel."""
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution, curve.use_fill_caps = "3D", radius, sides, True
    spline = curve.splines.new("POLY")
    spline.points.add(len(points) - 1)
    spline.points.foreach_set("co", np.column_stack([points, np.ones(len(points))]).astype(np.float32).ravel())
    spline.use_cyclic_u = is_cyclic
    curve.materials.append(surface)
    return bake(add(name, curve), project)


def join(name, things):
    """One object of several, which keeps their materials and the first one's origin."""
    with bpy.context.temp_override(active_object=things[0], object=things[0], selected_editable_objects=things, selected_objects=things):
        bpy.ops.object.join()
    things[0].name = things[0].data.name = name
    return things[0]


def copies(thing, places, group):
    """Puts an object at places of a position and an angle around z, as nodes of one mesh below the node of a group."""
    for index, (position, angle) in enumerate(places):
        copy = thing if index == 0 else add(thing.name, thing.data)
        copy.parent = group
        copy.matrix_local = Matrix.Translation(position) @ Matrix.Rotation(angle, 4, "Z")


def empty(name, position=(0.0, 0.0, 0.0), angle=0.0, scale=(1.0, 1.0, 1.0)):
    """A node without a mesh."""
    result = add(name, None)
    result.matrix_local = Matrix.Translation(position) @ Matrix.Rotation(angle, 4, "Z") @ Matrix.Diagonal((*scale, 1.0))
    return result
