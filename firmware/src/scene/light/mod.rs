//! Lights, for shadow rays: which one, from where on it, and how likely.
//!
//! Emissive triangles, points and spots are leaves of the light tree (module `tree`); distant lights and the environment are everywhere
//! equally far, and chosen apart: the header tells the three shares. One point of the unit square chooses all of it: each choice
//! uses up a part of a coordinate, and what is left is spread over [0, 1) again ([`Fraction`]). So neighbouring points
//! are near each other on one light, and a stratified pattern stratifies the lights.
//!
//! What samples a light and what tells the density of such a sample to rays that meet the light by themselves agree to the bit but
//! for the rounding of the ray's own way.

mod choice;
mod distant;
mod emitter;
mod environment;
mod sample;
mod tree;

pub use choice::Fraction;
pub use emitter::{EmitterPoint, emitter_density, emitter_point, falloff, read_emitter};
pub use environment::{
    environment_coordinates, environment_density, environment_direction, environment_radiance,
};
pub use sample::{LightSample, Receiver};
pub use tree::{Selection, select_emitter, selection_probability};

use photoncard_shared::image::Lights;
use photoncard_shared::message::Fault;

use super::SceneImage;
use crate::memory::MemoryPort;

/// The light that belongs to a point of the unit square, as a place receives it; `None` if nothing comes from there. `dither` is 32
/// random bits that belong to the point.
///
/// # Errors
/// If the image is not sound.
pub fn sample_light(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    receiver: &Receiver,
    [u, v]: [f32; 2],
    dither: u32,
) -> Result<Option<LightSample>, Fault> {
    let Lights { emitters, environment, distant, .. } = scene.header.lights;
    let across = Fraction::new(u, dither);
    if across.value() < emitters {
        let across = across.within(0.0, emitters);
        return emitter::sample(scene, memory, receiver, emitters, [across, Fraction::new(v, !dither)]);
    }
    let beyond_emitters = emitters + environment;
    if across.value() < beyond_emitters {
        let across = across.within(emitters, environment);
        return environment::sample(scene, memory, environment, [across, Fraction::new(v, !dither)])
            .map(Some);
    }
    if distant > 0.0 {
        let across = across.within(beyond_emitters, distant);
        return distant::sample(scene, memory, distant, across).map(Some);
    }
    Ok(None)
}
