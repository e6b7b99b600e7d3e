"""The render engine: a scene is exported, rendered by the command, and read back."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Sequence

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from . import command, events, exr
from .baking import BakeCancelledError, Baked, BakeError, BakeJob, bake_materials, bake_world
from .export.camera import CameraError, frame_of
from .export.objects import Exported, export
from .glb import TooLarge
from .packets import Tile
from .passes import matte_fields, passes_of
from .properties import program_stated
from .viewport import Viewport, region_camera

IDENTIFIER = "PHOTONCARD"

_INTERVAL = 0.1
"""Seconds between looks at what the user wants."""
_PHASES = {
    "pilot": (0.0, 0.1),
    "photons": (0.1, 0.2),
    "pack": (0.2, 0.23),
    "load": (0.23, 0.25),
    "tiles": (0.25, 1.0),
}
"""Shares of the whole at which phases begin and end."""


class PhotoncardEngine(bpy.types.RenderEngine):
    """photoncard as a render engine."""

    bl_idname = IDENTIFIER
    bl_label = "photoncard"
    bl_use_eevee_viewport = True
    bl_use_postprocess = True
    bl_use_preview = False

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Renders a view layer of a frame."""
        try:
            _Picture(self, depsgraph).render()
        except (CameraError, TooLarge, command.CommandError, exr.ExrError, OSError) as error:
            self._fail(str(error))
        except Exception as error:
            # Blender shows no errors of Python, and would show an empty picture.
            self._fail(
                f"The extension failed ({type(error).__name__}: {error}); the console has the details."
            )
            raise

    def _fail(self, message: str) -> None:
        self.report({"ERROR"}, message)
        self.error_set(message)

    def view_update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Notes changes of the scene that a viewport shows."""
        self._shown().update(depsgraph)

    def view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Shows the picture so far in a viewport."""
        viewport = self._shown()
        try:
            viewport.follow(*region_camera(context), depsgraph)
        except (TooLarge, command.CommandError, OSError) as error:
            viewport.error = str(error)
        self.update_stats("", viewport.error or viewport.status())
        picture = viewport.picture()
        if picture is not None:
            self._draw(picture, context)

    def __del__(self) -> None:
        viewport = getattr(self, "_viewport", None)
        if viewport is not None:
            viewport.free()
        if hasattr(super(), "__del__"):
            super().__del__()

    def _shown(self) -> Viewport:
        # Blender makes engines without calling a constructor in some versions.
        if getattr(self, "_viewport", None) is None:
            self._viewport = Viewport(self.tag_redraw)
        return self._viewport

    def _draw(self, picture: np.ndarray, context: bpy.types.Context) -> None:
        height, width, _ = picture.shape
        pixels = gpu.types.Buffer("FLOAT", picture.size, picture.reshape(-1))
        texture = gpu.types.GPUTexture((width, height), format="RGBA32F", data=pixels)
        gpu.state.blend_set("ALPHA_PREMULT")
        self.bind_display_space_shader(context.scene)
        draw_texture_2d(texture, (0, 0), context.region.width, context.region.height)
        self.unbind_display_space_shader()
        gpu.state.blend_set("NONE")

    def update_render_passes(self, scene: bpy.types.Scene, renderlayer: bpy.types.ViewLayer) -> None:
        """States the passes of a view layer."""
        for stated in passes_of(renderlayer, scene.photoncard.use_denoising):
            self.register_pass(
                scene, renderlayer, stated.name, len(stated.channels), stated.channels, stated.kind
            )


class _Picture:
    """One render of a view layer."""

    def __init__(self, engine: PhotoncardEngine, depsgraph: bpy.types.Depsgraph) -> None:
        self._engine = engine
        self._depsgraph = depsgraph
        self._scene = depsgraph.scene
        self._layer = depsgraph.view_layer
        self._frame = frame_of(self._scene.render)
        self._passes = passes_of(self._layer, self._scene.photoncard.use_denoising)
        self._progress = 0.0
        self._phase = ""

    def render(self) -> None:
        engine = self._engine
        if self._scene.render.use_multiview:
            raise command.CommandError("Stereoscopy is not rendered: untick it in the output settings.")
        if min(self._frame.size) < 1:
            raise command.CommandError("The render region has no pixels: make it larger, or untick it.")
        program = command.find(program_stated(), os.path.dirname(__file__))
        engine.update_stats("", "Exporting the scene")
        camera = engine.camera_override or self._scene.camera
        stated = self._scene.photoncard
        try:
            exported = export(
                self._depsgraph,
                camera,
                self._frame,
                self._bake_world if stated.use_bake else None,
                self._bake_materials if stated.use_material_bake else None,
            )
        except BakeCancelledError:
            return
        for line in exported.notices.lines():
            engine.report({"WARNING"}, line)
        with tempfile.TemporaryDirectory(prefix="photoncard-", dir=bpy.app.tempdir) as folder:
            self._render_in(folder, program, exported)

    def _bake_world(self, world: bpy.types.World) -> np.ndarray:
        return bake_world(world, self._is_cancelled)

    def _bake_materials(self, jobs: Sequence[BakeJob], folder: str) -> list[Baked | BakeError]:
        self._engine.update_stats("", "Baking materials")
        size, frame = self._scene.photoncard.bake_size, self._scene.frame_current
        return bake_materials(jobs, folder, size, frame, self._is_cancelled)

    def _render_in(self, folder: str, program: str, exported: Exported) -> None:
        output = os.path.join(folder, "picture.exr")
        arguments = exported.write(folder)
        run = command.Run(command.render_command(program, arguments, self._settings(), output), folder)
        try:
            while not run.is_over:
                if self._is_cancelled():
                    return
                self._take(run.received(_INTERVAL))
        finally:
            run.stop()
        run.check()
        self._engine.update_stats("", "Reading the picture")
        self._show(exr.read(output))
        self._engine.update_progress(1.0)

    def _is_cancelled(self) -> bool:
        return self._engine.test_break()

    def _settings(self) -> command.Settings:
        frame = self._frame
        settings = self._scene.photoncard.command_settings((frame.width, frame.height))
        settings.crop = None if frame.is_whole else frame.border
        settings.is_transparent = self._scene.render.film_transparent
        settings.layers = list(dict.fromkeys(stated.layer for stated in self._passes if stated.layer))
        return settings

    def _take(self, received: Iterable[Tile | events.Event]) -> None:
        for item in received:
            if isinstance(item, Tile):
                self._show_tile(item)
            elif isinstance(item, events.Progress):
                self._show_progress(item)
            elif isinstance(item, events.Remark):
                kind = "INFO" if item.kind == "message" else "WARNING"
                self._engine.report({kind}, str(item))

    def _show_progress(self, progress: events.Progress) -> None:
        begin, end = _PHASES.get(progress.phase, (self._progress, self._progress))
        self._progress = max(self._progress, begin + (end - begin) * progress.share)
        self._engine.update_progress(self._progress)
        done = f"{progress.phase.capitalize()} {progress.done:g}/{progress.total:g}"
        left = progress.seconds_left
        self._engine.update_stats("", done if left is None else f"Remaining: {_clock(left)} | {done}")

    def _show_tile(self, tile: Tile) -> None:
        width, height = self._frame.size
        is_inside = 0 <= tile.x <= width - tile.width and 0 <= tile.y <= height - tile.height
        if not is_inside or not {"R", "G", "B"} <= tile.channels.keys():
            return
        pixels = self._passes[0].pixels({**tile.channels, **_as_denoised(tile.channels)})
        result = self._begin(tile.x, height - tile.y - tile.height, tile.width, tile.height)
        _set(result.layers[0].passes["Combined"], pixels)
        self._engine.end_result(result)

    def _show(self, picture: exr.Picture) -> None:
        if (picture.width, picture.height) != self._frame.size:
            width, height = self._frame.size
            raise exr.ExrError(
                f"The picture has {picture.width}x{picture.height} pixels in place of {width}x{height}."
            )
        engine = self._engine
        for stated in self._passes:
            engine.add_pass(stated.name, len(stated.channels), stated.channels, layer=self._layer.name)
        result = self._begin(0, 0, picture.width, picture.height)
        for field, value in matte_fields(picture.attributes, self._layer.name):
            result.stamp_data_add_field(field, value)
        shown = result.layers[0].passes
        for stated in self._passes:
            _set(shown[stated.name], stated.pixels(picture.channels))
        engine.end_result(result)

    def _begin(self, x: int, y: int, width: int, height: int) -> bpy.types.RenderResult:
        return self._engine.begin_result(x, y, width, height, layer=self._layer.name)


def _as_denoised(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Tiles stand for the denoised picture until it is there."""
    return {f"denoised.{name}": channels[name] for name in "RGB"}


def _set(shown: bpy.types.RenderPass, pixels: np.ndarray) -> None:
    shown.rect.foreach_set(pixels.reshape(-1))


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours:02}:{minutes:02}:{rest:02}" if hours else f"{minutes:02}:{rest:02}"
