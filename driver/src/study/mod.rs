//! Studies: renders of the same scenes with one thing changed, kept and reported, and what they say of chips that no run
//! here has.
//!
//! A study is a list of [`Point`]s and a function from what was measured there to a [`Report`]. [`run`] measures
//! the points in a [`Laboratory`], which keeps them, and writes the report.

pub mod cost_model;
mod error;
mod index;
mod laboratory;
pub mod load_balance;
mod measure;
mod point;
mod provenance;
mod quality;
pub mod report;
mod sample;
mod scale;
pub mod store;
mod studies;

use std::path::{Path, PathBuf};

pub use self::error::StudyError;
pub use self::laboratory::{Laboratory, Outcome, Results, StudyObserver};
pub use self::measure::{Bench, Measurement, StructureReads, TileMeasurement};
pub use self::point::{ImageKey, Point, Task};
pub use self::quality::{Quality, Reference};
use self::report::{Provenance, Report};
pub use self::sample::{Estimate, SampleRate, choose};
pub use self::scale::Scale;
pub use self::studies::Study;

/// What to study, and where.
#[derive(Clone, Debug)]
pub struct StudyOptions {
    /// The studies, in order.
    pub studies: Vec<Study>,
    /// How large they are.
    pub scale: Scale,
    /// The folder of the scenes.
    pub scenes: PathBuf,
    /// The folder of the reports.
    pub out: PathBuf,
    /// Whether each report has a folder of its own in that, and a page links them all.
    pub is_collection: bool,
    /// Threads; `None` for one a core.
    pub threads: Option<usize>,
    /// Where the numbers come from; a report adds its settings.
    pub provenance: Provenance,
}

/// Measures and reports the studies. Finished points are kept in the folder `points` of `out`, and found again.
///
/// # Errors
/// If a scene is missing, a point cannot be measured, a file cannot be written, or the observer stops it.
pub fn run(options: &StudyOptions, observer: &dyn StudyObserver) -> Result<(), StudyError> {
    let mut laboratory = Laboratory::new(&options.out, &options.scenes, options.threads, observer)?;
    let mut reports: Vec<(Study, Report)> = Vec::new();
    for &study in &options.studies {
        let results = laboratory.measure(study.name(), &study.points(&options.scale))?;
        let mut report = study.report(&options.scale, &results);
        report.provenance = options.provenance.clone();
        report.provenance.settings = options.scale.rows();
        report::write(&folder(options, study), &report)?;
        reports.push((study, report));
    }
    if options.is_collection {
        index::write(&options.out, &reports, &options.provenance)?;
    }
    Ok(())
}

fn folder(options: &StudyOptions, study: Study) -> PathBuf {
    let out: &Path = &options.out;
    if options.is_collection { out.join(study.name()) } else { out.to_owned() }
}
