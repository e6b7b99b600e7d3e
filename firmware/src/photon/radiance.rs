//! The radiance that the nearest photons reflect: Jensen's density estimate, corrected where it is known to be wrong.
//!
//! `L = 1 / (pi r^2 c) sum f(incoming) power`, over the photons within `r`. Three corrections, each principled:
//!
//! - The distance r to the k-th photon is a stopping rule: with all k photons in the sum the estimate is too bright by
//!   `k / (k - 1)`. The k-th only says how far the search went; the k - 1 within r are summed. This is the unbiased
//!   estimate of a Poisson density, also where fewer than k lie within the greatest distance and r is that distance.
//! - Photons of another surface do not count: their surface normals differ. That leaves out photons on the other side
//!   of a thin wall, and those on the other wall of a corner.
//! - `c` is the area of all surface whose photons the search finds and the sum takes, in units of the disc's: without it
//!   every edge and corner darkens, and stacked surfaces glow. The host measures it around each photon, for about that
//!   photon's own distance to its k-th neighbour; here the nearest photon of the surface carries it. At the distance of
//!   the nearest of k photons, about r / sqrt(k), c has hardly changed.
//!
//! The estimate's blur remains: the radiance is a mean over the disc.

use core::f32::consts::PI;

use glam::Vec3;
use photoncard_shared::layout::{decode_normal, disc_fraction};

use super::{Candidate, NearestPhotons};
use crate::fixed_point::ColourSum;
use crate::scene::{DecodedLobe, PartialReflection, magnitude};
use crate::simd::{self, Isa, Kernel};
use crate::vector::{max, unit};

/// Least cosine between the surface normals of a photon and of the query on one surface.
pub const MIN_NORMAL_COSINE: f32 = 0.75;

/// Least radius of a disc over the place's greatest coordinate, about the rounding of the place: photons in one point have
/// no density.
const MIN_RADIUS_SHARE: f32 = 1e-6;

/// The radiance of a gather at a position, in the units of the reflection: the photons' power over the area of their disc,
/// reflected.
#[inline(always)]
pub fn reflected_radiance(nearest: &NearestPhotons, position: Vec3, reflection: &PartialReflection) -> Vec3 {
    simd::run(Estimate { nearest, position, reflection })
}

/// The [`Kernel`] of [`reflected_radiance`].
pub struct Estimate<'a, 'n> {
    /// The photons nearest to a place.
    pub nearest: &'a NearestPhotons<'n>,
    /// The place, metres.
    pub position: Vec3,
    /// The reflection there.
    pub reflection: &'a PartialReflection,
}

impl Kernel for Estimate<'_, '_> {
    type Output = Vec3;

    #[inline(always)]
    fn run(self, _: impl Isa) -> Vec3 {
        let Self { nearest, position, reflection } = self;
        let (radius_squared, farthest) = if nearest.is_full() {
            let farthest = extreme(nearest, u32::max, |candidate, other| candidate.order() > other.order());
            (farthest.map_or(0.0, |farthest| farthest.distance_squared()), farthest)
        } else {
            (nearest.max_distance_squared(), None)
        };
        let Some((closest, sums)) = sum(nearest, farthest, reflection) else { return Vec3::ZERO };
        let fraction = disc_fraction(closest.disc());
        let least = MIN_RADIUS_SHARE * magnitude(&[position]);
        let area = PI * max(radius_squared, max(least * least, f32::MIN_POSITIVE)) * fraction;
        sums.reflected() * (1.0 / area)
    }
}

/// The first or the last candidate: `choose` orders distances, `is_better` candidates of one distance.
#[inline(always)]
fn extreme(
    nearest: &NearestPhotons,
    choose: impl Fn(u32, u32) -> u32,
    is_better: impl Fn(&Candidate, &Candidate) -> bool,
) -> Option<Candidate> {
    let (distances, contents) = nearest.columns();
    let distance = distances.iter().copied().reduce(choose)?;
    let mut best: Option<Candidate> = None;
    for (&other, &content) in distances.iter().zip(contents) {
        if other == distance {
            let candidate = Candidate { distance, content };
            if best.is_none_or(|best| is_better(&candidate, &best)) {
                best = Some(candidate);
            }
        }
    }
    best
}

/// The closest photon of the surface, and the sums over its photons; `farthest`, if given, is left out.
#[inline(always)]
fn sum<'a>(
    nearest: &NearestPhotons,
    farthest: Option<Candidate>,
    reflection: &'a PartialReflection,
) -> Option<(Candidate, Sums<'a>)> {
    let (_, contents) = nearest.columns();
    let mut sums = Sums::new(reflection);
    if reflection.is_lambertian() && are_all_of(reflection.normal(), contents) {
        // A single photon is the farthest itself.
        if farthest.is_some() && contents.len() < 2 {
            return None;
        }
        sums.power.add_powers(contents);
        if let Some(farthest) = farthest {
            sums.power.subtract_power(farthest.content);
        }
        let closest = extreme(nearest, u32::min, |candidate, other| candidate.order() < other.order())?;
        return Some((closest, sums));
    }
    let mut same_surface = SameSurface::new(reflection.normal());
    // Of several photons equal to the farthest, one is left out.
    let mut excluded = farthest;
    let mut closest: Option<Candidate> = None;
    for candidate in nearest.candidates() {
        if excluded == Some(candidate) {
            excluded = None;
        } else if same_surface.holds(candidate.normal()) {
            if closest.is_none_or(|closest| candidate.order() < closest.order()) {
                closest = Some(candidate);
            }
            sums.add(&candidate);
        }
    }
    Some((closest?, sums))
}

/// `true` if every photon has a normal of this code.
#[inline(always)]
fn are_all_of(normal: u8, contents: &[u64]) -> bool {
    let differ =
        contents.iter().fold(0, |differ, content| differ | content ^ (u64::from(normal) << NORMAL_SHIFT));
    differ & 0xff << NORMAL_SHIFT == 0
}

/// First bit of the normal's code in a photon's contents.
const NORMAL_SHIFT: u32 = 50;

/// The sum of the photons' power, and the lobe's sum.
struct Sums<'a> {
    reflection: &'a PartialReflection,
    decoded: DecodedLobe,
    power: ColourSum,
    lobe: ColourSum,
}

impl<'a> Sums<'a> {
    #[inline(always)]
    fn new(reflection: &'a PartialReflection) -> Self {
        let decoded = reflection.decode_lobe();
        Self { reflection, decoded, power: ColourSum::ZERO, lobe: ColourSum::ZERO }
    }

    #[inline(always)]
    fn add(&mut self, photon: &Candidate) {
        self.power.add_rgbe(photon.power());
        if !self.reflection.is_lambertian() {
            let factor = self.reflection.lobe_factor(&self.decoded, photon.direction());
            self.lobe.add(Vec3::from_array(photon.power().decode()) * factor);
        }
    }

    #[inline(always)]
    fn reflected(&self) -> Vec3 {
        self.reflection.reflected(&self.power, &self.lobe)
    }
}

/// The test for photons of one surface. Neighbours mostly have the normal of the one before, whose answer is kept.
pub struct SameSurface {
    normal: Vec3,
    last: (u8, bool),
}

impl SameSurface {
    /// The test for a surface whose normal has this code.
    #[inline(always)]
    pub fn new(code: u8) -> Self {
        Self { normal: unit(decode_normal(code).into()), last: (code, true) }
    }

    /// `true` for a photon of the surface, by its normal's code.
    #[inline(always)]
    pub fn holds(&mut self, code: u8) -> bool {
        if self.last.0 != code {
            let other = unit(decode_normal(code).into());
            self.last = (code, other.dot(self.normal) >= MIN_NORMAL_COSINE);
        }
        self.last.1
    }
}
