"""Pictures of linear radiance: read, compared in blocks, looked at."""

import bpy
import numpy as np

import png

# Side of a block, and the share of its pixels that must count.
BLOCK, FILLED = 16, 0.25
# Blocks darker than this share of the mean are compared with that share instead of themselves.
DARK = 0.05


def read(path):
    """An EXR picture of one layer, rows from the top."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    values = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, image.channels)[::-1, :, :3].astype(float)
    bpy.data.images.remove(image)
    return values


def blocks(picture, mask):
    """The mean colour of each block over the pixels that count, for blocks with enough of them."""
    result = []
    for row in range(0, mask.shape[0], BLOCK):
        for column in range(0, mask.shape[1], BLOCK):
            block = np.s_[row : row + BLOCK, column : column + BLOCK]
            if mask[block].sum() >= FILLED * BLOCK * BLOCK:
                result.append(picture[block][mask[block]].mean(axis=0))
    return np.array(result)


class Difference:
    """How far a picture is from another: the ratio of their means, and the errors of blocks."""

    def __init__(self, picture, reference, mask):
        ours, theirs = blocks(picture, mask), blocks(reference, mask)
        level = np.maximum(theirs.mean(axis=1), DARK * theirs.mean())
        self.mean = picture[mask].mean() / reference[mask].mean()
        self.errors = np.abs(ours - theirs).mean(axis=1) / level

    def median(self):
        """The error that half of the blocks exceed."""
        return np.median(self.errors)

    def high(self):
        """The error that a block in twenty exceeds."""
        return np.percentile(self.errors, 95)


def show(pictures, path, exposure=None):
    """Writes pictures side by side as one PNG, by the same exposure and sRGB's curve."""
    picture = np.concatenate(pictures, axis=1)
    if exposure is None:
        exposure = 0.8 / max(np.percentile(pictures[-1], 97), 1e-9)
    light = np.clip(picture * exposure, 0.0, 1.0)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    pixels = np.round(255.0 * curve).astype(np.uint8)
    path.write_bytes(png.encode(pixels))
