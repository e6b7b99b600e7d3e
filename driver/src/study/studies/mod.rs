//! The studies: each a list of points, and a report on their outcomes.

mod balance;
mod glossy_floor;
mod machine;
mod present;
mod reordering;
mod scaling;
mod scenes;
mod techniques;
mod workload;

use super::laboratory::Results;
use super::point::Point;
use super::report::Report;
use super::scale::Scale;
use crate::choice::choices;

/// A study that the program offers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Study {
    /// Memory traffic by order, cache and layout.
    Reordering,
    /// Memory traffic over the exponent of a glossy floor: figure 6.17 of the dissertation.
    Figure617,
    /// The cost model of table 7.1, with nominal and measured counts.
    Table71,
    /// Each technique alone and all together, at equal numbers of rays and at equal quality.
    Techniques,
    /// Memory traffic over photons, tile sides and queue sizes; time over chips.
    Scaling,
}

choices!(Study {
    Reordering = "reordering": "Memory traffic by order, cache and layout",
    Figure617 = "figure-6.17": "Memory traffic over the exponent of a glossy floor",
    Table71 = "table-7.1": "Chips for a frame rate, by nominal and by measured counts",
    Techniques = "techniques": "Each technique alone and together, at as many rays and at equal quality",
    Scaling = "scaling": "Photons, tile sides, queues and chips",
});

impl Study {
    /// The points that the study measures.
    pub fn points(self, scale: &Scale) -> Vec<Point> {
        match self {
            Self::Reordering => reordering::points(scale),
            Self::Figure617 => glossy_floor::points(scale),
            Self::Table71 => machine::points(scale),
            Self::Techniques => techniques::points(scale),
            Self::Scaling => scaling::points(scale),
        }
    }

    /// The report on the results, without provenance.
    ///
    /// # Panics
    /// If `results` lack one of the [points](Self::points) of this scale.
    pub fn report(self, scale: &Scale, results: &Results) -> Report {
        match self {
            Self::Reordering => reordering::report(scale, results),
            Self::Figure617 => glossy_floor::report(scale, results),
            Self::Table71 => machine::report(scale, results),
            Self::Techniques => techniques::report(scale, results),
            Self::Scaling => scaling::report(scale, results),
        }
    }
}
