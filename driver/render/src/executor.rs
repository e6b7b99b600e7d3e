//! Trait of executors, which render the tiles of a picture.

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
use super::{Observer, RenderError, RenderSettings};
use crate::emulator::memory_model::MemoryTraffic;

/// Check that a chip with a budget can render a picture.
pub(super) type BudgetCheck<'a> = &'a dyn Fn(&Budget) -> Result<(), RenderError>;

/// Application of a check to all chips.
pub(super) type FitChips<'a> = dyn FnMut(BudgetCheck) -> Result<(), RenderError> + 'a;

/// Executor of a picture's tiles.
pub(super) trait Executor {
    /// Budget of each chip.
    fn budgets(&self) -> Vec<Budget>;

    /// Leaves out chips whose budgets fail the check, as long as `needed` others are left, and names them to
    /// the observer.
    ///
    /// # Errors
    /// The failure of a chip, if too few are left.
    fn leave_out(
        &mut self,
        check: BudgetCheck,
        needed: usize,
        observer: &dyn Observer,
    ) -> Result<(), RenderError>;

    /// Returns whether tiles are finished one after another, so that a render that ends early has finished
    /// tiles.
    fn finishes_tiles_early(&self) -> bool;

    /// Renders the tiles into the sinks.
    ///
    /// # Errors
    /// If the tiles cannot be rendered, or the observer stops the render; as [`Outcome::failure`] if the
    /// outcome until then is known.
    fn run(&mut self, work: Work) -> Result<Outcome, RenderError>;
}

/// Work of an executor.
pub(super) struct Work<'a> {
    /// The settings of the render.
    pub(super) settings: &'a RenderSettings,
    /// The card image.
    pub(super) image: &'a Arc<CardImage>,
    /// If the image is that of an earlier picture, or of a prepared scene.
    pub(super) is_image_kept: bool,
    /// The frame's parameters.
    pub(super) frame: &'a FrameParameters,
    /// All tiles of the picture.
    pub(super) tiles: Vec<Tile>,
    /// The picture, with the tiles of the render that is resumed; one of the sinks.
    pub(super) film: &'a Mutex<Film>,
    /// Destinations of finished tiles.
    pub(super) sinks: Vec<&'a dyn TileSink>,
    /// Outputs that are polled during the work.
    pub(super) outputs: &'a Outputs<'a>,
}

/// Outcome of an executor's work.
#[derive(Default)]
pub(super) struct Outcome {
    /// Counts of the work.
    pub(super) counters: Counters,
    /// Bytes over the link of each card.
    pub(super) links: Vec<LinkBytes>,
    /// Memory traffic; `None` if memory is not modelled.
    pub(super) traffic: Option<MemoryTraffic>,
    /// Number of cards.
    pub(super) cards: usize,
    /// Number of cards that were given up, left out for their budget, or have never answered the greeting.
    pub(super) cards_given_up: usize,
    /// Numbers of tiles that were rendered more than once or taken over.
    pub(super) tiles: TileCounts,
    /// Names of cards that alone have rendered dazzling tiles, which no other has verified, with their
    /// number. Tiles that were kept count for `an earlier render`.
    pub(super) dazzling: Vec<(String, usize)>,
    /// Error that has ended the work; the rest is what was done until then.
    pub(super) failure: Option<RenderError>,
    /// Time until the last card was loaded, seconds.
    pub(super) load_seconds: f64,
    /// Time after the last card was loaded, seconds.
    pub(super) render_seconds: f64,
}
