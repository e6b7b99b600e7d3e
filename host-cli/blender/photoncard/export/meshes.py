"""Exports evaluated meshes: triangles by material, with normals and texture coordinates of corners."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import bpy
import numpy as np

from ..glb import Glb
from ..notices import Notices
from .baked import BAKED_UVS, PartBake
from .materials import MaterialExporter, MaterialUse

_NOT_SURFACES = {
    "CURVES": "hair curves are not rendered",
    "POINTCLOUD": "point clouds are not rendered",
    "VOLUME": "volumes are not rendered",
    "GREASEPENCIL": "grease pencil is not rendered",
    "GPENCIL": "grease pencil is not rendered",
}


class MeshExporter:
    """Adds meshes to a document. Instances of an evaluated mesh with the same materials share one."""

    def __init__(self, glb: Glb, materials: MaterialExporter, notices: Notices) -> None:
        self._glb = glb
        self._materials = materials
        self._notices = notices
        self._known: dict[tuple[int, ...], int | None] = {}

    def mesh_of(
        self, ob: bpy.types.Object, materials: list[bpy.types.Material | None], bakes: Mapping[int, PartBake]
    ) -> int | None:
        """Index of the mesh of an evaluated object; `None` if it has no faces.

        `bakes` has what was baked for the object, by slots of `materials`.
        """
        if ob.type != "MESH":
            # The faces of curves, texts, surfaces and metaballs are instances of their own, of this type.
            if ob.type in _NOT_SURFACES:
                self._notices.add(_NOT_SURFACES[ob.type], ob.name)
            return None
        pointers = (material.as_pointer() if material else 0 for material in materials)
        key = (ob.data.as_pointer(), *pointers, *map(id, bakes.values()))
        if key not in self._known:
            self._known[key] = self._add(ob.data, ob.name, materials, bakes)
        return self._known[key]

    def _add(
        self,
        mesh: bpy.types.Mesh,
        name: str,
        materials: list[bpy.types.Material | None],
        bakes: Mapping[int, PartBake],
    ) -> int | None:
        primitives = []
        corners = Corners(mesh, name, self._notices)
        for slot, triangles in corners.by_material(len(materials)):
            material = materials[slot] if materials else None
            if slot in bakes:
                bake = bakes[slot]
                use = self._materials.use_baked(material, bake.values())
                primitives.append(self._primitive(corners, triangles, use, bake.baked.uvs))
            else:
                primitives.append(self._primitive(corners, triangles, self._materials.use(material)))
        if not primitives:
            return None
        return self._glb.add("meshes", {"name": mesh.name, "primitives": primitives})

    def _primitive(
        self, corners: Corners, triangles: np.ndarray, use: MaterialUse, baked_uvs: np.ndarray | None = None
    ) -> dict[str, object]:
        """A primitive of triangles, rows of three corners. They share corners unless they are baked."""
        if baked_uvs is None:
            used = np.zeros(corners.count, bool)
            used[triangles] = True
            kept = np.flatnonzero(used)
            indices = (np.cumsum(used) - 1)[triangles.reshape(-1)]
        else:
            kept, indices = triangles.reshape(-1), np.arange(triangles.size)
        attributes = {
            "POSITION": self._glb.attribute(corners.positions(kept), with_bounds=True),
            "NORMAL": self._glb.attribute(corners.normals(kept)),
        }
        for number, uv_map in enumerate(use.uv_maps):
            is_baked = baked_uvs is not None and uv_map == BAKED_UVS
            uvs = _downward(baked_uvs) if is_baked else corners.uvs(kept, uv_map)
            attributes[f"TEXCOORD_{number}"] = self._glb.attribute(uvs)
        if use.colours is not None:
            attributes["COLOR_0"] = self._glb.attribute(corners.colours(kept, use.colours))
        primitive: dict[str, object] = {
            "attributes": attributes,
            "indices": self._glb.indices(indices.astype(np.uint32)),
        }
        if use.index is not None:
            primitive["material"] = use.index
        return primitive


class Corners:
    """Corners of a mesh's faces, and what they have."""

    def __init__(self, mesh: bpy.types.Mesh, name: str, notices: Notices) -> None:
        self._mesh = mesh
        self._name = name
        self._notices = notices
        self.count = len(mesh.loops)
        self._vertices = _read(mesh.loops, "vertex_index", np.int32)
        self._positions = _read(mesh.vertices, "co", np.float32, 3)
        self._normals = _read(mesh.corner_normals, "vector", np.float32, 3)

    def by_material(self, slots: int) -> Iterator[tuple[int, np.ndarray]]:
        """Triangles of each material that faces have, as rows of three corners."""
        mesh = self._mesh
        if self.count == 0:
            return
        mesh.calc_loop_triangles()
        triangles = _read(mesh.loop_triangles, "loops", np.int32, 3)
        last = max(slots - 1, 0)
        stated = mesh.attributes.get("material_index")
        if stated is None or last == 0:
            yield 0, triangles
            return
        faces = np.clip(_read(mesh.polygons, "material_index", np.int32), 0, last)
        of_triangles = faces[_read(mesh.loop_triangle_polygons, "value", np.int32)]
        for slot in np.unique(of_triangles):
            yield int(slot), triangles[of_triangles == slot]

    def positions(self, kept: np.ndarray) -> np.ndarray:
        """Positions of corners."""
        return self._positions[self._vertices[kept]]

    def normals(self, kept: np.ndarray) -> np.ndarray:
        """Unit normals of corners, as Blender shades them."""
        normals = self._normals[kept]
        # Faces without area have no normal, and glTF has no zero vectors.
        lengths = np.linalg.norm(normals, axis=1)
        normals[~(lengths > 0.5)] = (0.0, 0.0, 1.0)
        return normals

    def uvs(self, kept: np.ndarray, uv_map: str) -> np.ndarray:
        """Texture coordinates of a UV map, of the map that is active in renders for an empty name."""
        layers = self._mesh.uv_layers
        layer = layers.get(uv_map) if uv_map else next((it for it in layers if it.active_render), None)
        if layer is None:
            sentence = "meshes without the UV map of their material take one texel"
            self._notices.add(sentence, f"{self._name} ({uv_map or 'active map'})")
            return np.zeros((len(kept), 2), np.float32)
        return _downward(_read(layer.uv, "vector", np.float32, 2)[kept])

    def colours(self, kept: np.ndarray, name: str) -> np.ndarray:
        """Linear colours of a colour attribute, of the one that is active in renders for an empty name."""
        attributes = self._mesh.color_attributes
        chosen = name or attributes.default_color_name
        attribute = attributes.get(chosen)
        if attribute is None:
            self._notices.add("meshes without the colour attribute of their material are black", self._name)
            return np.zeros((len(kept), 3), np.float32)
        colours = _read(attribute.data, "color", np.float32, 4)[:, :3]
        return colours[kept if attribute.domain == "CORNER" else self._vertices[kept]]

    def arrays(self, triangles: np.ndarray) -> dict[str, np.ndarray]:
        """A part of the mesh to be baked: vertices, triangles, and attributes of their corners."""
        corners = triangles.reshape(-1)
        vertices, places = np.unique(self._vertices[corners], return_inverse=True)
        arrays = {
            "positions": self._positions[vertices],
            "undeformed": _read(self._mesh.vertices, "undeformed_co", np.float32, 3)[vertices],
            "triangles": places.reshape(-1, 3).astype(np.int32),
            "normals": self.normals(corners),
        }
        indices = {"POINT": self._vertices[corners], "CORNER": corners}
        for attribute in self._mesh.attributes:
            stored = _ATTRIBUTES.get(attribute.data_type)
            is_internal = attribute.is_internal or attribute.name == "position"
            if stored and attribute.domain in indices and not is_internal:
                values = _read(attribute.data, *stored)[indices[attribute.domain]]
                arrays[f"{attribute.data_type} {attribute.name}"] = values
        return arrays


_ATTRIBUTES = {
    "FLOAT": ("value", np.float32),
    "INT": ("value", np.int32),
    "FLOAT_VECTOR": ("vector", np.float32, 3),
    "FLOAT_COLOR": ("color", np.float32, 4),
    "BYTE_COLOR": ("color", np.float32, 4),
    "FLOAT2": ("vector", np.float32, 2),
}
"""Property, type and width of the items of attributes that nodes read."""


def _downward(uvs: np.ndarray) -> np.ndarray:
    """Texture coordinates as glTF has them, v down."""
    return np.stack([uvs[:, 0], 1 - uvs[:, 1]], axis=1)


def _read(items: bpy.types.bpy_prop_collection, name: str, kind: type, width: int = 1) -> np.ndarray:
    values = np.empty(len(items) * width, kind)
    items.foreach_get(name, values)
    return values.reshape(-1, width) if width > 1 else values


def materials_of(ob: bpy.types.Object, real: bpy.types.Object) -> list[bpy.types.Material | None]:
    """Materials of an evaluated object's slots.

    `real` is the object that states them: another than `ob` for instances of geometry nodes.
    """
    if real.data is not None and ob.data is not None and real.data.as_pointer() == ob.data.as_pointer():
        return [slot.material for slot in real.material_slots]
    return list(ob.data.materials)
