"""Makes the picture on the wall of the room: `painting.py OUT.jpg` (needs Pillow and NumPy)."""

import sys

import numpy as np
from PIL import Image

WIDTH, HEIGHT = 320, 240
# Where each is, how high, how many waves it has, and its colour.
RIDGES = [
    (0.5, 0.10, 5.0, (110, 110, 140)),
    (0.6, 0.13, 8.0, (60, 90, 70)),
    (0.68, 0.05, 13.0, (34, 56, 40)),
]


def main():
    """A sun beside hills over a lake."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] / np.array([HEIGHT, WIDTH]).reshape(2, 1, 1)
    picture = blend((60, 90, 170), (250, 190, 120), np.clip(y / 0.6, 0.0, 1.0))
    sun = np.exp(-(((x - 0.28) * 4.0 / 3.0) ** 2 + (y - 0.3) ** 2) / 0.006)
    picture = picture * (1.0 - sun[..., None]) + np.array([255.0, 244.0, 200.0]) * sun[..., None]
    for base, height, waves, colour in RIDGES:
        ridge = base - height * (0.5 + 0.5 * np.sin(waves * x + 7.0 * base)) * (0.4 + x)
        picture[y > ridge] = colour
    lake = y > 0.72
    ripples = 0.5 + 0.5 * np.sin(90.0 * y**2 + 3.0 * np.sin(20.0 * x))
    picture[lake] = blend((40, 70, 110), (170, 150, 140), ripples)[lake]
    Image.fromarray(picture.clip(0, 255).astype(np.uint8)).save(sys.argv[1], quality=90, subsampling=0)


def blend(first, second, share):
    """Between two colours."""
    return np.array(first) * (1.0 - share[..., None]) + np.array(second) * share[..., None]


if __name__ == "__main__":
    main()
