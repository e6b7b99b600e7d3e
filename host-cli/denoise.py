"""Denoises R G B of an EXR file by Open Image Denoise, with its layers `albedo` and `N`: `denoise.py IN.exr OUT.exr`."""

import os
import sys

import numpy
import OpenEXR
import pyoidn

AUXILIARY = {"albedo": ["albedo.R", "albedo.G", "albedo.B"], "normal": ["N.X", "N.Y", "N.Z"]}
RADIANCE = ["R", "G", "B"]


def image(channels, names):
    missing = [name for name in names if name not in channels]
    if missing:
        sys.exit(f"denoise.py: the picture has no channel {', '.join(missing)}; render it with --aov albedo,N")
    planes = [channels[name].pixels.astype(numpy.float32) for name in names]
    return numpy.nan_to_num(numpy.stack(planes, axis=-1))


def main(source, target):
    # Attributes of the file, its provenance among them, and all other channels are kept.
    with OpenEXR.File(source, separate_channels=True) as file:
        channels, header = file.channels(), file.header()
        inputs = {name: image(channels, names) for name, names in AUXILIARY.items()}
        denoised = pyoidn.denoise(image(channels, RADIANCE), **inputs, hdr=True)
        for plane, name in enumerate(RADIANCE):
            pixels = channels[name].pixels
            pixels[...] = denoised[..., plane].astype(pixels.dtype)
        partial = f"{target}.denoising"
        try:
            OpenEXR.File(header, channels).write(partial)
            os.replace(partial, target)
        finally:
            if os.path.exists(partial):
                os.remove(partial)


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except (RuntimeError, OSError) as error:
        sys.exit(f"denoise.py: {error}")
