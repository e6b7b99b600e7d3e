"""The extension as a user installs it, for the tests in Blender."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import unittest
from pathlib import Path

os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="photoncard-user-")

import bpy  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parent))

import rendering  # noqa: E402

ZIP = os.environ.get("PHOTONCARD_ZIP", "")
MODULE = "bl_ext.user_default.photoncard"
# Noise of a draft and of Cycles' samples, and differences of the two models of reflection.
TOLERANCE = 0.05


def setUpModule() -> None:
    """Installs the zip by Blender's own operator, and enables the extension."""
    if not ZIP:
        raise unittest.SkipTest("PHOTONCARD_ZIP names no zip: make one by build.py")
    bpy.ops.preferences.addon_enable(module="cycles")
    bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True)


def draft(scene: bpy.types.Scene) -> bpy.types.Scene:
    """The scene with a quick quality, rendered by photoncard."""
    scene.render.engine = "PHOTONCARD"
    scene.photoncard.quality = "draft"
    rendering.use_cycles(scene, 64)
    return scene


def tearDownModule() -> None:
    """Leaves nothing behind."""
    shutil.rmtree(os.environ["BLENDER_USER_RESOURCES"], ignore_errors=True)


def run() -> None:
    """Runs the tests of the main module. The package bpy may hang when the interpreter ends."""
    result = unittest.main(exit=False).result
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0 if result.wasSuccessful() else 1)
