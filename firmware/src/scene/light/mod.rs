//! Light sampling for shadow rays: choice of a light and of a point on it, and the probability density.
//!
//! There are three kinds of lights: emitters (emissive triangles, point lights and spot lights), which are
//! leaves of the light tree (module `tree`); distant lights; and the environment. The card image's header
//! holds the probability of each kind. One point of the unit square makes all choices: each choice rescales a
//! coordinate within the chosen interval to [0, 1) for the next choice ([`Fraction`]). Neighbouring points of
//! the square therefore map to neighbouring points of one light, and stratified points give stratified
//! choices.
//!
//! Sampling and evaluation of the density use the same floating-point operations. The density of a gather ray
//! that hits a light therefore differs from that of a shadow ray only by the rounding of the hit point.

mod choice;
mod distant;
mod emitter;
mod environment;
mod sample;
mod tree;

pub use choice::Fraction;
pub use distant::disk_direction;
pub use emitter::{
    EmitterPoint, ProfileFrame, emitter_density, emitter_point, falloff, profile_intensity, read_emitter,
};
pub use environment::{
    environment_coordinates, environment_density, environment_direction, environment_radiance,
};
pub use sample::{LightSample, Receiver};
pub use tree::{LightChoices, Selection, select_emitter, selection_probability};

use photoncard_shared::image::Lights;
use photoncard_shared::message::Fault;

use super::SceneImage;
use crate::memory::MemoryPort;

/// Samples the light that arrives at the receiver of `choices`, by the point `(u, v)` of the unit square and
/// the 32 random bits `dither`. Returns `None` if the chosen light does not shine on the receiver, or the
/// scene has no light. Occlusion is not tested.
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
        return distant::sample(scene, memory, distant, [across, Fraction::new(v, !dither)]).map(Some);
    }
    Ok(None)
}
