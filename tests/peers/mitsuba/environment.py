"""Mitsuba's light from infinitely far of an equirectangular map, as photoncard takes it.

Photoncard's map has -z in its middle and y up, and its texels have no gradients. Mitsuba's has -z at its left edge, holds the
rows at the poles and at equal steps between them, and interpolates: so it is given a finer map of the same radiance.
"""

import mitsuba as mi
import numpy as np

OVERSAMPLING = 16


def emitter(path):
    """The environment of a map."""
    picture = mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    texels = np.array(picture)
    height, width = texels.shape[:2]
    rows = np.linspace(0.0, height, height * OVERSAMPLING + 1).astype(np.int64).clip(0, height - 1)
    columns = (np.arange(width * OVERSAMPLING) + 0.5) / OVERSAMPLING
    finer = texels[rows][:, columns.astype(np.int64)]
    half_turn = mi.ScalarTransform4f().rotate([0.0, 1.0, 0.0], 180.0)
    return {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(finer)), "to_world": half_turn}
