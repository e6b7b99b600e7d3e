"""Exports all instances of an evaluated scene: meshes and lights, the camera, and the world."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from typing import Any

import bpy

from ..glb import Glb
from ..notices import Notices
from .axes import node_matrix
from .bakes import BakeMaterials, MaterialBakes
from .camera import CameraError, Frame, add_camera
from .clipping import Clipping
from .lights import add_light
from .materials import MaterialExporter
from .meshes import MeshExporter, materials_of
from .world import Bake, World, world_of

_RAYS = ("diffuse", "glossy", "transmission", "shadow")


@dataclass
class Exported:
    """A scene in glTF, with what the command takes beside the file."""

    glb: Glb
    world: World
    light_groups: set[str]
    notices: Notices
    energy_compensation: bool

    def write(self, folder: str) -> list[str]:
        """Writes the scene's files into a folder, and returns the arguments that render them."""
        scene = os.path.join(folder, "scene.glb")
        self.glb.write(scene)
        arguments = [scene, *self.world.write(folder)]
        if self.energy_compensation:
            arguments.append("--energy-compensation")
        stated = {
            node.get("extras", {}).get("photoncard", {}).get("light_group")
            for node in self.glb.root.get("nodes", [])
        }
        if stated - {None}:
            arguments += ["--light-groups", "file"]
        if self.world.light_group in self.light_groups and self.world.is_lit:
            arguments += ["--light-groups", f"{self.world.light_group}=environment"]
        return arguments


def export(
    depsgraph: bpy.types.Depsgraph,
    camera: bpy.types.Object | None,
    frame: Frame,
    bake: Bake | None = None,
    bake_materials: BakeMaterials | None = None,
    is_view: bool = False,
) -> Exported:
    """Exports an evaluated scene as its view layer shows it to a camera. `bake` renders nodes of the world,
    `bake_materials` those of materials. A viewport (`is_view`) has a camera of its own, and needs none of the
    scene.

    Raises `CameraError`.
    """
    exporter = _Exporter(depsgraph)
    with tempfile.TemporaryDirectory(prefix="photoncard-bake-", dir=bpy.app.tempdir) as folder:
        if bake_materials is not None:
            exporter.bake(bake_materials, folder)
        for instance in depsgraph.object_instances:
            if instance.show_self:
                exporter.add(instance)
    scene = depsgraph.scene
    evaluated = camera.evaluated_get(depsgraph) if camera else None
    exporter.clipping.notice(evaluated, exporter.notices)
    try:
        add_camera(exporter.glb, evaluated, scene.render, frame, exporter.notices)
    except CameraError:
        if not is_view:
            raise
    if scene.render.use_motion_blur:
        exporter.notices.add("motion blur is not rendered")
    world = depsgraph.view_layer.world_override if hasattr(depsgraph.view_layer, "world_override") else None
    return Exported(
        exporter.glb,
        world_of(world or scene.world, bake, exporter.notices),
        exporter.light_groups,
        exporter.notices,
        exporter.materials.energy_compensation,
    )


class _Exporter:
    def __init__(self, depsgraph: bpy.types.Depsgraph) -> None:
        layer = depsgraph.view_layer
        self.glb = Glb()
        self.notices = Notices()
        self.materials = MaterialExporter(self.glb, self.notices, layer.material_override)
        self.light_groups = {group.name for group in layer.lightgroups}
        self._depsgraph = depsgraph
        self._layer = layer
        self.clipping = Clipping()
        self._meshes = MeshExporter(self.glb, self.materials, self.notices)
        self._bakes = MaterialBakes(self.materials, self.notices)

    def bake(self, run: BakeMaterials, folder: str) -> None:
        """Has materials baked, with images in a folder, before instances are added."""
        for instance in self._depsgraph.object_instances:
            if instance.show_self:
                self._bakes.add(instance)
        self._bakes.bake(run, folder)

    def add(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        ob = instance.object
        real = instance.instance_object if instance.is_instance else ob
        is_seen = ob.visible_camera and not self._is_indirect(instance)
        group = real.lightgroup if real.lightgroup in self.light_groups else ""
        extras: dict[str, Any] = {"light_group": group} if group else {}
        if ob.type == "LIGHT":
            self._note_rays(ob)
            add_light(self.glb, ob, instance.matrix_world, extras, is_seen, self.notices)
            return
        materials = materials_of(ob, real) if ob.type == "MESH" else []
        mesh = self._meshes.mesh_of(ob, materials, self._bakes.of(ob, materials, instance.matrix_world))
        if mesh is None:
            return
        self._note_rays(ob)
        if ob.is_holdout or ob.is_shadow_catcher:
            self.notices.add("holdouts and shadow catchers are rendered as they are", ob.name)
        matrix = node_matrix(instance.matrix_world)
        if matrix is None:
            self.notices.add("objects without a finite transform are not rendered", ob.name)
            return
        if is_seen:
            self.clipping.add(ob, instance.matrix_world)
        else:
            extras["camera"] = False
        node: dict[str, Any] = {"name": ob.name, "mesh": mesh, "matrix": matrix}
        if extras:
            node["extras"] = {"photoncard": extras}
        self.glb.add_node(node)

    def _is_indirect(self, instance: bpy.types.DepsgraphObjectInstance) -> bool:
        shown = instance.parent if instance.is_instance else instance.object
        return bool(shown) and shown.original.indirect_only_get(view_layer=self._layer)

    def _note_rays(self, ob: bpy.types.Object) -> None:
        hidden = [kind for kind in _RAYS if not getattr(ob, f"visible_{kind}")]
        if hidden:
            self.notices.add(
                "objects are visible to all rays but the camera's", f"{ob.name} ({', '.join(hidden)})"
            )
