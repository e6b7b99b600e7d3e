//! Observer of a render or of a card's self-test, which can stop it.

use std::error::Error;

use photoncard_picture::sink::TileSink;
use photoncard_shared::message::Tile;
use serde_json::Value;

use super::error::CardError;

/// Phase of a render, or of a card's self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Pilot renders, by which settings are chosen: without progress.
    Pilot,
    /// Tracing photons: progress in photons.
    Photons,
    /// Building the photon map and the card image: without progress.
    Pack,
    /// Loading the image into the cards: progress in bytes.
    Load,
    /// Rendering: progress in tiles.
    Tiles,
    /// Testing a card's memory, which is no phase of a render: progress in bytes, written or read.
    SelfTest,
}

/// Observer of a render or of a card's self-test, which can stop it. Its methods are called from the threads
/// of the work.
pub trait Observer: Sync {
    /// Reports the progress of a phase: `done` of `total`.
    fn progress(&self, phase: Phase, done: u64, total: u64);

    /// Returns whether the work should stop as soon as possible.
    fn is_stopped(&self) -> bool;

    /// Reports that `done` of `total` tiles are taken over from an earlier render.
    fn resumed(&self, _done: usize, _total: usize) {}

    /// Reports that finished tiles are in the partial file, so that a render that ends early can be resumed.
    fn kept(&self) {}

    /// Reports that a card was lost or given up; the others render its tiles.
    fn lost(&self, _card: &str, _error: &CardError) {}

    /// Reports that a card has rendered a tile, before the sinks have it; with the lines that it has read
    /// from DRAM, if its memory is [modelled](super::RenderSettings::modelled_caches).
    fn rendered(&self, _card: &str, _tile: &Tile, _dram_lines: Option<u64>) {}

    /// Sink of the observer's own for finished tiles.
    fn tiles(&self) -> Option<&dyn TileSink> {
        None
    }

    /// Reports the [statistics](super::Statistics) of a render that ends with an error after its cards have
    /// begun, up to then, as JSON.
    fn failed(&self, _statistics: Value) {}

    /// Tells that a viewer does not show the picture, or no more; the render goes on.
    fn not_shown(&self, _error: &dyn Error) {}
}

/// Observer that ignores all reports and never stops the work.
pub struct Unobserved;

impl Observer for Unobserved {
    fn progress(&self, _: Phase, _: u64, _: u64) {}

    fn is_stopped(&self) -> bool {
        false
    }
}
