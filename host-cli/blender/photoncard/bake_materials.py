"""Bakes inputs of materials to images, in Blender without a window.

The argument is a folder with `jobs.json` and a mesh for each job.
"""

from __future__ import annotations

import functools
import json
import math
import os
import sys
import traceback

import bpy
import numpy as np
from mathutils import Matrix
from mathutils.bvhtree import BVHTree

_SAMPLES = 4
_MARGIN = 16
"""Texels around charts that take the colour of the chart's border."""
_GAP = 4
"""Texels between charts."""
_TOLERANCE = 1e-4
_ATTRIBUTE = {
    "FLOAT": "value",
    "INT": "value",
    "FLOAT_VECTOR": "vector",
    "FLOAT_COLOR": "color",
    "BYTE_COLOR": "color",
    "FLOAT2": "vector",
}
"""Property of the items of attributes."""


def main(folder: str) -> None:
    """Does the jobs of a folder; `failures.json` has why some could not be done, by their numbers."""
    bpy.ops.preferences.addon_enable(module="cycles")
    with open(os.path.join(folder, "jobs.json"), encoding="utf-8") as file:
        stated = json.load(file)
    _set_up(bpy.context.scene, stated["frame"])
    failures = {}
    for number, job in enumerate(stated["jobs"]):
        try:
            _bake(folder, number, job, _material(**job["material"]), stated["size"])
        except Exception as error:
            traceback.print_exc()
            failures[number] = f"{type(error).__name__}: {error}"
    with open(os.path.join(folder, "failures.json"), "w", encoding="utf-8") as file:
        json.dump(failures, file)


@functools.cache
def _material(library: str, name: str) -> bpy.types.Material:
    with bpy.data.libraries.load(library) as (_, wanted):
        wanted.materials = [name]
    if wanted.materials[0] is None:
        raise RuntimeError(f"there is no material {name} in {library}")
    return wanted.materials[0]


def _set_up(scene: bpy.types.Scene, frame: int) -> None:
    for ob in list(scene.collection.all_objects):
        bpy.data.objects.remove(ob)
    scene.render.engine = "CYCLES"
    scene.frame_set(frame)
    scene.cycles.samples = _SAMPLES
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.render.bake.view_from = "ABOVE_SURFACE"


def _bake(folder: str, number: int, job: dict, stated: bpy.types.Material, size: int) -> None:
    with np.load(os.path.join(folder, f"{number}.npz")) as arrays:
        ob = _object(job["object"], dict(arrays))
    try:
        layer = _unwrap(ob, size)
        uvs = np.empty(2 * len(ob.data.loops), np.float32)
        layer.uv.foreach_get("vector", uvs)
        np.save(os.path.join(folder, f"{number}-uvs.npy"), uvs.reshape(-1, 2))
        for place, wanted in enumerate(job["inputs"]):
            material = stated.copy()
            ob.data.materials.clear()
            ob.data.materials.append(material)
            _show(material, wanted["path"], wanted["is_normal"])
            pixels = _image(material, layer.name, size, wanted["is_normal"])
            np.save(os.path.join(folder, f"{number}-{place}.npy"), pixels)
            bpy.data.materials.remove(material)
    finally:
        bpy.data.objects.remove(ob)


def _object(stated: dict, arrays: dict[str, np.ndarray]) -> bpy.types.Object:
    """The one object of the scene, selected and active."""
    positions, undeformed = arrays.pop("positions"), arrays.pop("undeformed")
    triangles, normals = arrays.pop("triangles"), arrays.pop("normals")
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(undeformed.tolist(), [], triangles.tolist())
    for name, values in arrays.items():
        kind, _, name = name.partition(" ")
        if name not in mesh.attributes:
            attribute = mesh.attributes.new(name, kind, "CORNER")
            attribute.data.foreach_set(_ATTRIBUTE[kind], np.ascontiguousarray(values).reshape(-1))
    if stated["active_uvs"]:
        mesh.uv_layers[stated["active_uvs"]].active_render = True
    if stated["active_colours"] in mesh.color_attributes:
        mesh.color_attributes.default_color_name = stated["active_colours"]
    mesh.polygons.foreach_set("use_smooth", [True] * len(triangles))
    mesh.normals_split_custom_set(normals.tolist())
    mesh.use_auto_texspace = False
    mesh.texspace_location, mesh.texspace_size = stated["texspace_location"], stated["texspace_size"]
    ob = bpy.data.objects.new(stated["name"], mesh)
    ob.matrix_world = Matrix(stated["matrix"])
    ob.color, ob.pass_index = stated["color"], stated["pass_index"]
    bpy.context.scene.collection.objects.link(ob)
    if not np.array_equal(positions, undeformed):
        # Generated coordinates are those of the mesh before it was deformed.
        ob.shape_key_add(name="undeformed")
        deformed = ob.shape_key_add(name="deformed")
        deformed.data.foreach_set("co", positions.reshape(-1))
        deformed.value = 1.0
    bpy.context.view_layer.objects.active = ob
    ob.select_set(True)
    return ob


def _unwrap(ob: bpy.types.Object, size: int) -> bpy.types.MeshUVLoopLayer:
    """The object's UV map if each point of the surface has a texel of its own, else a new one."""
    layers = ob.data.uv_layers
    layer = next((layer for layer in layers if layer.active_render), None)
    if layer is not None and _is_unique(ob.data, layer):
        layers.active = layer
        return layer
    name = layers.new(name="photoncard", do_init=False).name
    layers.active = layers[name]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(
        angle_limit=math.radians(66), margin_method="FRACTION", island_margin=_GAP / size
    )
    bpy.ops.object.mode_set(mode="OBJECT")
    return layers[name]


def _is_unique(mesh: bpy.types.Mesh, layer: bpy.types.MeshUVLoopLayer) -> bool:
    """True if a UV map is inside the unit square, and no triangle's middle is in another triangle."""
    uvs = np.zeros((len(mesh.loops), 3), np.float32)
    flat = np.empty(2 * len(uvs), np.float32)
    layer.uv.foreach_get("vector", flat)
    uvs[:, :2] = flat.reshape(-1, 2)
    corners = uvs.reshape(-1, 3, 3)
    sides = corners[:, 1:] - corners[:, :1]
    areas = np.abs(np.cross(sides[:, 0], sides[:, 1])[:, 2]) / 2
    real = np.empty(len(areas), np.float32)
    mesh.polygons.foreach_get("area", real)
    is_inside = uvs.min() >= -_TOLERANCE and uvs.max() <= 1 + _TOLERANCE
    if not is_inside or np.any((areas < 1e-12) & (real > 1e-12)):
        return False
    faces = np.arange(len(uvs)).reshape(-1, 3)[areas > 0]
    tree = BVHTree.FromPolygons(uvs.tolist(), faces.tolist(), all_triangles=True)
    return all(len(tree.find_nearest_range(middle.tolist(), 1e-7)) <= 1 for middle in uvs[faces].mean(axis=1))


def _show(material: bpy.types.Material, path: list[str], is_normal: bool) -> None:
    """Makes a material show one of its inputs: as emission, or as the normal of a diffuse surface."""
    *names, node_name, identifier = path
    trees, groups = [material.node_tree], []
    for name in names:
        group = trees[-1].nodes[name]
        # Another material may have the group too.
        group.node_tree = group.node_tree.copy()
        groups.append(group)
        trees.append(group.node_tree)
    tree = trees[-1]
    socket = _by_identifier(tree.nodes[node_name].inputs, identifier)
    source = socket.links[0].from_socket
    if is_normal:
        shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
        tree.links.new(source, shader.inputs["Normal"])
    else:
        shader = tree.nodes.new("ShaderNodeEmission")
        if socket.type == "VALUE":
            # A number that is fed by a colour is its grey value.
            number = tree.nodes.new("ShaderNodeMath")
            number.inputs[1].default_value = 0.0
            tree.links.new(source, number.inputs[0])
            source = number.outputs[0]
        tree.links.new(source, shader.inputs["Color"])
    shown = shader.outputs[0]
    for group, inner, outer in zip(reversed(groups), reversed(trees[1:]), reversed(trees[:-1])):
        added = inner.interface.new_socket("baked", in_out="OUTPUT", socket_type="NodeSocketShader")
        output = next(
            node for node in inner.nodes if node.bl_idname == "NodeGroupOutput" and node.is_active_output
        )
        inner.links.new(shown, _by_identifier(output.inputs, added.identifier))
        shown = _by_identifier(group.outputs, added.identifier)
    output = material.node_tree.get_output_node("CYCLES")
    for name in ("Volume", "Displacement"):
        for link in list(output.inputs[name].links):
            material.node_tree.links.remove(link)
    material.node_tree.links.new(shown, output.inputs["Surface"])


def _by_identifier(sockets: bpy.types.bpy_prop_collection, identifier: str) -> bpy.types.NodeSocket:
    return next(socket for socket in sockets if socket.identifier == identifier)


def _image(material: bpy.types.Material, uv_layer: str, size: int, is_normal: bool) -> np.ndarray:
    """The material's emission or normals as an image; what no chart covers has the mean of the others."""
    image = bpy.data.images.new("baked", size, size, alpha=True, float_buffer=True, is_data=True)
    image.generated_color = (0, 0, 0, 0)
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.nodes.active = node
    done = bpy.ops.object.bake(
        type="NORMAL" if is_normal else "EMIT",
        normal_space="TANGENT",
        margin=_MARGIN,
        margin_type="EXTEND",
        use_clear=False,
        uv_layer=uv_layer,
    )
    if done != {"FINISHED"}:
        raise RuntimeError("Cycles did not finish the bake")
    pixels = np.empty(size * size * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    pixels = pixels.reshape(size, size, 4)
    is_covered = pixels[..., 3] > 0
    if not is_covered.any():
        raise RuntimeError("no texel is covered by the UV map")
    colours = np.nan_to_num(pixels[..., :3])
    colours[~is_covered] = colours[is_covered].mean(axis=0)
    return colours


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    try:
        main(*arguments)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    # The package bpy may hang when the interpreter ends.
    os._exit(0)
