//! Hit of a ray, stored in twelve bytes, from which the surface can be read again.

use photoncard_shared::layout::{NO_INSTANCE, TriangleId};
use photoncard_shared::message::Fault;

use super::surface::{Detail, surface_of};
use super::triangles::read_triangle;
use super::{Hit, Ray, SceneImage, Surface};
use crate::memory::MemoryPort;

/// Point on a triangle, given by the triangle's index and barycentric coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    triangle: u32,
    /// Barycentric weights v and w of the second and third corner; the first has 1 - v - w.
    weights: [f32; 2],
}

impl Seen {
    /// Placeholder where no point is stored.
    pub const NOWHERE: Self = Self { triangle: 0, weights: [0.0; 2] };
    /// Marks a point that cannot be stored, because it lies behind specular surfaces, on a layer chosen at
    /// random or on an instance. Its eye path must be traced again.
    pub const ELSEWHERE: Self = Self { triangle: u32::MAX, ..Self::NOWHERE };

    /// Returns true for [`Self::ELSEWHERE`].
    #[inline(always)]
    pub fn is_elsewhere(&self) -> bool {
        self.triangle == u32::MAX
    }

    /// Creates the point of a hit; returns `None` on an instance, whose index does not fit.
    pub fn new(hit: &Hit) -> Option<Self> {
        let [_, v, w] = hit.intersection.barycentric;
        let TriangleId { index, instance } = hit.id;
        (instance == NO_INSTANCE).then_some(Self { triangle: index, weights: [v, w] })
    }

    /// Reads the surface at the point into `surface`, for the side on which the origin of `ray` lies. Of a
    /// material with several layers, the base is read. Sets `surface.distance` to 0.
    ///
    /// # Errors
    /// If the card image is invalid.
    #[inline(always)]
    pub fn surface(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        (ray, detail): (&Ray, Detail),
        surface: &mut Surface,
    ) -> Result<(), Fault> {
        let id = TriangleId::lone(self.triangle);
        let triangle = read_triangle(scene, memory, id)?;
        let [v, w] = self.weights;
        let place = (id, &triangle, detail);
        surface_of(scene, memory, ray, place, [1.0 - v - w, v, w], &|_| 0.0, surface)
    }
}
