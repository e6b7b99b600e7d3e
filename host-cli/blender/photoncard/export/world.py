"""Exports the world: a colour, or an equirectangular map with its rotation."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from .. import exr
from ..baking import BakeError
from ..notices import Notices
from .images import Unreadable, linear_pixels
from .nodes import Place, Unsupported, active_output, has_nodes, resolve
from .values import constant_of

_MIDDLE = -90.0
"""Turn that brings the middle of a map, -z in glTF, to Blender's +x."""


@dataclass
class World:
    """Light from infinitely far. `pixels` has the shape (height, width, 3), the top line first."""

    colour: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pixels: np.ndarray | None = None
    rotation: float = 0.0
    light_group: str = ""

    @property
    def is_lit(self) -> bool:
        """True if it gives light."""
        return max(self.colour) > 0

    def write(self, folder: str) -> list[str]:
        """Writes the map into a folder, and returns the arguments that render it."""
        if not self.is_lit:
            return []
        colour = ",".join(f"{channel:.9g}" for channel in self.colour)
        if self.pixels is None:
            return ["--environment", colour]
        path = os.path.join(folder, "world.exr")
        exr.write(path, self.pixels * np.array(self.colour, np.float32))
        turn = (_MIDDLE - self.rotation + 180) % 360 - 180
        return ["--environment", path, "--environment-rotation", f"{turn:.9g}"]


Bake = Callable[[bpy.types.World], np.ndarray]
"""Renders a world to an equirectangular map, or raises `BakeError`."""


def world_of(world: bpy.types.World | None, bake: Bake | None, notices: Notices) -> World:
    """The world of a scene; black without one.

    Nodes that cannot be said are baked by `bake`, or left out with a notice without it.
    """
    if world is None:
        return World()
    group = world.lightgroup
    if not has_nodes(world):
        return World(tuple(world.color), light_group=group)
    try:
        found = _of_nodes(world.node_tree)
    except (Unsupported, Unreadable) as reason:
        found = _baked(world, bake, reason, notices)
    found.light_group = group
    return found


def _baked(world: bpy.types.World, bake: Bake | None, reason: Exception, notices: Notices) -> World:
    remedy = "tick Bake World Nodes in the render settings"
    if bake is not None:
        try:
            return World((1.0, 1.0, 1.0), np.maximum(bake(world), 0))
        except BakeError as error:
            reason, remedy = error, "give it a colour or an equirectangular Environment Texture"
    notices.add(f"the world's light is left out ({reason}); {remedy}", world.name)
    return World()


def _of_nodes(tree: bpy.types.NodeTree) -> World:
    output = active_output(tree)
    if output is None:
        return World()
    end = resolve(Place(output.inputs["Surface"], ()))
    if not end.socket.is_output:
        return World()
    node = end.socket.node
    if node.bl_idname not in {"ShaderNodeBackground", "ShaderNodeEmission"}:
        raise Unsupported(node)
    strength = constant_of(Place(node.inputs["Strength"], end.groups))[0]
    colour = Place(node.inputs["Color"], end.groups)
    source = resolve(colour)
    image_node = source.socket.node
    if not source.socket.is_output or image_node.bl_idname != "ShaderNodeTexEnvironment":
        red, green, blue, _ = constant_of(colour)
        return World((red * strength, green * strength, blue * strength))
    if image_node.projection != "EQUIRECTANGULAR" or image_node.image is None:
        raise Unsupported(image_node)
    pixels = np.maximum(linear_pixels(image_node.image)[::-1, :, :3], 0)
    rotation = _rotation(Place(image_node.inputs["Vector"], source.groups))
    return World((strength, strength, strength), pixels, rotation)


def _rotation(vector: Place) -> float:
    """Degrees about Z of the mapping of an environment texture."""
    end = resolve(vector)
    if not end.socket.is_output:
        return 0.0
    node = end.socket.node
    if node.bl_idname == "ShaderNodeTexCoord" and end.socket.name == "Generated":
        return 0.0
    if node.bl_idname != "ShaderNodeMapping" or node.vector_type not in {"POINT", "VECTOR", "TEXTURE"}:
        raise Unsupported(node)
    location, turn, scale = (
        constant_of(Place(node.inputs[name], end.groups)) for name in ("Location", "Rotation", "Scale")
    )
    is_moved = node.vector_type != "VECTOR" and any(location[:3])
    if is_moved or any(turn[:2]) or any(abs(factor - 1) > 1e-6 for factor in scale[:3]):
        raise Unsupported(node)
    inner = _rotation(Place(node.inputs["Vector"], end.groups))
    degrees = math.degrees(turn[2])
    return inner + (-degrees if node.vector_type == "TEXTURE" else degrees)
