"""Mitsuba's light from infinitely far of an equirectangular map, as photoncard takes it.

Photoncard's map has -z in its middle and y up, and is interpolated between the centres of texels. Mitsuba's has -z at its left edge, and
holds the rows at the poles and at equal steps between them: so it is given a finer map of the same radiance.
"""

import mitsuba as mi
import numpy as np

OVERSAMPLING = 16


def emitter(path):
    """The environment of a map."""
    picture = mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    texels = np.array(picture)
    height, width = texels.shape[:2]
    rows = np.linspace(0.0, height, height * OVERSAMPLING + 1)
    columns = (np.arange(width * OVERSAMPLING) + 0.5) / OVERSAMPLING
    finer = between(between(texels, rows, 0, np.clip), columns, 1, lambda index, _, count: index % (count + 1))
    half_turn = mi.ScalarTransform4f().rotate([0.0, 1.0, 0.0], 180.0)
    return {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(finer)), "to_world": half_turn}


def between(texels, places, axis, wrap):
    """Texels interpolated along an axis; their centres are at halves."""
    below = np.floor(places - 0.5).astype(np.int64)
    share = (places - 0.5 - below).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1)).astype(np.float32)
    last = texels.shape[axis] - 1
    ends = [np.take(texels, wrap(index, 0, last), axis) for index in (below, below + 1)]
    return ends[0] * (1.0 - share) + ends[1] * share
