//! The passes of a block's pixels, sample by sample.

use photoncard_shared::message::{Fault, FrameParameters};

use super::light::{Component, add_light, count_gather};
use super::position::Pass;
use super::stored_point::{StoredPoint, StoredRays, pattern};
use super::{Chip, allowed_error};
use crate::irradiance_cache::SeenSample;
use crate::kind::{Buffer, ChipKind};
use crate::memory::{MemoryPort, Stage};
use crate::render::eye::{Sight, View};
use crate::render::{Context, GatherPoint, PixelSample, Purpose, caustic, direct, eye, final_gather};
use crate::scene::{Seen, Surface};

/// The gather point of a sample, its directions not yet chosen.
fn pixel_point(frame: &FrameParameters, at: PixelSample, surface: Surface, purpose: Purpose) -> GatherPoint {
    let pattern = pattern(frame, at);
    // With the cache, gather rays are a pixel's in number, without it a sample's.
    let is_of_pixel = allowed_error(frame).is_some();
    let rays = if is_of_pixel { frame.gather_rays.div_ceil(frame.samples.max(1)) } else { frame.gather_rays };
    if purpose == Purpose::Lobe {
        GatherPoint::lobe(surface, pattern, rays)
    } else {
        GatherPoint::sample(surface, pattern, rays)
    }
}

impl<K: ChipKind> Chip<K> {
    /// Casts the eye ray of the present sample; adds the light that needs no other ray.
    pub(super) fn look<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        let (index, at) = self.present();
        let mut stored = StoredPoint::NOTHING;
        match eye::view(context, at)? {
            Sight::Background(radiance) => {
                let light = radiance * sample_share(context);
                add_light(self.sums.view_mut(), context.frame, index as u16, Component::Direct, light);
            }
            Sight::Surface(view) => {
                let purpose = self.light_at_once(context, index, at, &view);
                let mut point = pixel_point(context.frame, at, view.surface, purpose);
                if purpose == Purpose::Sample && point.rays > 0 {
                    count_gather(self.sums.view_mut(), context.frame, index);
                }
                point.choose_directions(context, self.gathers.candidates())?;
                stored = StoredPoint {
                    seen: view.seen.unwrap_or(Seen::ELSEWHERE),
                    directions: point.directions,
                    rays: StoredRays::new(&point),
                };
            }
        }
        if let Some(slot) = self.points.view_mut().get_mut(index) {
            *slot = stored;
        }
        if self.position.next_index(self.block.pixels()) {
            self.position.pass = Pass::Direct;
        }
        Ok(())
    }

    /// Adds emission and interpolated irradiance, which need no ray. Returns the purpose of the gather rays.
    fn light_at_once<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        index: usize,
        at: PixelSample,
        View { surface, is_first, .. }: &View,
    ) -> Purpose {
        let frame = context.frame;
        let is_lambertian = frame.gather_rays > 0 && surface.reflection.has_lambertian();
        let sample = SeenSample { pixel: [at.x, at.y], film: eye::film_position(context, at), surface };
        // Records lie where eye rays meet surfaces, not behind mirrors and glass.
        let allowed = allowed_error(frame).filter(|_| is_lambertian && *is_first);
        let interpolated = allowed.and_then(|allowed| self.cache.interpolate(&sample, allowed));
        context.counters.lambertian_samples += u64::from(is_lambertian);
        context.counters.interpolated_samples += u64::from(interpolated.is_some());
        let (share, target) = (sample_share(context), index as u16);
        add_light(self.sums.view_mut(), frame, target, Component::Direct, surface.emission * share);
        let Some(light) = interpolated else { return Purpose::Sample };
        let reflected = surface.reflector().lambertian_albedo() * light;
        add_light(self.sums.view_mut(), frame, target, Component::Indirect, reflected * share);
        Purpose::Lobe
    }

    /// Adds the light of shadow rays and caustics to the present pixel.
    pub(super) fn light_directly<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        let (index, at) = self.present();
        context.memory.enter(Stage::Shadow);
        let stored = self.points.view().get(index).copied().unwrap_or(StoredPoint::NOTHING);
        let mut point = stored.point(context.frame, at);
        if stored.read_surface(context, at, &mut point.surface)? {
            let reflected = direct::reflected(context, at, &point)?;
            let light = reflected * sample_share(context);
            add_light(self.sums.view_mut(), context.frame, index as u16, Component::Direct, light);
            let focused = caustic::reflected(context, &point, self.gathers.candidates())?;
            let light = focused / context.frame.samples.max(1) as f32;
            add_light(self.sums.view_mut(), context.frame, index as u16, Component::Caustic, light);
        }
        if self.position.next_index(self.block.pixels()) {
            self.position.pass = Pass::Rays;
        }
        Ok(())
    }

    /// Goes on to the next pixel of the present row that has rays, or to the row's last one. Where irradiance is interpolated
    /// few pixels have any, and every direction bin looks for them.
    fn skip_pixels_without_rays(&mut self) {
        let [column, row] = self.block.pixel(self.position.index);
        let first = (row * self.tile.width + column) as usize;
        let left = (self.block.x + self.block.width).saturating_sub(column) as usize;
        let rest = self.points.view().get(first..first + left).unwrap_or_default();
        let skipped = rest.iter().position(|stored| stored.rays.number() > 0);
        self.position.index += skipped.unwrap_or(left.saturating_sub(1)) as u32;
    }

    /// Casts gather rays of the present bin, of the next pixel of the row that has any.
    pub(super) fn cast_for_pixel<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        self.skip_pixels_without_rays();
        let (index, at) = self.present();
        let Self { points, sums, gathers, position, .. } = self;
        let frame = context.frame;
        context.memory.enter(Stage::GatherRay);
        let stored = points.view().get(index).copied().unwrap_or(StoredPoint::NOTHING);
        let of_bin = stored.rays_of_bin(frame, at, position.bin);
        if !of_bin.is_empty()
            && let mut point = stored.point(frame, at)
            && stored.read_surface(context, at, &mut point.surface)?
        {
            let share = 1.0 / frame.samples as f32;
            let (rays, is_last) = position.next_rays(of_bin);
            for ray in rays {
                // A block has at most `Budget::tile_pixels` pixels, whose indices fit in 16 bits.
                let end = final_gather::cast(context, &point, index as u16, share, ray)?;
                let Some(end) = end else { continue };
                add_light(sums.view_mut(), frame, index as u16, Component::Direct, end.direct);
                match (end.request, &mut context.outlet) {
                    (None, _) => {}
                    (Some(request), Some(outlet)) => {
                        outlet.take(request);
                    }
                    (Some(request), None) => {
                        gathers.submit(context, request, &mut |request, brought| {
                            add_light(sums.view_mut(), frame, request.target, Component::Indirect, brought);
                        })?;
                    }
                }
            }
            if !is_last {
                return Ok(());
            }
        }
        if position.next_index(self.block.pixels()) && position.next_bin(frame.bins) {
            let is_last = position.next_sample(frame.samples);
            position.pass = if is_last { Pass::Done } else { Pass::Eye };
        }
        Ok(())
    }
}

/// The factor from a sample's radiance, W/(sr m^2), to its term in the pixel's sum.
#[inline(always)]
fn sample_share<M>(context: &Context<M>) -> f32 {
    1.0 / (context.frame.samples.max(1) as f32 * context.scene.header.radiance_unit)
}
