//! Studies: measurements of the shipped scenes with one setting varied, reports on them, and predictions for
//! machines that do not exist yet.
//!
//! A study is a list of [`Point`]s, each a scene with settings to measure, and a function that turns their
//! [`Results`] into a report. [`run`] measures the points in a [`Laboratory`], which stores their results,
//! and writes the reports. [`photoncard_render::cost_model`] predicts the number of chips that a frame rate
//! needs; `load_balance` simulates how evenly a picture's tiles load these chips.
#![forbid(unsafe_code)]

mod axes;
pub mod dissertation;
mod error;
mod figures;
mod host;
mod index;
mod laboratory;
mod load_balance;
mod measure;
mod parts;
mod point;
mod provenance;
mod quality;
mod report;
mod sample;
mod scale;
mod store;
mod studies;
mod symbol_axes;
mod whole_frame;

use std::path::{Path, PathBuf};

pub use self::axes::{Axis, AxisError, MAX_POINTS};
pub use self::error::StudyError;
pub use self::figures::check;
use self::host::HostBench;
pub use self::laboratory::{Laboratory, Results, StudyObserver};
pub use self::measure::{Measurement, ReadSums, TileMeasurement};
pub use self::parts::{Extent, PartError, RECORD, Union, UnitedPoints, unite};
pub use self::point::{ALONG_CURVE, ImageKey, Point, Task};
pub use self::quality::{Quality, TileDeviation};
use self::report::Report;
pub use self::report::{Cell, Figure, NOT_REACHED, Provenance, ReportError, human};
pub use self::sample::{Estimate, SampleRate};
pub use self::scale::Scale;
pub use self::store::StoreError;
use self::studies::SweptScene;
pub use self::studies::{Hardware, Study, Sweep};
pub use self::symbol_axes::{SymbolAxes, SymbolAxesError};
pub use self::whole_frame::{FrameOutcome, WholeFrame};
use photoncard_picture::choice::Choice;
use photoncard_render::parts::Part;
use photoncard_scene::{Scene, SceneContents};

/// Options of [`run`]: the studies, their scale, and the folders that they read and write.
#[derive(Clone, Debug)]
pub struct StudyOptions {
    /// Studies to run, in this order.
    pub studies: Vec<Study>,
    /// Settings that all studies have in common.
    pub scale: Scale,
    /// Folder of the scenes.
    pub scenes: PathBuf,
    /// Folder of the reports.
    pub out: PathBuf,
    /// True if each report has its own folder in [`Self::out`], with an index page of links to all reports.
    /// If false, reports are written into [`Self::out`] itself.
    pub is_collection: bool,
    /// Number of threads; `None` for one per core.
    pub threads: Option<usize>,
    /// Provenance of the numbers. Each report adds its settings.
    pub provenance: Provenance,
    /// Points to measure: all, those of a part, or none.
    pub extent: Extent,
}

/// Measures the points of all studies, and writes a report for each study and `figures.csv` with the key
/// figures of all. A collection of the nominal scale has the page [`dissertation`] too. The points of a
/// collection are measured before its first report is written. Results are stored in the folder `points` of
/// [`StudyOptions::out`], so that a later run does not measure the same points again.
///
/// # Errors
/// If a scene is missing, a point cannot be measured, a file cannot be written, the observer stops the study,
/// or a point of united parts is missing.
pub fn run(options: &StudyOptions, observer: &dyn StudyObserver) -> Result<(), StudyError> {
    let mut laboratory = Laboratory::new(&options.out, &options.scenes, options.threads, observer)?;
    let mut bench = HostBench::new(&options.out, &options.scenes, options.threads, observer)?;
    match &options.extent {
        Extent::Whole if options.is_collection => {
            laboratory.measure(COLLECTION, &all_points(options))?;
        }
        Extent::Whole => {}
        Extent::Part { part, command } => return run_part(options, (*part, command), laboratory, &mut bench),
        Extent::Merged(united) => {
            laboratory.refuse_missing(united)?;
            bench.refuse_missing();
        }
    }
    let mut reports: Vec<(Study, Report)> = Vec::new();
    for &study in &options.studies {
        let results = laboratory.measure(study.name(), &study.points(&options.scale))?;
        let mut report =
            study.report(&options.scale, &results, &study.host_frames(&options.scale, &mut bench)?);
        report.provenance = options.provenance.clone();
        report.provenance.settings = options.scale.rows();
        report::write(&folder(options, study), &report)?;
        reports.push((study, report));
    }
    if options.is_collection {
        index::write(&options.out, options.scale.banner(), &reports, &options.provenance)?;
    }
    let check = check(&mut laboratory)?;
    let figures: Vec<_> = reports.into_iter().flat_map(|(_, report)| report.figures).collect();
    if options.is_collection && options.scale.is_nominal() {
        figures::write_claims(&options.out, &figures)?;
    }
    figures::write(&options.out, &options.scale, check, figures)
}

/// Name of the measurements of several studies.
const COLLECTION: &str = "all";

/// Points of all studies. Measured together, those of different studies share card images and references.
fn all_points(options: &StudyOptions) -> Vec<Point> {
    options.studies.iter().flat_map(|study| study.points(&options.scale)).collect()
}

/// Measures the share of a part, and writes its record. The first part measures the host's work.
fn run_part(
    options: &StudyOptions,
    (part, command): (Part, &[String]),
    mut laboratory: Laboratory,
    bench: &mut HostBench,
) -> Result<(), StudyError> {
    for study in &options.studies {
        laboratory.measure_part(study.name(), &study.points(&options.scale), part)?;
        if part.number() == 1 {
            study.host_frames(&options.scale, bench)?;
        }
    }
    laboratory.measure_part(figures::CHECK, &figures::check_points(), part)?;
    let threads = laboratory.threads();
    let provenance = &options.provenance;
    Ok(parts::write_record(&options.out, (part, command), laboratory.checksums(), threads, provenance)?)
}

/// Options of [`run_sweep`].
pub struct SweepOptions {
    /// Sweep to run.
    pub sweep: Sweep,
    /// Name of the scene of all points.
    pub name: String,
    /// Scene, without the changes of materials that a point makes.
    pub scene: Scene,
    /// Folder of the report.
    pub out: PathBuf,
    /// Number of threads; `None` for one per core.
    pub threads: Option<usize>,
    /// Provenance of the numbers. The report adds its settings.
    pub provenance: Provenance,
    /// Points to measure: all, those of a part, or none.
    pub extent: Extent,
}

/// Name of the measurements of a sweep.
const SWEEP: &str = "sweep";

/// Measures all points of a sweep and writes its report. All points are checked before the first is measured.
/// Results are stored as by [`run`].
///
/// # Errors
/// If a point is not possible or cannot be measured, a file cannot be written, or the observer stops the
/// sweep.
pub fn run_sweep(options: SweepOptions, observer: &dyn StudyObserver) -> Result<(), StudyError> {
    let SweepOptions { sweep, name, scene, out, threads, mut provenance, extent } = options;
    for point in sweep.points() {
        point.check()?;
        point.settings.camera(&scene)?;
        let mut materials =
            Scene::from(SceneContents { materials: scene.materials.clone(), ..SceneContents::default() });
        point.assignments.iter().try_for_each(|assignment| materials.apply(assignment))?;
    }
    let checksum = scene.checksum().to_owned();
    let mut laboratory = Laboratory::new(&out, Path::new(""), threads, observer)?;
    laboratory.add(&name, scene);
    match extent {
        Extent::Whole => {}
        Extent::Part { part, command } => {
            laboratory.measure_part(SWEEP, sweep.points(), part)?;
            let (scenes, threads) = (laboratory.checksums(), laboratory.threads());
            return Ok(parts::write_record(&out, (part, &command), scenes, threads, &provenance)?);
        }
        Extent::Merged(united) => laboratory.refuse_missing(&united)?,
    }
    let results = laboratory.measure(SWEEP, sweep.points())?;
    provenance.settings.extend(sweep.rows());
    let scene = SweptScene { name: &name, checksum: &checksum };
    Ok(report::write(&out, &Report { provenance, ..sweep.report(scene, &results) })?)
}

fn folder(options: &StudyOptions, study: Study) -> PathBuf {
    let out: &Path = &options.out;
    if options.is_collection { out.join(study.name()) } else { out.to_owned() }
}
