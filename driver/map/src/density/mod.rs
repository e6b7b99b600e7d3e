//! Prepares the density estimate on the host.
//!
//! Two results follow from the card image and the number of photons of a gather. `search` finds the distances
//! of gathers from the density of the photons. `disc` computes the disc fraction of every photon: the area of
//! surface within the radius of a gather, divided by the area of a flat disc.

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
