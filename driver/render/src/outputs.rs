//! Outputs that are written while a render runs: the file of finished tiles, viewers and the observer.

use std::sync::{Arc, Mutex};

use photoncard_picture::film::Film;
use photoncard_picture::sink::{FinishedTile, TileSink};
use photoncard_picture::viewer::Viewer;
use photoncard_scene::Scene;
use photoncard_shared::message::Tile;

use super::{Observer, RenderSettings};
use crate::display::Display;
use crate::partial::{PartialError, PartialRender};

/// Outputs that are requested by the settings and written while a render runs.
pub(super) struct Outputs<'a> {
    partial: Option<PartialRender>,
    /// Film of earlier samples to which the render adds. Tiles are shown with these samples added.
    pub(super) base: Option<Arc<Film>>,
    /// Number of dazzling tiles (light far above the scene's) among the complete samples taken over from the
    /// file.
    pub(super) kept_dazzling: usize,
    viewers: Vec<Box<dyn Viewer>>,
    pub(super) observer: &'a dyn Observer,
}

impl<'a> Outputs<'a> {
    /// Opens the outputs. Tiles of a resumed render are written into the film and shown. If the file has all
    /// tiles of the first samples, the film of these samples replaces `base`, and `film` gets the remaining
    /// samples.
    ///
    /// # Errors
    /// If the file of finished tiles cannot be read, or is not the file of this picture.
    pub(super) fn open(
        scene: &Scene,
        settings: &RenderSettings,
        tiles: &[Tile],
        (film, base): (&mut Film, Option<Arc<Film>>),
        observer: &'a dyn Observer,
    ) -> Result<Self, PartialError> {
        let begin = |partial| {
            let mut identity = settings.identity(scene);
            // The file may have another number of samples. With an irradiance cache, pixels depend on the
            // planned number of samples, which must be equal.
            identity.remove("spp");
            if settings.integrator.irradiance_error.is_some() {
                identity.insert("planned-spp".to_owned(), settings.integrator.planned().into());
            }
            PartialRender::begin(partial, identity.into(), film)
        };
        let begun = settings.outputs.partial.as_ref().map(begin).transpose()?;
        let (partial, kept) = begun.map_or((None, None), |(partial, kept)| (Some(partial), kept));
        let is_dazzling = |tile: &&Tile| {
            let kept = kept.as_ref().and_then(|kept| kept.finished(tile));
            kept.is_some_and(|tile| tile.is_dazzling())
        };
        let kept_dazzling = tiles.iter().filter(is_dazzling).count();
        let base = kept.map(Arc::new).or(base);
        let outputs = Self { partial, viewers: viewers(settings, film), base, kept_dazzling, observer };
        outputs.report_kept();
        let resumed: Vec<&Tile> = tiles.iter().filter(|tile| film.has(tile)).collect();
        resumed.iter().filter_map(|tile| film.finished(tile)).for_each(|tile| outputs.put(&tile));
        if !resumed.is_empty() {
            observer.resumed(resumed.len(), tiles.len());
        }
        Ok(outputs)
    }

    /// Sinks of finished tiles: the film, the outputs that show them, and the partial file.
    pub(super) fn sinks<'s>(&'s self, film: &'s Mutex<Film>) -> Vec<&'s dyn TileSink> {
        let mut sinks: Vec<&dyn TileSink> = vec![film, self];
        sinks.extend(self.partial.as_ref().map(|partial| partial as &dyn TileSink));
        sinks
    }

    /// Checks that writing finished tiles into their file has not failed.
    ///
    /// # Errors
    /// If writing a tile failed.
    pub(super) fn check_partial(&self) -> Result<(), PartialError> {
        self.partial.as_ref().map_or(Ok(()), PartialRender::check)
    }

    /// Reports to the observer that finished tiles are in the file, if there are any.
    pub(super) fn report_kept(&self) {
        if self.partial.as_ref().is_some_and(PartialRender::holds_tiles) {
            self.observer.kept();
        }
    }

    /// Reports to the observer, once per failed viewer, why the picture is not shown.
    pub(super) fn report_failed_viewers(&self) {
        for error in self.viewers.iter().filter_map(|viewer| viewer.failure()) {
            self.observer.not_shown(error.as_ref());
        }
    }

    /// Sends the remaining pixels to the viewers. Returns the file of finished tiles.
    pub(super) fn finish(self, film: &Film) -> Option<PartialRender> {
        self.viewers.iter().for_each(|viewer| viewer.finish(film));
        self.report_failed_viewers();
        self.partial
    }
}

/// Passes tiles to the viewers and the observer, with the samples of the base added.
impl TileSink for Outputs<'_> {
    fn put(&self, tile: &FinishedTile) {
        let added = self.base.as_ref().and_then(|base| base.added_to(tile));
        let tile = added.as_ref().unwrap_or(tile);
        self.viewers.iter().for_each(|viewer| viewer.put(tile));
        self.observer.tiles().into_iter().for_each(|sink| sink.put(tile));
    }

    fn revoke(&self, tile: &Tile) {
        self.viewers.iter().for_each(|viewer| viewer.revoke(tile));
        self.observer.tiles().into_iter().for_each(|sink| sink.revoke(tile));
    }
}

fn viewers(settings: &RenderSettings, film: &Film) -> Vec<Box<dyn Viewer>> {
    let channels = settings.picture.layers.channels();
    let mut viewers: Vec<Box<dyn Viewer>> = Vec::new();
    if let Some(display) = &settings.outputs.display {
        viewers.push(Box::new(Display::open(display, film.window(), &channels)));
    }
    viewers
}
