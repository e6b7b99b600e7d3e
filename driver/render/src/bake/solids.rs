//! Samples inside solids: they are moved out or left out, so that the foot of an object is neither black nor
//! lit from its other side.
//!
//! A ray that meets the back of a solid's face comes from within. A face bounds a solid if its material is
//! one-sided, or if it is part of a closed surface ([`photoncard_scene::parts`]).

use std::collections::HashSet;

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::{Hit, Ray, SceneImage, closest_hit, magnitude};
use photoncard_map::pack::PackedScene;
use photoncard_scene::{Scene, parts};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::texels::{Sample, Texel};

/// Minimum distance of a sample from a wall that it adjoins, texels.
const CLEARANCE: f32 = 0.1;
/// Height of rays above the surface, texels.
const LIFT: f32 = 0.02;
/// Share of the scene's box on each axis from which a closed surface is a room, not a solid.
const ROOM: f32 = 0.9;
/// Times that a sample is moved.
const MOVES: u32 = 2;

/// Finds the solids of a scene by rays on the host.
pub(super) struct Solids<'p> {
    image: SceneImage,
    lines: Lines<'p>,
    /// True for each material that is one-sided and does not emit: its faces count as those of a solid. A
    /// lamp may be a lone sheet.
    is_of_solids: Vec<bool>,
    /// Sorted corners of the other faces that bound closed surfaces.
    closed: HashSet<[[u32; 3]; 3]>,
    /// Length of a texel's side, metres.
    texel: f32,
}

impl<'p> Solids<'p> {
    /// Solids of a scene without instances, which is packed, for texels whose side has a length, metres.
    pub(super) fn new(scene: &Scene, packed: &'p PackedScene, texel: f32) -> Self {
        let (image, lines) = packed.view();
        let materials = scene.materials.iter();
        let is_of_solids: Vec<bool> =
            materials.map(|material| !material.double_sided && !material.is_emissive()).collect();
        let closed = if is_of_solids.contains(&false) { closed_faces(scene) } else { HashSet::new() };
        Self { image, lines, is_of_solids, closed, texel }
    }

    /// Moves the samples of texels out of solids, and removes those that cannot be moved, or are hidden from
    /// the texel's first sample.
    ///
    /// # Errors
    /// A [`Fault`] if the packed scene is invalid.
    pub(super) fn free(&self, texels: &mut [Texel]) -> Result<(), Fault> {
        texels.par_iter_mut().try_for_each(|texel| {
            let mut samples = Vec::with_capacity(texel.samples.len());
            for sample in &texel.samples {
                samples.extend(self.moved(sample)?);
            }
            texel.samples = self.together(samples)?;
            Ok(())
        })
    }

    /// Sample at a place outside solids, and whether it was moved; `None` if it is deep inside.
    fn moved(&self, sample: &Sample) -> Result<Option<(Sample, bool)>, Fault> {
        let mut sample = *sample;
        for number in 0..MOVES {
            let Some(exit) = self.exit(&sample)? else {
                let is_free = !self.is_enclosed(&sample)?;
                return Ok(is_free.then_some((self.cleared(&sample)?, number > 0)));
            };
            sample.position = exit;
        }
        let is_free = self.exit(&sample)?.is_none() && !self.is_enclosed(&sample)?;
        Ok(is_free.then_some((sample, true)))
    }

    /// Place behind the nearest back of a face within half a texel; `None` if there is none.
    fn exit(&self, sample: &Sample) -> Result<Option<Vec3>, Fault> {
        let mut nearest: Option<(f32, Vec3)> = None;
        for direction in around(sample.face) {
            let Some(hit) = self.hit(sample, direction, 0.5 * self.texel)? else { continue };
            let distance = hit.intersection.distance;
            if self.is_from_within(&hit, direction) && nearest.is_none_or(|(least, _)| distance < least) {
                nearest = Some((distance, direction));
            }
        }
        let behind =
            |(distance, direction)| sample.position + direction * (distance + CLEARANCE * self.texel);
        Ok(nearest.map(behind))
    }

    /// Returns whether most of five rays into the half space above a sample meet backs of solids' faces.
    fn is_enclosed(&self, sample: &Sample) -> Result<bool, Fault> {
        let mut within = 0;
        let slanted = around(sample.face).into_iter().step_by(2);
        let rays = slanted.map(|direction| (direction + sample.face).normalize_or(sample.face));
        for direction in rays.chain([sample.face]) {
            let hit = self.hit(sample, direction, f32::INFINITY)?;
            within += u32::from(hit.is_some_and(|hit| self.is_from_within(&hit, direction)));
        }
        Ok(within >= 3)
    }

    /// Sample at a small distance from the walls that it adjoins.
    fn cleared(&self, sample: &Sample) -> Result<Sample, Fault> {
        let clearance = CLEARANCE * self.texel;
        let mut moved = *sample;
        for direction in around(sample.face) {
            if let Some(hit) = self.hit(&moved, direction, clearance)? {
                moved.position -= direction * (clearance - hit.intersection.distance);
            }
        }
        // A gap that is narrower than the clearance leaves no place to move to.
        let way = moved.position - sample.position;
        let is_blocked = way != Vec3::ZERO && !self.sees(sample, moved.position)?;
        Ok(if is_blocked { *sample } else { moved })
    }

    /// Samples that see the first of them, in their order. First is the one nearest to the texel's centre, of
    /// those that were not moved if there are any.
    fn together(&self, samples: Vec<(Sample, bool)>) -> Result<Vec<Sample>, Fault> {
        let first = samples.iter().min_by(|(one, is_moved), (other, other_is_moved)| {
            is_moved.cmp(other_is_moved).then(one.off_centre.total_cmp(&other.off_centre))
        });
        let Some(&(first, _)) = first else { return Ok(Vec::new()) };
        let mut kept = Vec::with_capacity(samples.len());
        for (sample, _) in samples {
            if sample == first || self.sees(&first, sample.position)? {
                kept.push(sample);
            }
        }
        Ok(kept)
    }

    /// Returns whether nothing lies between a sample and a place, just above the surface.
    fn sees(&self, from: &Sample, to: Vec3) -> Result<bool, Fault> {
        let way = to - from.position;
        let length = way.length();
        let direction = way.normalize_or(from.face);
        Ok(length == 0.0 || self.hit(from, direction, length)?.is_none())
    }

    fn hit(&self, sample: &Sample, direction: Vec3, max_distance: f32) -> Result<Option<Hit>, Fault> {
        let rounding = 64.0 * f32::EPSILON * magnitude(&[sample.position]);
        let origin = sample.position + sample.face * (LIFT * self.texel + rounding);
        let mut lines = self.lines;
        closest_hit(&self.image, &mut lines, &Ray::of_light(origin, direction, max_distance))
    }

    fn is_from_within(&self, hit: &Hit, direction: Vec3) -> bool {
        let [a, b, c] = hit.triangle.vertices.map(Vec3::from);
        let is_back = (b - a).cross(c - a).dot(direction) > 0.0;
        let is_of_solid = self.is_of_solids.get(hit.triangle.material as usize) == Some(&true);
        is_back && (is_of_solid || self.closed.contains(&key([a, b, c])))
    }
}

/// Eight unit directions perpendicular to a unit normal, in a circle.
fn around(normal: Vec3) -> [Vec3; 8] {
    const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;
    let (u, v) = normal.any_orthonormal_pair();
    let (p, q) = ((u + v) * HALF, (u - v) * HALF);
    [u, p, v, -q, -u, -p, -v, q]
}

/// Faces of closed surfaces that do not surround the scene.
fn closed_faces(scene: &Scene) -> HashSet<[[u32; 3]; 3]> {
    let corners: Vec<[Vec3; 3]> = scene.triangles.iter().map(|triangle| triangle.vertices).collect();
    let of = |index: &u32| corners.get(*index as usize).copied().unwrap_or_default();
    let (lower, upper) = scene.bounds();
    let mut faces = HashSet::new();
    for part in parts(&corners).iter().filter(|part| part.is_closed) {
        let points = || part.triangles.iter().flat_map(of);
        let low = points().fold(Vec3::INFINITY, Vec3::min);
        let high = points().fold(Vec3::NEG_INFINITY, Vec3::max);
        let is_room =
            (high - low).cmpge((upper - lower) * ROOM).all() && part.triangles.len() < corners.len();
        if !is_room {
            faces.extend(part.triangles.iter().map(|index| key(of(index))));
        }
    }
    faces
}

fn key(corners: [Vec3; 3]) -> [[u32; 3]; 3] {
    let mut key = corners.map(|corner| corner.to_array().map(|axis| (axis + 0.0).to_bits()));
    key.sort_unstable();
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_unit_vectors_in_the_plane_in_opposite_pairs() {
        for normal in [Vec3::Y, Vec3::NEG_Z, Vec3::new(0.6, 0.0, -0.8)] {
            let all = around(normal);
            for (direction, opposite) in all.iter().zip(all.iter().cycle().skip(4)) {
                assert!(direction.dot(normal).abs() < 1e-6 && (direction.length() - 1.0).abs() < 1e-6);
                assert!((*direction + *opposite).length() < 1e-6);
            }
        }
    }
}
