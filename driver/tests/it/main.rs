//! The host's library as a whole: cards, sessions and renders.

mod choices;
#[cfg(unix)]
mod links;
#[cfg(unix)]
mod lost_cards;
mod panics;
mod renderer;
mod scene_lights;
mod scene_offset;
mod scripted_card;
mod simulation;
mod standstill;
mod studies;
#[path = "../../scene/tests/it/support.rs"]
mod support;
mod turns;
mod versions;
