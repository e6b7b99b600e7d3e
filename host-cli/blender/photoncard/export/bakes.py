"""Finds materials whose nodes glTF has no counterpart of, and has them baked for each mesh that has them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import bpy
from mathutils import Matrix

from ..baking import Baked, BakeError, BakeJob
from ..notices import Notices
from .baked import PartBake
from .materials import MaterialExporter
from .meshes import Corners, materials_of

BakeMaterials = Callable[[Sequence[BakeJob], str], list[Baked | BakeError]]
"""Does jobs, with files in a folder that outlives what it returns. Raises `BakeError` if none can be done."""
_OF_PLACE = {"ShaderNodeNewGeometry", "ShaderNodeObjectInfo", "ShaderNodeVectorTransform"}
"""Nodes whose values are others on another object of the same mesh; more are in `_differs_by_place`."""


@dataclass
class MaterialBakes:
    """Collects the parts of a scene whose materials are to be baked, and has them baked."""

    materials: MaterialExporter
    notices: Notices
    _seen: set[tuple[object, ...]] = field(default_factory=set)
    _jobs: dict[tuple[object, ...], BakeJob] = field(default_factory=dict)
    _done: dict[tuple[object, ...], PartBake] = field(default_factory=dict)

    def add(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        """Adds the parts of an instance that are not known yet."""
        ob = instance.object
        if ob.type != "MESH":
            return
        stated = materials_of(ob, instance.instance_object if instance.is_instance else ob)
        wanted = {
            slot: self._key(ob, slot, stated, instance.matrix_world)
            for slot, material in enumerate(stated)
            if self.materials.unsaid(material)
        }
        new = {slot: key for slot, key in wanted.items() if key not in self._seen}
        if not new:
            return
        self._seen.update(new.values())
        corners = Corners(ob.data, ob.name, self.notices)
        for slot, triangles in corners.by_material(len(stated)):
            if slot in new:
                self._jobs[new[slot]] = BakeJob(
                    self.materials.shown(stated[slot]),
                    self.materials.unsaid(stated[slot]),
                    _described(ob, instance.matrix_world),
                    corners.arrays(triangles),
                )

    def bake(self, run: BakeMaterials, folder: str) -> None:
        """Has all parts baked, with images in a folder; those that cannot be are named."""
        if not self._jobs:
            return
        jobs = list(self._jobs.values())
        try:
            results: list[Baked | BakeError] = run(jobs, folder)
        except BakeError as error:
            results = [error] * len(jobs)
        for (key, job), result in zip(self._jobs.items(), results):
            if isinstance(result, BakeError):
                self.notices.add(f"materials are not baked ({result})", job.material.name)
            else:
                self._done[key] = PartBake(job, result)

    def of(
        self, ob: bpy.types.Object, materials: list[bpy.types.Material | None], matrix: Matrix
    ) -> dict[int, PartBake]:
        """What was baked for an object with these materials, by their slots."""
        if not self._done:
            return {}
        found = {
            slot: self._done.get(self._key(ob, slot, materials, matrix)) for slot in range(len(materials))
        }
        return {slot: bake for slot, bake in found.items() if bake is not None}

    def _key(
        self, ob: bpy.types.Object, slot: int, materials: list[bpy.types.Material | None], matrix: Matrix
    ) -> tuple[object, ...]:
        material = self.materials.shown(materials[slot])
        key: tuple[object, ...] = (ob.data.as_pointer(), slot, material.name_full if material else "")
        if material is not None and material.node_tree and _differs_by_place(material.node_tree):
            key += (ob.name_full, *(number for row in matrix for number in row))
        return key


def _differs_by_place(tree: bpy.types.NodeTree) -> bool:
    return any(
        node.bl_idname in _OF_PLACE
        or (node.bl_idname == "ShaderNodeTexCoord" and node.object is not None)
        or (node.bl_idname == "ShaderNodeAttribute" and node.attribute_type != "GEOMETRY")
        or (node.bl_idname == "ShaderNodeGroup" and node.node_tree and _differs_by_place(node.node_tree))
        for node in tree.nodes
    )


def _described(ob: bpy.types.Object, matrix: Matrix) -> dict[str, object]:
    mesh = ob.data
    return {
        "name": ob.name,
        "matrix": [list(row) for row in matrix],
        "color": list(ob.color),
        "pass_index": ob.pass_index,
        "texspace_location": list(mesh.texspace_location),
        "texspace_size": list(mesh.texspace_size),
        "active_uvs": next((layer.name for layer in mesh.uv_layers if layer.active_render), ""),
        "active_colours": mesh.color_attributes.default_color_name or "",
    }
