"""The mean of pictures: `mean.py OUT.exr IN.exr ...`."""

import sys

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
output, *inputs = sys.argv[1:]
pictures = [np.array(mi.Bitmap(path)) for path in inputs]
mi.Bitmap(np.mean(pictures, axis=0, dtype=np.float64).astype(np.float32)).write(output)
