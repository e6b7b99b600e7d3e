"""Exports lights: `KHR_lights_punctual`, and area lights in extras."""

from __future__ import annotations

import math
from typing import Any

import bpy
from mathutils import Matrix

from .. import light_units
from ..glb import Glb
from ..notices import Notices
from .axes import node_matrix
from .nodes import Place, Unsupported, active_output, input_of, resolve
from .values import constant_of

_EYE = "a light is visible to the camera only as an area light: its sphere or disk is not seen"
_FALLOFF = 1e-3


def add_light(
    glb: Glb, ob: bpy.types.Object, world: Matrix, extras: dict[str, Any], is_seen: bool, notices: Notices
) -> None:
    """Adds a light object; `extras` are those of its node."""
    light = ob.data
    if light.type == "AREA" and getattr(getattr(light, "cycles", None), "is_portal", False):
        # A portal guides the samples of Cycles, and gives no light.
        return
    colour = _colour(light, notices)
    if light.energy == 0 or colour is None or max(colour) == 0:
        return
    if min(colour) * light.energy < 0:
        notices.add("lights of negative power are not rendered", ob.name)
        return
    matrix = node_matrix(world)
    if matrix is None:
        notices.add("lights without a finite transform are not rendered", ob.name)
        return
    node: dict[str, Any] = {"name": ob.name, "matrix": matrix}
    if light.type == "AREA":
        extras = {**extras, "area_light": _area(light, colour, world, is_seen)}
        if light.spread < math.pi - _FALLOFF:
            notices.add("area lights emit with a spread of 180 degrees, whatever theirs is", ob.name)
    else:
        punctual = _punctual(light, colour, ob.name, notices)
        node["extensions"] = {"KHR_lights_punctual": {"light": glb.add_light(punctual)}}
        if is_seen:
            notices.add(_EYE, ob.name)
    if extras:
        node["extras"] = {"photoncard": extras}
    glb.add_node(node)


def _colour(light: bpy.types.Light, notices: Notices) -> tuple[float, float, float] | None:
    """Colour times all factors but the power; `None` if the light's nodes emit nothing."""
    colour = list(light.color)
    if getattr(light, "use_temperature", False):
        colour = [a * b for a, b in zip(colour, light.temperature_color)]
    factor = 2.0 ** getattr(light, "exposure", 0.0)
    if light.use_nodes and light.node_tree:
        emitted = _emission(light.node_tree, light.name, notices)
        if emitted is None:
            return None
        colour = [a * b for a, b in zip(colour, emitted)]
    return colour[0] * factor, colour[1] * factor, colour[2] * factor


def _emission(tree: bpy.types.NodeTree, name: str, notices: Notices) -> tuple[float, float, float] | None:
    """Colour times strength that a light's nodes state; `None` for no emission."""
    output = active_output(tree)
    end = resolve(Place(output.inputs["Surface"], ())) if output else None
    if end is None or not end.socket.is_output:
        return None
    try:
        if end.socket.node.bl_idname != "ShaderNodeEmission":
            raise Unsupported(end.socket.node)
        strength = constant_of(input_of(end, "Strength"))[0]
        red, green, blue, _ = constant_of(input_of(end, "Color"))
    except Unsupported as reason:
        notices.add(f"nodes of lights are ignored ({reason})", name)
        return 1.0, 1.0, 1.0
    return red * strength, green * strength, blue * strength


def _punctual(
    light: bpy.types.Light, colour: tuple[float, float, float], name: str, notices: Notices
) -> dict[str, Any]:
    is_normalized = getattr(light, "normalize", True)
    extras: dict[str, float] = {}
    punctual: dict[str, Any] = {"name": name}
    if light.type == "SUN":
        punctual["type"] = "directional"
        strength = light_units.sun_irradiance(light.energy, light.angle, is_normalized)
        if light.angle > 0:
            extras["angle"] = math.degrees(light.angle)
    else:
        radius = light.shadow_soft_size
        strength = light_units.point_intensity(light.energy, radius, is_normalized)
        if radius > 0:
            extras["radius"] = radius
        punctual["type"] = "point"
        if light.type == "SPOT":
            punctual["type"] = "spot"
            inner, outer = light_units.spot_cones(light.spot_size, light.spot_blend)
            punctual["spot"] = {"innerConeAngle": inner, "outerConeAngle": outer}
            if light.spot_size / 2 > light_units.WIDEST_SPOT + _FALLOFF:
                notices.add("spot lights emit at most 180 degrees wide", name)
    brightest = max(colour)
    punctual["color"] = [channel / brightest for channel in colour]
    punctual["intensity"] = strength * brightest
    if extras:
        punctual["extras"] = {"photoncard": extras}
    return punctual


def _area(
    light: bpy.types.Light, colour: tuple[float, float, float], world: Matrix, is_seen: bool
) -> dict[str, Any]:
    is_ellipse = light.shape in {"DISK", "ELLIPSE"}
    width = light.size
    height = light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size
    scale = world.to_scale()
    area = light_units.ellipse_or_rectangle(abs(width * scale.x), abs(height * scale.y), is_ellipse)
    radiance = light_units.area_radiance(light.energy, max(area, 1e-12), getattr(light, "normalize", True))
    return {
        "shape": "ellipse" if is_ellipse else "rectangle",
        "size": [width, height],
        "radiance": [channel * radiance for channel in colour],
        "camera": is_seen,
    }
