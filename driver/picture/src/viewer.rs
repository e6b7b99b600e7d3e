//! Viewers: sinks that show tiles as they are finished. A render goes on without one that fails.

use std::error::Error;

use crate::film::Film;
use crate::sink::TileSink;

/// A sink that shows tiles as they are finished. Neither its failure nor its delay is a render's.
pub trait Viewer: TileSink {
    /// The error that ended the viewer, returned once. After an error nothing more is shown.
    fn failure(&self) -> Option<Box<dyn Error>>;

    /// Shows what the complete film has and the viewer has not shown yet, in bounded time.
    fn finish(&self, film: &Film);
}
