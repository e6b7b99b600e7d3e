//! Eye rays, and the eye paths that follow them through perfectly specular surfaces. An irradiance frame has
//! no such surfaces, and sensors have no rays.

use glam::Vec3;
use photoncard_shared::layout::TriangleId;
use photoncard_shared::message::{Fault, Projection};

use super::pixel_filter::place;
use super::specular_path::{Carried, Passes, PathEnd, SpecularPath, surface_choice};
use super::{Context, PixelSample};
use crate::memory::{MemoryPort, Stage};
use crate::sampler::Dimension;
use crate::scene::camera::{self, CameraSample};
use crate::scene::light::environment_radiance;
use crate::scene::{Detail, Seen, Surface, closest_hit, read_surface_with};
use crate::vector::point_on_disc;

/// Point of the picture and of the lens from which a path starts. The paths of a pixel are stratified over
/// the pixel filter, which can extend beyond the pixel and the picture, and over the lens.
pub fn camera_sample<M>(context: &Context<M>, pixel: PixelSample) -> CameraSample {
    let PixelSample { x, y, .. } = pixel;
    let frame = context.frame;
    let point = |dimension| {
        let (pattern, index) = pixel.stratified(frame, dimension);
        pattern.point(index)
    };
    let [jitter_x, jitter_y] = point(Dimension::Pixel);
    let film = [x as f32 + place(frame.filter, jitter_x), y as f32 + place(frame.filter, jitter_y)];
    match frame.camera.projection {
        Projection::ThinLens { .. } => CameraSample { film, lens: point_on_disc(point(Dimension::Lens)) },
        _ => CameraSample::of_film(film),
    }
}

/// Surface at which an eye path ends.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The surface, with reflection and emission multiplied by the throughput of the eye path.
    pub surface: Surface,
    /// Hit of the eye ray, from which the surface can be read again; `None` behind perfectly specular
    /// surfaces, on an instance, and if a random choice between layers was made.
    pub seen: Option<Seen>,
    /// True if no perfectly specular surface lies between the eye and the surface.
    pub is_first: bool,
    /// Point of the picture and of the lens from which the path starts ([`camera_sample`]).
    pub sample: CameraSample,
    /// [Depth](camera::depth) of the eye ray's hit, metres.
    pub depth: f32,
    /// First surface that the eye ray hits.
    pub first: FirstHit,
}

/// First surface that an eye ray hits, whatever its material.
#[derive(Clone, Copy, Debug)]
pub struct FirstHit {
    /// The triangle.
    pub id: TriangleId,
    /// Position of the hit, metres.
    pub position: Vec3,
}

/// End of an eye path.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "a chip has no heap, and one sight at a time")]
pub enum Sight {
    /// A surface.
    Surface(View),
    /// The environment.
    Background {
        /// Radiance, W/(sr m^2), times the throughput of the eye path. It is zero without an environment, for
        /// a path that contributes nothing, and in a transparent frame if the eye ray itself leaves the
        /// scene.
        radiance: Vec3,
        /// [Depth](camera::depth) of the eye ray's hit, metres, and the hit; `None` if the ray itself leaves
        /// the scene.
        hit: Option<(f32, FirstHit)>,
    },
}

impl Sight {
    /// Returns the surface; `None` for the environment.
    pub fn surface(self) -> Option<View> {
        match self {
            Self::Surface(view) => Some(view),
            Self::Background { .. } => None,
        }
    }
}

/// Traces an eye path: the eye ray, and its continuation at perfectly specular surfaces.
///
/// # Errors
/// If the card image is invalid.
pub fn view<M: MemoryPort>(context: &mut Context<M>, pixel: PixelSample) -> Result<Sight, Fault> {
    context.memory.enter(Stage::Eye);
    let sample = camera_sample(context, pixel);
    if !camera::has_rays(&context.frame.camera) {
        return on_sensor(context, pixel, sample);
    }
    context.counters.eye_rays += 1;
    let ray = camera::ray(context.frame, &sample);
    let (pattern, index) = pixel.stratified(context.frame, Dimension::Specular);
    // The first two random choices of a path are stratified over all paths of a pixel.
    let first = || pattern.point(index);
    let first_layer = surface_choice(0, 0);
    let random = |choice| match choice {
        0 => first()[0],
        _ if choice == first_layer => first()[1],
        _ => pattern.choice(index, choice),
    };
    let mut path = SpecularPath::new(ray, Carried::Radiance, Passes::Specular);
    let Some(mut hit) = closest_hit(context.scene, context.memory, &ray)? else {
        return background(context, &path, None);
    };
    let of_surface = |choice| random(surface_choice(0, choice));
    let mut surface = Surface::NOWHERE;
    let detail = Detail::seen_in(context.frame);
    read_surface_with(context.scene, context.memory, &ray, &hit, detail, &of_surface, &mut surface)?;
    let first_hit = FirstHit { id: hit.id, position: surface.position };
    let is_first = surface.specular.is_none();
    // Only the eye path can repeat a random choice between layers.
    let is_stored = is_first && surface.probability >= 1.0;
    let per_distance = camera::depth_per_distance(&context.frame.camera, ray.direction);
    if !is_first {
        let end = path.follow(context, &mut surface, &mut hit, &random)?;
        let hit = Some((path.first_distance * per_distance, first_hit));
        match end {
            PathEnd::Surface => {}
            PathEnd::Escaped => return background(context, &path, hit),
            PathEnd::Lost => return Ok(Sight::Background { radiance: Vec3::ZERO, hit }),
        }
    }
    Ok(Sight::Surface(View {
        depth: if is_first {
            camera::depth(&context.frame.camera, surface.position)
        } else {
            path.first_distance * per_distance
        },
        surface: surface.dimmed(path.throughput),
        seen: if is_stored { Seen::new(&hit) } else { None },
        is_first,
        sample,
        first: first_hit,
    }))
}

/// Sight of a pixel's sensor.
#[cold]
#[inline(never)]
fn on_sensor<M: MemoryPort>(
    context: &mut Context<M>,
    PixelSample { x, y, .. }: PixelSample,
    sample: CameraSample,
) -> Result<Sight, Fault> {
    let nothing = Sight::Background { radiance: Vec3::ZERO, hit: None };
    let sensor = camera::sensor(context.frame, context.scene, context.memory, [x, y])?;
    Ok(sensor.map_or(nothing, |surface| {
        let first = FirstHit { id: TriangleId::lone(0), position: surface.position };
        Sight::Surface(View { surface, seen: None, is_first: true, sample, depth: 0.0, first })
    }))
}

/// Sight of the environment at the end of a path that has left the scene.
fn background<M: MemoryPort>(
    context: &mut Context<M>,
    path: &SpecularPath,
    hit: Option<(f32, FirstHit)>,
) -> Result<Sight, Fault> {
    if hit.is_none() && (context.frame.transparent || context.frame.irradiance) {
        return Ok(Sight::Background { radiance: Vec3::ZERO, hit });
    }
    let radiance = environment_radiance(context.scene, context.memory, path.ray.direction)?;
    Ok(Sight::Background { radiance: radiance * path.throughput, hit })
}

/// Reads the surface at a stored hit of the eye ray of `sample` into `surface`.
///
/// # Errors
/// If the card image is invalid.
#[inline(always)]
pub fn surface<M: MemoryPort>(
    context: &mut Context<M>,
    sample: &CameraSample,
    seen: &Seen,
    surface: &mut Surface,
) -> Result<(), Fault> {
    let ray = camera::ray(context.frame, sample);
    seen.surface(context.scene, context.memory, (&ray, Detail::seen_in(context.frame)), surface)
}

/// Finds the surface that the eye ray through position `film` of the picture, and the centre of the lens,
/// hits first.
///
/// # Errors
/// If the card image is invalid.
pub fn see<M: MemoryPort>(context: &mut Context<M>, film: [f32; 2]) -> Result<Option<Surface>, Fault> {
    context.memory.enter(Stage::Eye);
    context.counters.eye_rays += 1;
    let ray = camera::ray(context.frame, &CameraSample::of_film(film));
    let Some(hit) = closest_hit(context.scene, context.memory, &ray)? else { return Ok(None) };
    let mut found = Surface::NOWHERE;
    let detail = Detail::seen_in(context.frame);
    // Read as a stored hit is, whose rounding differs.
    match Seen::new(&hit) {
        Some(seen) => seen.surface(context.scene, context.memory, (&ray, detail), &mut found)?,
        None => read_surface_with(context.scene, context.memory, &ray, &hit, detail, &|_| 0.0, &mut found)?,
    }
    Ok(Some(found))
}
