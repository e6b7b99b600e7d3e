"""Lambertian reflection plus one Phong lobe, as photoncard has it.

`f = kd / pi + ks (n + 2) / (2 pi) max(0, cos alpha)^n`, alpha measured from the mirror direction: Lafortune and Willems,
Using the modified Phong reflectance model for physically based rendering, 1994. Mitsuba 3 has no such model of its own.
"""

import drjit as dr
import mitsuba as mi


class PhongLobe(mi.BSDF):
    """One-sided; sampled by the lobe and by the cosine, in the ratio of their reflectances."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.diffuse = mi.Color3f(props["diffuse"])
        self.specular = mi.Color3f(props["specular"])
        self.exponent = mi.Float(props["exponent"])
        diffuse, specular = dr.max(self.diffuse), dr.max(self.specular)
        self.lobe_share = specular / (diffuse + specular)
        front = mi.BSDFFlags.FrontSide
        self.m_components = [mi.BSDFFlags.GlossyReflection | front, mi.BSDFFlags.DiffuseReflection | front]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def lobe_cosine(self, si, wo):
        """The cosine between a direction and the mirror direction, none below zero."""
        mirror = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
        return dr.maximum(dr.dot(mirror, wo), 0.0)

    def sample(self, ctx, si, sample1, sample2, active):
        takes_lobe = sample1 < self.lobe_share
        cosine = dr.power(sample2.x, 1.0 / (self.exponent + 1.0))
        sine = dr.safe_sqrt(1.0 - cosine * cosine)
        angle = 2.0 * dr.pi * sample2.y
        around = mi.Vector3f(sine * dr.cos(angle), sine * dr.sin(angle), cosine)
        lobe = mi.Frame3f(mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)).to_world(around)
        wo = dr.select(takes_lobe, lobe, mi.warp.square_to_cosine_hemisphere(sample2))
        record = dr.zeros(mi.BSDFSample3f)
        record.wo = wo
        record.pdf = self.pdf(ctx, si, wo, active)
        record.eta = 1.0
        record.sampled_type = dr.select(
            takes_lobe, mi.UInt32(+mi.BSDFFlags.GlossyReflection), mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
        )
        record.sampled_component = dr.select(takes_lobe, mi.UInt32(0), mi.UInt32(1))
        active &= record.pdf > 0.0
        return record, dr.select(active, self.eval(ctx, si, wo, active) / record.pdf, 0.0)

    def eval(self, ctx, si, wo, active):
        active &= (si.wi.z > 0.0) & (wo.z > 0.0)
        power = dr.power(self.lobe_cosine(si, wo), self.exponent)
        lobe = self.specular * ((self.exponent + 2.0) / (2.0 * dr.pi) * power)
        return dr.select(active, (self.diffuse / dr.pi + lobe) * wo.z, 0.0)

    def pdf(self, ctx, si, wo, active):
        active &= (si.wi.z > 0.0) & (wo.z > 0.0)
        power = dr.power(self.lobe_cosine(si, wo), self.exponent)
        lobe = (self.exponent + 1.0) / (2.0 * dr.pi) * power
        return dr.select(active, dr.lerp(wo.z / dr.pi, lobe, self.lobe_share), 0.0)

    def eval_pdf(self, ctx, si, wo, active):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def traverse(self, callback):
        pass

    def to_string(self):
        return "PhongLobe[]"
