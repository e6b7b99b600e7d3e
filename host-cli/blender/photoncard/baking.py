"""Bakes nodes that glTF has no counterpart of, by Cycles in another Blender without a window.

Cycles cannot be called inside a render of another engine, and another Blender changes nothing of this one.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from . import exr

_FOLDER = os.path.dirname(__file__)
_PATIENCE = 300
"""Seconds that a world may take, and each job of a material."""
_INTERVAL = 0.1
"""Seconds between looks at whether the user has cancelled."""

IsCancelled = Callable[[], bool]


class BakeError(Exception):
    """Nodes that could not be baked, with the reason."""


class BakeCancelledError(Exception):
    """The user has cancelled the render."""


@dataclass(frozen=True)
class BakeJob:
    """Inputs of a material to be baked on a part of an object."""

    material: bpy.types.Material
    inputs: dict[tuple[str, ...], bool]
    """Paths of inputs, with whether each is a normal."""
    ob: dict[str, object]
    """What nodes can ask of the object: name, transform and others."""
    arrays: dict[str, np.ndarray]
    """The part's mesh."""


@dataclass(frozen=True)
class Baked:
    """What a job has made: texture coordinates of corners, v up, and a file for each input."""

    uvs: np.ndarray
    files: list[str]

    def image(self, number: int) -> np.ndarray:
        """Linear RGB of an input by its number, of the shape (height, width, 3), the bottom line first."""
        return np.load(self.files[number])


def bake_world(world: bpy.types.World, is_cancelled: IsCancelled = lambda: False) -> np.ndarray:
    """The light of a world as an equirectangular map of the shape (height, width, 3), the top line first.

    Raises `BakeError` or `BakeCancelledError`.
    """
    with tempfile.TemporaryDirectory(prefix="photoncard-bake-", dir=bpy.app.tempdir) as folder:
        library, output = os.path.join(folder, "world.blend"), os.path.join(folder, "world.exr")
        try:
            bpy.data.libraries.write(library, {world.original}, fake_user=True)
            _run("bake_world.py", [library, world.original.name, output], _PATIENCE, is_cancelled)
            channels = exr.read(output).channels
            return np.stack([channels[name] for name in "RGB"], axis=-1)
        except (OSError, RuntimeError, exr.ExrError, KeyError, subprocess.SubprocessError) as error:
            raise BakeError(f"Cycles could not bake it: {error}") from error


def bake_materials(
    jobs: Sequence[BakeJob], folder: str, size: int, frame: int, is_cancelled: IsCancelled
) -> list[Baked | BakeError]:
    """Bakes materials to square images of `size` texels a side at a frame, with files in `folder`.

    Raises `BakeError` if no job can be done, or `BakeCancelledError`.
    """
    own = os.path.join(folder, "materials.blend")
    described = []
    for number, job in enumerate(jobs):
        np.savez(os.path.join(folder, f"{number}.npz"), **job.arrays)
        inputs = [{"path": path, "is_normal": is_normal} for path, is_normal in job.inputs.items()]
        linked = job.material.original.library
        library = bpy.path.abspath(linked.filepath) if linked else own
        material = {"library": library, "name": job.material.original.name}
        described.append({"object": job.ob, "material": material, "inputs": inputs})
    try:
        # Blender writes no contents of linked materials.
        local = {job.material.original for job in jobs if not job.material.original.library}
        bpy.data.libraries.write(own, local, fake_user=True)
        with open(os.path.join(folder, "jobs.json"), "w", encoding="utf-8") as file:
            json.dump({"size": size, "frame": frame, "jobs": described}, file)
        _run("bake_materials.py", [folder], _PATIENCE * len(jobs), is_cancelled)
        with open(os.path.join(folder, "failures.json"), encoding="utf-8") as file:
            failures = json.load(file)
    except (OSError, ValueError, RuntimeError, subprocess.SubprocessError) as error:
        raise BakeError(f"Cycles could not bake them: {error}") from error
    return [_result(folder, number, job, failures) for number, job in enumerate(jobs)]


def _result(folder: str, number: int, job: BakeJob, failures: dict[str, str]) -> Baked | BakeError:
    if str(number) in failures:
        return BakeError(failures[str(number)])
    files = [os.path.join(folder, f"{number}-{place}.npy") for place in range(len(job.inputs))]
    return Baked(np.load(os.path.join(folder, f"{number}-uvs.npy")), files)


def _run(script: str, arguments: list[str], patience: float, is_cancelled: IsCancelled) -> None:
    path = os.path.join(_FOLDER, script)
    # The package bpy of Python has no program of its own.
    program = [sys.executable, path]
    if bpy.app.binary_path and not getattr(bpy.app, "module", False):
        options = ["--background", "--factory-startup", "--python-exit-code", "1", "--python", path, "--"]
        program = [bpy.app.binary_path, *options]
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    end = time.monotonic() + patience
    with subprocess.Popen([*program, *arguments], text=True, **pipes) as process:
        try:
            while True:
                try:
                    output, errors = process.communicate(timeout=_INTERVAL)
                    break
                except subprocess.TimeoutExpired:
                    if is_cancelled():
                        raise BakeCancelledError from None
                    if time.monotonic() > end:
                        raise
        finally:
            process.kill()
    if process.returncode != 0:
        said = (errors or output).strip().splitlines()
        raise RuntimeError(said[-1] if said else f"Blender ended with the status {process.returncode}")
