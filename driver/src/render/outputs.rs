//! Outputs of a render while it runs: the file of finished tiles, the viewers and the observer.

use std::sync::Mutex;

use photoncard_shared::message::Tile;

use super::{Observer, RenderSettings};
use crate::display::Display;
use crate::film::Film;
use crate::partial::{PartialError, PartialRender};
use crate::scene::FixedScene;
use crate::sink::TileSink;
use crate::viewer::Viewer;

/// Outputs of a render while it runs, as far as the settings ask for them.
pub(super) struct Outputs<'a> {
    partial: Option<PartialRender>,
    viewers: Vec<Box<dyn Viewer>>,
    pub(super) observer: &'a dyn Observer,
}

impl<'a> Outputs<'a> {
    /// Opens the outputs. Tiles of the render that is resumed are written into the film, and shown.
    ///
    /// # Errors
    /// If the file of finished tiles cannot be read or is not the file of this picture.
    pub(super) fn open(
        scene: &FixedScene,
        settings: &RenderSettings,
        tiles: &[Tile],
        film: &mut Film,
        observer: &'a dyn Observer,
    ) -> Result<Self, PartialError> {
        let begin = |partial| PartialRender::begin(partial, settings.identity_of(scene).into(), film);
        let partial = settings.outputs.partial.as_ref().map(begin).transpose()?;
        let outputs = Self { partial, viewers: viewers(settings, film), observer };
        outputs.report_kept();
        let resumed: Vec<&Tile> = tiles.iter().filter(|tile| film.has(tile)).collect();
        for tile in resumed.iter().filter_map(|tile| film.finished(tile)) {
            outputs.viewers.iter().for_each(|viewer| viewer.put(&tile));
        }
        if !resumed.is_empty() {
            observer.resumed(resumed.len(), tiles.len());
        }
        Ok(outputs)
    }

    /// Sinks of finished tiles: the film, the viewers, the observer's, and the file if tiles are finished early.
    pub(super) fn sinks<'s>(&'s self, film: &'s Mutex<Film>, finished_early: bool) -> Vec<&'s dyn TileSink> {
        let mut sinks: Vec<&dyn TileSink> = vec![film];
        let partial = self.partial.as_ref().filter(|_| finished_early);
        sinks.extend(partial.map(|partial| partial as &dyn TileSink));
        sinks.extend(self.viewers.iter().map(|viewer| viewer.as_ref() as &dyn TileSink));
        sinks.extend(self.observer.tiles());
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

    /// Reports to the observer, once for each viewer that has failed, why the picture is not shown.
    pub(super) fn report_failed_viewers(&self) {
        for error in self.viewers.iter().filter_map(|viewer| viewer.failure()) {
            self.observer.not_shown(error.as_ref());
        }
    }

    /// Shows the rest of the picture. Returns the file of finished tiles.
    pub(super) fn finish(self, film: &Film) -> Option<PartialRender> {
        self.viewers.iter().for_each(|viewer| viewer.finish(film));
        self.report_failed_viewers();
        self.partial
    }
}

/// The viewers that the settings ask for.
fn viewers(settings: &RenderSettings, film: &Film) -> Vec<Box<dyn Viewer>> {
    let channels = settings.picture.layers.channels();
    let mut viewers: Vec<Box<dyn Viewer>> = Vec::new();
    if let Some(display) = &settings.outputs.display {
        viewers.push(Box::new(Display::open(display, film.window(), &channels)));
    }
    viewers
}
