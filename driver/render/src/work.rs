//! Work of the cards on a picture, and its outcome.

use std::sync::{Arc, Mutex};

use photoncard_cards::scheduler::TileCounts;
use photoncard_cards::session::LinkBytes;
use photoncard_map::pack::CardImage;
use photoncard_picture::film::Film;
use photoncard_picture::sink::TileSink;
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{FrameParameters, Tile};

use super::outputs::Outputs;
use super::{RenderError, RenderSettings};
use crate::emulator::memory_model::MemoryTraffic;

/// Function that checks whether a chip with a budget can render a picture.
pub(super) type BudgetCheck<'a> = &'a dyn Fn(&Budget) -> Result<(), RenderError>;

/// Function that applies a check to all chips.
pub(super) type FitChips<'a> = dyn FnMut(BudgetCheck) -> Result<(), RenderError> + 'a;

/// Work that cards get.
pub(super) struct Work<'a> {
    pub(super) settings: &'a RenderSettings,
    pub(super) image: &'a Arc<CardImage>,
    /// True if the image is from an earlier picture or a prepared scene.
    pub(super) is_image_kept: bool,
    pub(super) frame: &'a FrameParameters,
    /// All tiles of the picture.
    pub(super) tiles: Vec<Tile>,
    /// Film of the picture, which is one of the sinks. It contains the tiles of the resumed render.
    pub(super) film: &'a Mutex<Film>,
    /// Destinations of finished tiles.
    pub(super) sinks: Vec<&'a dyn TileSink>,
    /// Outputs that are polled during the work.
    pub(super) outputs: &'a Outputs<'a>,
}

/// Outcome of the work of cards.
#[derive(Default)]
pub(super) struct Outcome {
    /// Counters of the work.
    pub(super) counters: Counters,
    /// Bytes transferred over the link of each card.
    pub(super) links: Vec<LinkBytes>,
    /// Memory traffic; `None` if memory is not modelled.
    pub(super) traffic: Option<MemoryTraffic>,
    pub(super) cards: usize,
    /// Number of cards that were given up, left out because of their budget, or never answered the greeting.
    pub(super) cards_given_up: usize,
    /// Numbers of tiles that were rendered more than once or taken over.
    pub(super) tiles: TileCounts,
    /// Names of cards that rendered dazzling tiles which no other card verified, with the number of such
    /// tiles. Kept tiles count for [`EARLIER_RENDER`](crate::statistics::EARLIER_RENDER).
    pub(super) dazzling: Vec<(String, usize)>,
    /// Error that ended the work. The other fields describe the work until then.
    pub(super) failure: Option<RenderError>,
    /// Time until the last card was loaded, seconds.
    pub(super) load_seconds: f64,
    /// Time after the last card was loaded, seconds.
    pub(super) render_seconds: f64,
}
