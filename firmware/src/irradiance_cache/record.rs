//! One irradiance record: position, radius of validity, and irradiance with its gradients.

use glam::Vec3;
use photoncard_shared::layout::Rgbe;
use photoncard_shared::message::{Fault, Invariant};

use super::gradient::{Coefficients, Distances, rotation};
use super::packed_normal::PackedNormal;
use crate::fixed_point::ColourSum;
use crate::importance::CELLS;
use crate::scene::Surface;
use crate::vector::{from_upper_half, max, min, sqrt, tangents, upper_half};

/// State of a record, with its data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Content {
    /// During the survey: inverse distance to the surroundings in each cell of the hemisphere, 1/m, bfloat16.
    /// It is 0 in cells that are not surveyed yet.
    Surveying([u16; CELLS]),
    /// After the survey: distance to the surroundings in each cell of the hemisphere.
    Surveyed(Distances),
    /// During the gather: the strongest gather ray, and sums of radiance over all rays.
    Gathering(Strongest, GatherSums),
    /// After the gather: irradiance and gradients.
    Gathered(Irradiance),
}

/// Sums over the gather rays of a record, in the card image's radiance units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GatherSums {
    /// Coefficients of the translational gradient by cell of the hemisphere, bfloat16.
    pub(super) coefficients: [[u16; 2]; CELLS],
    pub(super) mean: ColourSum,
    pub(super) translation: [ColourSum; 2],
    pub(super) rotation: [ColourSum; 2],
}

/// Strongest term of a record's sums, and the strength of the second strongest term. A term is the weighted
/// radiance of a gather ray, its strength the sum of the channels. Neither depends on the order of the terms.
/// The type has an alignment of 1 byte, so that it fits beside the tag of [`Content`] and enlarges no record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Strongest {
    pub(super) light: Rgbe,
    pub(super) cell: u8,
    /// Strength of the second strongest term, bfloat16.
    pub(super) second: [u8; 2],
}

const _: () = assert!(size_of::<Content>() == size_of::<GatherSums>() + align_of::<GatherSums>());

impl Strongest {
    /// Value before the first term.
    pub(super) const NONE: Self = Self { light: Rgbe([0; 4]), cell: 0, second: [0; 2] };

    /// Takes account of a term: the weighted radiance of a gather ray in cell `cell` of the hemisphere.
    #[inline]
    pub(super) fn add(&mut self, cell: u8, light: Vec3) {
        if upper_half(light.element_sum()) < self.second() {
            return;
        }
        let term = Self { light: Rgbe::encode(light.to_array(), 0), cell, second: [0; 2] };
        let [weaker, stronger] = if term.key() > self.key() { [*self, term] } else { [term, *self] };
        let second = self.second().max(upper_half(weaker.light().element_sum()));
        *self = Self { second: second.to_ne_bytes(), ..stronger };
    }

    fn light(&self) -> Vec3 {
        Vec3::from_array(self.light.decode())
    }

    fn second(&self) -> u16 {
        u16::from_ne_bytes(self.second)
    }

    /// Sort key of a term: strength, then cell and encoded radiance. The bits of non-negative `f32` numbers
    /// sort like the numbers.
    fn key(&self) -> [u32; 3] {
        [self.light().element_sum().to_bits(), self.cell.into(), u32::from_le_bytes(self.light.0)]
    }
}

/// Maximum ratio of the strength of a record's strongest term to the summed strength of the others, if no
/// other term is nearly as strong. A small bright surface that the direction table does not favour is hit by
/// a ray of only one record in many, and would show as a disc of that record's radius.
const LONE_SHARE: f32 = 0.25;

impl GatherSums {
    /// Creates sums without terms.
    pub(super) fn new(coefficients: &Coefficients) -> Self {
        Self {
            coefficients: coefficients.map(|cell| cell.map(upper_half)),
            mean: ColourSum::ZERO,
            translation: [ColourSum::ZERO; 2],
            rotation: [ColourSum::ZERO; 2],
        }
    }

    /// Adds the weighted radiance of a gather ray in cell `cell` of the hemisphere.
    #[inline]
    pub(super) fn add(&mut self, cell: u8, brought: Vec3) {
        self.mean.add(brought);
        if let Some(coefficients) = self.coefficients.get(cell as usize) {
            for (sum, coefficient) in self.translation.iter_mut().zip(coefficients) {
                sum.add(brought * from_upper_half(*coefficient));
            }
        }
        for (sum, coefficient) in self.rotation.iter_mut().zip(rotation(cell)) {
            sum.add(brought * coefficient);
        }
    }

    /// Converts the sums to irradiance over pi, W/(sr m^2). `unit` is the radiance unit, W/(sr m^2),
    /// `distance` the record's harmonic mean distance, metres.
    pub(super) fn irradiance(&self, unit: f32, distance: f32) -> Irradiance {
        Irradiance {
            mean: self.mean.value() * unit,
            translation: self.translation.map(|sum| sum.value() * (unit / distance)),
            rotation: self.rotation.map(|sum| sum.value() * unit),
        }
    }

    /// Limits the strength of the strongest term to `max(second, LONE_SHARE * others)`. Here `second` is the
    /// strength of the second strongest term and `others` the sum of all terms but the strongest. The
    /// strongest term is stored as `Rgbe`; by this rounding it may exceed the limit by about 1/128 of its
    /// strength. A record's only term is kept.
    pub(super) fn limited(mut self, strongest: &Strongest) -> Self {
        let [strength, second] = [strongest.light().element_sum(), from_upper_half(strongest.second())];
        let others = self.mean.value().element_sum() - strength;
        let allowed = max(second, LONE_SHARE * others);
        if second > 0.0 && strength > allowed {
            self.add(strongest.cell, strongest.light() * (allowed / strength - 1.0));
        }
        self
    }
}

/// Indirect irradiance at a record. Gradients lie in the surface's tangent plane; their components are along
/// tangent and bitangent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Irradiance {
    /// Irradiance divided by pi, W/(sr m^2): the radiance that a white Lambertian surface reflects.
    pub(super) mean: Vec3,
    /// Translational gradient of `mean`, W/(sr m^3).
    pub(super) translation: [Vec3; 2],
    /// Rotational gradient of `mean`, W/(sr m^2 rad): derivative with respect to rotation of the normal about
    /// each axis.
    pub(super) rotation: [Vec3; 2],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Record {
    pub(super) position: Vec3,
    /// Unit shading normal on the side of the eye.
    pub(super) normal: Vec3,
    /// Unit normal of the triangle on the side of the eye; [`PackedNormal::NONE`] if it equals `normal`.
    pub(super) geometric_normal: PackedNormal,
    /// Maximum magnitude of the coordinates from which the position was computed, metres. It bounds the
    /// rounding error.
    pub(super) magnitude: f32,
    /// Harmonic mean of the distances to the surroundings, metres; undefined before the survey ends.
    pub(super) distance: f32,
    /// Radius of validity, metres: `distance`, but at least so large that the record is valid over a few
    /// pixels.
    pub(super) radius: f32,
    pub(super) content: Content,
}

/// Maximum of the harmonic mean distance, metres, for records without surroundings. Its square is finite.
const FARTHEST: f32 = 1e18;
/// Minimum distance to the surroundings, metres. It keeps the sum of inverse distances, and their squares,
/// finite.
const NEAREST: f32 = 1.0 / FARTHEST;
/// Maximum distance of an interpolated point from the record's tangent plane, divided by
/// `radius sqrt(allowed error)`.
const PLANE_SHARE: f32 = 0.1;
/// Maximum distance of an interpolated point from the record's tangent plane, divided by the harmonic mean
/// distance. Farther points may lie behind the surroundings: a record on the ceiling in the gap above a lamp
/// must not light the lamp's lower side.
const FREE_SHARE: f32 = 0.5;

impl Record {
    /// Record of a surface before its survey. The radius of validity is at least `least` metres.
    pub(super) fn new(surface: &Surface, least: f32) -> Self {
        let Surface { position, normal, magnitude, .. } = *surface;
        let is_flat = surface.geometric_normal == normal;
        let geometric_normal =
            if is_flat { PackedNormal::NONE } else { PackedNormal::new(surface.geometric_normal) };
        let content = Content::Surveying([0; CELLS]);
        Self { position, normal, geometric_normal, magnitude, distance: least, radius: least, content }
    }

    /// Sets the distance to the surroundings in a cell of the hemisphere, metres; infinite if there are none.
    /// The inverse is rounded to bfloat16.
    pub(super) fn set_distance(&mut self, cell: u8, distance: f32) -> Result<(), Fault> {
        if let Content::Surveying(inverses) = &mut self.content
            && let Some(inverse) = inverses.get_mut(cell as usize)
        {
            *inverse = upper_half(1.0 / max(distance, NEAREST));
            return Ok(());
        }
        Err(Invariant::Record.fault())
    }

    /// Ends the survey: computes the harmonic mean distance and the radius.
    pub(super) fn end_survey(&mut self) -> Result<(), Fault> {
        let Content::Surveying(inverses) = self.content else { return Err(Invariant::Record.fault()) };
        let inverses = inverses.map(from_upper_half);
        let mean = inverses.iter().sum::<f32>() * (1.0 / CELLS as f32);
        self.distance = 1.0 / max(mean, 1.0 / FARTHEST);
        self.radius = max(self.distance, self.radius);
        self.content = Content::Surveyed(Distances::new(&inverses, self.distance));
        Ok(())
    }

    /// White Lambertian surface with the record's position and normals.
    pub(super) fn surface(&self) -> Surface {
        let geometric_normal = self.geometric_normal.get().unwrap_or(self.normal);
        Surface { geometric_normal, ..Surface::white(self.position, self.normal, self.magnitude) }
    }

    /// Error of the record at a point `p` with the normal `n`: `|p - p_i|^2 / R^2 + 1 - n.n_i`, where `p_i`
    /// and `n_i` are the record's position and normal, and `R` is `radius`. It is of second order in distance
    /// and angle, because gradients remove the first-order error of Ward, Rubinstein, Clear 1988. It is
    /// infinite for points off the record's tangent plane (the tolerance shrinks with the distance of the
    /// surroundings) and for normals at 90 degrees or more.
    pub(super) fn error(&self, radius: f32, allowed: f32, position: Vec3, normal: Vec3) -> f32 {
        let way = position - self.position;
        let cosine = self.normal.dot(normal);
        let height = way.dot(self.normal + normal) * 0.5;
        let height_allowed = min(PLANE_SHARE * sqrt(allowed) * radius, FREE_SHARE * self.distance);
        if cosine <= 0.0 || height > height_allowed || height < -height_allowed {
            return f32::INFINITY;
        }
        way.length_squared() / (radius * radius) + (1.0 - cosine)
    }
}

impl Irradiance {
    /// Irradiance over pi, extrapolated to a point by the gradients (Ward, Heckbert 1992). The record is at
    /// `origin` with the normal `origin_normal`. The result is not negative.
    pub(super) fn at(&self, origin: Vec3, origin_normal: Vec3, position: Vec3, normal: Vec3) -> Vec3 {
        let (tangent, bitangent) = tangents(origin_normal);
        let along = |gradient: &[Vec3; 2], way: Vec3| {
            gradient[0] * tangent.dot(way) + gradient[1] * bitangent.dot(way)
        };
        let changed = self.mean
            + along(&self.translation, position - origin)
            + along(&self.rotation, origin_normal.cross(normal));
        changed.max(Vec3::ZERO)
    }

    /// Limits the translational gradient to `mean / distance`, both averaged over channels. Steeper gradients
    /// are noise.
    pub(super) fn limited(mut self, distance: f32) -> Self {
        let greatest = self.mean.element_sum() * (1.0 / 3.0) / distance;
        let [x, y] = self.translation.map(|component| component.element_sum() * (1.0 / 3.0));
        let length = sqrt(x * x + y * y);
        if length > greatest {
            self.translation = self.translation.map(|component| component * (greatest / length));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Irradiance of a record whose gather rays are given as pairs of cell and light. The channels of the
    /// light are in the proportion 1 : 1/2 : 1/4.
    fn mean(terms: impl IntoIterator<Item = (u8, f32)>) -> Irradiance {
        let (mut strongest, mut sums) = (Strongest::NONE, GatherSums::new(&[[0.5, 0.25]; CELLS]));
        for (cell, light) in terms {
            let light = Vec3::new(1.0, 0.5, 0.25) * light;
            strongest.add(cell, light);
            sums.add(cell, light);
        }
        sums.limited(&strongest).irradiance(1.0, 1.0)
    }

    const EVEN: f32 = 1.0 / 128.0;

    fn even() -> impl Iterator<Item = (u8, f32)> {
        (0..127).map(|ray| (ray % CELLS as u8, EVEN))
    }

    #[test]
    fn a_lone_strong_ray_brings_at_most_a_quarter_of_the_others() {
        let limited = mean(even().chain([(3, 4.0)]));
        let expected = mean(even().chain([(3, 0.25 * 127.0 * EVEN)]));
        assert!((limited.mean.x / expected.mean.x - 1.0).abs() < 0.01);
        for (limited, expected) in
            [(limited.translation[0], expected.translation[0]), (limited.rotation[1], expected.rotation[1])]
        {
            assert!((limited - expected).length() < 0.01, "{limited} {expected}");
        }
    }

    #[test]
    fn rays_that_another_one_confirms_keep_their_light() {
        let all = |terms: &[(u8, f32)]| terms.iter().map(|&(_, light)| light).sum::<f32>();
        for strong in [&[(3, 0.1)][..], &[(3, 4.0), (9, 4.0)]] {
            let terms: std::vec::Vec<_> = even().chain(strong.iter().copied()).collect();
            assert!((mean(terms.iter().copied()).mean.x / all(&terms) - 1.0).abs() < 1e-6, "{strong:?}");
        }
        assert_eq!(mean([(7, 4.0)]).mean.x, 4.0, "the only light");
    }

    #[test]
    fn a_record_does_not_depend_on_the_order_of_its_rays() {
        // Strengths that are equal, and strengths that differ by less than their rounding error.
        let near = 171.2 / 256.0;
        for strong in [[(3, 4.0), (9, 4.0), (4, 5.0), (2, 5.0)], [(1, near), (2, near), (9, near), (9, 0.1)]]
        {
            let mut terms: std::vec::Vec<_> = even().take(8).chain(strong).collect();
            let expected = mean(terms.iter().copied());
            for _ in 0..terms.len() {
                terms.rotate_left(1);
                assert_eq!(mean(terms.iter().copied()), expected);
                assert_eq!(mean(terms.iter().rev().copied()), expected);
            }
        }
    }
}
