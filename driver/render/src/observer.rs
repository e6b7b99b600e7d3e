//! Observer of a render or of a card's self-test. It can stop the work.

use std::error::Error;
use std::time::Duration;

use photoncard_picture::sink::TileSink;
use photoncard_shared::message::Tile;
use serde_json::Value;

use super::error::CardError;

/// Phase of a render, or of a card's self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Pilot renders, from which settings are chosen. There is no progress.
    Pilot,
    /// Photon tracing. Progress counts photons.
    Photons,
    /// Construction of the photon map and the card image. There is no progress.
    Pack,
    /// Loading of the card image into the cards. Progress counts bytes.
    Load,
    /// Rendering. Progress counts tiles.
    Tiles,
    /// Test of the memory of a card, in a self-test. Progress counts bytes written or read.
    SelfTest,
}

/// Observer of a render or of a card's self-test, which can stop the work. Its methods are called from the
/// threads that do the work.
pub trait Observer: Sync {
    /// Reports the progress of a phase: `done` of `total`.
    fn progress(&self, phase: Phase, done: u64, total: u64);

    /// Returns whether the work should stop as soon as possible.
    fn is_stopped(&self) -> bool;

    /// Reports that `done` of `total` tiles were taken over from an earlier render.
    fn resumed(&self, _done: usize, _total: usize) {}

    /// Reports that the partial file has finished tiles, from which a later render can resume if this one
    /// ends early.
    fn kept(&self) {}

    /// Reports that a card was lost or given up. The other cards render its tiles.
    fn lost(&self, _card: &str, _error: &CardError) {}

    /// Reports that a card was lost and no other is left. The render waits for it to come back, for at most
    /// `_longest`.
    fn waits_for(&self, _card: &str, _error: &CardError, _longest: Duration) {}

    /// Reports that a card rendered a tile, before sinks receive the tile. `_dram_lines` is the number of
    /// lines read from DRAM, if the memory is [modelled](super::RenderSettings::modelled_caches).
    fn rendered(&self, _card: &str, _tile: &Tile, _dram_lines: Option<u64>) {}

    /// Returns a sink of the observer for finished tiles, if it has one.
    fn tiles(&self) -> Option<&dyn TileSink> {
        None
    }

    /// Reports [statistics](super::Statistics) of the work so far, as JSON. It is called when a render ends
    /// with an error after its cards have begun.
    fn failed(&self, _statistics: Value) {}

    /// Reports that a viewer cannot show the picture, or can no longer. The render continues.
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
