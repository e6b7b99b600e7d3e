//! Cameras: the ray or the sensor of a point of the picture, and the depth of a surface.

use glam::Vec3;
use photoncard_shared::address::{LineAddress, Structure};
use photoncard_shared::layout::{Record, Sensor};
use photoncard_shared::message::{Camera, Fault, FaultCode, FrameParameters, Projection};

use super::{Ray, RayKind, SceneImage, Surface, read_slot};
use crate::memory::MemoryPort;
use crate::vector::{max, max_component, min, sqrt, unit};

/// Point of the picture and of the lens from which a ray starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSample {
    /// Position in the picture, pixels from the upper left corner.
    pub film: [f32; 2],
    /// Position on a thin lens: a point of the unit disc.
    pub lens: [f32; 2],
}

impl CameraSample {
    /// Sample at position `film` of the picture and the centre of the lens.
    pub const fn of_film(film: [f32; 2]) -> Self {
        Self { film, lens: [0.0; 2] }
    }
}

/// Ray of a frame's camera.
pub fn ray(frame: &FrameParameters, sample: &CameraSample) -> Ray {
    let [column, row] = sample.film;
    ray_at(&frame.camera, [column / frame.width as f32, row / frame.height as f32], sample.lens)
}

/// Ray of a camera at the point with the fractions `u` of the picture's width and `v` of its height, from the
/// upper left corner, and a point `lens` of the unit disc, which only a thin lens uses.
pub fn ray_at(camera: &Camera, [u, v]: [f32; 2], lens: [f32; 2]) -> Ray {
    let [shift_x, shift_y] = camera.shift;
    let [x, y] = [2.0 * u - 1.0 + shift_x, 1.0 - 2.0 * v + shift_y];
    let [origin, forward, right, up] =
        [camera.origin, camera.forward, camera.right, camera.up].map(Vec3::from_array);
    let plane = || forward + right * x + up * y;
    let ray = |origin, direction| Ray::new(RayKind::Eye, origin, direction);
    match camera.projection {
        Projection::Pinhole => ray(origin, unit(plane())),
        Projection::ThinLens { right, up, focus } => {
            let [across, along] = lens;
            let offset = Vec3::from_array(right) * across + Vec3::from_array(up) * along;
            ray(origin + offset, unit(plane() - offset * (1.0 / focus)))
        }
        Projection::Orthographic => ray(origin + right * x + up * y, unit(forward)),
        Projection::Panorama { angles: [longitude, latitude] } => {
            let (sin, cos) = libm::sincosf(longitude * x);
            let (height, radius) = libm::sincosf(latitude * y);
            ray(origin, unit((forward * cos + right * sin) * radius + up * height))
        }
        // Sensors have no rays.
        Projection::Sensors { .. } => ray(origin, forward),
    }
}

/// Returns false for sensors, which see without rays.
pub fn has_rays(camera: &Camera) -> bool {
    !matches!(camera.projection, Projection::Sensors { .. })
}

/// Maximum magnitude of a scene's coordinates, metres, that moves sensors off surfaces: by a millimetre
/// ([`offset_origin`](super::offset_origin)). In wider scenes, sensors on a surface must lie off it.
const MAX_REACH: f32 = 256.0;

/// Reads the sensor of pixel `(x, y)` as a white Lambertian surface that is seen along its normal; `None` for
/// a pixel without a sensor.
///
/// # Errors
/// If the sensor is outside the card's memory.
#[inline(never)]
pub fn sensor(
    frame: &FrameParameters,
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    [x, y]: [u32; 2],
) -> Result<Option<Surface>, Fault> {
    const PER_LINE: u32 = Sensor::PER_LINE as u32;
    const BYTES: u32 = Sensor::BYTES as u32;
    let Projection::Sensors { line, first, count } = frame.camera.projection else { return Ok(None) };
    let number = y.wrapping_mul(frame.width).wrapping_add(x);
    let Some(index) = number.checked_sub(first).filter(|&index| index < count) else { return Ok(None) };
    let slot = index % PER_LINE;
    let address = LineAddress(line.wrapping_add(index / PER_LINE));
    let used = slot * BYTES..(slot + 1) * BYTES;
    let bytes = read_slot::<{ Sensor::BYTES }>(memory, Structure::Attributes, address, slot as usize, used);
    let bytes = bytes.ok_or(Fault { code: FaultCode::Record, detail: index })??;
    let Sensor { position, normal } = Sensor::read(bytes);
    let position = Vec3::from_array(position);
    let magnitude = max(min(scene.header.reach, MAX_REACH), max_component(position.abs()));
    Ok(Some(Surface::white(position, normal.into(), magnitude)))
}

/// Depth of a position, metres: its distance from the camera along the camera's axis, or in a panorama its
/// distance from the camera.
pub fn depth(camera: &Camera, position: Vec3) -> f32 {
    let from_origin = position - Vec3::from_array(camera.origin);
    match camera.projection {
        Projection::Panorama { .. } => sqrt(from_origin.length_squared()),
        _ => from_origin.dot(camera.forward.into()),
    }
}

/// [`depth`] per distance along a ray of the camera with this direction.
pub fn depth_per_distance(camera: &Camera, direction: Vec3) -> f32 {
    match camera.projection {
        Projection::Panorama { .. } => 1.0,
        _ => direction.dot(camera.forward.into()),
    }
}

/// Height that a pixel covers at the depth of a position, metres.
pub fn pixel_side(frame: &FrameParameters, position: Vec3) -> f32 {
    let camera = &frame.camera;
    let up = || sqrt(Vec3::from_array(camera.up).length_squared());
    let half_height = match camera.projection {
        Projection::Pinhole | Projection::ThinLens { .. } => depth(camera, position) * up(),
        Projection::Orthographic => up(),
        Projection::Panorama { angles: [_, latitude] } => depth(camera, position) * latitude,
        Projection::Sensors { .. } => 0.0,
    };
    half_height * 2.0 / frame.height as f32
}
