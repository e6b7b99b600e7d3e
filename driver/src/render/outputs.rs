//! Outputs of a render while it runs: the file of finished tiles, the display server and the observer.

use std::sync::Mutex;

use photoncard_shared::message::Tile;

use super::{Observer, RenderSettings};
use crate::display::Display;
use crate::film::Film;
use crate::partial::{PartialError, PartialRender};
use crate::scene::Scene;
use crate::sink::TileSink;

/// Outputs of a render while it runs, as far as the settings ask for them.
pub(super) struct Outputs<'a> {
    partial: Option<PartialRender>,
    display: Option<Display>,
    pub(super) observer: &'a dyn Observer,
}

impl<'a> Outputs<'a> {
    /// Opens the outputs. Tiles of the render that is resumed are written into the film, and shown.
    ///
    /// # Errors
    /// If the file of finished tiles cannot be read or is not the file of this picture.
    pub(super) fn open(
        scene: &Scene,
        settings: &RenderSettings,
        tiles: &[Tile],
        film: &mut Film,
        observer: &'a dyn Observer,
    ) -> Result<Self, PartialError> {
        let begin = |partial| PartialRender::begin(partial, settings.identity(scene).into(), film);
        let partial = settings.outputs.partial.as_ref().map(begin).transpose()?;
        let channels = settings.picture.layers.channels();
        let open = |display| Display::open(display, film.window(), &channels);
        let display = settings.outputs.display.as_ref().map(open);
        let outputs = Self { partial, display, observer };
        outputs.report_kept();
        let resumed: Vec<&Tile> = tiles.iter().filter(|tile| film.has(tile)).collect();
        if let Some(display) = &outputs.display {
            resumed.iter().filter_map(|tile| film.finished(tile)).for_each(|tile| display.put(&tile));
        }
        if !resumed.is_empty() {
            observer.resumed(resumed.len(), tiles.len());
        }
        Ok(outputs)
    }

    /// Sinks of finished tiles: the film, the display server, and the file if tiles are finished early.
    pub(super) fn sinks<'s>(&'s self, film: &'s Mutex<Film>, finished_early: bool) -> Vec<&'s dyn TileSink> {
        let mut sinks: Vec<&dyn TileSink> = vec![film];
        let partial = self.partial.as_ref().filter(|_| finished_early);
        sinks.extend(partial.map(|partial| partial as &dyn TileSink));
        sinks.extend(self.display.as_ref().map(|display| display as &dyn TileSink));
        sinks
    }

    /// Checks that finished tiles could be written into their file.
    ///
    /// # Errors
    /// If one could not.
    pub(super) fn check_partial(&self) -> Result<(), PartialError> {
        self.partial.as_ref().map_or(Ok(()), PartialRender::check)
    }

    /// Reports to the observer that finished tiles are in the file, if any are.
    pub(super) fn report_kept(&self) {
        if self.partial.as_ref().is_some_and(PartialRender::holds_tiles) {
            self.observer.kept();
        }
    }

    /// Reports to the observer, once, the error that keeps the picture from being shown.
    pub(super) fn report_display(&self) {
        if let Some(error) = self.display.as_ref().and_then(Display::failure) {
            self.observer.not_shown(&error);
        }
    }

    /// Shows the rest of the picture. Returns the file of finished tiles.
    pub(super) fn finish(self, film: &Film) -> Option<PartialRender> {
        if let Some(display) = &self.display {
            display.finish(film);
        }
        self.report_display();
        self.partial
    }
}
