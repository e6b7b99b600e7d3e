//! Density estimate of the radiance that the nearest photons reflect (Jensen 2001, chapter 7), with three
//! corrections.
//!
//! `L = 1 / (pi r^2 c) sum f(incoming) power`, summed over the photons within `r`:
//!
//! - `r` is the distance of the k-th photon. A sum over all k photons would be too bright by the factor
//!   `k / (k - 1)`. The sum is therefore over the k - 1 nearer photons, which is the unbiased estimate of a
//!   Poisson density. If fewer than k photons lie within the maximum distance, the sum is over all of them,
//!   and `r` is the maximum distance.
//! - Photons of other surfaces are excluded by their normals, such as those on the other side of a thin wall
//!   or on the adjacent wall of a corner.
//! - `c`, the disc fraction, is the area of the surface whose photons are in the sum, divided by the disc's
//!   area `pi r^2`. Without `c`, edges and corners would darken, and stacked surfaces would be too bright.
//!   The host measures `c` for each photon, within about its distance to its k-th neighbour. A gather uses
//!   the `c` of the nearest photon of its surface. Where walls hide photons, area and photons are those of
//!   the visible region ([`super::region`]).
//!
//! The remaining bias is blur: the radiance is a mean over the disc.

use core::f32::consts::PI;

use glam::Vec3;
use photoncard_shared::budget::MAX_LIGHT_GROUPS;
use photoncard_shared::layout::{disc_fraction, is_of_region};

use super::{Candidate, NearestPhotons, SameSurface, Sectors};
use crate::fixed_point::ColourSum;
use crate::light_groups::{GroupedLight, LightGroups};
use crate::scene::{DecodedLobe, PartialReflection};
use crate::simd::{self, Isa, Kernel};
use crate::vector::{max, min};

/// Minimum squared radius of a disc, in units of the squared side of a photon grid cell. The disc then has
/// the area of a cell's face: all photons in a cell are rounded to one point.
const MIN_RADIUS_SQUARED: f32 = 1.0 / PI;

/// Result of a density estimate at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflected {
    /// Reflected radiance, photon power units/(sr m^2), times the weight in the `PartialReflection`.
    pub radiance: GroupedLight,
    /// Number of photon normals decoded.
    pub normals_decoded: u32,
    /// Closest photon of the point's surface; `None` if no photon is in the sum.
    pub closest: Option<Candidate>,
    /// Visibility of the photons from the point, according to the disc fraction of the closest photon.
    pub sight: Sight,
}

/// Visibility of a gather's photons from its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// No wall hides photons around the closest one, or the search was limited to a visible region.
    Free,
    /// Walls hide part of the closest photon's disc.
    Walled,
    /// The closest photon of the point's surface is too far away to represent the point, or there is none.
    Unknown,
}

/// Maximum area of the disc up to the closest photon, divided by the mean area per photon. If the photon is
/// farther away, its disc fraction does not represent that of the point. On a wall, this happens in one
/// gather of 1,100.
const APART: f32 = 7.0;

/// Density estimate from the photons of a finished search: their reflected power, divided by the area of
/// their disc or of `region`, if given. `cell` is the side of a cell of the photon grid, metres. The light of
/// `groups` is summed separately.
#[inline(never)]
pub fn reflected_radiance(
    nearest: &NearestPhotons,
    cell: f32,
    region: Option<&Sectors>,
    reflection: &PartialReflection,
    groups: LightGroups,
) -> Reflected {
    let lobe = reflection.decode_lobe();
    simd::run(Estimate { nearest, cell, region, reflection, lobe, groups })
}

/// Computation of [`reflected_radiance`], compiled for every instruction set.
pub struct Estimate<'a, 'n> {
    /// The nearest photons of a finished search.
    pub nearest: &'a NearestPhotons<'n>,
    /// Side of a cell of the photon grid, metres.
    pub cell: f32,
    /// Region that was searched; `None` for a sphere.
    pub region: Option<&'a Sectors>,
    /// Reflection at the position.
    pub reflection: &'a PartialReflection,
    /// Lobe of the reflection.
    pub lobe: DecodedLobe,
    /// Light groups whose light is summed separately.
    pub groups: LightGroups,
}

impl Kernel for Estimate<'_, '_> {
    type Output = Reflected;

    #[inline(always)]
    fn run(self, _: impl Isa) -> Reflected {
        let Self { nearest, cell, region, reflection, lobe, groups } = self;
        let (radius_squared, farthest) = if nearest.is_full() {
            let farthest = extreme(nearest, u32::max, |candidate, other| candidate.order() > other.order());
            (farthest.map_or(0.0, |farthest| farthest.distance_squared()), farthest)
        } else {
            (nearest.max_distance_squared(), None)
        };
        let Some((closest, sums)) = sum(nearest, farthest, Sums::new(reflection, lobe, groups)) else {
            let sight = if region.is_none() && !nearest.is_empty() { Sight::Unknown } else { Sight::Free };
            return Reflected { radiance: GroupedLight::NONE, normals_decoded: 0, closest: None, sight };
        };
        let radius_squared = max(radius_squared, max(MIN_RADIUS_SQUARED * cell * cell, f32::MIN_POSITIVE));
        let fraction = disc_fraction(closest.disc());
        let in_disc = PI * radius_squared * fraction;
        let is_of_region = is_of_region(closest.disc());
        let area = region.map_or(in_disc, |region| {
            let in_region = max(region.area(radius_squared), f32::MIN_POSITIVE);
            if is_of_region { in_region * fraction } else { min(in_region, in_disc) }
        });
        let is_apart = closest.distance_squared() * nearest.len() as f32 > APART * radius_squared;
        let sight = match region {
            None if is_of_region => Sight::Walled,
            None if is_apart => Sight::Unknown,
            _ => Sight::Free,
        };
        Reflected {
            radiance: sums.reflected(1.0 / area),
            normals_decoded: sums.normals_decoded,
            closest: Some(closest),
            sight,
        }
    }
}

/// Closest or farthest candidate. `choose` is the minimum or the maximum of two distances. Among candidates
/// at that distance, `is_better` decides.
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

/// Sums over the photons of the surface, except `farthest`. Returns the closest of these photons and the
/// sums; `None` if there is no such photon.
#[inline(always)]
fn sum<'a>(
    nearest: &NearestPhotons,
    farthest: Option<Candidate>,
    mut sums: Sums<'a>,
) -> Option<(Candidate, Sums<'a>)> {
    let (_, contents) = nearest.columns();
    let reflection = sums.reflection;
    let are_one = sums.groups.is_one() && reflection.is_lambertian();
    if are_one && are_all_of(reflection.normal(), contents) {
        // With a single photon, `farthest` is the closest too.
        if farthest.is_some() && contents.len() < 2 {
            return None;
        }
        let [power, ..] = &mut sums.power;
        power.add_powers(contents);
        if let Some(farthest) = farthest {
            power.subtract_power(farthest.content);
        }
        let closest = extreme(nearest, u32::min, |candidate, other| candidate.order() < other.order())?;
        return Some((closest, sums));
    }
    let mut same_surface = SameSurface::new(reflection.normal());
    // Exactly one of several photons that equal the farthest is excluded.
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
    sums.normals_decoded = same_surface.decoded();
    Some((closest?, sums))
}

/// Returns true if the normals of all photons have the code `normal`.
#[inline(always)]
fn are_all_of(normal: u8, contents: &[u64]) -> bool {
    let differ =
        contents.iter().fold(0, |differ, content| differ | content ^ (u64::from(normal) << NORMAL_SHIFT));
    differ & 0xff << NORMAL_SHIFT == 0
}

/// Position of the lowest bit of the normal's code in a photon's content.
const NORMAL_SHIFT: u32 = 50;

/// Sum of the photons' power (`power`), and of power times [`PartialReflection::lobe_factor`] (`lobe`), by
/// light group.
struct Sums<'a> {
    reflection: &'a PartialReflection,
    decoded: DecodedLobe,
    power: [ColourSum; MAX_LIGHT_GROUPS],
    lobe: [ColourSum; MAX_LIGHT_GROUPS],
    groups: LightGroups,
    normals_decoded: u32,
}

impl<'a> Sums<'a> {
    #[inline(always)]
    fn new(reflection: &'a PartialReflection, decoded: DecodedLobe, groups: LightGroups) -> Self {
        let none = [ColourSum::ZERO; MAX_LIGHT_GROUPS];
        Self { reflection, decoded, power: none, lobe: none, groups, normals_decoded: 0 }
    }

    #[inline(always)]
    fn add(&mut self, photon: &Candidate) {
        let group = self.groups.index(photon.light_group());
        let (Some(power), Some(lobe)) = (self.power.get_mut(group), self.lobe.get_mut(group)) else { return };
        power.add_rgbe(photon.power());
        if !self.reflection.is_lambertian() {
            let factor = PartialReflection::lobe_factor(&self.decoded, photon.direction());
            lobe.add(Vec3::from_array(photon.power().decode()) * factor);
        }
    }

    #[inline(always)]
    fn reflected(&self, scale: f32) -> GroupedLight {
        let mut sums = self.power.iter().zip(&self.lobe);
        GroupedLight::of_groups(self.groups, |_| match sums.next() {
            Some((power, lobe)) => self.reflection.reflected(power, lobe) * scale,
            None => Vec3::ZERO,
        })
    }
}
