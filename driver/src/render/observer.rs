//! What watches a render, and can stop it.

use std::error::Error;

use super::error::CardError;

/// What a render is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Tracing photons: progress in photons.
    Photons,
    /// Building the photon map and the card image: no progress.
    Pack,
    /// Loading the image into the cards: progress in bytes.
    Load,
    /// Rendering: progress in tiles.
    Tiles,
}

/// Watches a render, and can stop it.
pub trait Observer: Sync {
    /// Tells how far a phase is.
    fn progress(&self, phase: Phase, done: u64, total: u64);

    /// Whether the render is to stop as soon as it can.
    fn is_stopped(&self) -> bool;

    /// Tells that so many of all tiles were rendered before.
    fn resumed(&self, _done: usize, _total: usize) {}

    /// Tells that finished tiles are kept, so that a render that ends early can be gone on with.
    fn kept(&self) {}

    /// Tells that a card was lost, or is used no more; the others go on with its tiles.
    fn lost(&self, _card: &str, _error: &CardError) {}

    /// Tells that a viewer does not show the picture, or no more; the render goes on.
    fn not_shown(&self, _error: &dyn Error) {}
}

/// Watches nothing and never stops.
pub struct Unobserved;

impl Observer for Unobserved {
    fn progress(&self, _: Phase, _: u64, _: u64) {}

    fn is_stopped(&self) -> bool {
        false
    }
}
