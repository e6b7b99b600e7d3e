"""The surface of a body that absorbs light on its way through.

Every way through a body ends on its surface, from within, and there its length is known. So light is weakened there (Beer and
Lambert), and Mitsuba's integrator of surfaces will do: its integrator of volumes takes three times as long.
"""

import drjit as dr
import mitsuba as mi


class AbsorbingBody(mi.BSDF):
    """A smooth surface, `nested`, around what absorbs by `absorption`, 1/m."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.nested = props["nested"]
        self.absorption = mi.Color3f(props["absorption"])
        self.m_components = [self.nested.flags(index) for index in range(self.nested.component_count())]
        self.m_flags = self.nested.flags()

    def sample(self, ctx, si, sample1, sample2, active):
        record, weight = self.nested.sample(ctx, si, sample1, sample2, active)
        is_within = si.wi.z < 0.0
        return record, dr.select(is_within, weight * dr.exp(-self.absorption * si.t), weight)

    def eval(self, ctx, si, wo, active):
        return mi.Color3f(0.0)

    def pdf(self, ctx, si, wo, active):
        return mi.Float(0.0)

    def eval_pdf(self, ctx, si, wo, active):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def traverse(self, callback):
        pass

    def to_string(self):
        return "AbsorbingBody[]"
