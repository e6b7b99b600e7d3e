//! A render, from a loaded scene to a complete film.
//!
//! A [`Renderer`] determines settings, film, outputs, card image and frame parameters in this order. Cards at
//! the other ends of links then render the tiles of the film. [`render`] uses a new renderer for a single
//! picture.
#![forbid(unsafe_code)]

mod address;
pub mod bake;
mod card_thread;
mod cards;
mod chip;
pub mod cost_model;
mod crew;
pub mod display;
pub mod emulator;
mod error;
mod greeting;
mod hands;
pub mod measure;
mod memory;
mod noise;
mod observer;
mod open_card;
mod outputs;
pub mod partial;
pub mod parts;
mod passes;
mod prepared;
mod provenance;
pub mod quality;
#[cfg(not(target_family = "wasm"))]
pub mod relay;
mod renderer;
mod self_test;
mod settings;
mod statistics;
mod work;

pub use address::CardAddress;
pub use chip::{ChipFileError, ChipModel};
pub use error::{CardError, RenderError};
pub use greeting::{CardInfo, card_info, card_ping};
pub use hands::{ChipWorkers, completed, turn};
pub use memory::{MemoryStatistics, ReadStatistics, StageReads, StructureReads};
pub use observer::{Observer, Phase, Unobserved};
pub use passes::{Aim, Ending, Passes};
pub use photoncard_cards::session::BoardInfo;
pub use photoncard_shared::budget::{Budget, MAX_BINS, MAX_DRAM_BYTES};
pub use photoncard_shared::message::{Filter, Radiance, Sampling};
pub use photoncard_shared::message::{MemoryPattern, MemoryUse, WrongWord, WrongWords};
pub use prepared::{PreparedError, PreparedScene};
pub use provenance::Provenance;
pub use renderer::{Chosen, Renderer, Rendering};
pub use self_test::{
    ArithmeticTest, PatternTest, SelfTest, WrongResult, WrongResults, card_self_test, self_test_on,
};
pub use settings::{
    CardSet, Changes, DEFAULT_CAUSTIC_PHOTONS, Integrator, MIN_IRRADIANCE_ERROR, NamedSettings, PROGRAM,
    PhotonMaps, Picture, RenderSettings, Schedule, Setting, TileOutputs,
};
pub use statistics::{EARLIER_RENDER, LinkStatistics, Rays, Statistics};
pub use work::Times;

use photoncard_map::pack::PackedScene;
use photoncard_scene::Scene;

/// Renders a scene. A [`Renderer`] renders further pictures on the same cards.
///
/// A serial port may stay open for about a second after the function returns, because a detached thread may
/// still try to reopen the port.
///
/// # Errors
/// If settings or scene do not fit the cards, a card fails, or the observer stops the render.
pub fn render(
    scene: &Scene,
    settings: &RenderSettings,
    observer: &dyn Observer,
) -> Result<Rendering, RenderError> {
    Renderer::default().render(scene, settings, observer)
}

/// Renders a scene as [`render`] does, but with photons and integrator chosen by `choose` for the packed
/// scene. `choose` is called after the cards have answered. `settings` determine everything else.
///
/// # Errors
/// As [`render`], and the errors of `choose`.
pub fn render_chosen(
    scene: &Scene,
    settings: &RenderSettings,
    choose: &dyn Fn(&PackedScene) -> Chosen,
    observer: &dyn Observer,
) -> Result<Rendering, RenderError> {
    Renderer::default().render_chosen(scene, settings, choose, observer)
}
