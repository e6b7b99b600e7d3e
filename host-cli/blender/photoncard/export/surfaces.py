"""Reads the shaders of a material into the parameters that glTF has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace

import bpy
import numpy as np

from ..notices import Notices
from .images import Unreadable
from .nodes import Path, Place, Unsupported, active_output, input_of, is_linked, path_of, resolve
from .value import Value, combine, constant
from .values import constant_of, value_of


@dataclass(frozen=True)
class NormalMap:
    """A tangent-space normal map and its strength."""

    value: Value
    strength: float


@dataclass(frozen=True)
class Surface:
    """Parameters of glTF's model; the defaults are those of a black dielectric without reflection."""

    base: Value = field(default_factory=lambda: constant(0.0))
    metallic: Value = field(default_factory=lambda: constant(0.0))
    roughness: Value = field(default_factory=lambda: constant(1.0))
    ior: float = 1.5
    specular: Value = field(default_factory=lambda: constant(0.0))
    """Factor of the reflectance that the index of refraction has."""
    transmission: Value = field(default_factory=lambda: constant(0.0))
    translucency: float = 0.0
    """Share of diffuse light that is transmitted."""
    coat: Value = field(default_factory=lambda: constant(0.0))
    coat_roughness: Value = field(default_factory=lambda: constant(0.0))
    sheen: Value = field(default_factory=lambda: constant(0.0))
    sheen_roughness: float = 0.5
    emission: Value = field(default_factory=lambda: constant(0.0))
    alpha: Value = field(default_factory=lambda: constant(1.0))
    normal: NormalMap | None = None
    coat_normal: NormalMap | None = None
    is_wall: bool = False
    """True for glass that bends no light."""
    has_multiscatter: bool = False

    @property
    def is_glossy(self) -> bool:
        """True if anything but a Lambertian base reflects."""
        return any(
            value.texels.any() for value in (self.metallic, self.specular, self.coat, self.transmission)
        )


_REMEDY = "Bake Procedural Materials in the render settings keeps it"

_EMPTY = Surface(alpha=constant(0.0))


class SurfaceReader:
    """Reads the surface of one material, and notices what it leaves out.

    `baked` has values of inputs that stand for those of their nodes.
    """

    def __init__(self, name: str, notices: Notices, baked: Mapping[Path, Value] | None = None) -> None:
        self.varying: set[Path] = set()
        """Inputs that are not the same everywhere, but for normals."""
        self.unsaid: set[Path] = set()
        """Inputs whose nodes glTF has no counterpart of, but for normals."""
        self.unsaid_normals: set[Path] = set()
        self._name = name
        self._notices = notices
        self._baked = baked or {}

    def read(self, tree: bpy.types.NodeTree) -> Surface:
        """The surface that a material's nodes state."""
        output = active_output(tree)
        if output is None:
            return Surface()
        for socket in ("Displacement", "Volume"):
            if is_linked(Place(output.inputs[socket], ())):
                self._note(f"{socket.lower()} of materials is not rendered")
        return self._shader(Place(output.inputs["Surface"], ()))

    def _note(self, sentence: str) -> None:
        self._notices.add(sentence, self._name)

    def _shader(self, place: Place) -> Surface:
        end = resolve(place)
        if not end.socket.is_output:
            return Surface()
        read = _SHADERS.get(end.socket.node.bl_idname)
        if read is None:
            kind = end.socket.node.bl_rna.name
            self._note(f"shaders {kind} are rendered as a grey Diffuse BSDF")
            return Surface(base=constant((0.8, 0.8, 0.8)))
        return read(self, end)

    def _value_of(self, place: Place) -> Value:
        """Value of an input. Raises `Unsupported` or `Unreadable`."""
        path = path_of(place)
        if path in self._baked:
            return self._baked[path]
        try:
            value = value_of(place)
        except Unsupported:
            self.unsaid.add(path)
            raise
        if not value.is_constant:
            self.varying.add(path)
        return value

    def _value(self, end: Place, name: str) -> Value:
        """Value of an input; what it has unlinked, and a notice, if its nodes cannot be said."""
        place = input_of(end, name)
        try:
            return self._value_of(place)
        except (Unsupported, Unreadable) as reason:
            self._note(f"{name} takes its unlinked value ({reason}); {_REMEDY}")
            value = place.socket.default_value
            return constant(value if isinstance(value, (int, float)) else tuple(value))

    def _combine(self, node: bpy.types.Node, function: Callable[..., np.ndarray], *values: Value) -> Value:
        """The value of a function of several values: of their means if they have no common mapping."""
        try:
            return combine(node, function, *values)
        except Unsupported as reason:
            self.unsaid |= self.varying
            self._note(f"textures are rendered as their means ({reason}); {_REMEDY}")
            return combine(node, function, *(constant(value.colour) for value in values))

    def _constant(self, end: Place, name: str) -> float:
        value = self._value(end, name)
        if not value.is_constant:
            self._note(f"{name} takes the mean of its texture")
        return value.number

    def _is_stated(self, end: Place, name: str, default: float) -> bool:
        """True if an input that has no counterpart is linked or not at its default."""
        place = input_of(end, name)
        return is_linked(place) or abs(place.socket.default_value - default) > 1e-6

    def _principled(self, end: Place) -> Surface:
        for name, default, what in _LOST:
            if name in end.socket.node.inputs and self._is_stated(end, name, default):
                self._note(f"{what} of Principled BSDF is not rendered")
        level, tint = self._value(end, "Specular IOR Level"), self._value(end, "Specular Tint")
        node = end.socket.node
        emission = (
            self._combine(
                node,
                lambda a, b: a * b,
                self._value(end, "Emission Color"),
                self._value(end, "Emission Strength"),
            )
            if self._emits(end)
            else constant(0.0)
        )
        coat = self._value(end, "Coat Weight")
        if coat.texels.any() and self._is_stated(end, "Coat IOR", 1.5):
            self._note("coats have an IOR of 1.5")
        if coat.texels.any() and min(self._value(end, "Coat Tint").colour) < 1 - 1e-6:
            self._note("coats have no tint")
        return Surface(
            base=self._value(end, "Base Color"),
            metallic=self._value(end, "Metallic"),
            roughness=self._value(end, "Roughness"),
            ior=max(self._constant(end, "IOR"), 1.0),
            specular=self._combine(node, lambda a, b: 2 * a * b, level, tint),
            transmission=self._value(end, "Transmission Weight"),
            coat=coat,
            coat_roughness=self._value(end, "Coat Roughness"),
            sheen=self._combine(
                node, lambda a, b: a * b, self._value(end, "Sheen Weight"), self._value(end, "Sheen Tint")
            ),
            sheen_roughness=self._constant(end, "Sheen Roughness"),
            emission=emission,
            alpha=self._value(end, "Alpha"),
            normal=self._normal(input_of(end, "Normal")),
            coat_normal=self._normal(input_of(end, "Coat Normal")),
            has_multiscatter=node.distribution == "MULTI_GGX",
        )

    def _emits(self, end: Place) -> bool:
        strength = input_of(end, "Emission Strength")
        return is_linked(strength) or strength.socket.default_value != 0

    def _normal(self, place: Place) -> NormalMap | None:
        path = path_of(place)
        if path in self._baked:
            return NormalMap(self._baked[path], 1.0)
        end = resolve(place)
        if not end.socket.is_output:
            return None
        node = end.socket.node
        try:
            if node.bl_idname != "ShaderNodeNormalMap" or node.space != "TANGENT":
                raise Unsupported(node)
            value = value_of(input_of(end, "Color"))
            if value.mapping is None:
                return None
            if node.uv_map and not value.mapping.uv_map:
                value = replace(value, mapping=replace(value.mapping, uv_map=node.uv_map))
            return NormalMap(value, constant_of(input_of(end, "Strength"))[0])
        except (Unsupported, Unreadable) as reason:
            if isinstance(reason, Unsupported):
                self.unsaid_normals.add(path)
            self._note(f"normals are those of the mesh ({reason}); {_REMEDY}")
            return None

    def _diffuse(self, end: Place) -> Surface:
        if end.socket.node.bl_idname == "ShaderNodeBsdfDiffuse" and self._is_stated(end, "Roughness", 0.0):
            self._note("the roughness of diffuse reflection is not rendered")
        return Surface(base=self._value(end, "Color"), normal=self._normal(input_of(end, "Normal")))

    def _subsurface(self, end: Place) -> Surface:
        self._note("subsurface scattering is rendered as diffuse reflection")
        return self._diffuse(end)

    def _translucent(self, end: Place) -> Surface:
        return Surface(base=self._value(end, "Color"), translucency=1.0)

    def _glossy(self, end: Place) -> Surface:
        node = end.socket.node
        colour = "Base Color" if node.bl_idname == "ShaderNodeBsdfMetallic" else "Color"
        if getattr(node, "fresnel_type", "") == "PHYSICAL_CONDUCTOR":
            self._note("a Metallic BSDF has its base colour, without IOR and extinction")
        return Surface(
            base=self._value(end, colour),
            metallic=constant(1.0),
            roughness=self._value(end, "Roughness"),
            specular=constant(1.0),
            normal=self._normal(input_of(end, "Normal")),
            has_multiscatter=node.distribution == "MULTI_GGX",
        )

    def _glass(self, end: Place) -> Surface:
        return Surface(
            base=self._value(end, "Color"),
            roughness=self._value(end, "Roughness"),
            ior=max(self._constant(end, "IOR"), 1.0),
            specular=constant(1.0),
            transmission=constant(1.0),
            normal=self._normal(input_of(end, "Normal")),
        )

    def _refraction(self, end: Place) -> Surface:
        self._note("a Refraction BSDF is rendered as a Glass BSDF")
        return self._glass(end)

    def _transparent(self, end: Place) -> Surface:
        colour = self._value(end, "Color")
        if colour.is_constant and min(colour.colour) > 1 - 1e-6:
            return _EMPTY
        # A tinted sheet of air.
        return Surface(
            base=colour,
            roughness=constant(0.0),
            ior=1.0,
            specular=constant(0.0),
            transmission=constant(1.0),
            is_wall=True,
        )

    def _emission(self, end: Place) -> Surface:
        colour, strength = self._value(end, "Color"), self._value(end, "Strength")
        return Surface(emission=self._combine(end.socket.node, lambda a, b: a * b, colour, strength))

    def _add(self, end: Place) -> Surface:
        first, second = (self._shader(Place(socket, end.groups)) for socket in end.socket.node.inputs)
        for one, other in ((first, second), (second, first)):
            if _only_emits(one):
                emission = self._combine(end.socket.node, lambda a, b: a + b, one.emission, other.emission)
                return replace(other, emission=emission)
            if _is_empty(one):
                return replace(other, alpha=constant(1.0))
        self._note("an Add Shader of two reflections is rendered as the first of them")
        return first

    def _mix(self, end: Place) -> Surface:
        node = end.socket.node
        factor_place, first_place, second_place = (Place(socket, end.groups) for socket in node.inputs)
        first, second = self._shader(first_place), self._shader(second_place)
        factor_end = resolve(factor_place)
        kind = factor_end.socket.node.bl_idname if factor_end.socket.is_output else ""
        if kind in {"ShaderNodeFresnel", "ShaderNodeLayerWeight"}:
            return self._coated(factor_end, first, second)
        try:
            factor = self._value_of(factor_place)
        except (Unsupported, Unreadable) as reason:
            self._note(f"a Mix Shader takes half of each ({reason}); {_REMEDY}")
            factor = constant(0.5)
        return self._mixed(node, factor, first, second)

    def _coated(self, end: Place, base: Surface, gloss: Surface) -> Surface:
        """A reflection over another by Fresnel's factor: a dielectric."""
        if _is_empty(base) or _only_emits(gloss) or base.metallic.texels.any():
            self._note("a Mix Shader by Fresnel takes half of each")
            return self._mixed(end.socket.node, constant(0.5), base, gloss)
        if end.socket.node.bl_idname == "ShaderNodeFresnel":
            ior = max(self._constant(end, "IOR"), 1.0)
        else:
            ior = 1 / max(1 - self._constant(end, "Blend"), 1e-5)
        return replace(
            base,
            roughness=gloss.roughness,
            ior=ior,
            specular=constant(gloss.base.colour),
            has_multiscatter=gloss.has_multiscatter,
        )

    def _mixed(self, node: bpy.types.Node, factor: Value, first: Surface, second: Surface) -> Surface:
        if factor.is_constant and factor.number in {0.0, 1.0}:
            return second if factor.number else first
        share = factor
        rest = factor.map(lambda texels: 1 - texels)
        for shown, part, other in ((second, share, first), (first, rest, second)):
            if _is_empty(other):
                return replace(shown, alpha=self._product(node, shown.alpha, part))
        for shown, part, other, others in ((second, share, first, rest), (first, rest, second, share)):
            if _only_emits(other):
                return replace(
                    shown,
                    base=self._product(node, shown.base, part),
                    specular=self._product(node, shown.specular, part),
                    emission=self._sum(
                        node,
                        self._product(node, shown.emission, part),
                        self._product(node, other.emission, others),
                    ),
                )
        if _kind(first) != _kind(second):
            self._note("a Mix Shader of unlike shaders is rendered with the mean of their parameters")
        return self._interpolated(node, factor, first, second)

    def _product(self, node: bpy.types.Node, first: Value, second: Value) -> Value:
        return self._combine(node, lambda a, b: a * b, first, second)

    def _sum(self, node: bpy.types.Node, first: Value, second: Value) -> Value:
        return self._combine(node, lambda a, b: a + b, first, second)

    def _interpolated(self, node: bpy.types.Node, factor: Value, first: Surface, second: Surface) -> Surface:
        def mixed(a: object, b: object) -> object:
            if isinstance(a, Value) and isinstance(b, Value):
                if a.is_constant and b.is_constant and np.array_equal(a.texels, b.texels):
                    return a
                return self._combine(node, lambda t, x, y: x + t * (y - x), factor, a, b)
            if isinstance(a, bool) or not isinstance(a, float):
                return a or b
            return a + factor.number * (b - a)

        names = [item.name for item in fields(Surface)]
        return Surface(**{name: mixed(getattr(first, name), getattr(second, name)) for name in names})


def _is_empty(surface: Surface) -> bool:
    return surface.alpha.is_constant and surface.alpha.number == 0


def _only_emits(surface: Surface) -> bool:
    reflects = (surface.base, surface.specular, surface.metallic, surface.coat, surface.sheen)
    is_black = all(value.is_constant and not value.texels[:3].any() for value in reflects)
    return is_black and bool(surface.emission.texels[..., :3].any())


def _kind(surface: Surface) -> tuple[bool, bool]:
    return bool(surface.metallic.texels.any()), bool(surface.transmission.texels.any())


_LOST = (
    ("Subsurface Weight", 0.0, "subsurface scattering"),
    ("Anisotropic", 0.0, "anisotropy"),
    ("Thin Film Thickness", 0.0, "thin film"),
    ("Diffuse Roughness", 0.0, "the diffuse roughness"),
)

_SHADERS: dict[str, Callable[[SurfaceReader, Place], Surface]] = {
    "ShaderNodeBsdfPrincipled": SurfaceReader._principled,
    "ShaderNodeBsdfDiffuse": SurfaceReader._diffuse,
    "ShaderNodeSubsurfaceScattering": SurfaceReader._subsurface,
    "ShaderNodeBsdfTranslucent": SurfaceReader._translucent,
    "ShaderNodeBsdfAnisotropic": SurfaceReader._glossy,
    "ShaderNodeBsdfGlossy": SurfaceReader._glossy,
    "ShaderNodeBsdfMetallic": SurfaceReader._glossy,
    "ShaderNodeBsdfGlass": SurfaceReader._glass,
    "ShaderNodeBsdfRefraction": SurfaceReader._refraction,
    "ShaderNodeBsdfTransparent": SurfaceReader._transparent,
    "ShaderNodeEmission": SurfaceReader._emission,
    "ShaderNodeBackground": SurfaceReader._emission,
    "ShaderNodeAddShader": SurfaceReader._add,
    "ShaderNodeMixShader": SurfaceReader._mix,
}
