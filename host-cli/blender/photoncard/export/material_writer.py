"""Writes a surface as a material of glTF, with its textures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from ..glb import Glb
from ..notices import Notices
from .images import ImageStore, is_linear, linear_pixels
from .surfaces import NormalMap, Surface
from .value import Mapping, Value, constant, mappings_of, of_one_size

_MOST_UV_MAPS = 2
_WRAPS = {"REPEAT": 10497, "EXTEND": 33071, "CLIP": 33071, "MIRROR": 33648}
_LINEAR_FILTER = 9729
_NEAREST_FILTER = 9728
_THICKNESS = 1e-3
"""Thickness, metres, of glass in flat sheets. Closed meshes are solid whatever it is."""
_IOR = 1.5
_TOLERANCE = 2e-3

Json = dict[str, Any]


@dataclass
class MaterialUse:
    """A material of the document, and what meshes give it."""

    index: int | None = None
    uv_maps: list[str] = field(default_factory=list)
    colours: str | None = None


class MaterialWriter:
    """Writes one material."""

    def __init__(self, glb: Glb, images: ImageStore, name: str, notices: Notices) -> None:
        self.use = MaterialUse()
        self._glb = glb
        self._images = images
        self._name = name
        self._notices = notices

    def write(self, surface: Surface) -> Json:
        """The material of a surface."""
        item: Json = {"name": self._name, "pbrMetallicRoughness": self._reflection(surface)}
        if not surface.alpha.is_constant or surface.alpha.number < 1:
            item["alphaMode"] = "BLEND"
        extensions: Json = {}
        self._emission(surface.emission, item, extensions)
        if surface.normal:
            item["normalTexture"] = self._normal_map(surface.normal)
        self._dielectric(surface, extensions)
        self._layers(surface, extensions)
        if extensions:
            item["extensions"] = extensions
            for name in extensions:
                self._glb.use(name)
        return item

    def _reflection(self, surface: Surface) -> Json:
        base, alpha = surface.base, surface.alpha
        if base.colours is not None:
            self.use.colours = base.colours
        pbr: Json = {}
        factor, texture = self._base(base, alpha)
        pbr["baseColorFactor"] = factor
        if texture is not None:
            pbr["baseColorTexture"] = texture
        pbr.update(self._metallic_roughness(surface.metallic, surface.roughness))
        return pbr

    def _base(self, base: Value, alpha: Value) -> tuple[list[float], Json | None]:
        """Factor and texture of base colour with alpha."""
        base, alpha = self._of_one_mapping(base, alpha)
        if base.mapping is None and alpha.mapping is None:
            return [*_clamped(base.texels[:3]), _clamped([alpha.number])[0]], None
        colour, opacity = of_one_size(base, alpha)
        if base.mapping is None:
            factor = [*_clamped(colour[:3]), 1.0]
            white = np.ones((*opacity.shape[:2], 3), np.float32)
            return factor, self._texture(np.concatenate([white, opacity[..., :1]], axis=2), True, alpha)
        if alpha.mapping is None:
            return [1.0, 1.0, 1.0, _clamped([alpha.number])[0]], self._image(base, True)
        pixels = np.concatenate([colour[..., :3], opacity[..., :1]], axis=2)
        return [1.0] * 4, self._file(base, pixels, True) or self._texture(pixels, True, base)

    def _metallic_roughness(self, metallic: Value, roughness: Value) -> Json:
        metallic, roughness = self._of_one_mapping(metallic, roughness)
        if metallic.mapping is None and roughness.mapping is None:
            factors = _clamped([metallic.number, roughness.number])
            return {"metallicFactor": factors[0], "roughnessFactor": factors[1]}
        metal, rough = (texels[..., 0] for texels in of_one_size(metallic, roughness))
        has_metal = metallic.mapping is not None or metallic.number > 0
        source = roughness if roughness.mapping is not None else metallic
        shape = source.texels.shape[:2] if rough.ndim == metal.ndim == 0 else np.broadcast(metal, rough).shape
        pixels = np.ones((*shape, 3), np.float32)
        pixels[..., 1], pixels[..., 2] = rough, metal
        channels = (1, 2) if has_metal else (1,)
        texture = self._file(source, pixels, False, channels) or self._texture(pixels, False, source)
        return {
            "metallicFactor": 1.0 if has_metal else 0.0,
            "roughnessFactor": 1.0,
            "metallicRoughnessTexture": texture,
        }

    def _emission(self, emission: Value, item: Json, extensions: Json) -> None:
        emission = self._without_colours(emission)
        brightest = float(emission.texels[..., :3].max())
        if brightest <= 0:
            return
        item["emissiveFactor"], texture = self._scaled(emission, brightest)
        if texture:
            item["emissiveTexture"] = texture
        if brightest != 1:
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": brightest}

    def _normal_map(self, normal: NormalMap) -> Json:
        return {**self._image(normal.value, False), "scale": normal.strength}

    def _dielectric(self, surface: Surface, extensions: Json) -> None:
        """Index of refraction, specular and transmission."""
        if surface.ior != _IOR:
            extensions["KHR_materials_ior"] = {"ior": surface.ior}
        specular = self._without_colours(surface.specular)
        strongest = float(specular.texels[..., :3].max())
        if strongest <= 0:
            extensions["KHR_materials_specular"] = {"specularFactor": 0.0}
        elif specular.mapping is not None or any(channel != 1 for channel in specular.texels[:3]):
            factor, texture = self._scaled(specular, strongest)
            stated: Json = {"specularColorFactor": [channel * strongest for channel in factor]}
            if texture:
                stated["specularColorTexture"] = texture
            extensions["KHR_materials_specular"] = stated
        transmission = self._without_colours(surface.transmission)
        if transmission.texels[..., 0].any():
            extensions["KHR_materials_transmission"] = self._factor("transmission", transmission, 0)
            if not surface.is_wall:
                extensions["KHR_materials_volume"] = {"thicknessFactor": _THICKNESS}

    def _layers(self, surface: Surface, extensions: Json) -> None:
        if surface.translucency > 0:
            extensions["KHR_materials_diffuse_transmission"] = {
                "diffuseTransmissionFactor": surface.translucency,
                "diffuseTransmissionColorFactor": _clamped(surface.base.colour),
            }
        if surface.coat.texels[..., 0].any():
            coat = self._factor("clearcoat", surface.coat, 0)
            coat.update(self._factor("clearcoatRoughness", surface.coat_roughness, 1))
            if surface.coat_normal:
                coat["clearcoatNormalTexture"] = self._normal_map(surface.coat_normal)
            extensions["KHR_materials_clearcoat"] = coat
        if surface.sheen.texels[..., :3].any():
            factor, texture = self._scaled(self._without_colours(surface.sheen), 1.0)
            sheen: Json = {"sheenColorFactor": factor, "sheenRoughnessFactor": surface.sheen_roughness}
            if texture:
                sheen["sheenColorTexture"] = texture
            extensions["KHR_materials_sheen"] = sheen

    def _factor(self, name: str, value: Value, channel: int) -> Json:
        """Factor and texture of a number that glTF reads from a channel."""
        value = self._without_colours(value)
        if value.mapping is None:
            return {f"{name}Factor": _clamped([value.number])[0]}
        pixels = np.repeat(value.texels[..., :1], 3, axis=2)
        texture = self._file(value, pixels, False, (channel,)) or self._texture(pixels, False, value)
        return {f"{name}Factor": 1.0, f"{name}Texture": texture}

    def _scaled(self, value: Value, scale: float) -> tuple[list[float], Json | None]:
        """Factor of 0 to 1 and texture of a colour that is divided by its greatest value."""
        scaled = value.map(lambda texels: texels / scale)
        if scaled.mapping is None:
            return _clamped(scaled.texels[:3]), None
        return [1.0] * 3, self._image(scaled, True)

    def _image(self, value: Value, is_colour: bool) -> Json:
        """Texture of a value's three channels, of the image's file if that has them."""
        if value.is_plain and value.image and _is_encoded_as(value.image, is_colour):
            index = self._images.add_file(value.image)
            if index is not None:
                return self._info(index, value.mapping)
        pixels = value.texels[..., :3]
        return self._file(value, pixels, is_colour) or self._texture(pixels, is_colour, value)

    def _of_one_mapping(self, first: Value, second: Value) -> tuple[Value, Value]:
        """Two values of one texture: the second becomes its mean if its mapping differs."""
        if len(mappings_of(first, second)) < 2:
            return first, second
        sentence = "textures that glTF has in one image take one mapping: the second is rendered as its mean"
        self._notices.add(sentence, self._name)
        return first, constant(second.texels.reshape(-1, 4).mean(axis=0))

    def _without_colours(self, value: Value) -> Value:
        if value.colours is None:
            return value
        self._notices.add("colour attributes change the base colour alone", self._name)
        return Value(value.texels, value.mapping, value.image)

    def _file(
        self, value: Value, pixels: np.ndarray, is_colour: bool, channels: tuple[int, ...] | None = None
    ) -> Json | None:
        """The file of the image that has these pixels in `channels`, by default in all of them."""
        image = value.image
        if image is None or not _is_encoded_as(image, is_colour):
            return None
        own = linear_pixels(image)
        if own.shape[:2] != pixels.shape[:2]:
            return None
        compared = list(channels or range(pixels.shape[2]))
        if np.abs(own[..., compared] - pixels[..., compared]).max() > _TOLERANCE:
            return None
        index = self._images.add_file(image)
        return None if index is None else self._info(index, value.mapping)

    def _texture(self, pixels: np.ndarray, is_colour: bool, value: Value) -> Json:
        name = value.image.name if value.image else self._name
        return self._info(self._images.add_pixels(pixels, is_colour, name), value.mapping)

    def _info(self, image: int, mapping: Mapping | None) -> Json:
        mapping = mapping or Mapping()
        if mapping.wrap == "CLIP":
            self._notices.add("textures that are clipped repeat their border", self._name)
        filters = _NEAREST_FILTER if mapping.is_nearest else _LINEAR_FILTER
        wrap = _WRAPS[mapping.wrap]
        sampler = {"magFilter": filters, "minFilter": filters, "wrapS": wrap, "wrapT": wrap}
        info: Json = {
            "index": self._once("textures", {"source": image, "sampler": self._once("samplers", sampler)}),
            "texCoord": self._uv_set(mapping.uv_map),
        }
        transform: Json = {}
        if any(mapping.offset):
            transform["offset"] = list(mapping.offset)
        if mapping.rotation:
            transform["rotation"] = mapping.rotation
        if mapping.scale != (1.0, 1.0):
            transform["scale"] = list(mapping.scale)
        if transform:
            info["extensions"] = {"KHR_texture_transform": transform}
            self._glb.use("KHR_texture_transform")
        return info

    def _uv_set(self, uv_map: str) -> int:
        maps = self.use.uv_maps
        if uv_map not in maps:
            if len(maps) == _MOST_UV_MAPS:
                self._notices.add("materials take two UV maps, and the first in place of others", self._name)
                return 0
            maps.append(uv_map)
        return maps.index(uv_map)

    def _once(self, kind: str, item: Json) -> int:
        known = self._glb.root.get(kind, [])
        return known.index(item) if item in known else self._glb.add(kind, item)


def _is_encoded_as(image: bpy.types.Image, is_colour: bool) -> bool:
    """True if an image's file has the encoding that glTF gives colours, sRGB, or data."""
    return not image.is_float and is_linear(image) != is_colour


def _clamped(values: Any) -> list[float]:
    return [min(max(float(value), 0.0), 1.0) for value in values]
