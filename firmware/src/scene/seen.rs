//! A hit in twelve bytes, from which the surface can be read again.

use photoncard_shared::message::Fault;

use super::bvh::read_triangle;
use super::surface::surface_of;
use super::{Hit, Ray, SceneImage, Surface};
use crate::memory::MemoryPort;

/// Point on a triangle: index and barycentric coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Index of the triangle.
    triangle: u32,
    /// Weights v and w of the second and third corner; the first has 1 - v - w.
    weights: [f32; 2],
}

impl Seen {
    /// Arbitrary initial value.
    pub const NOWHERE: Self = Self { triangle: 0, weights: [0.0; 2] };
    /// Marks a point that is seen through specular surfaces, and must be found by its path.
    pub const ELSEWHERE: Self = Self { triangle: u32::MAX, ..Self::NOWHERE };

    /// `true` for [`Self::ELSEWHERE`].
    #[inline(always)]
    pub fn is_elsewhere(&self) -> bool {
        self.triangle == u32::MAX
    }

    /// The point of a hit.
    pub fn new(hit: &Hit) -> Self {
        let [_, v, w] = hit.intersection.barycentric;
        Self { triangle: hit.index, weights: [v, w] }
    }

    /// Reads the surface on the side of the ray's origin into `surface`, of several layers the base. Its
    /// `distance` is 0.
    ///
    /// # Errors
    /// If the image is not sound.
    #[inline(always)]
    pub fn surface(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        ray: &Ray,
        surface: &mut Surface,
    ) -> Result<(), Fault> {
        let triangle = read_triangle(scene, memory, self.triangle)?;
        let [v, w] = self.weights;
        surface_of(scene, memory, ray, (self.triangle, &triangle), [1.0 - v - w, v, w], &|_| 0.0, surface)
    }
}
