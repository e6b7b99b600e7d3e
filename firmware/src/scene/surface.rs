//! What a ray finds where it meets a triangle: its material there, textures applied, seen from the ray's side.

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{
    DOUBLE_SIDED, HAS_ATTRIBUTES, Material, NO_TEXTURE, Record, Reflectance, Triangle,
};
use photoncard_shared::message::Fault;

use super::corners::Corners;
use super::reflection::{Scattering, Texel, View, scattering};
use super::specular::Specular;
use super::{Hit, Ray, Reflection, Reflector, SceneImage, magnitude, offset_origin};
use crate::memory::MemoryPort;
use crate::vector::{max_component, unit};

const MATERIALS_PER_LINE: u32 = Material::PER_LINE as u32;

/// The point where a ray meets a surface, on the side that it comes from.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point, metres.
    pub position: Vec3,
    /// Unit shading normal on the side of the ray's origin.
    pub normal: Vec3,
    /// Unit normal of the triangle on the side of the ray's origin.
    pub geometric_normal: Vec3,
    /// Unit vector back along the ray.
    pub outgoing: Vec3,
    /// How this side reflects, its perfectly specular part apart; black on the back of a one-sided surface.
    pub reflection: Reflection,
    /// What of light it reflects or lets through perfectly specularly.
    pub specular: Specular,
    /// Absorption coefficient of what the ray came through, 1/m, where the surface is the inside of glass.
    pub absorption: Vec3,
    /// Radiance that this side emits, W/(sr m^2).
    pub emission: Vec3,
    /// Index of the emitter that the surface belongs to, if it is one.
    pub emitter: Option<u32>,
    /// Whether the other side does the same.
    pub double_sided: bool,
    /// Distance along the ray, metres.
    pub distance: f32,
    /// The greatest coordinate that the point was computed from, metres: its rounding is in proportion.
    pub magnitude: f32,
}

impl Surface {
    /// A white Lambertian surface, seen from straight above.
    pub fn white(position: Vec3, normal: Vec3, magnitude: f32) -> Self {
        Self {
            position,
            normal,
            geometric_normal: normal,
            outgoing: normal,
            reflection: Reflection::lambertian(Vec3::ONE),
            specular: Specular::NONE,
            absorption: Vec3::ZERO,
            emission: Vec3::ZERO,
            emitter: None,
            double_sided: false,
            distance: 0.0,
            magnitude,
        }
    }

    /// The same without smooth shading: what photons are stored at, and gathers look for.
    #[inline(always)]
    pub fn flat(self) -> Self {
        Self { normal: self.geometric_normal, ..self }
    }

    /// The reflection seen from the ray's origin.
    #[inline(always)]
    pub fn reflector(&self) -> Reflector {
        let Self { normal, outgoing, reflection, .. } = *self;
        Reflector { normal, outgoing, reflection }
    }

    /// The same with its light dimmed, before it gets to whoever looks.
    #[inline(always)]
    pub fn dimmed(mut self, throughput: Vec3) -> Self {
        self.reflection = self.reflection.dimmed(throughput);
        self.emission *= throughput;
        self
    }

    /// A point just off the surface, from which a ray does not meet it again.
    #[inline(always)]
    pub fn offset_origin(&self) -> Vec3 {
        offset_origin(self.position, self.geometric_normal, self.magnitude)
    }

    /// The same on the other side.
    pub fn offset_behind(&self) -> Vec3 {
        offset_origin(self.position, -self.geometric_normal, self.magnitude)
    }

    /// Whether a direction is on the side that the surface is seen from, by both of its normals: light from elsewhere does
    /// not reach it, however it is shaded.
    #[inline(always)]
    pub fn is_above(&self, direction: Vec3) -> bool {
        self.normal.dot(direction) > 0.0 && self.geometric_normal.dot(direction) > 0.0
    }

    /// Unit vector to where light that came along the ray is mirrored.
    pub fn mirrored(&self) -> Vec3 {
        Specular::reflected_direction(self.outgoing, self.normal, self.geometric_normal)
    }
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
    let Hit { intersection, triangle, index } = hit;
    surface_of(scene, memory, ray, (*index, triangle), intersection.barycentric, intersection.distance)
}

/// A triangle's material.
#[inline(always)]
pub(super) fn read_material(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    index: u32,
) -> Result<Material, Fault> {
    let kind = SectionKind::Materials;
    let bytes = scene.record::<{ Material::BYTES }, MATERIALS_PER_LINE>(memory, kind, index)?;
    Ok(Material::read(bytes))
}

/// The surface of a triangle at a place on it.
#[inline(always)]
pub(super) fn surface_of(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    (index, triangle): (u32, &Triangle),
    weights: [f32; 3],
    distance: f32,
) -> Result<Surface, Fault> {
    let material = read_material(scene, memory, triangle.material)?;
    let [a, b, c] = triangle.vertices.map(Vec3::from_array);
    let [u, v, w] = weights;
    let front_normal = unit((b - a).cross(c - a));
    let is_front = front_normal.dot(ray.direction) < 0.0;
    let normal = if is_front { front_normal } else { -front_normal };
    let double_sided = material.flags & DOUBLE_SIDED != 0;
    let bare = Surface {
        // From the corners and not along the ray: the rounding is then that of the corners.
        position: a * u + b * v + c * w,
        outgoing: -ray.direction,
        reflection: Reflection::BLACK,
        double_sided,
        distance,
        ..Surface::white(Vec3::ZERO, normal, magnitude(&[a, b, c, ray.origin]))
    };
    if let Reflectance::Phong { diffuse, specular, exponent } = material.reflectance
        && is_plain(&material)
    {
        let reflection = Reflection::phong(diffuse.into(), specular.into(), exponent);
        let is_visible = is_front || double_sided;
        return Ok(Surface {
            reflection: if is_visible { reflection } else { Reflection::BLACK },
            emission: if is_visible { material.emission.into() } else { Vec3::ZERO },
            ..bare
        });
    }
    finished(scene, memory, bare, (index, weights, is_front), &material)
}

/// Whether a material is all that there is to its surfaces.
#[inline(always)]
fn is_plain(material: &Material) -> bool {
    material.textures == [NO_TEXTURE; 3] && material.flags & HAS_ATTRIBUTES == 0
}

/// A surface with its corners' attributes, its textures and its material.
#[inline(never)]
fn finished(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    bare: Surface,
    (index, weights, is_front): (u32, [f32; 3], bool),
    material: &Material,
) -> Result<Surface, Fault> {
    let is_glass = matches!(material.reflectance, Reflectance::Glass { .. });
    if !(is_front || bare.double_sided || is_glass) {
        return Ok(bare);
    }
    let emits = is_front || bare.double_sided;
    let emission = if emits { material.emission.into() } else { Vec3::ZERO };
    let mut surface = Surface { emission, ..bare };
    let has_corners = material.flags & HAS_ATTRIBUTES != 0;
    let corners = if has_corners { Corners::read(scene, memory, index, weights)? } else { None };
    let mut texel = Texel::WHITE;
    if let Some(corners) = &corners {
        let [base, metallic_roughness, emissive] = material.textures;
        texel.colour = rgb(corners.texture(scene, memory, base)?) * rgb(corners.colour());
        [_, texel.roughness, texel.metallic, _] = corners.texture(scene, memory, metallic_roughness)?;
        if max_component(surface.emission) > 0.0 {
            surface.emission *= rgb(corners.texture(scene, memory, emissive)?);
            surface.emitter = corners.emitter();
        }
        if let Some(normal) = corners.normal() {
            surface.normal = shading_normal(if is_front { normal } else { -normal }, &bare);
        }
    }
    let Surface { normal, geometric_normal, outgoing, .. } = surface;
    let view = View { outgoing, normals: [normal, geometric_normal], is_front };
    let Scattering { reflection, specular, absorption } = scattering(material, &texel, &view);
    Ok(Surface { reflection, specular, absorption, ..surface })
}

fn rgb([red, green, blue, _]: [f32; 4]) -> Vec3 {
    Vec3::new(red, green, blue)
}

/// The cosine to the viewer that a shading normal has at the least.
const LEAST_COSINE: f32 = 0.01;

/// A shading normal turned towards the viewer where it is turned away, as it may be at the edge of what is round.
fn shading_normal(normal: Vec3, bare: &Surface) -> Vec3 {
    let cosine = normal.dot(bare.outgoing);
    let turned =
        if cosine < LEAST_COSINE { normal + bare.outgoing * (LEAST_COSINE - cosine) } else { normal };
    let turned = unit(turned);
    // What has no direction, or is on the wrong side after all, is flat.
    if turned.dot(bare.geometric_normal) > 0.0 { turned } else { bare.geometric_normal }
}
