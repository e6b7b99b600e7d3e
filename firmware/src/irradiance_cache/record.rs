//! One irradiance record: position, radius of validity, and irradiance with its gradients.

use glam::Vec3;
use photoncard_shared::message::{Fault, Invariant};

use super::gradient::{Coefficients, Distances, rotation};
use super::packed_normal::PackedNormal;
use crate::fixed_point::ColourSum;
use crate::importance::CELLS;
use crate::scene::Surface;
use crate::vector::{from_upper_half, max, min, tangents, upper_half};

/// State of a record, with its data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Content {
    /// During the survey: inverse distance to the surroundings by cell of the hemisphere, 1/m, bfloat16. It
    /// is 0 in cells that are not surveyed yet.
    Surveying([u16; CELLS]),
    /// After the survey: distances to the surroundings.
    Surveyed(Distances),
    /// During the gather: sums of radiance.
    Gathering(GatherSums),
    /// After the gather: irradiance and gradients.
    Gathered(Irradiance),
}

/// Sums of a record that is being gathered, in the image's radiance units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GatherSums {
    /// Coefficients of the translational gradient by cell, bfloat16.
    coefficients: [[u16; 2]; CELLS],
    mean: ColourSum,
    translation: [ColourSum; 2],
    rotation: [ColourSum; 2],
}

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

    /// Adds the radiance of a gather ray in a cell of the hemisphere.
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

    /// Converts the sums to irradiance. `unit` is the radiance unit, `distance` the record's harmonic mean
    /// distance, metres.
    pub(super) fn irradiance(&self, unit: f32, distance: f32) -> Irradiance {
        Irradiance {
            mean: self.mean.value() * unit,
            translation: self.translation.map(|sum| sum.value() * (unit / distance)),
            rotation: self.rotation.map(|sum| sum.value() * unit),
        }
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
    /// Radius of validity, metres: `distance`, but at least so large that the record is valid over some
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

    /// White Lambertian surface at the record's position.
    pub(super) fn surface(&self) -> Surface {
        let geometric_normal = self.geometric_normal.get().unwrap_or(self.normal);
        Surface { geometric_normal, ..Surface::white(self.position, self.normal, self.magnitude) }
    }

    /// Error of the record at a point: `|p - p_i|^2 / R^2 + 1 - n n_i`, where R is `radius`. It is of second
    /// order in distance and angle, because gradients remove the first-order error of Ward, Rubinstein, Clear
    /// 1988. It is infinite for points off the record's tangent plane (the tolerance shrinks with the
    /// distance of the surroundings) and for normals at 90 degrees or more.
    pub(super) fn error(&self, radius: f32, allowed: f32, position: Vec3, normal: Vec3) -> f32 {
        let way = position - self.position;
        let cosine = self.normal.dot(normal);
        let height = way.dot(self.normal + normal) * 0.5;
        let height_allowed = min(PLANE_SHARE * libm::sqrtf(allowed) * radius, FREE_SHARE * self.distance);
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

    /// Limits the translational gradient to `mean / distance`, averaged over channels. Steeper gradients are
    /// noise.
    pub(super) fn limited(mut self, distance: f32) -> Self {
        let greatest = self.mean.element_sum() * (1.0 / 3.0) / distance;
        let [x, y] = self.translation.map(|component| component.element_sum() * (1.0 / 3.0));
        let length = libm::sqrtf(x * x + y * y);
        if length > greatest {
            self.translation = self.translation.map(|component| component * (greatest / length));
        }
        self
    }
}
