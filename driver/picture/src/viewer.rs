//! Viewers: sinks that show tiles as soon as they are finished. A render continues if a viewer fails.

use std::error::Error;

use crate::film::Film;
use crate::sink::TileSink;

/// A sink that shows tiles as soon as they are finished. Neither its failure nor its delay affects a render.
pub trait Viewer: TileSink {
    /// Returns the error that ended the viewer, once: later calls return `None`. After an error nothing more
    /// is shown.
    fn failure(&self) -> Option<Box<dyn Error>>;

    /// Shows those pixels of the complete film that are not shown yet. Returns in bounded time.
    fn finish(&self, film: &Film);
}
