"""Notices objects that the clipping of a camera would cut: photoncard has none."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from ..notices import Notices


class Clipping:
    """Bounding boxes of the objects of a scene."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._boxes: list[tuple[Matrix, list[float]]] = []

    def add(self, ob: bpy.types.Object, world: Matrix) -> None:
        """Adds an object that the camera may see."""
        self._names.append(ob.name)
        self._boxes.append((world.copy(), [value for corner in ob.bound_box for value in corner]))

    def notice(self, camera: bpy.types.Object | None, notices: Notices) -> None:
        """Notices what lies wholly or in part before *Clip Start* or behind *Clip End*."""
        if camera is None or camera.type != "CAMERA" or not self._boxes:
            return
        worlds = np.array([world for world, _ in self._boxes])
        corners = np.array([box for _, box in self._boxes]).reshape(-1, 8, 3)
        placed = np.einsum("nij,nkj->nki", worlds[:, :3, :3], corners) + worlds[:, None, :3, 3]
        view = np.array(camera.matrix_world.inverted_safe())
        depths = -(placed @ view[2, :3] + view[2, 3])
        near, far = depths.min(axis=1), depths.max(axis=1)
        # Of what surrounds the camera, the nearest point is not known.
        cut = (near > 0) & (near < camera.data.clip_start) | (far > camera.data.clip_end)
        for index in np.flatnonzero(cut):
            notices.add("objects are rendered beyond the camera's clipping too", self._names[index])
