"""Mitsuba's textures of those of a glTF file.

Texels are decoded, and multiplied by factors, before Mitsuba interpolates between them, as glTF wants it.
"""

import mitsuba as mi
import numpy as np

# Texels of an opacity for each texel of the alpha that it comes from.
MASK_OVERSAMPLING = 16


def colour(texture, factor):
    """Red, green and blue, times a factor."""
    texels = pixels(texture)[..., :3]
    # IEC 61966-2-1.
    linear = np.where(texels <= 0.04045, texels / 12.92, ((texels + 0.055) / 1.055) ** 2.4)
    return bitmap(texture, linear * factor, "bilinear")


def cut_out(texture, factor, cutoff):
    """One where the interpolated alpha is at least the cutoff, zero elsewhere.

    Mitsuba would interpolate what has been compared; so what has been interpolated is compared, on a finer grid whose
    texels are then taken as they are.
    """
    alpha = pixels(texture)[..., 3] * factor
    for axis in (0, 1):
        alpha = finer(alpha, axis, texture.wrap[1 - axis])
    return bitmap(texture, (alpha >= cutoff).astype(np.float64)[..., None], "nearest")


def finer(values, axis, wrap):
    """Values interpolated at the middles of texels that are finer along an axis."""
    count = values.shape[axis]
    places = (np.arange(count * MASK_OVERSAMPLING) + 0.5) / MASK_OVERSAMPLING - 0.5
    below = np.floor(places).astype(np.int64)
    share = (places - below).reshape([-1 if axis == each else 1 for each in range(2)])

    def taken(index):
        return np.take(values, index % count if wrap == "repeat" else np.clip(index, 0, count - 1), axis)

    return taken(below) * (1.0 - share) + taken(below + 1) * share


def pixels(texture):
    """The texels as they are encoded, RGBA within 0 and 1, rows from the top."""
    stream = mi.MemoryStream()
    stream.write(texture.image)
    stream.seek(0)
    picture = mi.Bitmap(stream)
    # Only the layout is changed: both ends say that they are encoded.
    picture.set_srgb_gamma(True)
    picture = picture.convert(mi.Bitmap.PixelFormat.RGBA, mi.Struct.Type.UInt8, True)
    return np.array(picture).astype(np.float64) / 255.0


def bitmap(texture, values, filter_type):
    """A texture of linear values."""
    if texture.wrap[0] != texture.wrap[1]:
        raise ValueError("Mitsuba wraps both coordinates alike")
    to_uv = np.eye(4)
    to_uv[:2, :2] = texture.matrix
    to_uv[:2, 3] = texture.offset
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(values, dtype=np.float32)),
        "raw": True,
        "filter_type": filter_type,
        "wrap_mode": texture.wrap[0],
        "to_uv": mi.ScalarTransform4f(to_uv),
    }
