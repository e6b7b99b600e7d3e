"""Exports evaluated meshes: triangles by material, with normals and texture coordinates of corners."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from ..glb import Glb
from ..notices import Notices
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

    def mesh_of(self, ob: bpy.types.Object, real: bpy.types.Object) -> int | None:
        """Index of the mesh of an evaluated object; `None` if it has no faces.

        `real` is the object that states the materials: another than `ob` for instances of geometry nodes.
        """
        if ob.type != "MESH":
            # The faces of curves, texts, surfaces and metaballs are instances of their own, of this type.
            if ob.type in _NOT_SURFACES:
                self._notices.add(_NOT_SURFACES[ob.type], ob.name)
            return None
        materials = _materials_of(ob, real)
        key = (ob.data.as_pointer(), *(material.as_pointer() if material else 0 for material in materials))
        if key not in self._known:
            self._known[key] = self._add(ob.data, ob.name, materials)
        return self._known[key]

    def _add(self, mesh: bpy.types.Mesh, name: str, materials: list[bpy.types.Material | None]) -> int | None:
        primitives = []
        corners = Corners(mesh, name, self._notices)
        for slot, triangles in corners.by_material(len(materials)):
            use = self._materials.use(materials[slot] if materials else None)
            primitives.append(self._primitive(corners, triangles, use))
        if not primitives:
            return None
        return self._glb.add("meshes", {"name": mesh.name, "primitives": primitives})

    def _primitive(self, corners: Corners, triangles: np.ndarray, use: MaterialUse) -> dict[str, object]:
        """A primitive of triangles, rows of three corners."""
        used = np.zeros(corners.count, bool)
        used[triangles] = True
        kept = np.flatnonzero(used)
        places = np.cumsum(used, dtype=np.uint32) - 1
        attributes = {
            "POSITION": self._glb.attribute(corners.positions(kept), with_bounds=True),
            "NORMAL": self._glb.attribute(corners.normals(kept)),
        }
        for number, uv_map in enumerate(use.uv_maps):
            attributes[f"TEXCOORD_{number}"] = self._glb.attribute(corners.uvs(kept, uv_map))
        if use.colours is not None:
            attributes["COLOR_0"] = self._glb.attribute(corners.colours(kept, use.colours))
        indices = self._glb.indices(places[triangles].reshape(-1))
        primitive: dict[str, object] = {"attributes": attributes, "indices": indices}
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
        uvs = _read(layer.uv, "vector", np.float32, 2)[kept]
        uvs[:, 1] = 1 - uvs[:, 1]
        return uvs

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


def _read(items: bpy.types.bpy_prop_collection, name: str, kind: type, width: int = 1) -> np.ndarray:
    values = np.empty(len(items) * width, kind)
    items.foreach_get(name, values)
    return values.reshape(-1, width) if width > 1 else values


def _materials_of(ob: bpy.types.Object, real: bpy.types.Object) -> list[bpy.types.Material | None]:
    if real.data is not None and ob.data is not None and real.data.as_pointer() == ob.data.as_pointer():
        return [slot.material for slot in real.material_slots]
    return list(ob.data.materials)
