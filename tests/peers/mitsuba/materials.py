"""Mitsuba's materials of those of a glTF file, by photoncard's conventions."""

import mitsuba as mi
import numpy as np

import textures

VERTEX_COLOUR = "vertex_color"
# The first bytes of an image without alpha.
JPEG = b"\xff\xd8"
SPECULAR, TRANSMISSION = "KHR_materials_specular", "KHR_materials_transmission"


def reflection(source, material, part):
    """The reflection of a material as part of a surface, with holes where it is cut out."""
    front = smooth(material) or frosted(material) or rough(source, material, part) or phong(material)
    front = front or lambertian(source, material, part)
    has_two_sides = material.get("doubleSided") and TRANSMISSION not in material.get("extensions", {})
    bsdf = {"type": "twosided", "front": front} if has_two_sides else front
    if material.get("alphaMode", "OPAQUE") == "OPAQUE":
        return bsdf
    return {"type": "mask", "opacity": opacity(source, material), "nested": bsdf}


def smooth(material):
    """A mirror or clear glass, or nothing if the material is neither."""
    metallic_roughness = material["pbrMetallicRoughness"]
    if SPECULAR in material.get("extensions", {}) or metallic_roughness.get("roughnessFactor", 1.0) > 0.0:
        return None
    base = base_factor(material)[:3]
    if metallic_roughness.get("metallicFactor", 1.0) == 1.0:
        if min(base) < 1.0:
            raise ValueError(f"{material['name']}: Mitsuba has no mirror with Schlick's reflectance, only a white one")
        return {"type": "conductor", "material": "none"}
    if extension(material, TRANSMISSION).get("transmissionFactor", 0.0) != 1.0 or min(base) < 1.0:
        raise ValueError(f"{material['name']}: what is smooth and no metal is read here only as clear glass")
    if extension(material, "KHR_materials_volume").get("thicknessFactor", 0.0) == 0.0:
        return {"type": "thindielectric", "int_ior": refraction(material), "ext_ior": 1.0}
    surface = {"type": "dielectric", "int_ior": refraction(material), "ext_ior": 1.0}
    coefficient = absorption(material)
    if not coefficient.any():
        return surface
    from absorbing import AbsorbingBody

    mi.register_bsdf("absorbing_body", AbsorbingBody)
    return {"type": "absorbing_body", "nested": surface, "absorption": mi.ScalarColor3f(coefficient)}


def frosted(material):
    """Clear solid glass with a rough surface, or nothing if the material is another."""
    transmission = extension(material, TRANSMISSION).get("transmissionFactor", 0.0)
    if transmission == 0.0:
        return None
    is_solid = extension(material, "KHR_materials_volume").get("thicknessFactor", 0.0) > 0.0
    if transmission != 1.0 or not is_solid or absorption(material).any() or min(base_factor(material)[:3]) < 1.0:
        raise ValueError(f"{material['name']}: what is rough and transmits is read here only as clear solid glass")
    alpha = material["pbrMetallicRoughness"].get("roughnessFactor", 1.0) ** 2
    surface = {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha}
    return surface | {"int_ior": refraction(material), "ext_ior": 1.0}


def rough(source, material, part):
    """glTF's metallic-roughness model, or nothing if the material is Lambertian."""
    is_metallic = material["pbrMetallicRoughness"].get("metallicFactor", 1.0) != 0.0
    if extension(material, SPECULAR).get("specularFactor", 1.0) == 0.0 and not is_metallic:
        return None
    # Imported here, as the variant must have been chosen before a BSDF is derived.
    from microfacets import MetallicRoughness

    mi.register_bsdf("metallic_roughness", MetallicRoughness)
    metallic_roughness = material["pbrMetallicRoughness"]
    if metallic_roughness.get("metallicFactor", 1.0) not in (0.0, 1.0):
        raise ValueError(f"{material['name']}: what is neither a metal nor a dielectric is not read here")
    return {
        "type": "metallic_roughness",
        "base_colour": base_colour(source, material, part),
        "metallic": float(metallic_roughness.get("metallicFactor", 1.0)),
        "roughness": float(metallic_roughness.get("roughnessFactor", 1.0)),
        "ior": float(refraction(material)),
    }


def phong(material):
    """A Phong lobe over Lambertian reflection, or nothing if the material states none."""
    lobe = material.get("extras", {}).get("photoncard", {}).get("phong")
    if lobe is None:
        return None
    from phong import PhongLobe

    mi.register_bsdf("phong_lobe", PhongLobe)
    return {
        "type": "phong_lobe",
        "diffuse": mi.ScalarColor3f(base_factor(material)[:3]),
        "specular": mi.ScalarColor3f(lobe["specular"]),
        "exponent": float(lobe["exponent"]),
    }


def lambertian(source, material, part):
    """Lambertian reflection."""
    return {"type": "diffuse", "reflectance": base_colour(source, material, part)}


def base_colour(source, material, part):
    """The base colour: a factor, by a texture or the colours of vertices."""
    factor = np.array(base_factor(material)[:3])
    info = material["pbrMetallicRoughness"].get("baseColorTexture")
    if part.colours is not None:
        if info is not None or (factor != 1.0).any():
            raise ValueError(f"{material['name']}: Mitsuba does not multiply the colours of vertices")
        return {"type": "mesh_attribute", "name": VERTEX_COLOUR}
    return colour(factor) if info is None else textures.colour(source.texture(info), factor)


def opacity(source, material):
    """One where the surface is there; the share of it that is there, where it is blended."""
    info = material["pbrMetallicRoughness"].get("baseColorTexture")
    if material["alphaMode"] == "BLEND":
        if info is not None and not source.texture(info).image.startswith(JPEG):
            raise ValueError(f"{material['name']}: surfaces blended by a texture are not read here")
        return base_factor(material)[3]
    if info is None:
        raise ValueError(f"{material['name']}: cut out without a texture")
    return textures.cut_out(source.texture(info), base_factor(material)[3], material.get("alphaCutoff", 0.5))


def emission(source, material):
    """The radiance of a material, or nothing."""
    factor = np.array(material.get("emissiveFactor", [0.0, 0.0, 0.0]))
    factor = factor * extension(material, "KHR_materials_emissive_strength").get("emissiveStrength", 1.0)
    if not factor.any():
        return None
    if material.get("doubleSided"):
        raise ValueError("Mitsuba's area lights have one side")
    info = material.get("emissiveTexture")
    return colour(factor) if info is None else textures.colour(source.texture(info), factor)


def absorption(material):
    """The absorption coefficient of what is below a surface, 1/m: KHR_materials_volume."""
    volume = extension(material, "KHR_materials_volume")
    if volume.get("thicknessFactor", 0.0) == 0.0 or "attenuationDistance" not in volume:
        return np.zeros(3)
    return -np.log(volume.get("attenuationColor", [1.0, 1.0, 1.0])) / volume["attenuationDistance"]


def base_factor(material):
    """The base colour and alpha."""
    return material["pbrMetallicRoughness"].get("baseColorFactor", [1.0, 1.0, 1.0, 1.0])


def refraction(material):
    """The index of refraction."""
    return extension(material, "KHR_materials_ior").get("ior", 1.5)


def colour(values):
    """Linear RGB."""
    return {"type": "rgb", "value": [float(value) for value in values]}


def extension(material, name):
    """An extension of a material, or nothing."""
    return material.get("extensions", {}).get(name, {})
