"""glTF's metallic-roughness model (glTF 2.0, appendix B.2 and B.3): GGX with Smith's masking and Schlick's Fresnel, over Lambertian
reflection of what a dielectric lets through. Masking is height-correlated, as in most renderers, where the appendix has the product.

Mitsuba's `principled` has another diffuse part, which depends on the roughness.
"""

import drjit as dr
import mitsuba as mi


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
        through = self.diffuse(base_colour) * (1.0 - fresnel) / dr.pi * wo.z
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
