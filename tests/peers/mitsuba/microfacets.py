"""glTF's metallic-roughness model (glTF 2.0, appendix B.2 and B.3): GGX with Smith's masking and Schlick's Fresnel, over Lambertian
reflection of what a dielectric lets through. Masking is height-correlated, as in most renderers, where the appendix has the product.

Mitsuba's `principled` has another diffuse part, which depends on the roughness.

Appendix B adds light at grazing angles. As in Blender's Principled BSDF and in photoncard, the Lambertian part has what the
facets leave: the Fresnel term of a dielectric's Lambertian part is at least the albedo of its facets towards the viewer.
"""

import drjit as dr
import mitsuba as mi
import numpy as np


COSINES, DIRECTIONS = 64, 64


def facet_albedo(alpha, normal_reflectance):
    """Albedo of facets of a dielectric by the cosine of the viewer, of visible normals (Heitz 2018) on a grid."""
    u, angle = (values.ravel() for values in np.meshgrid(*[(np.arange(DIRECTIONS) + 0.5) / DIRECTIONS] * 2))
    radius, angle = np.sqrt(u), 2.0 * np.pi * angle
    across, along = radius * np.cos(angle), radius * np.sin(angle)
    albedos = []
    for cosine in np.maximum(np.linspace(0.0, 1.0, COSINES), 1e-3):
        view = np.array([alpha * np.sqrt(1.0 - cosine**2), 0.0, cosine])
        view /= np.linalg.norm(view)
        share = 0.5 * (1.0 + view[2])
        lifted = (1.0 - share) * np.sqrt(1.0 - across**2) + share * along
        normal = across[:, None] * np.array([0.0, 1.0, 0.0]) + lifted[:, None] * np.cross(view, [0.0, 1.0, 0.0])
        normal += np.sqrt(np.maximum(1.0 - across**2 - lifted**2, 0.0))[:, None] * view
        normal = normal * [alpha, alpha, 1.0]
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        outgoing = np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])
        dot = normal @ outgoing
        incident = 2.0 * dot * normal[:, 2] - cosine
        lit = incident > 0.0
        slopes = [alpha**2 * (1.0 / np.maximum(z, 1e-6) ** 2 - 1.0) for z in (cosine, incident)]
        out_lambda, in_lambda = ((np.sqrt(1.0 + slope) - 1.0) / 2.0 for slope in slopes)
        fresnel = normal_reflectance + (1.0 - normal_reflectance) * (1.0 - np.clip(dot, 0.0, 1.0)) ** 5
        albedos.append(np.mean(np.where(lit, fresnel * (1.0 + out_lambda) / (1.0 + out_lambda + in_lambda), 0.0)))
    return albedos


class MetallicRoughness(mi.BSDF):
    """A metal or a dielectric, nothing between. One-sided; sampled by visible normals and by the cosine, in the ratio of what
    they reflect straight on."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.base_colour, self.metallic = props.get_texture("base_colour"), props["metallic"]
        ior = props["ior"]
        self.dielectric = ((ior - 1.0) / (ior + 1.0)) ** 2
        # glTF 2.0, B.2.3: alpha is the square of the roughness.
        alpha = props["roughness"] ** 2
        self.facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, True)
        self.albedo = mi.Float(facet_albedo(alpha, self.dielectric))
        mean = self.base_colour.mean()
        specular, diffuse = self.normal_reflectance(mean), self.diffuse(mean)
        # Far more is reflected at grazing angles than straight on.
        self.facet_share = dr.maximum(specular / dr.maximum(specular + diffuse, 1e-6), 0.25)
        front = mi.BSDFFlags.FrontSide
        self.m_components = [mi.BSDFFlags.GlossyReflection | front, mi.BSDFFlags.DiffuseReflection | front]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def normal_reflectance(self, base_colour):
        """Reflectance straight on."""
        return dr.lerp(self.dielectric, base_colour, self.metallic)

    def diffuse(self, base_colour):
        """Albedo of the Lambertian part under no facets."""
        return base_colour * (1.0 - self.metallic)

    def albedo_towards(self, cosine):
        """The dielectric's albedo by its facets, interpolated in a table."""
        place = dr.clip(cosine, 0.0, 1.0) * (COSINES - 1)
        below = mi.UInt32(dr.minimum(dr.floor(place), COSINES - 2))
        low, high = (dr.gather(mi.Float, self.albedo, below + step) for step in (0, 1))
        return dr.lerp(low, high, place - mi.Float(below))

    def sample(self, ctx, si, sample1, sample2, active):
        takes_facet = sample1 < self.facet_share
        facet, _ = self.facets.sample(si.wi, sample2)
        wo = dr.select(takes_facet, mi.reflect(si.wi, facet), mi.warp.square_to_cosine_hemisphere(sample2))
        record = dr.zeros(mi.BSDFSample3f)
        record.wo = wo
        record.pdf = self.pdf(ctx, si, wo, active)
        record.eta = 1.0
        record.sampled_type = dr.select(
            takes_facet, mi.UInt32(+mi.BSDFFlags.GlossyReflection), mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
        )
        record.sampled_component = dr.select(takes_facet, mi.UInt32(0), mi.UInt32(1))
        active &= record.pdf > 0.0
        return record, dr.select(active, self.eval(ctx, si, wo, active) / record.pdf, 0.0)

    def eval(self, ctx, si, wo, active):
        active &= (si.wi.z > 0.0) & (wo.z > 0.0)
        half = dr.normalize(si.wi + wo)
        grazing = dr.power(1.0 - dr.abs(dr.dot(si.wi, half)), 5.0)
        base_colour = self.base_colour.eval(si, active)
        straight = self.normal_reflectance(base_colour)
        fresnel = straight + (1.0 - straight) * grazing
        # Correlated by height (Heitz 2014): Mitsuba's own G is the product.
        masking, shadowing = (dr.maximum(self.facets.smith_g1(way, half), 1e-6) for way in (si.wi, wo))
        visible = 1.0 / (1.0 / masking + 1.0 / shadowing - 1.0)
        facets = self.facets.eval(half) * visible / (4.0 * si.wi.z)
        # A metal has no diffuse part, so one Fresnel term serves both: that of the dielectric, where there is one.
        through = self.diffuse(base_colour) * (1.0 - dr.maximum(fresnel, self.albedo_towards(si.wi.z))) / dr.pi * wo.z
        return dr.select(active, fresnel * facets + through, 0.0)

    def pdf(self, ctx, si, wo, active):
        active &= (si.wi.z > 0.0) & (wo.z > 0.0)
        half = dr.normalize(si.wi + wo)
        facets = self.facets.pdf(si.wi, half) / (4.0 * dr.dot(wo, half))
        return dr.select(active, dr.lerp(wo.z / dr.pi, facets, self.facet_share), 0.0)

    def eval_pdf(self, ctx, si, wo, active):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def traverse(self, callback):
        pass

    def to_string(self):
        return "MetallicRoughness[]"
