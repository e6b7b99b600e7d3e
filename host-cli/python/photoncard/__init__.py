"""Global illumination by photon mapping: renders, measures and bakes glTF scenes by its command.

>>> import photoncard as pc
>>> scene = pc.load("scenes/room.glb")
>>> scene["lamp"].emission = 28, 24, 19
>>> picture = scene.render(size=(64, 48), quality="draft", photons=5000, aov=["indirect"])
>>> picture.image.shape
(48, 64, 3)
>>> bool((picture["indirect"] <= picture.image * 1.0001).all())
True
"""

from importlib.metadata import PackageNotFoundError, version

from ._command import command
from ._errors import Error, UnknownName, UnknownOption, UnknownProperty
from ._exr import Exr, read_exr
from ._measure import Measurement, bake, measure
from ._picture import Picture, read
from ._process import Note, Progress
from ._render import merge
from ._scene import Item, Scene, load
from ._sweep import Sweep, sweep
from ._table import Table

try:
    __version__ = version("photoncard")
except PackageNotFoundError:
    __version__ = "unknown"

__all__ = [
    "Error",
    "Exr",
    "Item",
    "Measurement",
    "Note",
    "Picture",
    "Progress",
    "Scene",
    "Sweep",
    "Table",
    "UnknownName",
    "UnknownOption",
    "UnknownProperty",
    "bake",
    "command",
    "load",
    "measure",
    "merge",
    "read",
    "read_exr",
    "sweep",
]
