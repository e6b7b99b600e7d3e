"""Axes of glTF, whose y points up, and of Blender, whose z does."""

from __future__ import annotations

import math

import numpy as np
from mathutils import Matrix

_TO_GLTF = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


def node_matrix(world: Matrix) -> list[float] | None:
    """The transform of an object as glTF's column-major matrix; `None` if it is not finite."""
    matrix = _TO_GLTF @ world
    values = [matrix[row][column] for column in range(4) for row in range(4)]
    values[3] = values[7] = values[11] = 0.0
    values[15] = 1.0
    return values if all(math.isfinite(value) for value in values) else None


def from_gltf(vectors: np.ndarray) -> np.ndarray:
    """Vectors of glTF's axes, in the last dimension, in those of Blender."""
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)
