//! Density estimation as the host prepares it: what a gather on the chip knows beyond the photons.
//!
//! Both depend on the image and the number of neighbours: the greatest distance of gathers, from the photons' own density
//! (`search`), and at every photon the disc fraction, the area of surface within the radius of a gather there over that of
//! a flat disc (`disc`).

mod ball;
mod block;
mod chords;
mod disc;
mod lanes;
mod rays;
mod search;
mod shadows;
mod sides;
mod surroundings;

pub(crate) use self::disc::measure_discs;
pub(crate) use self::search::{automatic_max_distance, caustic_max_distance};
