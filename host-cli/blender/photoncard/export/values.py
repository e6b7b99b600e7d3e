"""Reads the values of node sockets."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import bpy
import numpy as np

from .images import check_readable, tiled_pixels
from .nodes import Place, Unsupported, input_of, resolve
from .value import Mapping, Value, combine, constant, grey, with_alpha


def constant_of(place: Place) -> tuple[float, float, float, float]:
    """Value of an input that is to be the same everywhere.

    Raises `Unsupported`.
    """
    value = value_of(place)
    if not value.is_constant:
        raise Unsupported(resolve(place).socket.node, "it is no constant")
    red, green, blue, alpha = value.texels.tolist()
    return red, green, blue, alpha


def value_of(place: Place) -> Value:
    """Value of an input.

    Raises `Unsupported`, or `Unreadable` for an image without pixels.
    """
    end = resolve(place)
    if not end.socket.is_output:
        value = end.socket.default_value
        return constant(value if isinstance(value, (int, float)) else tuple(value))
    read = _READERS.get(end.socket.node.bl_idname)
    if read is None:
        raise Unsupported(end.socket.node)
    value = read(end)
    # A number that is fed by a colour is its grey value.
    if place.socket.type == "VALUE" and end.socket.type in {"RGBA", "VECTOR"}:
        weights = [1 / 3, 1 / 3, 1 / 3] if end.socket.type == "VECTOR" else _LUMINANCE
        return value.map(lambda texels: grey(texels @ np.array([*weights, 0], np.float32)))
    return value


_LUMINANCE = [0.2126, 0.7152, 0.0722]


def _own(end: Place) -> Value:
    value = end.socket.default_value
    return constant(value if isinstance(value, (int, float)) else tuple(value))


def _image(end: Place) -> Value:
    node = end.socket.node
    if node.image is None:
        # Cycles shows a missing image in pink; an empty node is black.
        return constant((0.0, 0.0, 0.0, 0.0)) if end.socket.name == "Color" else constant(0.0)
    if node.projection != "FLAT":
        raise Unsupported(node, f"its projection is {node.projection.title()}")
    mapping = replace(
        _mapping(input_of(end, "Vector")),
        wrap=node.extension,
        is_nearest=node.interpolation == "Closest",
    )
    if node.image.source == "TILED":
        colour = _tiles(node, mapping)
    else:
        check_readable(node.image)
        colour = Value(None, mapping, node.image)
    return colour.map(lambda texels: grey(texels[..., 3])) if end.socket.name == "Alpha" else colour


def _tiles(node: bpy.types.Node, mapping: Mapping) -> Value:
    """All tiles (UDIM) in one image, on which a transform brings the UV map."""
    if replace(mapping, uv_map="", wrap="", is_nearest=False) != Mapping(wrap=""):
        raise Unsupported(node, "its image is tiled (UDIM), and follows a mapping")
    tiles = tiled_pixels(node.image)
    if tiles is None:
        raise Unsupported(node, "the tiles of its image (UDIM) are too large together")
    width, height = 1 / tiles.columns, 1 / tiles.rows
    offset = (-tiles.column * width, 1 - (1 - tiles.row) * height)
    return Value(tiles.pixels, replace(mapping, offset=offset, scale=(width, height), wrap="EXTEND"))


def _mapping(vector: Place) -> Mapping:
    end = resolve(vector)
    if not end.socket.is_output:
        return Mapping()
    node = end.socket.node
    if node.bl_idname == "ShaderNodeUVMap":
        return Mapping(node.uv_map)
    if node.bl_idname == "ShaderNodeTexCoord" and end.socket.name == "UV":
        return Mapping()
    if node.bl_idname != "ShaderNodeMapping":
        raise Unsupported(node, "textures take UV maps")
    inner = _mapping(input_of(end, "Vector"))
    if replace(inner, uv_map="") != Mapping():
        raise Unsupported(node, "it follows another mapping")
    location, turn, scale = (
        constant_of(input_of(end, name)) if name in node.inputs and node.inputs[name].enabled else (0.0,) * 4
        for name in ("Location", "Rotation", "Scale")
    )
    return replace(_transform(node, location, turn, scale), uv_map=inner.uv_map)


def _transform(
    node: bpy.types.Node, location: tuple[float, ...], turn: tuple[float, ...], scale: tuple[float, ...]
) -> Mapping:
    """glTF's transform, whose v points down, of a mapping in the plane."""
    if any(abs(angle) > 1e-6 for angle in turn[:2]) or node.vector_type not in {"POINT", "TEXTURE", "VECTOR"}:
        raise Unsupported(node, "it does not stay in the plane")
    (x, y), angle, (width, height) = location[:2], turn[2], scale[:2]
    if node.vector_type == "TEXTURE":
        if abs(angle) > 1e-6 and abs(width - height) > 1e-6 or width == 0 or height == 0:
            raise Unsupported(node, "its inverse is skewed")
        sine, cosine = math.sin(-angle), math.cos(-angle)
        x, y = -(cosine * x - sine * y) / width, -(sine * x + cosine * y) / height
        angle, width, height = -angle, 1 / width, 1 / height
    sine, cosine = math.sin(angle), math.cos(angle)
    offset = (x - sine * height, 1 - cosine * height - y)
    return Mapping(offset=offset, rotation=angle, scale=(width, height))


def _colour_attribute(end: Place) -> Value:
    node = end.socket.node
    if end.socket.name != "Color":
        raise Unsupported(node, f"its output {end.socket.name} is used")
    is_layer = node.bl_idname == "ShaderNodeVertexColor"
    if not is_layer and node.attribute_type != "GEOMETRY":
        raise Unsupported(node, "it is no attribute of the geometry")
    return Value(np.ones(4, np.float32), colours=node.layer_name if is_layer else node.attribute_name)


def _mix(end: Place) -> Value:
    node = end.socket.node
    if node.data_type == "ROTATION":
        raise Unsupported(node)
    sockets = {socket.name: socket for socket in node.inputs if socket.enabled}
    factor, first, second = (value_of(Place(sockets[name], end.groups)) for name in ("Factor", "A", "B"))
    if node.clamp_factor:
        factor = factor.map(lambda texels: np.clip(texels, 0, 1))
    blend = node.blend_type if node.data_type == "RGBA" else "MIX"
    is_clamped = node.data_type == "RGBA" and node.clamp_result
    return _blended(node, blend, is_clamped, factor, first, second)


def _mix_rgb(end: Place) -> Value:
    node = end.socket.node
    factor, first, second = (value_of(input_of(end, name)) for name in ("Fac", "Color1", "Color2"))
    return _blended(node, node.blend_type, node.use_clamp, factor, first, second)


def _blended(
    node: bpy.types.Node, kind: str, is_clamped: bool, factor: Value, first: Value, second: Value
) -> Value:
    if kind == "MULTIPLY" and factor.is_constant and factor.number == 1 and not is_clamped:
        product = _product_with_colours(first, second)
        if product is not None:
            return product
    blend = _BLENDS.get(kind)
    if blend is None:
        raise Unsupported(node, f"its mode is {kind.replace('_', ' ').title()}")

    def mixed(t: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        a, b, t = np.broadcast_arrays(a, b, t)
        result = a + t * (blend(a, b) - a)
        result = with_alpha(result, a[..., 3] if kind != "MIX" else result[..., 3])
        return np.clip(result, 0, 1) if is_clamped else result

    return combine(node, mixed, factor, first, second)


def _product_with_colours(first: Value, second: Value) -> Value | None:
    """Product of a colour attribute and another value, which glTF states as it is."""
    for one, other in ((first, second), (second, first)):
        if one.colours is not None and other.colours is None and one.mapping is None:
            factor = one.texels
            return replace(other.map(lambda texels, factor=factor: texels * factor), colours=one.colours)
    return None


_BLENDS: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "MIX": lambda a, b: b,
    "ADD": lambda a, b: a + b,
    "MULTIPLY": lambda a, b: a * b,
    "SUBTRACT": lambda a, b: a - b,
    "DARKEN": np.minimum,
    "LIGHTEN": np.maximum,
    "SCREEN": lambda a, b: 1 - (1 - a) * (1 - b),
    "DIFFERENCE": lambda a, b: np.abs(a - b),
    "DIVIDE": lambda a, b: np.where(b != 0, a / np.where(b != 0, b, 1), a),
    "OVERLAY": lambda a, b: np.where(a < 0.5, 2 * a * b, 1 - 2 * (1 - a) * (1 - b)),
}


def _math(end: Place) -> Value:
    node = end.socket.node
    function = _FUNCTIONS.get(node.operation)
    if function is None:
        raise Unsupported(node, f"its operation is {node.operation.replace('_', ' ').title()}")
    inputs = [Place(socket, end.groups) for socket in node.inputs if socket.enabled]
    values = [value_of(place) for place in inputs]
    result = combine(node, function, *values)
    return result.map(lambda texels: np.clip(texels, 0, 1)) if node.use_clamp else result


def _safe_power(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.power(np.maximum(a, 0), b)


_FUNCTIONS: dict[str, Callable[..., np.ndarray]] = {
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": lambda a, b: np.where(b != 0, a / np.where(b != 0, b, 1), 0),
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": _safe_power,
    "SQRT": lambda a: np.sqrt(np.maximum(a, 0)),
    "ABSOLUTE": np.abs,
    "MINIMUM": np.minimum,
    "MAXIMUM": np.maximum,
    "LESS_THAN": lambda a, b: (a < b).astype(np.float32),
    "GREATER_THAN": lambda a, b: (a > b).astype(np.float32),
}


def _invert(end: Place) -> Value:
    factor, colour = (value_of(input_of(end, name)) for name in ("Fac", "Color"))
    return combine(end.socket.node, lambda t, a: with_alpha(a + t * (1 - 2 * a), a[..., 3]), factor, colour)


def _gamma(end: Place) -> Value:
    colour, gamma = (value_of(input_of(end, name)) for name in ("Color", "Gamma"))
    return combine(end.socket.node, lambda a, b: with_alpha(_safe_power(a, b), a[..., 3]), colour, gamma)


def _bright_contrast(end: Place) -> Value:
    colour, bright, contrast = (value_of(input_of(end, name)) for name in ("Color", "Bright", "Contrast"))

    def changed(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        return with_alpha(np.maximum((1 + c) * a + b - 0.5 * c, 0), a[..., 3])

    return combine(end.socket.node, changed, colour, bright, contrast)


def _hue_saturation(end: Place) -> Value:
    names = ("Hue", "Saturation", "Value", "Fac", "Color")

    def changed(
        hue: np.ndarray, saturation: np.ndarray, value: np.ndarray, factor: np.ndarray, colour: np.ndarray
    ) -> np.ndarray:
        turned = _hsv(colour)
        turned[..., 0] = (turned[..., 0] + hue[..., 0] + 0.5) % 1
        turned[..., 1] = np.clip(turned[..., 1] * saturation[..., 0], 0, 1)
        turned[..., 2] = turned[..., 2] * value[..., 0]
        mixed = colour[..., :3] + factor[..., :3] * (_rgb(turned) - colour[..., :3])
        return with_alpha(np.maximum(mixed, 0), colour[..., 3])

    return combine(end.socket.node, changed, *(value_of(input_of(end, name)) for name in names))


def _hsv(colour: np.ndarray) -> np.ndarray:
    red, green, blue = (colour[..., channel] for channel in range(3))
    high, low = colour[..., :3].max(axis=-1), colour[..., :3].min(axis=-1)
    span = np.where(high > low, high - low, 1)
    hue = np.select(
        [high == red, high == green],
        [(green - blue) / span % 6, (blue - red) / span + 2],
        (red - green) / span + 4,
    )
    hue = np.where(high > low, hue / 6, 0)
    return np.stack([hue, np.where(high > 0, (high - low) / np.where(high > 0, high, 1), 0), high], axis=-1)


def _rgb(hsv: np.ndarray) -> np.ndarray:
    hue, saturation, value = (hsv[..., channel] for channel in range(3))
    shifts = np.array([5.0, 3.0, 1.0], np.float32)
    k = (shifts + hue[..., None] * 6) % 6
    ramp = np.clip(np.minimum(k, 4 - k), 0, 1)
    return value[..., None] * (1 - saturation[..., None] * ramp)


def _curves(end: Place) -> Value:
    node = end.socket.node
    node.mapping.initialize()
    steps = np.linspace(0, 1, 257)
    tables = [
        np.array([node.mapping.evaluate(node.mapping.curves[channel], step) for step in steps])
        for channel in range(4)
    ]

    def changed(factor: np.ndarray, colour: np.ndarray) -> np.ndarray:
        combined = np.interp(colour[..., :3], steps, tables[3])
        curved = np.stack(
            [np.interp(combined[..., channel], steps, tables[channel]) for channel in range(3)], axis=-1
        )
        return with_alpha(colour[..., :3] + factor[..., :3] * (curved - colour[..., :3]), colour[..., 3])

    return combine(node, changed, *(value_of(input_of(end, name)) for name in ("Fac", "Color")))


def _ramp(end: Place) -> Value:
    node = end.socket.node
    steps = np.linspace(0, 1, 1025)
    table = np.array([tuple(node.color_ramp.evaluate(step)) for step in steps])

    def changed(factor: np.ndarray) -> np.ndarray:
        channels = [np.interp(factor[..., 0], steps, table[:, channel]) for channel in range(4)]
        colour = np.stack(channels, axis=-1)
        return grey(colour[..., 3]) if end.socket.name == "Alpha" else colour

    return combine(node, changed, value_of(input_of(end, "Fac")))


def _grey_value(end: Place) -> Value:
    value = value_of(input_of(end, "Color"))
    return combine(end.socket.node, lambda a: grey(a[..., :3] @ np.array(_LUMINANCE, np.float32)), value)


def _separate(end: Place) -> Value:
    node = end.socket.node
    colour = value_of(Place(node.inputs[0], end.groups))
    channel = [socket.identifier for socket in node.outputs].index(end.socket.identifier)
    is_hsv = getattr(node, "mode", "RGB") == "HSV"
    if getattr(node, "mode", "RGB") not in {"RGB", "HSV"}:
        raise Unsupported(node, f"its mode is {node.mode}")
    return combine(node, lambda a: grey((_hsv(a) if is_hsv else a)[..., channel]), colour)


def _join(end: Place) -> Value:
    node = end.socket.node
    if getattr(node, "mode", "RGB") not in {"RGB", "HSV"}:
        raise Unsupported(node, f"its mode is {node.mode}")

    def joined(*channels: np.ndarray) -> np.ndarray:
        stacked = np.stack(np.broadcast_arrays(*(channel[..., 0] for channel in channels)), axis=-1)
        colour = _rgb(stacked) if getattr(node, "mode", "RGB") == "HSV" else stacked
        return with_alpha(colour, np.float32(1))

    return combine(node, joined, *(value_of(Place(socket, end.groups)) for socket in node.inputs))


def _map_range(end: Place) -> Value:
    node = end.socket.node
    if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
        raise Unsupported(node, "it is not linear in numbers")
    names = ("Value", "From Min", "From Max", "To Min", "To Max")

    def changed(value: np.ndarray, *limits: np.ndarray) -> np.ndarray:
        low, high, to_low, to_high = limits
        span = np.where(high != low, high - low, 1)
        share = (value - low) / span
        return to_low + (np.clip(share, 0, 1) if node.clamp else share) * (to_high - to_low)

    return combine(node, changed, *(value_of(Place(node.inputs[name], end.groups)) for name in names))


def _clamp(end: Place) -> Value:
    if end.socket.node.clamp_type != "MINMAX":
        raise Unsupported(end.socket.node, "it is of the type Range")
    values = (value_of(input_of(end, name)) for name in ("Value", "Min", "Max"))
    return combine(end.socket.node, lambda a, low, high: np.minimum(np.maximum(a, low), high), *values)


def _light_path(end: Place) -> Value:
    """Rays of the camera stand for all."""
    return constant(1.0 if end.socket.name == "Is Camera Ray" else 0.0)


def _geometry(end: Place) -> Value:
    if end.socket.name != "Backfacing":
        raise Unsupported(end.socket.node, f"its output {end.socket.name} is used")
    return constant(0.0)


_READERS: dict[str, Callable[[Place], Value]] = {
    "ShaderNodeRGB": _own,
    "ShaderNodeValue": _own,
    "ShaderNodeTexImage": _image,
    "ShaderNodeVertexColor": _colour_attribute,
    "ShaderNodeAttribute": _colour_attribute,
    "ShaderNodeMix": _mix,
    "ShaderNodeMixRGB": _mix_rgb,
    "ShaderNodeMath": _math,
    "ShaderNodeInvert": _invert,
    "ShaderNodeGamma": _gamma,
    "ShaderNodeBrightContrast": _bright_contrast,
    "ShaderNodeHueSaturation": _hue_saturation,
    "ShaderNodeRGBCurve": _curves,
    "ShaderNodeValToRGB": _ramp,
    "ShaderNodeRGBToBW": _grey_value,
    "ShaderNodeSeparateColor": _separate,
    "ShaderNodeSeparateRGB": _separate,
    "ShaderNodeSeparateXYZ": _separate,
    "ShaderNodeCombineColor": _join,
    "ShaderNodeCombineRGB": _join,
    "ShaderNodeCombineXYZ": _join,
    "ShaderNodeMapRange": _map_range,
    "ShaderNodeClamp": _clamp,
    "ShaderNodeLightPath": _light_path,
    "ShaderNodeNewGeometry": _geometry,
}
