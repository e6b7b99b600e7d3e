"""The light of caustics alone: what comes from a lamp by smooth surfaces to the first surface seen that is not smooth.

In the notation of light paths, `E S* D S+ L`. Mitsuba does not tell paths apart.
"""

import drjit as dr
import mitsuba as mi


class Caustics(mi.SamplingIntegrator):
    """A path tracer that samples reflection alone: light that comes by a smooth surface is found in no other way."""

    def __init__(self, props):
        mi.SamplingIntegrator.__init__(self, props)
        self.max_depth = props.get("max_depth", 64)

    @dr.syntax
    def sample(self, scene, sampler, ray, medium=None, active=True):
        ray, active = mi.Ray3f(ray), mi.Bool(active)
        throughput, radiance = mi.Spectrum(1.0), mi.Spectrum(0.0)
        has_met_rough, has_passed_smooth = mi.Bool(False), mi.Bool(False)
        depth = mi.UInt32(0)
        while active:
            si = scene.ray_intersect(ray, active)
            emission = si.emitter(scene).eval(si, active)
            radiance += dr.select(active & has_passed_smooth, throughput * emission, 0.0)
            active &= si.is_valid()
            record, weight = si.bsdf(ray).sample(
                mi.BSDFContext(), si, sampler.next_1d(active), sampler.next_2d(active), active
            )
            is_smooth = mi.has_flag(record.sampled_type, mi.BSDFFlags.Delta)
            # The second surface that is not smooth would make the light indirect.
            active &= is_smooth | ~has_met_rough
            has_passed_smooth |= is_smooth & has_met_rough
            has_met_rough |= ~is_smooth
            throughput *= weight
            depth += 1
            active &= (dr.max(throughput) > 0.0) & (depth < self.max_depth)
            ray = si.spawn_ray(si.to_world(record.wo))
        return radiance, mi.Bool(True), []

    def to_string(self):
        return "Caustics[]"
