//! Preparation of the density estimate on the host.
//!
//! Both results depend on the image and the number of neighbours: distances of gathers, from the density of
//! the photons (`search`), and for every photon its disc fraction, the area of surface within the radius of a
//! gather over the area of a flat disc (`disc`).

mod ball;
mod block;
mod chords;
mod crossings;
mod disc;
mod evidence;
mod lanes;
mod rays;
mod search;
mod shadows;
mod sides;
mod surfaces;
mod surroundings;

pub(crate) use self::disc::measure_discs;
pub(crate) use self::search::{GatherDistances, SampledDistances};
