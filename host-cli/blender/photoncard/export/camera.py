"""Exports the camera of a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bpy

from ..glb import Glb
from ..notices import Notices
from .axes import node_matrix


class CameraError(Exception):
    """A camera that photoncard does not have, with what helps."""


@dataclass
class Frame:
    """Size of the whole picture, pixels, and the border that is rendered: columns and rows from the top."""

    width: int
    height: int
    border: tuple[int, int, int, int]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of what is rendered."""
        left, right, top, bottom = self.border
        return right - left, bottom - top

    @property
    def is_whole(self) -> bool:
        """True if nothing of the picture is left out."""
        return self.border == (0, self.width, 0, self.height)


def frame_of(render: bpy.types.RenderSettings) -> Frame:
    """The picture that render settings ask for, as Blender rounds it."""
    width = render.resolution_x * render.resolution_percentage // 100
    height = render.resolution_y * render.resolution_percentage // 100
    border = (0, width, 0, height)
    if render.use_border:
        left, right = int(render.border_min_x * width), int(render.border_max_x * width)
        low, high = int(render.border_min_y * height), int(render.border_max_y * height)
        border = (left, right, height - high, height - low)
    return Frame(width, height, border)


def add_camera(
    glb: Glb, ob: bpy.types.Object | None, render: bpy.types.RenderSettings, frame: Frame, notices: Notices
) -> None:
    """Adds the camera with the aspect ratio of `frame`.

    Raises `CameraError` if there is none, or one that cannot be rendered.
    """
    if ob is None:
        raise CameraError(
            "The scene has no camera: add one, or choose it as Camera in the scene's properties."
        )
    if ob.type != "CAMERA":
        raise CameraError(f"{ob.name} is no camera: choose one as Camera in the scene's properties.")
    matrix = node_matrix(ob.matrix_world)
    if matrix is None:
        raise CameraError(f"The camera {ob.name} has no finite transform: clear its transforms.")
    lens = ob.data
    camera: dict[str, Any] = {"name": ob.name}
    extras: dict[str, Any] = {}
    if lens.type == "PANO":
        _panorama(lens, frame, camera, extras)
    else:
        _flat(ob, lens, render, frame, camera, extras, notices)
    if extras:
        camera["extras"] = {"photoncard": extras}
    glb.add_node({"name": ob.name, "matrix": matrix, "camera": glb.add("cameras", camera)})
    if render.pixel_aspect_x != render.pixel_aspect_y:
        notices.add("pixels are rendered square: the pixel aspect is to be 1")


def _flat(
    ob: bpy.types.Object,
    lens: bpy.types.Camera,
    render: bpy.types.RenderSettings,
    frame: Frame,
    camera: dict[str, Any],
    extras: dict[str, Any],
    notices: Notices,
) -> None:
    aspect = frame.width / frame.height
    fits_width = lens.sensor_fit == "HORIZONTAL" or lens.sensor_fit == "AUTO" and aspect >= 1
    to_height = 1 / aspect if fits_width else 1.0
    if lens.type == "ORTHO":
        half = lens.ortho_scale / 2 * to_height
        camera["type"] = "orthographic"
        camera["orthographic"] = {"xmag": half * aspect, "ymag": half, "znear": 0.0, "zfar": 1e6}
    elif lens.type == "PERSP":
        sensor = lens.sensor_height if lens.sensor_fit == "VERTICAL" else lens.sensor_width
        tangent = sensor / (2 * lens.lens) * to_height
        camera["type"] = "perspective"
        camera["perspective"] = {"aspectRatio": aspect, "yfov": 2 * math.atan(tangent), "znear": 1e-3}
    else:
        raise CameraError(
            f"Cameras of the type {lens.type.title()} are not rendered: choose Perspective, Orthographic or "
            "Panoramic."
        )
    if lens.shift_x or lens.shift_y:
        fitted, longer = (frame.width if fits_width else frame.height), max(frame.width, frame.height)
        extras["shift"] = [lens.shift_x * fitted / longer, lens.shift_y * fitted / longer]
    if lens.dof.use_dof:
        _depth_of_field(ob, lens, extras, notices)


def _depth_of_field(
    ob: bpy.types.Object, lens: bpy.types.Camera, extras: dict[str, Any], notices: Notices
) -> None:
    if lens.type == "ORTHO":
        notices.add("orthographic cameras are rendered without depth of field", ob.name)
        return
    dof = lens.dof
    if dof.aperture_blades >= 3 or dof.aperture_ratio != 1:
        notices.add("apertures are round", ob.name)
    found = lens_of(ob)
    if found is not None:
        extras["aperture"], extras["focus"] = found


def lens_of(ob: bpy.types.Object) -> tuple[float, float] | None:
    """Diameter of a camera's lens and its distance in focus, metres; None for a pinhole."""
    lens, dof = ob.data, ob.data.dof
    if not dof.use_dof:
        return None
    distance = dof.focus_distance
    if dof.focus_object:
        target = dof.focus_object.matrix_world
        if dof.focus_subtarget and dof.focus_object.type == "ARMATURE":
            bone = dof.focus_object.pose.bones.get(dof.focus_subtarget)
            target = target @ bone.matrix if bone else target
        view = ob.matrix_world.to_3x3().col[2].normalized()
        distance = abs((target.translation - ob.matrix_world.translation).dot(view))
    diameter = lens.lens * 1e-3 / dof.aperture_fstop
    return (diameter, distance) if distance > 0 and diameter > 0 else None


def _panorama(lens: bpy.types.Camera, frame: Frame, camera: dict[str, Any], extras: dict[str, Any]) -> None:
    # Before Blender 5.0 these are properties of Cycles.
    stated = lens if hasattr(lens, "panorama_type") else getattr(lens, "cycles", None)
    kind = getattr(stated, "panorama_type", "EQUIRECTANGULAR")
    if kind != "EQUIRECTANGULAR":
        raise CameraError(
            f"Panoramas of the type {kind.replace('_', ' ').title()} are not rendered: "
            "choose Equirectangular."
        )
    west, east = (
        getattr(stated, name, limit)
        for name, limit in (("longitude_min", -math.pi), ("longitude_max", math.pi))
    )
    south, north = (
        getattr(stated, name, limit)
        for name, limit in (("latitude_min", -math.pi / 2), ("latitude_max", math.pi / 2))
    )
    if abs(west + east) > 1e-4 or abs(south + north) > 1e-4:
        raise CameraError(
            "Panoramas are rendered around the view direction: state a Min. of minus the Max. for latitude "
            "and longitude, and turn the camera."
        )
    camera["type"] = "perspective"
    camera["perspective"] = {"aspectRatio": frame.width / frame.height, "yfov": 1.0, "znear": 1e-3}
    extras["panorama"] = [math.degrees(east - west), math.degrees(north - south)]
