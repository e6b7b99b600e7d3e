//! Errors of the photon pass and the photon map.

use photoncard_shared::message::Fault;

use crate::pack::PackError;

/// Why there is no photon map.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PhotonError {
    /// Hardly any path meets a surface.
    #[error(
        "only {stored} photons were stored of {paths} traced from the lights: they meet hardly any surface"
    )]
    #[diagnostic(help(
        "the back of a one-sided triangle neither shines nor reflects: turn the triangles of lamps and of what they light \
         so that their fronts face each other, or make them double-sided; and check that surfaces reflect"
    ))]
    Lost {
        /// Photons stored.
        stored: usize,
        /// Paths traced.
        paths: u64,
    },
    /// Photons could not be told apart: the scene is too wide for so small a gather.
    #[error(
        "the scene is too wide: a cell of the grid of photon positions has a side of {cell} m, and a gather reaches only \
         {max_distance} m"
    )]
    #[diagnostic(help(
        "leave out geometry that is far away, move the scene to the origin, or choose a greater --max-distance or fewer \
         --photons"
    ))]
    TooWide {
        /// Side of a cell of the grid, metres.
        cell: f32,
        /// Greatest distance of a gather, metres.
        max_distance: f32,
    },
    /// The packed scene is not sound.
    #[error("the packed scene is not sound: {0:?}")]
    Unsound(Fault),
    /// The image with the photons is too large.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Pack(#[from] PackError),
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
}

impl From<Fault> for PhotonError {
    fn from(fault: Fault) -> Self {
        Self::Unsound(fault)
    }
}
