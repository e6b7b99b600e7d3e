//! Light sampling for shadow rays: choice of a light and of a point on it, with the probability density.
//!
//! Emissive triangles, point lights and spot lights are leaves of the light tree (module `tree`). Distant
//! lights and the environment are infinitely far and not in the tree; the header of the card image has the
//! probabilities of the three kinds. One point of the unit square makes all choices: each choice uses a part
//! of a coordinate and rescales the remainder ([`Fraction`]). Neighbouring points therefore map to
//! neighbouring points of one light, and a stratified pattern stratifies the lights.
//!
//! Sampling and density use equal operations. The weights of a shadow ray and of a gather ray that hits the
//! light therefore differ only by the rounding of the gather ray's hit.

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
pub use tree::{LightChoices, Selection, select_emitter, selection_probability};

use photoncard_shared::image::Lights;
use photoncard_shared::message::Fault;

use super::SceneImage;
use crate::memory::MemoryPort;

/// Samples a light for the receiver of `choices` by a point `(u, v)` of the unit square and 32 random bits;
/// `None` if the chosen light does not reach the receiver, or there is no light.
///
/// # Errors
/// If the card image is invalid.
pub fn sample_light(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    choices: &mut LightChoices,
    [u, v]: [f32; 2],
    dither: u32,
) -> Result<Option<LightSample>, Fault> {
    let Lights { emitters, environment, distant, .. } = scene.header.lights;
    let across = Fraction::new(u, dither);
    if across.value() < emitters {
        let across = across.within(0.0, emitters);
        return emitter::sample(scene, memory, choices, emitters, [across, Fraction::new(v, !dither)]);
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
