//! Surfaces: a triangle's material at the point where a ray meets it, textures applied, seen from the ray's side.

use glam::Vec3;
use photoncard_shared::layout::{
    BLENDS, DOUBLE_SIDED, HAS_ATTRIBUTES, LayerTexture, Material, NO_TEXTURE, Reflectance, Triangle,
};
use photoncard_shared::message::Fault;

use super::corners::Corners;
use super::coverage::covered;
use super::materials::{has_layers, layer_texel, read_layers, read_material};
use super::normal_map::{base_normal, mapped_normal};
use super::reflection::{Layer, Scattering, Taken, Texel, View, scattering, take};
use super::shading_normal::{bent, bent_by_share, points_away, turned};
use super::specular::Specular;
use super::{Hit, Ray, Reflection, Reflector, SceneImage, magnitude, offset_origin};
use crate::memory::MemoryPort;
use crate::vector::{max, max_component, min, unit};

/// Random numbers of [`read_surface`].
pub const SURFACE_CHOICES: u32 = 4;

/// Surface at the hit of a ray, on the side of the ray's origin.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Position, metres.
    pub position: Vec3,
    /// Unit shading normal on the side of the ray's origin.
    pub normal: Vec3,
    /// Unit normal of the triangle on the side of the ray's origin.
    pub geometric_normal: Vec3,
    /// Unit vector back along the ray.
    pub outgoing: Vec3,
    /// The reflection of this side, without its perfectly specular part; black on the back of a one-sided surface.
    pub reflection: Reflection,
    /// The perfectly specular part.
    pub specular: Specular,
    /// Absorption coefficient of the glass that the ray came through, 1/m; zero in air.
    pub absorption: Vec3,
    /// Radiance that this side emits, W/(sr m^2).
    pub emission: Vec3,
    /// Index of the emitter that the surface belongs to, if it is one.
    pub emitter: Option<u32>,
    /// `true` if the other side reflects and emits too (glTF's `doubleSided`).
    pub double_sided: bool,
    /// Probability with which the surface's layer was taken, 1 for a surface of one layer: reflection and emission are over it.
    pub probability: f32,
    /// Share of the surface that is there, 1 without partial coverage: rays meet it with this probability.
    pub coverage: f32,
    /// `true` for the other side of a surface, seen through it. Photons are stored on the side where they arrive.
    pub is_behind: bool,
    /// Distance along the ray, metres.
    pub distance: f32,
    /// Greatest absolute coordinate that `position` was computed from, metres: it bounds the rounding error.
    pub magnitude: f32,
}

impl Surface {
    /// White Lambertian surface, seen along its normal.
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
            probability: 1.0,
            coverage: 1.0,
            is_behind: false,
            distance: 0.0,
            magnitude,
        }
    }

    /// The surface without smooth shading, as photons are stored on it and gathers search them.
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

    /// Reflection and emission times a throughput.
    #[inline(always)]
    pub fn dimmed(mut self, throughput: Vec3) -> Self {
        self.reflection = self.reflection.dimmed(throughput);
        self.emission *= throughput;
        self
    }

    /// The other side as it is seen through the surface: the side of the ray is mirrored.
    fn seen_through(self) -> Self {
        let front = -self.normal;
        Self {
            geometric_normal: -self.geometric_normal,
            outgoing: self.outgoing - front * (2.0 * front.dot(self.outgoing)),
            is_behind: true,
            ..self
        }
    }

    /// A point just off the surface, from which a ray does not meet it again.
    #[inline(always)]
    pub fn offset_origin(&self) -> Vec3 {
        offset_origin(self.position, self.geometric_normal, self.magnitude)
    }

    /// A point just off the other side, from which a ray does not meet the surface again.
    pub fn offset_behind(&self) -> Vec3 {
        offset_origin(self.position, -self.geometric_normal, self.magnitude)
    }

    /// `true` for a direction above both shading and geometric normal's horizon. Light from other directions is excluded, so that
    /// smooth normals leak none.
    #[inline(always)]
    pub fn is_above(&self, direction: Vec3) -> bool {
        self.normal.dot(direction) > 0.0 && self.geometric_normal.dot(direction) > 0.0
    }

    /// The mirror direction of the ray, a unit vector away from the surface.
    pub fn mirrored(&self) -> Vec3 {
        if self.specular.beside != Vec3::ZERO {
            return self.specular.beside;
        }
        Specular::reflected_direction(self.outgoing, self.normal, self.geometric_normal)
    }
}

/// Reads the surface where a ray meets a triangle. `random` gives [`SURFACE_CHOICES`] numbers in [0, 1), which choose one of its
/// layers; the base is the layer of 0.
///
/// # Errors
/// If the triangle's material is not in the image.
#[inline(always)]
pub fn read_surface(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    hit: &Hit,
    random: &dyn Fn(u32) -> f32,
) -> Result<Surface, Fault> {
    let Hit { intersection, triangle, index } = hit;
    let surface = surface_of(scene, memory, ray, (*index, triangle), intersection.barycentric, random)?;
    Ok(Surface { distance: intersection.distance, ..surface })
}

/// Surface of a triangle at barycentric `weights`, at a distance of 0: [`read_surface`].
#[inline(always)]
pub(super) fn surface_of(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    (index, triangle): (u32, &Triangle),
    weights: [f32; 3],
    random: &dyn Fn(u32) -> f32,
) -> Result<Surface, Fault> {
    let material = read_material(scene, memory, triangle.material)?;
    let [a, b, c] = triangle.vertices.map(Vec3::from_array);
    let [u, v, w] = weights;
    let front_normal = unit((b - a).cross(c - a));
    let is_front = front_normal.dot(ray.direction) < 0.0;
    let normal = if is_front { front_normal } else { -front_normal };
    let double_sided = material.flags & DOUBLE_SIDED != 0;
    let bare = Surface {
        // From the corners, not along the ray: the rounding error is relative to the corners.
        position: a * u + b * v + c * w,
        outgoing: -ray.direction,
        reflection: Reflection::BLACK,
        double_sided,
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
    finished(scene, memory, bare, (index, weights, is_front), &material, random)
}

/// `true` for a material without textures, vertex attributes and layers.
#[inline(always)]
fn is_plain(material: &Material) -> bool {
    material.textures == [NO_TEXTURE; 3] && material.flags & HAS_ATTRIBUTES == 0 && material.layers.is_none()
}

/// The surface with vertex attributes, textures and material applied.
#[inline(never)]
fn finished(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    bare: Surface,
    (index, weights, is_front): (u32, [f32; 3], bool),
    material: &Material,
    random: &dyn Fn(u32) -> f32,
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
        let [texture, colour] = [corners.texture(scene, memory, base)?, corners.colour()];
        texel.colour = rgb(texture) * rgb(colour);
        if material.flags & BLENDS != 0 {
            surface.coverage = covered(material, texture[3] * colour[3]);
        }
        [_, texel.roughness, texel.metallic, _] = corners.texture(scene, memory, metallic_roughness)?;
        if max_component(surface.emission) > 0.0 {
            surface.emission *= rgb(corners.texture(scene, memory, emissive)?);
            surface.emitter = corners.emitter();
        }
        let front = if is_front { bare.geometric_normal } else { -bare.geometric_normal };
        if let Some(normal) = base_normal(scene, memory, material, corners, front)? {
            surface.normal = if is_front { normal } else { -normal };
        }
    }
    let Surface { normal, geometric_normal, outgoing, .. } = surface;
    let view =
        View { outgoing, normals: [turned(normal, outgoing, geometric_normal), geometric_normal], is_front };
    if has_layers(material) {
        return layered(scene, memory, surface, (corners.as_ref(), material), (&texel, &view), random);
    }
    let Scattering { reflection, specular, absorption } = scattering(material, &texel, &view);
    let surface = Surface { reflection, specular, absorption, ..surface };
    Ok(shaded_by_parts(surface, &view, random(0)))
}

/// Minimum probability of each of two parts with normals of their own.
const MIN_PART: f32 = 1.0 / 8.0;

/// A surface with the shading normals of its parts, instead of the one of its corners or texture: the Lambertian part has that one, a
/// lobe or a mirror the bent one. Of a narrow lobe and a Lambertian part whose normals differ, one is taken by a random number in
/// [0, 1), over its probability. A wide lobe, for which photons are stored, shares a normal with the Lambertian part.
#[inline(never)]
fn shaded_by_parts(surface: Surface, view: &View, random: f32) -> Surface {
    let Surface { normal, geometric_normal, outgoing, reflection, .. } = surface;
    if normal == geometric_normal || (reflection.is_lambertian() && surface.specular.is_none()) {
        return surface;
    }
    let [turned, _] = view.normals;
    let share = reflection.glossy_share();
    if !(reflection.has_narrow_lobe() && share < 1.0) {
        return Surface { normal: bent_by_share(turned, share, outgoing, geometric_normal), ..surface };
    }
    let bent = bent(turned, outgoing, geometric_normal);
    // Not by the difference from `normal`, which rounding decides: a stored hit, read again, must give the same answer.
    if bent == turned && !points_away(normal, outgoing) {
        return surface;
    }
    let diffuse_share = min(max(1.0 - share, MIN_PART), 1.0 - MIN_PART);
    let (part, normal, probability) = if random < diffuse_share {
        (reflection.without_narrow_lobe(), normal, diffuse_share)
    } else {
        (reflection.narrow_lobe(), bent, 1.0 - diffuse_share)
    };
    let reflection = part.dimmed(Vec3::splat(1.0 / probability));
    Surface { normal, reflection, probability: surface.probability * probability, ..surface }
}

/// The surface of one of a material's layers. All layers of the side emit.
#[inline(never)]
fn layered(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    surface: Surface,
    (corners, material): (Option<&Corners>, &Material),
    (texel, view): (&Texel, &View),
    random: &dyn Fn(u32) -> f32,
) -> Result<Surface, Fault> {
    let layers = read_layers(scene, memory, material)?;
    let layer_texel = layer_texel(scene, memory, corners, &layers)?;
    let coat_normal = match corners {
        Some(corners) => {
            let map = (layers.texture(LayerTexture::CoatNormal), layers.coat_normal_scale);
            let sign = if view.is_front { 1.0 } else { -1.0 };
            let normal = mapped_normal(scene, memory, map, corners, surface.geometric_normal * sign)?;
            normal.map(|normal| normal * sign)
        }
        None => None,
    };
    let Surface { normal: own, geometric_normal, outgoing, .. } = surface;
    let coat_normal = turned(coat_normal.unwrap_or(geometric_normal), outgoing, geometric_normal);
    let taken = take((material, &layers), (texel, &layer_texel), view, coat_normal, random);
    let Taken { layer, scattering: Scattering { reflection, specular, absorption }, .. } = taken;
    let Taken { normal, probability, of_front, .. } = taken;
    let surface = Surface { reflection, specular, absorption, normal, probability, ..surface };
    if layer == Layer::Behind {
        return Ok(Surface { emission: Vec3::ZERO, ..surface }.seen_through());
    }
    let normals = [normal, geometric_normal];
    let normal = if layer == Layer::Base { own } else { normal };
    let surface = Surface { normal, emission: surface.emission / of_front, ..surface };
    Ok(shaded_by_parts(surface, &View { normals, ..*view }, random(SURFACE_CHOICES - 1)))
}

fn rgb([red, green, blue, _]: [f32; 4]) -> Vec3 {
    Vec3::new(red, green, blue)
}
