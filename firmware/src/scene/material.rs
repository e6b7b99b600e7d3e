//! Reflection: Lambertian plus one Phong cosine lobe, `f = kd / pi + ks (n + 2) / (2 pi) max(0, cos alpha)^n`, alpha
//! measured from the mirror direction.

use core::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{DOUBLE_SIDED, Material, Record, Reflectance, Triangle};
use photoncard_shared::message::Fault;

use super::{Hit, Ray, SceneImage, magnitude, offset_origin};
use crate::memory::MemoryPort;
use crate::vector::{max_component, unit};

const MATERIALS_PER_LINE: u32 = Material::PER_LINE as u32;

/// The point where a ray meets a surface, on the side that it comes from.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point, metres.
    pub position: Vec3,
    /// Unit geometric normal on the side of the ray's origin.
    pub normal: Vec3,
    /// Unit vector back along the ray.
    pub outgoing: Vec3,
    /// How this side reflects; black on the back of a one-sided surface.
    pub reflection: Reflection,
    /// Radiance that this side emits, W/(sr m^2).
    pub emission: Vec3,
    /// Whether the other side does the same.
    pub double_sided: bool,
    /// Distance along the ray, metres.
    pub distance: f32,
    /// The greatest coordinate that the point was computed from, metres: its rounding is in proportion.
    pub magnitude: f32,
}

impl Surface {
    /// A point just off the surface, from which a ray does not meet it again.
    #[inline(always)]
    pub fn offset_origin(&self) -> Vec3 {
        offset_origin(self.position, self.normal, self.magnitude)
    }
}

/// A reflection function's parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    /// Lambertian albedo.
    pub diffuse: Vec3,
    /// Albedo of the Phong lobe.
    pub specular: Vec3,
    /// Exponent of the Phong lobe.
    pub exponent: f32,
}

impl Reflection {
    /// No reflection.
    pub const BLACK: Self = Self { diffuse: Vec3::ZERO, specular: Vec3::ZERO, exponent: 0.0 };

    /// Whether nothing is reflected.
    #[inline(always)]
    pub fn is_black(&self) -> bool {
        !self.has_lambertian() && !self.has_lobe()
    }

    /// Whether there is a Lambertian part.
    #[inline(always)]
    pub fn has_lambertian(&self) -> bool {
        max_component(self.diffuse) > 0.0
    }

    /// Whether there is a Phong lobe.
    #[inline(always)]
    pub fn has_lobe(&self) -> bool {
        max_component(self.specular) > 0.0
    }

    /// The Lambertian part of `f`, 1/sr.
    #[inline(always)]
    pub fn lambertian(&self) -> Vec3 {
        self.diffuse * FRAC_1_PI
    }

    /// The lobe's part of `f`, 1/sr, for an incoming direction at `cosine` to the mirror direction.
    #[inline(always)]
    pub fn lobe(&self, cosine: f32) -> Vec3 {
        self.specular * ((self.exponent + 2.0) / (2.0 * PI) * lobe_power(cosine, self.exponent))
    }

    /// `f`, 1/sr, for unit vectors away from the surface, both on the side of `normal`.
    #[inline(always)]
    pub fn evaluate(&self, normal: Vec3, outgoing: Vec3, incoming: Vec3) -> Vec3 {
        if !self.has_lobe() {
            return self.lambertian();
        }
        self.lambertian() + self.lobe(mirror(outgoing, normal).dot(incoming))
    }
}

/// `max(0, cosine)^exponent`; zero at and below the lobe's horizon for every exponent, 0 among them.
#[inline(always)]
pub(crate) fn lobe_power(cosine: f32, exponent: f32) -> f32 {
    if cosine > 0.0 { libm::powf(cosine, exponent) } else { 0.0 }
}

/// The mirror direction of a unit vector about a unit normal.
#[inline(always)]
pub(crate) fn mirror(direction: Vec3, normal: Vec3) -> Vec3 {
    normal * (2.0 * normal.dot(direction)) - direction
}

/// Reads what a ray finds where it meets a triangle.
///
/// # Errors
/// If the triangle's material is not in the image.
#[inline(always)]
pub fn read_surface(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    hit: &Hit,
) -> Result<Surface, Fault> {
    let Hit { intersection, triangle, .. } = hit;
    surface_of(scene, memory, ray, triangle, intersection.barycentric, intersection.distance)
}

/// The surface of a triangle at a place on it.
#[inline(always)]
pub(super) fn surface_of(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    triangle: &Triangle,
    [u, v, w]: [f32; 3],
    distance: f32,
) -> Result<Surface, Fault> {
    let bytes = scene.record::<{ Material::BYTES }, MATERIALS_PER_LINE>(
        memory,
        SectionKind::Materials,
        triangle.material,
    )?;
    let material = Material::read(bytes);
    let [a, b, c] = triangle.vertices.map(Vec3::from_array);
    let front_normal = unit((b - a).cross(c - a));
    let is_front = front_normal.dot(ray.direction) < 0.0;
    let double_sided = material.flags & DOUBLE_SIDED != 0;
    let visible = is_front || double_sided;
    let reflection = match material.reflectance {
        Reflectance::Phong { diffuse, specular, exponent } => {
            Reflection { diffuse: diffuse.into(), specular: specular.into(), exponent }
        }
        _ => Reflection::BLACK,
    };
    Ok(Surface {
        // From the corners and not along the ray: the rounding is then that of the corners.
        position: a * u + b * v + c * w,
        normal: if is_front { front_normal } else { -front_normal },
        outgoing: -ray.direction,
        reflection: if visible { reflection } else { Reflection::BLACK },
        emission: if visible { material.emission.into() } else { Vec3::ZERO },
        double_sided,
        distance,
        magnitude: magnitude(&[a, b, c, ray.origin]),
    })
}
