"""Exports materials: metallic-roughness with the extensions that photoncard reads."""

from __future__ import annotations

import bpy

from ..glb import Glb
from ..notices import Notices
from .images import ImageStore
from .material_writer import MaterialUse, MaterialWriter
from .nodes import has_nodes
from .surfaces import Surface, SurfaceReader
from .value import constant


class MaterialExporter:
    """Adds materials to a document, each once."""

    def __init__(self, glb: Glb, notices: Notices, override: bpy.types.Material | None) -> None:
        self.energy_compensation = False
        self._glb = glb
        self._notices = notices
        self._override = override
        self._images = ImageStore(glb)
        self._known: dict[str, MaterialUse] = {}

    def use(self, material: bpy.types.Material | None) -> MaterialUse:
        """The material of a slot; Blender's default material for an empty one."""
        material = self._override or material
        key = material.name_full if material else ""
        if key not in self._known:
            self._known[key] = self._add(material)
        return self._known[key]

    def _add(self, material: bpy.types.Material | None) -> MaterialUse:
        name = material.name if material else "Default"
        writer = MaterialWriter(self._glb, self._images, name, self._notices)
        surface = self._surface(material, name)
        self.energy_compensation |= surface.has_multiscatter and surface.is_glossy
        item = writer.write(surface)
        item["doubleSided"] = not (material and material.use_backface_culling)
        use = writer.use
        use.index = self._glb.add("materials", item)
        return use

    def _surface(self, material: bpy.types.Material | None, name: str) -> Surface:
        if material is None:
            return Surface(base=constant((0.8, 0.8, 0.8)))
        if not has_nodes(material):
            return Surface(
                base=constant(tuple(material.diffuse_color[:3])),
                metallic=constant(material.metallic),
                roughness=constant(material.roughness),
                specular=constant(2 * material.specular_intensity),
            )
        return SurfaceReader(name, self._notices).read(material.node_tree)
