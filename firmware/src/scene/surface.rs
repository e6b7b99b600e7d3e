//! Surface at the point where a ray hits a triangle: geometry, and the material with textures applied, for
//! the side from which the ray comes.

use glam::Vec3;
use photoncard_shared::layout::{
    BLENDS, DOUBLE_SIDED, HAS_ATTRIBUTES, LayerTexture, Material, NARROW_LOBE, NO_TEXTURE, PANE, Reflectance,
    Triangle, TriangleId,
};
use photoncard_shared::message::{Fault, FrameParameters};

use super::corners::Corners;
use super::coverage::covered;
use super::materials::{has_layers, layer_texel, read_layers, read_material};
use super::normal_map::{base_normal, mapped_normal};
use super::reflection::{Layer, Scattering, Texel, View, scattering, take};
use super::shading_normal::{bent, bent_by_share, points_away, turned};
use super::specular::Specular;
use super::{Hit, Ray, Reflection, Reflector, SceneImage, magnitude, offset_origin};
use crate::memory::MemoryPort;
use crate::vector::{max, max_component, min, unit};

/// Number of random numbers that [`read_surface`] may use.
pub const SURFACE_CHOICES: u32 = 4;

/// Detail in which a surface is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Its shading: normals of the corners or of the normal map, and interpolated textures.
    Shading,
    /// A gather of photons at the end of a gather ray: one random texel stands for the interpolated ones of
    /// each texture of a material without layers, and the geometric normal, with which photons are gathered,
    /// for the shading normal where no ray follows a narrow lobe. Less of the scene is read.
    Gathering,
    /// A point at which irradiance is measured: a white Lambertian surface with the shading normal, without
    /// emission.
    Irradiance,
}

impl Detail {
    /// Detail of the surfaces that eye rays meet.
    #[inline(always)]
    pub fn seen_in(frame: &FrameParameters) -> Self {
        if frame.irradiance { Self::Irradiance } else { Self::Shading }
    }
}

/// Surface at a point that a ray hits, seen from the ray's side: the side on which the ray's origin lies.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Position, metres.
    pub position: Vec3,
    /// Unit shading normal on the ray's side.
    pub normal: Vec3,
    /// Unit normal of the triangle on the ray's side.
    pub geometric_normal: Vec3,
    /// Unit vector opposite to the ray's direction.
    pub outgoing: Vec3,
    /// Reflection on the ray's side, without the perfectly specular part; black on the back of a one-sided
    /// surface.
    pub reflection: Reflection,
    /// Perfectly specular reflection and transmission.
    pub specular: Specular,
    /// Absorption coefficient of the glass that the ray passed through, 1/m; zero in air.
    pub absorption: Vec3,
    /// Radiance emitted by the ray's side, W/(sr m^2).
    pub emission: Vec3,
    /// Light group of the emission.
    pub light_group: u8,
    /// Index of the emitter that the surface belongs to; `None` if it is not an emitter.
    pub emitter: Option<u32>,
    /// Probability of the random choices that were made: of a material layer, and of the Lambertian part or
    /// the lobe; 1 without choices. `reflection` is already divided by this probability, and `specular` by
    /// the probability of the layer. `emission` is divided by the probability that any layer with emission is
    /// chosen.
    pub probability: f32,
    /// Fraction of the surface that is present: the probability with which a ray hits it; 1 without partial
    /// coverage.
    pub coverage: f32,
    /// True if the values describe the far side of the surface, seen through it by diffuse or rough
    /// transmission. The photons that the reflection needs are stored on the far side.
    pub is_behind: bool,
    /// Distance along the ray, metres.
    pub distance: f32,
    /// Maximum absolute coordinate of the triangle's corners and of the ray's origin, metres. The rounding
    /// error of `position` is proportional to it.
    pub magnitude: f32,
}

impl Surface {
    /// Placeholder, to be overwritten by a surface.
    pub const NOWHERE: Self = Self::white(Vec3::ZERO, Vec3::Z, 0.0);

    /// White Lambertian surface, seen along its normal.
    pub const fn white(position: Vec3, normal: Vec3, magnitude: f32) -> Self {
        Self {
            position,
            normal,
            geometric_normal: normal,
            outgoing: normal,
            reflection: Reflection::lambertian(Vec3::ONE),
            specular: Specular::NONE,
            absorption: Vec3::ZERO,
            emission: Vec3::ZERO,
            light_group: 0,
            emitter: None,
            probability: 1.0,
            coverage: 1.0,
            is_behind: false,
            distance: 0.0,
            magnitude,
        }
    }

    /// Replaces the shading normal by the geometric normal, with which photons are stored and gathered.
    #[inline(always)]
    pub fn flat(self) -> Self {
        Self { normal: self.geometric_normal, ..self }
    }

    /// Reflection towards the ray's origin, for evaluation and sampling.
    #[inline(always)]
    pub fn reflector(&self) -> Reflector {
        let Self { normal, geometric_normal, outgoing, reflection, .. } = *self;
        Reflector { normal, geometric_normal, outgoing, reflection }
    }

    /// Multiplies reflection and emission by a throughput.
    #[inline(always)]
    pub fn dimmed(mut self, throughput: Vec3) -> Self {
        self.reflection = self.reflection.dimmed(throughput);
        self.emission *= throughput;
        self
    }

    /// Reverses the geometric normal and mirrors `outgoing`, for the far side of the surface seen through it.
    /// `normal` must already be that of the far side.
    fn see_through(&mut self) {
        let front = -self.normal;
        self.geometric_normal = -self.geometric_normal;
        self.outgoing -= front * (2.0 * front.dot(self.outgoing));
        self.is_behind = true;
    }

    /// Origin of new rays on the ray's side: a point just off the surface, which they do not hit again.
    #[inline(always)]
    pub fn offset_origin(&self) -> Vec3 {
        offset_origin(self.position, self.geometric_normal, self.magnitude)
    }

    /// Origin of new rays on the far side: a point just off the surface, which they do not hit again.
    pub fn offset_behind(&self) -> Vec3 {
        offset_origin(self.position, -self.geometric_normal, self.magnitude)
    }

    /// Returns true if a direction is above the horizons of both the shading and the geometric normal. Light
    /// from other directions is ignored, so that smooth shading does not leak light through the triangle.
    #[inline(always)]
    pub fn is_above(&self, direction: Vec3) -> bool {
        self.normal.dot(direction) > 0.0 && self.geometric_normal.dot(direction) > 0.0
    }

    /// Unit direction, away from the surface, from which the specular reflection towards `outgoing` comes.
    pub fn mirrored(&self) -> Vec3 {
        if self.specular.beside != Vec3::ZERO {
            return self.specular.beside;
        }
        Specular::reflected_direction(self.outgoing, self.normal, self.geometric_normal)
    }
}

/// Reads the surface where a ray hits a triangle into `surface`. The result is written in place, because a
/// chip would copy its 230 bytes one by one. `random(i)` must return random number `i` in [0, 1), for `i`
/// from 0 to [`SURFACE_CHOICES`] - 1. The numbers choose one of the material's layers, or texels;
/// `random(0) == 0` chooses the base.
///
/// # Errors
/// If the triangle's material is not in the card image.
#[inline(always)]
pub fn read_surface(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    hit: &Hit,
    random: &dyn Fn(u32) -> f32,
    surface: &mut Surface,
) -> Result<(), Fault> {
    read_surface_with(scene, memory, ray, hit, Detail::Shading, random, surface)
}

/// Does [`read_surface`] in this detail.
///
/// # Errors
/// If the triangle's material is not in the card image.
#[inline(always)]
pub fn read_surface_with(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    hit: &Hit,
    detail: Detail,
    random: &dyn Fn(u32) -> f32,
    surface: &mut Surface,
) -> Result<(), Fault> {
    let Hit { intersection, triangle, id } = hit;
    let place = (*id, triangle, detail);
    surface_of(scene, memory, ray, place, intersection.barycentric, random, surface)?;
    surface.distance = intersection.distance;
    Ok(())
}

/// Does [`read_surface`] for the barycentric coordinates `weights`. Sets `surface.distance` to 0.
#[inline(always)]
pub(super) fn surface_of(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    ray: &Ray,
    (id, triangle, detail): (TriangleId, &Triangle, Detail),
    weights: [f32; 3],
    random: &dyn Fn(u32) -> f32,
    surface: &mut Surface,
) -> Result<(), Fault> {
    let material = read_material(scene, memory, triangle.material)?;
    let [a, b, c] = triangle.vertices.map(Vec3::from_array);
    let [u, v, w] = weights;
    let front_normal = unit((b - a).cross(c - a));
    let is_front = front_normal.dot(ray.direction) < 0.0;
    let normal = if is_front { front_normal } else { -front_normal };
    // The position is interpolated from the corners instead of computed along the ray, so that its rounding
    // error is relative to the corners' coordinates.
    let position = a * u + b * v + c * w;
    *surface = Surface::white(position, normal, magnitude(&[a, b, c, ray.origin]));
    surface.outgoing = -ray.direction;
    surface.reflection = Reflection::BLACK;
    surface.light_group = material.light_group;
    if detail == Detail::Irradiance {
        return finish_white(scene, memory, surface, (id, weights, is_front), &material);
    }
    let is_visible = is_front || material.flags & DOUBLE_SIDED != 0;
    if let Reflectance::Phong { diffuse, specular, exponent } = material.reflectance
        && is_plain(&material)
    {
        if is_visible {
            surface.reflection = Reflection::phong(diffuse.into(), specular.into(), exponent);
            surface.emission = material.emission.into();
        }
    } else if is_visible || matches!(material.reflectance, Reflectance::Glass { .. }) {
        surface.emission = if is_visible { material.emission.into() } else { Vec3::ZERO };
        finish(scene, memory, surface, (id, weights, is_front), (&material, detail), random)?;
    }
    Ok(())
}

/// Returns true if a material has neither textures nor vertex attributes nor layers.
#[inline(always)]
fn is_plain(material: &Material) -> bool {
    material.textures == [NO_TEXTURE; 3] && material.flags & HAS_ATTRIBUTES == 0 && material.layers.is_none()
}

/// Returns true if a material without transmission covers its triangles, and has no layers but a normal map.
fn is_of_base(scene: &SceneImage, memory: &mut impl MemoryPort, material: &Material) -> Result<bool, Fault> {
    let is_glass = matches!(material.reflectance, Reflectance::Glass { .. });
    let covers = !is_glass && material.flags & BLENDS == 0;
    Ok(covers && read_layers(scene, memory, material)?.are_of_base())
}

/// Applies vertex attributes, textures and material to a surface. `surface.emission` must already be the
/// untextured emission.
#[inline(never)]
fn finish(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    surface: &mut Surface,
    (id, weights, is_front): (TriangleId, [f32; 3], bool),
    (material, detail): (&Material, Detail),
    random: &dyn Fn(u32) -> f32,
) -> Result<(), Fault> {
    let Surface { outgoing, geometric_normal, .. } = *surface;
    let has_corners = material.flags & HAS_ATTRIBUTES != 0;
    let corners = if has_corners { Corners::read(scene, memory, id, weights)? } else { None };
    let mut texel = Texel::WHITE;
    if let Some(corners) = &corners {
        let [base, metallic_roughness, emissive] = material.textures;
        // Such a material has one layer: its choice needs no random number.
        let is_gathered = detail == Detail::Gathering && is_of_base(scene, memory, material)?;
        let choice = is_gathered.then(|| [random(1), random(2)]);
        let [texture, colour] = [corners.texture_by(scene, memory, base, choice)?, corners.colour()];
        texel.colour = rgb(texture) * rgb(colour);
        if material.flags & BLENDS != 0 {
            surface.coverage = covered(material, texture[3] * colour[3]);
        }
        [_, texel.roughness, texel.metallic, _] =
            corners.texture_by(scene, memory, metallic_roughness, choice)?;
        if max_component(surface.emission) > 0.0 {
            surface.emission *= rgb(corners.texture(scene, memory, emissive)?);
            surface.emitter = corners.emitter();
        }
        let front = if is_front { geometric_normal } else { -geometric_normal };
        // The smooth normals of a box's corners would tilt the faces of a pane.
        if material.flags & PANE == 0
            && !(is_gathered && material.flags & NARROW_LOBE == 0)
            && let Some(normal) = base_normal(scene, memory, material, (corners, choice), front)?
        {
            surface.normal = if is_front { normal } else { -normal };
        }
    }
    let normals = [turned(surface.normal, outgoing, geometric_normal), geometric_normal];
    let view = View { outgoing, normals, is_front };
    if has_layers(material) {
        return take_layer(scene, memory, surface, (corners.as_ref(), material), (&texel, &view), random);
    }
    let Scattering { reflection, specular, absorption } = scattering(material, &texel, &view);
    (surface.reflection, surface.specular, surface.absorption) = (reflection, specular, absorption);
    shade_by_parts(surface, &view, random(0));
    Ok(())
}

/// Makes a surface white and Lambertian, with the normal of its corners or its normal map.
#[cold]
#[inline(never)]
fn finish_white(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    surface: &mut Surface,
    (id, weights, is_front): (TriangleId, [f32; 3], bool),
    material: &Material,
) -> Result<(), Fault> {
    surface.reflection = Reflection::lambertian(Vec3::ONE);
    surface.light_group = 0;
    let has_normals = material.flags & HAS_ATTRIBUTES != 0 && material.flags & PANE == 0;
    let corners = if has_normals { Corners::read(scene, memory, id, weights)? } else { None };
    let side = if is_front { 1.0 } else { -1.0 };
    let front = surface.geometric_normal * side;
    if let Some(corners) = &corners
        && let Some(normal) = base_normal(scene, memory, material, (corners, None), front)?
    {
        surface.normal = normal * side;
    }
    Ok(())
}

/// Minimum probability of each of the two choices of [`shade_by_parts`]: the Lambertian part and the narrow
/// lobe.
const MIN_PART: f32 = 1.0 / 8.0;

/// Sets the shading normal that the surface's reflection needs. The Lambertian part needs the normal of the
/// corners or of the normal map; a lobe or a mirror needs the [`bent`] normal. A wide lobe and the Lambertian
/// part share a normal in between ([`bent_by_share`]). If a narrow lobe and the Lambertian part need
/// different normals, the random number `random`, in [0, 1), chooses one of the two. Its reflection is
/// divided by the probability of the choice.
#[inline(never)]
fn shade_by_parts(surface: &mut Surface, view: &View, random: f32) {
    let Surface { normal, geometric_normal, outgoing, reflection, .. } = *surface;
    if normal == geometric_normal || (reflection.is_lambertian() && surface.specular.is_none()) {
        return;
    }
    let [turned, _] = view.normals;
    let share = reflection.glossy_share();
    if !(reflection.has_narrow_lobe() && share > 0.0 && share < 1.0) {
        surface.normal = bent_by_share(turned, share, outgoing, geometric_normal);
        return;
    }
    let bent = bent(turned, outgoing, geometric_normal);
    // The decision does not compare `bent` with `normal`, because the result would depend on rounding: a
    // stored hit that is read again must lead to the same decision.
    if bent == turned && !points_away(normal, outgoing) {
        return;
    }
    let diffuse_share = min(max(1.0 - share, MIN_PART), 1.0 - MIN_PART);
    let (part, normal, probability) = if random < diffuse_share {
        (reflection.without_narrow_lobe(), normal, diffuse_share)
    } else {
        (reflection.narrow_lobe_beside_base(), bent, 1.0 - diffuse_share)
    };
    surface.normal = normal;
    surface.reflection = part.dimmed(Vec3::splat(1.0 / probability));
    surface.probability *= probability;
}

/// Chooses one layer of a surface's material at random and sets the surface's scattering to that of the
/// layer. If the far side is chosen (`Layer::Behind`), the emission becomes zero; otherwise it is divided by
/// the probability that the far side is not chosen.
#[inline(never)]
fn take_layer(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    surface: &mut Surface,
    (corners, material): (Option<&Corners>, &Material),
    (texel, view): (&Texel, &View),
    random: &dyn Fn(u32) -> f32,
) -> Result<(), Fault> {
    let layers = read_layers(scene, memory, material)?;
    let layer_texel = layer_texel(scene, memory, corners, &layers)?;
    let coat_normal = match corners {
        Some(corners) => {
            let map = (layers.texture(LayerTexture::CoatNormal), layers.coat_normal_scale);
            let sign = if view.is_front { 1.0 } else { -1.0 };
            let normal = mapped_normal(scene, memory, map, (corners, None), surface.geometric_normal * sign)?;
            normal.map(|normal| normal * sign)
        }
        None => None,
    };
    let Surface { geometric_normal, outgoing, .. } = *surface;
    let coat_normal = turned(coat_normal.unwrap_or(geometric_normal), outgoing, geometric_normal);
    let taken = take((material, &layers), (texel, &layer_texel), view, coat_normal, random);
    let Scattering { reflection, specular, absorption } = taken.scattering;
    (surface.reflection, surface.specular, surface.absorption) = (reflection, specular, absorption);
    surface.probability = taken.probability;
    if taken.layer == Layer::Behind {
        (surface.normal, surface.emission) = (taken.normal, Vec3::ZERO);
        surface.see_through();
        return Ok(());
    }
    surface.emission /= taken.of_front;
    if taken.layer != Layer::Base {
        surface.normal = taken.normal;
    }
    let view = View { normals: [taken.normal, geometric_normal], ..*view };
    // Choice 0 is stratified, and unused where the material has one layer here.
    let choice = if taken.probability < 1.0 { SURFACE_CHOICES - 1 } else { 0 };
    shade_by_parts(surface, &view, random(choice));
    Ok(())
}

fn rgb([red, green, blue, _]: [f32; 4]) -> Vec3 {
    Vec3::new(red, green, blue)
}
