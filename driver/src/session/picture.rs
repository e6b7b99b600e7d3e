//! What sessions work on together.

use std::sync::{Mutex, MutexGuard, PoisonError};

use photoncard_shared::message::Tile;

use crate::display::{Display, DisplayError};
use crate::film::{Film, FilmError, Window};
use crate::partial::{self, PartialError, PartialRender};
use crate::scheduler::Scheduler;

/// What sessions work on together. Each part has a lock of its own, which is held while that part is used: no card waits
/// for another's lines to be encoded, nor for a file.
pub struct Picture {
    scheduler: Scheduler,
    film: Mutex<Film>,
    partial: Option<PartialRender>,
    display: Option<Display>,
}

impl Picture {
    /// The tiles that are left, the film they go to, and where finished ones are kept, if they are.
    pub fn new(scheduler: Scheduler, film: Film, partial: Option<PartialRender>) -> Self {
        Self { scheduler, film: Mutex::new(film), partial, display: None }
    }

    /// The same picture, shown while it is rendered.
    #[must_use]
    pub fn shown_on(self, display: Option<Display>) -> Self {
        Self { display, ..self }
    }

    /// A picture of one pixel and no tile, for a session that has nothing to render yet.
    ///
    /// # Errors
    /// If there is no memory for a pixel.
    pub fn empty() -> Result<Self, FilmError> {
        let film = Film::new(1, 1, Window::full(1, 1))?;
        Ok(Self::new(Scheduler::new(Vec::new()), film, None))
    }

    /// Which tiles are left.
    pub fn scheduler(&self) -> &Scheduler {
        &self.scheduler
    }

    /// Where pixels go.
    pub fn film(&self) -> MutexGuard<'_, Film> {
        // A thread that panicked holding the lock has left whole pixels.
        self.film.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A tile's pixels are all in the film.
    pub(super) fn complete(&self, tile: &Tile) {
        if let Some(partial) = &self.partial {
            let record = partial::record(tile, &self.film());
            partial.keep(&record);
        }
        if let Some(display) = &self.display {
            display.show(tile, &self.film());
        }
        self.scheduler.complete();
    }

    /// Tells what went wrong while finished tiles were kept.
    ///
    /// # Errors
    /// If anything did.
    pub(crate) fn check_partial(&self) -> Result<(), PartialError> {
        self.partial.as_ref().map_or(Ok(()), PartialRender::check)
    }

    /// Whether finished tiles are kept.
    pub(crate) fn holds_tiles(&self) -> bool {
        self.partial.as_ref().is_some_and(PartialRender::holds_tiles)
    }

    /// Why the picture is not shown, or no more, if that was not told before.
    pub(crate) fn display_failure(&self) -> Option<DisplayError> {
        self.display.as_ref().and_then(Display::failure)
    }

    /// The film, where finished tiles are kept, and where they are shown.
    pub(crate) fn into_parts(self) -> (Film, Option<PartialRender>, Option<Display>) {
        let film = self.film.into_inner().unwrap_or_else(PoisonError::into_inner);
        (film, self.partial, self.display)
    }
}
