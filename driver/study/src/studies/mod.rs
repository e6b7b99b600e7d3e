//! The studies. Each is a list of points, and a report on their outcomes.

mod arithmetic;
mod balance;
mod flights;
mod glossy_floor;
mod headlines;
mod interactive;
mod machine;
mod overlap;
mod present;
mod reordering;
mod scaling;
mod sweep;
mod techniques;
mod times;
mod workload;

pub(crate) use self::sweep::SweptScene;
pub use self::sweep::{Hardware, Sweep};
use super::error::StudyError;
use super::host::{HostBench, HostFrame};
use super::laboratory::Results;
use super::point::Point;
use super::report::Report;
use super::scale::Scale;
use photoncard_picture::choice::choices;

/// A study that the program offers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Study {
    /// Memory traffic by order of the gathers, cache, and layout of the photon map.
    Reordering,
    /// Memory traffic over the exponent of a glossy floor (figure 6.17 of Steinhurst's dissertation, 2007).
    Figure617,
    /// Number of chips for a frame rate, by the cost model of the dissertation's Table 7.1 with nominal and
    /// with measured counts.
    Table71,
    /// Memory traffic of each technique alone and of all together, at equal numbers of rays and at equal
    /// quality.
    Techniques,
    /// Memory traffic over the number of photons, the side of tiles and the size of the queue; time over the
    /// number of chips.
    Scaling,
    /// Time and bytes of each part of a frame's work while the camera and lights move.
    Interactive,
}

choices!(Study {
    Reordering = "reordering": "Memory traffic by order, cache and layout",
    Figure617 = "figure-6.17": "Memory traffic over the exponent of a glossy floor",
    Table71 = "table-7.1": "Chips for a frame rate, by nominal and by measured counts",
    Techniques = "techniques": "Each technique alone and together, at as many rays and at equal quality",
    Scaling = "scaling": "Photons, tile sides, queues and chips",
    Interactive = "interactive": "Parts of a frame while camera and lights move",
});

impl Study {
    /// Points that the study measures.
    pub(crate) fn points(self, scale: &Scale) -> Vec<Point> {
        match self {
            Self::Reordering => reordering::points(scale),
            Self::Figure617 => glossy_floor::points(scale),
            Self::Table71 => machine::points(scale),
            Self::Techniques => techniques::points(scale),
            Self::Scaling => scaling::points(scale),
            Self::Interactive => interactive::points(scale),
        }
    }

    /// Measures the host's work that the report needs besides the points.
    ///
    /// # Errors
    /// As [`HostBench::measure`].
    pub(crate) fn host_frames(
        self,
        scale: &Scale,
        bench: &mut HostBench,
    ) -> Result<Vec<HostFrame>, StudyError> {
        match self {
            Self::Interactive => interactive::host_frames(scale, bench),
            _ => Ok(Vec::new()),
        }
    }

    /// Creates the report on the results, without provenance. It includes published figures only at a
    /// [nominal](Scale::is_nominal) scale.
    ///
    /// # Panics
    /// If `results` lack one of the [points](Self::points) of this scale.
    pub(crate) fn report(self, scale: &Scale, results: &Results, host: &[HostFrame]) -> Report {
        let report = match self {
            Self::Reordering => reordering::report(scale, results),
            Self::Figure617 => glossy_floor::report(scale, results),
            Self::Table71 => machine::report(scale, results),
            Self::Techniques => techniques::report(scale, results),
            Self::Scaling => scaling::report(scale, results),
            Self::Interactive => interactive::report(scale, results, host),
        };
        match scale.banner() {
            Some(banner) => report.marked(banner),
            None => report,
        }
    }
}

#[cfg(test)]
mod tests {
    use photoncard_shared::address::STRUCTURES;
    use photoncard_shared::counters::Counters;

    use photoncard_map::photon_map::PhotonMapSize;
    use photoncard_picture::choice::Choice;
    use photoncard_render::ChipModel;
    use photoncard_render::emulator::EmulatedKind;
    use photoncard_render::emulator::contents::Contents;

    use super::super::dissertation::{self, Measured};
    use super::super::host::{Change, Changed};
    use super::super::laboratory::Outcome;
    use super::super::measure::{Measurement, ReadSums, TileMeasurement};
    use super::super::point::Task;
    use super::super::quality::{Quality, TileDeviation};
    use super::*;

    /// Host's work with made-up numbers.
    fn host_frame() -> HostFrame {
        let change = |change| Changed { change, bytes: 6_000_000, of: 8_000_000 };
        HostFrame {
            image_bytes: 8_000_000,
            map: PhotonMapSize { photons: 500_000, bytes: 7_000_000 },
            threads: 2,
            tracing: 0.5,
            building: 0.25,
            measuring: 0.25,
            changes: vec![
                change(Change::Dimmed),
                change(Change::Replaced(0.1)),
                change(Change::Replaced(1.0)),
            ],
        }
    }

    #[test]
    fn interactive_frames_report_the_threads_and_links_of_their_measurements() {
        let page = page(Study::Interactive, &Scale::FULL);
        // 30 frames of a second each on two threads.
        assert!(page.contains(">60<"), "threads");
        assert!(
            page.contains("all lights dimmed to a half") && page.contains("10 % of the photons traced anew")
        );
    }

    /// Page of a study with made-up outcomes.
    fn report_of(study: Study, scale: &Scale) -> Report {
        let counters =
            Counters { gathers: 10, gather_rays: 20, eye_rays: 1, photons_found: 500, ..Counters::ZERO };
        let reads = [ReadSums { requests: 9, raw_bytes: 180, dram_bytes: 128 }; STRUCTURES];
        let tile = TileMeasurement {
            tile: 0,
            stands_for: 1,
            counters,
            reads,
            waiting_written_bytes: 0,
            contents: Contents::ZERO,
            reuse: None,
        };
        let error = TileDeviation { pixels: 256, squares: 7.0, noise: 0.5, sum: 760.0, reference: 768.0 };
        let outcome = |point: &Point| match point.task {
            Task::Traffic { .. } => Outcome::Traffic(Measurement {
                tiles: vec![tile.clone()],
                rendered: 1,
                map: PhotonMapSize { photons: 500_000, bytes: 7_000_000 },
            }),
            Task::Quality { .. } => Outcome::Quality(Quality { tiles: vec![error; 3] }),
        };
        let points = study.points(scale).into_iter();
        let results = Results::new(points.map(|point| (point.clone(), outcome(&point))).collect());
        study.report(scale, &results, &[(); 9].map(|()| host_frame()))
    }

    fn page(study: Study, scale: &Scale) -> String {
        report_of(study, scale).to_html()
    }

    #[test]
    fn every_claim_of_the_dissertation_names_figures_that_the_studies_measure() {
        let figures: Vec<_> =
            Study::ALL.iter().flat_map(|study| report_of(*study, &Scale::FULL).figures).collect();
        let measured = |name: &str, scene: &str| {
            figures
                .iter()
                .any(|figure| figure.name == name && figure.scene == scene)
                .then_some(Measured { value: 1.0, interval: None })
        };
        let page = dissertation::page(&measured);
        assert!(!page.contains("not measured"), "{page}");
    }

    #[test]
    fn the_points_of_all_studies_are_possible_on_their_chips() {
        let kinds = [EmulatedKind::Large, EmulatedKind::Micro].map(ChipModel::from);
        for scale in [Scale::FULL, Scale::QUICK] {
            for study in Study::ALL {
                study.points(&scale).iter().for_each(|point| point.check().unwrap());
            }
            for model in kinds.clone() {
                let scale = scale.clone().with_chips(model);
                for study in [Study::Reordering, Study::Table71, Study::Scaling, Study::Interactive] {
                    study.points(&scale).iter().for_each(|point| point.check().unwrap());
                }
            }
        }
    }

    #[test]
    fn published_figures_appear_only_at_the_nominal_scale() {
        let larger = Scale { side: 1024, ..Scale::FULL };
        for (study, words) in [
            (Study::Reordering, "Published figures are of frames"),
            (Study::Figure617, "is cited for three claims"),
            (Study::Table71, "The dissertation gives"),
            (Study::Techniques, "The dissertation says"),
        ] {
            for (scale, is_nominal) in [(Scale::FULL, true), (Scale::QUICK, false), (larger.clone(), false)] {
                let page = page(study, &scale);
                assert_eq!(page.contains(words), is_nominal, "{}", study.name());
                assert_eq!(!page.contains("class=\"banner\""), is_nominal, "{}", study.name());
            }
        }
    }
}
