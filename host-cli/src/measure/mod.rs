//! Command `photoncard measure`.

mod grid;
mod points;
mod summary;
mod table;

use std::path::Path;

use miette::{MietteDiagnostic, Report};
use photoncard_driver::render::measure::{
    MAX_SENSORS, Meter, PROBE_DIRECTIONS, Point, SENSORS_TOGETHER, Share, probe_points,
};
use photoncard_driver::render::{Observer, Phase, RenderSettings};
use photoncard_driver::scene::Scene;

use self::grid::Grid;
use self::points::Points;
use self::summary::Summary;
use self::table::{Photometry, Table};
use crate::arguments::{Engine, MeasureOptions, PointOptions};
use crate::failure::Failure;
use crate::farm;
use crate::progress::Progress;
use crate::render::{dram_bytes, on_threads, without_view};
use crate::{input, outputs};

/// Measures the points and writes the table.
pub(crate) fn run(options: &MeasureOptions) -> Result<(), Failure> {
    let settings = options.settings();
    check(options, &settings)?;
    if let Some(engine) = options.job.farm {
        return job(options, engine);
    }
    let scene = input::load(&options.scene, dram_bytes(&settings))?;
    let (scene, settings) = without_view(&options.scene, &options.host, (scene, settings))?;
    let source = Source::open(&options.points, &scene)?;
    let photometry = Photometry::new(&options.units, &scene)?;
    let progress = Progress::start(&options.host, settings.cards.count(), Phase::Tiles)?;
    let meter = Meter::new(&scene, &settings, photometry.weights);
    let summary =
        on_threads(options.host.threads, || measure(options, source, meter, photometry, &progress))?
            .map_err(|failure| failure.stopped_as("stopped; no table was written"))?;
    progress.finish();
    if !options.host.quiet {
        summary.say(&photometry);
    }
    Ok(())
}

/// Prints the job that measures the points in parts on a farm.
fn job(options: &MeasureOptions, engine: Engine) -> Result<(), Failure> {
    let Some(output) = options.output.path() else {
        let text = "a job writes its table to a file";
        return Err(Failure::Input(Report::new(MietteDiagnostic::new(text).with_help("give -o OUT.csv"))));
    };
    let points = options.points.points.as_deref();
    if points.is_some_and(|path| !is_file(path)) {
        return Err(no_parts_of_a_pipe());
    }
    let mut inputs: Vec<&Path> = input::files(&options.scene).into_iter().map(|(path, _)| path).collect();
    inputs.extend(points);
    let work = farm::Work { command: "measure", inputs: &inputs, output, merge: farm::Merge::Tables };
    farm::print(engine, &work, options.job.parts)
}

fn no_parts_of_a_pipe() -> Failure {
    let text = "parts are of a known number of points, and those of a pipe are not counted";
    let help = "give --points a file, or leave out --part and --farm";
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

fn check(options: &MeasureOptions, settings: &RenderSettings) -> Result<(), Failure> {
    let mut inputs = input::files(&options.scene);
    inputs.extend(options.points.points.as_deref().map(|path| (path, "the points")));
    let written: Vec<&Path> = options.output.path().into_iter().collect();
    outputs::check(&inputs, &written, &[])?;
    let is_piped = options.points.points.as_deref().is_some_and(|path| !is_file(path));
    if is_piped && options.part.is_some() {
        return Err(no_parts_of_a_pipe());
    }
    Ok(settings.check()?)
}

/// Points of a measurement.
enum Source {
    /// Lines of a file, and their number, unless they come from a pipe.
    File {
        points: Points,
        count: Option<u64>,
        is_z_up: bool,
    },
    Grid(std::vec::IntoIter<Point>),
}

impl Source {
    /// Opens the points. Those of a file are all read once, so that a wrong line is found before any work.
    fn open(options: &PointOptions, scene: &Scene) -> Result<Self, Failure> {
        let PointOptions { points, grid, spacing, height, normal, probes, z_up } = options;
        let most = u64::from(MAX_SENSORS) / sensors_each(*probes) as u64;
        if let Some(place) = grid {
            let grid = Grid { place, spacing: spacing.unwrap_or(0.0), height: *height, normal: *normal };
            let points = grid.points(scene)?;
            if points.len() as u64 > most {
                return Err(too_many("the grid", points.len() as u64, most, "give a greater --spacing"));
            }
            return Ok(Self::Grid(points.into_iter()));
        }
        let path = points.as_deref().unwrap_or(Path::new("-"));
        let mut count = None;
        if is_file(path) {
            let mut read = Points::open(path, *probes)?;
            let mut points = 0;
            while read.next()?.is_some() {
                points += 1;
            }
            if points > most {
                let name = path.display().to_string();
                return Err(too_many(&name, points, most, "divide the points among several files"));
            }
            count = Some(points);
        }
        Ok(Self::File { points: Points::open(path, *probes)?, count, is_z_up: *z_up })
    }

    /// Number of points, if it is known.
    fn count(&self) -> Option<u64> {
        match self {
            Self::File { count, .. } => *count,
            Self::Grid(points) => Some(points.len() as u64),
        }
    }

    fn next(&mut self) -> Result<Option<Given>, Failure> {
        Ok(match self {
            Self::File { points, is_z_up, .. } => points.next()?.map(|given| {
                let turned = |[x, y, z]: [f64; 3]| if *is_z_up { [x, z, -y] } else { [x, y, z] };
                let point = Point { position: turned(given.position), normal: turned(given.normal) };
                Given { given, point }
            }),
            Self::Grid(points) => points.next().map(|point| Given { given: point, point }),
        })
    }

    /// Reads the next points, at most `most`.
    fn take(&mut self, most: usize) -> Result<Vec<Given>, Failure> {
        let mut taken = Vec::new();
        while taken.len() < most
            && let Some(point) = self.next()?
        {
            taken.push(point);
        }
        Ok(taken)
    }
}

/// A point as it is given, and in the scene's coordinates.
#[derive(Clone, Copy)]
struct Given {
    given: Point,
    point: Point,
}

/// Measures the points group by group.
fn measure(
    options: &MeasureOptions,
    mut source: Source,
    mut meter: Meter,
    photometry: Photometry,
    progress: &Progress,
) -> Result<Summary, Failure> {
    let all = source.count();
    let [first, end] = match (options.part, all) {
        (Some(part), Some(all)) => part.range(all),
        _ => [0, all.unwrap_or(u64::MAX)],
    };
    for _ in 0..first {
        source.next()?;
    }
    let are_probes = options.points.probes;
    let each = sensors_each(are_probes);
    let together = SENSORS_TOGETHER / each;
    let has_names = options.part.is_none_or(|part| part.number() == 1);
    let mut table = Table::create(&options.output, has_names, are_probes)?;
    let groups = all.map_or(1, |_| (end - first).div_ceil(together as u64).max(1));
    let (mut at, mut group) = (first, 0);
    let mut summary = Summary::new(options.units.threshold, are_probes);
    while at < end {
        let points = source.take(together.min((end - at) as usize))?;
        if points.is_empty() {
            break;
        }
        let sensors: Vec<Point> = if are_probes {
            points.iter().flat_map(|given| probe_points(given.point.position)).collect()
        } else {
            points.iter().map(|given| given.point).collect()
        };
        let observer: &dyn Observer =
            &Share { observer: progress, index: group, count: groups.max(group + 1) };
        let number = u32::try_from(at.saturating_mul(each as u64)).unwrap_or(u32::MAX);
        let readings = meter.measure(number, &sensors, observer)?;
        for (Given { given, .. }, readings) in points.iter().zip(readings.chunks(each)) {
            let irradiance = match readings {
                [reading] => {
                    table.write(given, reading, &photometry)?;
                    reading.irradiance()
                }
                _ => table.write_probe(given, readings)?,
            };
            summary.add(photometry.lux(irradiance));
        }
        at += points.len() as u64;
        group += 1;
    }
    table.finish()?;
    Ok(summary)
}

/// Number of sensors of a point.
fn sensors_each(are_probes: bool) -> usize {
    if are_probes { PROBE_DIRECTIONS } else { 1 }
}

fn too_many(name: &str, points: u64, most: u64, help: &str) -> Failure {
    let text = format!("{name} has {points} points, more than {most}");
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

/// Returns false for standard input and other pipes, which cannot be read twice.
fn is_file(path: &Path) -> bool {
    path.as_os_str() != "-" && std::fs::metadata(path).map_or(true, |found| found.is_file())
}
