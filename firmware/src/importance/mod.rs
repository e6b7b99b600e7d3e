//! Directions of final gather rays by importance sampling of the reflection function, of the photons, or of
//! both.
//!
//! Every surface point that gather rays start from has a [`DirectionTable`]: 4x8 cells of the hemisphere and
//! one more entry for the reflection's lobe and for foci, cones about the photons of a cell. Each has a share
//! of the rays. A stratified pattern is mapped by the table's inverse cumulative distribution function. The
//! density of the whole mixture weights each ray, so that no choice of shares biases the picture. The
//! sampling methods differ only in the source of the shares:
//!
//! | sampling | share of a cell | share of the lobe |
//! |---|---|---|
//! | reflection | the Lambertian albedo, all cells alike | the lobe's albedo |
//! | photon | the flux of the photons that came through it | none |
//! | product | the same flux, times the reflection | the part of the lobe narrower than a cell |
//! | mixture | the mean of reflection and photon | half the lobe's albedo |
//! | focused | as of product, and foci where the photons of a cell arrive close together | as of product |
//!
//! *Photon* is from Jensen 1995, *Importance driven path tracing using the photon map*; *product* from
//! Steinhurst, Lastra 2006, *Global importance sampling of glossy surfaces using the photon map*.
//!
//! Points with few rays use the table of the reflection with every sampling method
//! ([`GatherPoint::choose_directions`](crate::render::GatherPoint::choose_directions)).
//!
//! Generative reordering derives its direction bins from the table entries ([`DirectionTable::bin`]).

mod focus;
mod hemisphere;
mod incident;
mod table;

pub use hemisphere::{CELLS, COLUMNS, ROWS, cell_of};
pub(crate) use hemisphere::{cell_at, cell_centre, direction_in};
pub use incident::IncidentFlux;
pub use table::{DirectionTable, ENTRIES};

use glam::Vec3;

/// Direction of a gather ray, with the weight of its radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherDirection {
    /// Unit vector away from the surface.
    pub direction: Vec3,
    /// Weight of the radiance from this direction: `f cos(theta) / p`, dimensionless.
    pub weight: Vec3,
    /// Probability density of the direction, 1/sr.
    pub density: f32,
    /// Cell of the hemisphere that contains the direction.
    pub cell: u8,
}
