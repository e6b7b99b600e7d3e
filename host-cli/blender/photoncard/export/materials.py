"""Exports materials: metallic-roughness with the extensions that photoncard reads."""

from __future__ import annotations

from collections.abc import Mapping

import bpy

from ..glb import Glb
from ..notices import Notices
from .images import ImageStore
from .material_writer import MaterialUse, MaterialWriter
from .nodes import Path, has_nodes
from .surfaces import Surface, SurfaceReader
from .value import Value, constant


class MaterialExporter:
    """Adds materials to a document, each once, and once more for each mesh that it is baked for."""

    def __init__(self, glb: Glb, notices: Notices, override: bpy.types.Material | None) -> None:
        self.energy_compensation = False
        self._glb = glb
        self._notices = notices
        self._override = override
        self._images = ImageStore(glb)
        self._known: dict[str, MaterialUse] = {}
        self._unsaid: dict[str, dict[Path, bool]] = {}

    def use(self, material: bpy.types.Material | None) -> MaterialUse:
        """The material of a slot; Blender's default material for an empty one."""
        material = self.shown(material)
        key = material.name_full if material else ""
        if key not in self._known:
            self._known[key] = self._add(material, {})
        return self._known[key]

    def use_baked(self, material: bpy.types.Material | None, baked: Mapping[Path, Value]) -> MaterialUse:
        """The material of a slot with values in place of those of its nodes, for one mesh."""
        return self._add(self.shown(material), baked)

    def shown(self, material: bpy.types.Material | None) -> bpy.types.Material | None:
        """The material that is rendered for that of a slot."""
        return self._override or material

    def unsaid(self, material: bpy.types.Material | None) -> dict[Path, bool]:
        """Inputs of a slot's material that are to be baked, with whether each is a normal.

        If one value is to be baked, all that vary are, since textures that glTF joins have one mapping.
        """
        material = self.shown(material)
        if material is None or not has_nodes(material):
            return {}
        if material.name_full not in self._unsaid:
            reader = SurfaceReader(material.name, Notices())
            reader.read(material.node_tree)
            values = reader.unsaid | reader.varying if reader.unsaid else set()
            self._unsaid[material.name_full] = {
                **dict.fromkeys(sorted(values), False),
                **dict.fromkeys(sorted(reader.unsaid_normals), True),
            }
        return self._unsaid[material.name_full]

    def _add(self, material: bpy.types.Material | None, baked: Mapping[Path, Value]) -> MaterialUse:
        name = material.name if material else "Default"
        writer = MaterialWriter(self._glb, self._images, name, self._notices)
        surface = self._surface(material, name, baked)
        self.energy_compensation |= surface.has_multiscatter and surface.is_glossy
        item = writer.write(surface)
        item["doubleSided"] = not (material and material.use_backface_culling)
        use = writer.use
        use.index = self._glb.add("materials", item)
        return use

    def _surface(
        self, material: bpy.types.Material | None, name: str, baked: Mapping[Path, Value]
    ) -> Surface:
        if material is None:
            return Surface(base=constant((0.8, 0.8, 0.8)))
        if not has_nodes(material):
            return Surface(
                base=constant(tuple(material.diffuse_color[:3])),
                metallic=constant(material.metallic),
                roughness=constant(material.roughness),
                specular=constant(2 * material.specular_intensity),
            )
        return SurfaceReader(name, self._notices, baked).read(material.node_tree)
