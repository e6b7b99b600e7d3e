//! What a ray has met, in twelve bytes: enough to read the surface again.

use photoncard_shared::message::Fault;

use super::bvh::read_triangle;
use super::surface::surface_of;
use super::{Hit, Ray, SceneImage, Surface};
use crate::memory::MemoryPort;

/// A place on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Index of the triangle.
    triangle: u32,
    /// Weights of its second and third corner; that of the first is the rest of 1.
    weights: [f32; 2],
}

impl Seen {
    /// A place on no surface in particular.
    pub const NOWHERE: Self = Self { triangle: 0, weights: [0.0; 2] };
    /// A place that is not kept here.
    pub const ELSEWHERE: Self = Self { triangle: u32::MAX, ..Self::NOWHERE };

    /// Whether the place is [`Self::ELSEWHERE`].
    #[inline(always)]
    pub fn is_elsewhere(&self) -> bool {
        self.triangle == u32::MAX
    }

    /// Where a ray met a triangle.
    pub fn new(hit: &Hit) -> Self {
        let [_, v, w] = hit.intersection.barycentric;
        Self { triangle: hit.index, weights: [v, w] }
    }

    /// The surface there, on the side that the ray comes from. Its distance is not known and zero.
    ///
    /// # Errors
    /// If the image is not sound.
    #[inline(always)]
    pub fn surface(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        ray: &Ray,
    ) -> Result<Surface, Fault> {
        let triangle = read_triangle(scene, memory, self.triangle)?;
        let [v, w] = self.weights;
        surface_of(scene, memory, ray, (self.triangle, &triangle), [1.0 - v - w, v, w], 0.0)
    }
}
