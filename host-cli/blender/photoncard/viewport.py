"""Viewport shading *Rendered*: a session of `photoncard view` whose camera follows the region."""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import command
from .baking import BakeError, bake_world
from .export.camera import Frame, lens_of
from .export.objects import export
from .properties import program_stated
from .session import MAX_PIXELS, MAX_SIDE, Camera, Session

_REST = 0.15
"""Seconds without a change of the scene after which it is exported."""
_SCENE = (
    bpy.types.Collection,
    bpy.types.Image,
    bpy.types.Light,
    bpy.types.Material,
    bpy.types.NodeTree,
    bpy.types.Object,
    bpy.types.Scene,
    bpy.types.World,
)
"""Kinds of data of which a change may change the picture.

Meshes and curves change with their objects, and the visibility of objects with the scene.
"""


class Viewport:
    """The picture of a region."""

    def __init__(self, tag_redraw: Callable[[], None]) -> None:
        """`tag_redraw` asks for a call of `draw`, from any thread."""
        self._tag = tag_redraw
        self._is_free = False
        self._folder = tempfile.TemporaryDirectory(prefix="photoncard-view-", dir=bpy.app.tempdir)
        self._session: Session | None = None
        self._command: list[str] = []
        self._changed_at: float | None = time.monotonic() - _REST
        self._worlds: dict[str, np.ndarray | BakeError] = {}
        self._notices: list[str] = []
        self._camera: Camera | None = None
        self._size = (0, 0)
        self.error = ""
        """Why there is no picture; empty if there is one."""

    def update(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Notes changes of the scene."""
        updates = [update.id for update in depsgraph.updates]
        if any(_is_of_world(changed, depsgraph.scene.world) for changed in updates):
            self._worlds.clear()
        if any(isinstance(changed, _SCENE) and not _is_camera(changed) for changed in updates):
            self._changed_at = time.monotonic()
        self._tag_redraw()

    def follow(self, camera: Camera, size: tuple[int, int], depsgraph: bpy.types.Depsgraph) -> None:
        """Exports the scene if it has changed, and gives the view the camera and the size of the region."""
        self._export(depsgraph)
        session = self._session
        if session is None:
            return
        if session.is_over:
            self.error = f"{session.error or 'photoncard has ended.'} A change of the scene starts it anew."
            return
        self.error = session.error
        if size != self._size:
            self._size = size
            session.resize(*size)
        if camera != self._camera:
            self._camera = camera
            session.look(camera)

    def picture(self) -> np.ndarray | None:
        """The picture so far: RGBA, linear, rows from the bottom."""
        return self._session.picture() if self._session else None

    def status(self) -> str:
        """What the session is at."""
        state: dict[str, Any] = self._session.state if self._session else {}
        if not state:
            return "Starting"
        shown = "Done" if state.get("settled") else f"Samples: {state.get('samples') or 0}"
        return " | ".join([shown, *self._notices])

    def free(self) -> None:
        """Ends the session."""
        self._is_free = True
        if self._session:
            self._session.stop()
            self._session = None
        self._folder.cleanup()

    def _tag_redraw(self) -> None:
        try:
            if not self._is_free:
                self._tag()
        except ReferenceError:
            # Blender has removed the engine.
            self._is_free = True

    def _export(self, depsgraph: bpy.types.Depsgraph) -> None:
        if self._changed_at is None:
            return
        if time.monotonic() - self._changed_at < _REST:
            self._tag_redraw()
            return
        self._changed_at = None
        scene = depsgraph.scene
        bake = self._bake if scene.photoncard.use_bake else None
        exported = export(depsgraph, scene.camera, Frame(1, 1, (0, 1, 0, 1)), bake, is_view=True)
        self._notices = exported.notices.lines()
        arguments = exported.write(self._folder.name)
        wanted = self._view_command(arguments, scene)
        if self._session and not self._session.is_over and wanted == self._command:
            self._session.reload()
            return
        if self._session:
            self._session.stop()
        self._command = wanted
        self._camera, self._size = None, (0, 0)
        try:
            self._session = Session(wanted, self._folder.name, self._tag_redraw)
        except OSError as error:
            self._session = None
            self.error = f"photoncard cannot be started: {error}"

    def _view_command(self, scene_arguments: list[str], scene: bpy.types.Scene) -> list[str]:
        program = command.find(program_stated(), os.path.dirname(__file__))
        settings = scene.photoncard.command_settings((1, 1))
        options = ["--size", "64x64", "--quality", settings.quality]
        if settings.is_denoised:
            options.append("--denoise")
        if scene.render.film_transparent:
            options.append("--transparent")
        if settings.caustic_photons is not None:
            options += ["--caustic-photons", str(settings.caustic_photons)]
        for card in settings.cards:
            options += ["--card", card]
        return [program, "view", *scene_arguments, *options]

    def _bake(self, world: bpy.types.World) -> np.ndarray:
        """Bakes a world once, until it changes."""
        if world.name not in self._worlds:
            try:
                self._worlds[world.name] = bake_world(world)
            except BakeError as error:
                self._worlds[world.name] = error
        baked = self._worlds[world.name]
        if isinstance(baked, BakeError):
            raise baked
        return baked


def _is_of_world(changed: bpy.types.ID, world: bpy.types.World | None) -> bool:
    if isinstance(changed, bpy.types.ShaderNodeTree) and changed.is_embedded_data:
        return world is not None and changed.original == world.original.node_tree
    return isinstance(changed, (bpy.types.Image, bpy.types.ShaderNodeTree, bpy.types.World))


def _is_camera(changed: bpy.types.ID) -> bool:
    return isinstance(changed, bpy.types.Object) and changed.type == "CAMERA"


def size_of(width: int, height: int) -> tuple[int, int]:
    """Size of the picture of a region, within the limits of a view."""
    scale = max(1.0, width / MAX_SIDE, height / MAX_SIDE, math.sqrt(width * height / MAX_PIXELS))
    return max(1, int(width / scale)), max(1, int(height / scale))


def camera_of(
    view: Matrix,
    projection: Matrix,
    size: tuple[int, int],
    behind: float,
    lens: tuple[float, float] | None = None,
) -> Camera:
    """Camera of a region's view and projection matrices.

    That of a parallel projection stands `behind` metres behind the region's, since Blender's shows what lies
    behind itself. `lens` is the diameter and the distance in focus, metres; None is a pinhole.
    """
    world = view.inverted()
    position, forward, up = world.translation, -world.col[2].to_3d(), world.col[1].to_3d()
    width, height = size
    longer = 2 * max(size)
    is_parallel = projection[3][3] == 1
    if is_parallel:
        position = position - behind * forward
    column, sign = (3, -1) if is_parallel else (2, 1)
    shift = (sign * projection[0][column] * width / longer, sign * projection[1][column] * height / longer)
    return Camera(
        position=_in_gltf(position),
        look_at=_in_gltf(position + forward),
        up=_in_gltf(up),
        shift=shift,
        fov=None if is_parallel else math.degrees(2 * math.atan(1 / projection[1][1])),
        height=2 / projection[1][1] if is_parallel else None,
        lens=lens or (0.0, 0.0),
    )


def _in_gltf(vector: Vector) -> tuple[float, float, float]:
    return vector.x, vector.z, -vector.y


def region_camera(context: bpy.types.Context) -> tuple[Camera, tuple[int, int]]:
    """Camera and size of the picture of the context's region."""
    region, shown, space = context.region, context.region_data, context.space_data
    size = size_of(region.width, region.height)
    ob = space.camera if shown.view_perspective == "CAMERA" else None
    is_camera = ob is not None and ob.type == "CAMERA" and ob.data.type == "PERSP"
    lens = lens_of(ob.evaluated_get(context.evaluated_depsgraph_get())) if is_camera else None
    return camera_of(shown.view_matrix, shown.window_matrix, size, space.clip_end / 2, lens), size
