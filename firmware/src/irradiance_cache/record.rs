//! One irradiance record: where it is, how far it reaches, and the irradiance with its gradients.

use glam::Vec3;

use super::gradient::Distances;
use crate::importance::CELLS;
use crate::scene::Surface;
use crate::vector::{from_upper_half, max, tangents, upper_half};

/// What a record knows of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Content {
    /// Nothing yet: the inverse distance of what is around in each cell of the hemisphere, as far as it is known, 1/m.
    Surveying([u16; CELLS]),
    /// The distances of what is around.
    Surveyed(Distances),
    /// What was gathered.
    Gathered(Irradiance),
}

/// Indirect light at a record. Gradients are in the surface's tangent plane: along the tangent and the bitangent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Irradiance {
    /// The irradiance over pi, W/(sr m^2): the radiance that a white Lambertian surface would reflect.
    pub(super) mean: Vec3,
    /// Its change with the place, 1/m.
    pub(super) translation: [Vec3; 2],
    /// Its change with the normal's rotation about an axis, 1/rad.
    pub(super) rotation: [Vec3; 2],
}

/// A record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Record {
    pub(super) position: Vec3,
    /// Unit normal on the side of the eye.
    pub(super) normal: Vec3,
    /// The greatest coordinate that the position was computed from, metres.
    magnitude: f32,
    /// Harmonic mean of the distances of what is around, metres; unknown before the survey ends.
    pub(super) distance: f32,
    /// The same, not below what makes the record reach some pixels.
    pub(super) radius: f32,
    pub(super) content: Content,
}

/// The harmonic mean of the distances where there is nothing around, metres: its square is finite.
const FARTHEST: f32 = 1e18;
/// What is nearer is taken to be as far, metres: the sum of the inverse distances, and their squares, are finite.
const NEAREST: f32 = 1.0 / FARTHEST;
/// Of a record's radius, how far a place may be from its tangent plane, over the square root of the error.
const PLANE_SHARE: f32 = 0.1;

impl Record {
    /// The record of a surface that is not yet surveyed, with a radius of at least `least` metres.
    pub(super) fn new(surface: &Surface, least: f32) -> Self {
        let Surface { position, normal, magnitude, .. } = *surface;
        let content = Content::Surveying([0; CELLS]);
        Self { position, normal, magnitude, distance: least, radius: least, content }
    }

    /// Tells the distance of what is around in a cell of the hemisphere, metres, infinite if there is nothing. Its inverse is
    /// rounded to eight bits.
    pub(super) fn set_distance(&mut self, cell: u8, distance: f32) {
        if let Content::Surveying(inverses) = &mut self.content
            && let Some(inverse) = inverses.get_mut(cell as usize)
        {
            *inverse = upper_half(1.0 / max(distance, NEAREST));
        }
    }

    /// All distances are known: how far the record reaches.
    pub(super) fn end_survey(&mut self) {
        let Content::Surveying(inverses) = self.content else { return };
        let inverses = inverses.map(from_upper_half);
        let mean = inverses.iter().sum::<f32>() * (1.0 / CELLS as f32);
        self.distance = 1.0 / max(mean, 1.0 / FARTHEST);
        self.radius = max(self.distance, self.radius);
        self.content = Content::Surveyed(Distances::new(&inverses, self.distance));
    }

    /// A white Lambertian surface where the record is.
    pub(super) fn surface(&self) -> Surface {
        Surface::white(self.position, self.normal, self.magnitude)
    }

    /// The error of the record at a place, for a radius of `radius`: the square of the distance over it, and how far
    /// the normal has turned (Ward, Rubinstein, Clear 1988, whose error is of first order; with gradients it is of
    /// second). Infinite out of its plane.
    pub(super) fn error(&self, radius: f32, allowed: f32, position: Vec3, normal: Vec3) -> f32 {
        let way = position - self.position;
        let cosine = self.normal.dot(normal);
        let height = way.dot(self.normal + normal) * 0.5;
        let height_allowed = PLANE_SHARE * libm::sqrtf(allowed) * radius;
        if cosine <= 0.0 || height > height_allowed || height < -height_allowed {
            return f32::INFINITY;
        }
        way.length_squared() / (radius * radius) + (1.0 - cosine)
    }
}

impl Irradiance {
    /// The irradiance over pi at a place near the record at `origin` with normal `origin_normal` (Ward, Heckbert 1992).
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

    /// No gradient that changes the irradiance by more than itself within `distance`: such a one is noise.
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
