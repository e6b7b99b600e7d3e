//! The radiance that the nearest photons reflect: Jensen's density estimate, corrected where it is known to be wrong.
//!
//! `L = 1 / (pi r^2 c) sum f(incoming) power`, over the photons within `r`. Three corrections, each principled:
//!
//! - The distance r to the k-th photon is a stopping rule: with all k photons in the sum the estimate is too bright by
//!   `k / (k - 1)`. The k-th only says how far the search went; the k - 1 within r are summed. This is the unbiased
//!   estimate of a Poisson density, also where fewer than k lie within the greatest distance and r is that distance.
//! - Photons of another surface do not count: their surface normals differ. That leaves out photons on the other side
//!   of a thin wall, and those on the other wall of a corner.
//! - `c` is the part of the disc that is surface at all, without which every edge and corner darkens. The host measures
//!   it around each photon, for that photon's own distance to its k-th neighbour; the nearest photon of the same
//!   surface tells it here. At the distance of the nearest of k photons, about r / sqrt(k), c has hardly changed.
//!
//! What is left is the estimate's blur: the radiance is a mean over the disc.

use core::f32::consts::PI;
use core::ptr;

use glam::Vec3;
use photoncard_shared::layout::{FULL_DISC, decode_normal};

use super::{Candidate, NearestPhotons};
use crate::fixed_point::ColourSum;
use crate::gather::PartialReflection;
use crate::vector::{max, unit};

/// Photons whose surface normal is at a lesser cosine to the query's belong to another surface.
pub const MIN_NORMAL_COSINE: f32 = 0.75;

/// The radius of a disc is at least this share of the place's greatest coordinate, about its rounding: photons in one
/// point have no density.
const MIN_RADIUS_SHARE: f32 = 1e-6;

/// What a gather at a position adds to its pixel, in the units of the reflection: the photons' power over the area of their
/// disc, reflected.
#[inline(always)]
pub fn reflected_radiance(nearest: &NearestPhotons, position: Vec3, reflection: &PartialReflection) -> Vec3 {
    let candidates = nearest.candidates();
    let farthest = candidates.iter().max_by_key(|candidate| candidate.order());
    let Some(farthest) = farthest else { return Vec3::ZERO };
    let (radius_squared, excluded) = if nearest.is_full() {
        (farthest.distance_squared(), Some(farthest))
    } else {
        (nearest.max_distance_squared(), None)
    };
    let mut same_surface = SameSurface::new(reflection.normal());
    // Of several that are equal to the farthest one is left out.
    let is_excluded = |candidate| excluded.is_some_and(|excluded| ptr::eq(excluded, candidate));
    let counted = candidates
        .iter()
        .filter(|&candidate| !is_excluded(candidate) && same_surface.holds(candidate.normal()));
    let mut closest: Option<&Candidate> = None;
    let mut sums = Sums::new(reflection);
    for candidate in counted {
        if closest.is_none_or(|closest| candidate.order() < closest.order()) {
            closest = Some(candidate);
        }
        sums.add(candidate);
    }
    let Some(closest) = closest else { return Vec3::ZERO };
    let fraction = (closest.disc() as f32 + 1.0) * (1.0 / (FULL_DISC as f32 + 1.0));
    let least = MIN_RADIUS_SHARE * crate::scene::magnitude(&[position]);
    let area = PI * max(radius_squared, max(least * least, f32::MIN_POSITIVE)) * fraction;
    sums.reflected() * (1.0 / area)
}

/// The photons' power, and the lobe's share of it.
struct Sums<'a> {
    reflection: &'a PartialReflection,
    mirror: Vec3,
    power: ColourSum,
    lobe: ColourSum,
}

impl<'a> Sums<'a> {
    #[inline(always)]
    fn new(reflection: &'a PartialReflection) -> Self {
        let mirror = if reflection.has_lobe() { reflection.mirror() } else { Vec3::ZERO };
        Self { reflection, mirror, power: ColourSum::ZERO, lobe: ColourSum::ZERO }
    }

    #[inline(always)]
    fn add(&mut self, photon: &Candidate) {
        self.power.add_rgbe(photon.power());
        if self.reflection.has_lobe() {
            let share = self.reflection.lobe_share(self.mirror, photon.direction());
            self.lobe.add(Vec3::from_array(photon.power().decode()) * share);
        }
    }

    #[inline(always)]
    fn reflected(&self) -> Vec3 {
        self.reflection.diffuse() * self.power.value() + self.reflection.lobe() * self.lobe.value()
    }
}

/// Tells the photons of one surface; neighbours mostly have the normal of the one before.
pub struct SameSurface {
    normal: Vec3,
    last: (u8, bool),
}

impl SameSurface {
    #[inline(always)]
    /// Photons whose surface normal is near the one that this code stands for.
    pub fn new(code: u8) -> Self {
        Self { normal: unit(decode_normal(code).into()), last: (code, true) }
    }

    #[inline(always)]
    /// Whether a photon of this normal's code is one.
    pub fn holds(&mut self, code: u8) -> bool {
        if self.last.0 != code {
            let other = unit(decode_normal(code).into());
            self.last = (code, other.dot(self.normal) >= MIN_NORMAL_COSINE);
        }
        self.last.1
    }
}
