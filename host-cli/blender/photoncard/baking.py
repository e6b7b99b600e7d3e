"""Bakes nodes that glTF has no counterpart of, by Cycles in another Blender without a window.

Cycles cannot be called inside a render of another engine.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

import bpy
import numpy as np

from . import exr

_SCRIPT = os.path.join(os.path.dirname(__file__), "bake_world.py")
_PATIENCE = 300


class BakeError(Exception):
    """Nodes that could not be baked, with the reason."""


def bake_world(world: bpy.types.World) -> np.ndarray:
    """The light of a world as an equirectangular map of the shape (height, width, 3), the top line first.

    Raises `BakeError`.
    """
    with tempfile.TemporaryDirectory(prefix="photoncard-bake-", dir=bpy.app.tempdir) as folder:
        library, output = os.path.join(folder, "world.blend"), os.path.join(folder, "world.exr")
        try:
            bpy.data.libraries.write(library, {world.original}, fake_user=True)
            _run([library, world.original.name, output])
            channels = exr.read(output).channels
            return np.stack([channels[name] for name in "RGB"], axis=-1)
        except (OSError, RuntimeError, exr.ExrError, KeyError, subprocess.SubprocessError) as error:
            raise BakeError(f"Cycles could not bake it: {error}") from error


def _run(arguments: list[str]) -> None:
    # The package bpy of Python has no program of its own.
    program = [sys.executable, _SCRIPT]
    if bpy.app.binary_path and not getattr(bpy.app, "module", False):
        options = ["--background", "--factory-startup", "--python-exit-code", "1", "--python", _SCRIPT, "--"]
        program = [bpy.app.binary_path, *options]
    done = subprocess.run(
        [*program, *arguments], capture_output=True, text=True, timeout=_PATIENCE, stdin=subprocess.DEVNULL
    )
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise RuntimeError(said[-1] if said else f"Blender ended with the status {done.returncode}")
