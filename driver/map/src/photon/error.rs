//! Errors of the photon pass and the photon map.

use photoncard_shared::message::Fault;

use crate::pack::PackError;

/// Error of the photon pass or of the construction of the photon map.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PhotonError {
    /// The photon grid is too coarse for the maximum distance of gathers, because the scene is too wide.
    #[error(
        "the scene is too wide: a cell of the grid of photon positions has a side of {cell} m, and a gather reaches only \
         {max_distance} m"
    )]
    #[diagnostic(help(
        "leave out geometry that is far away, move the scene to the origin, or choose a greater \
         `photons.max_distance` or fewer `photons.count`"
    ))]
    TooWide {
        /// Side of a cell of the photon grid, metres.
        cell: f32,
        /// Maximum distance of a gather, metres.
        max_distance: f32,
    },
    /// A packed scene is malformed.
    #[error("the packed scene is malformed: {0:?}")]
    Unsound(Fault),
    /// The card image with its photons is too large.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Pack(#[from] PackError),
    /// The caller stopped the photon pass.
    #[error("stopped")]
    Stopped,
}

impl From<Fault> for PhotonError {
    fn from(fault: Fault) -> Self {
        Self::Unsound(fault)
    }
}
