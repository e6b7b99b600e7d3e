//! Eye rays: what a sample of a pixel sees.

use glam::Vec3;
use photoncard_shared::message::Fault;

use super::{Context, PixelSample};
use crate::memory::MemoryPort;
use crate::sampler::{Dimension, Pattern};
use crate::scene::{Ray, Surface, closest_hit, read_surface};
use crate::vector::unit;

/// The surface that a sample sees. The samples of a pixel are stratified over its square (a box filter).
///
/// # Errors
/// If the image is not sound.
pub fn see<M: MemoryPort>(context: &mut Context<M>, pixel: PixelSample) -> Result<Option<Surface>, Fault> {
    let ray = eye_ray(context, pixel);
    context.counters.eye_rays += 1;
    match closest_hit(context.scene, context.memory, &ray)? {
        Some(hit) => read_surface(context.scene, context.memory, &ray, &hit).map(Some),
        None => Ok(None),
    }
}

fn eye_ray<M>(context: &Context<M>, PixelSample { x, y, sample }: PixelSample) -> Ray {
    let frame = context.frame;
    let [jitter_x, jitter_y] =
        Pattern::new(frame.seed, x, y, 0, Dimension::Pixel).point(sample, frame.samples);
    let u = (x as f32 + jitter_x) / frame.width as f32;
    let v = (y as f32 + jitter_y) / frame.height as f32;
    let camera = &frame.camera;
    let [forward, right, up] = [camera.forward, camera.right, camera.up].map(Vec3::from_array);
    let direction = forward + right * (2.0 * u - 1.0) + up * (1.0 - 2.0 * v);
    Ray::new(camera.origin.into(), unit(direction))
}

/// Distance of a surface along the view's axis, metres.
pub fn depth<M>(context: &Context<M>, surface: &Surface) -> f32 {
    let camera = &context.frame.camera;
    (surface.position - Vec3::from_array(camera.origin)).dot(camera.forward.into())
}
