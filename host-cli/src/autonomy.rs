//! Command `photoncard autonomy`: daylight autonomy by tables of measurements, one for each hour (IES LM-83).

use std::fmt::Write;
use std::path::Path;

use csv::{ReaderBuilder, StringRecord};
use miette::{MietteDiagnostic, Report};
use photoncard_driver::output;

use crate::arguments::{AutonomyOptions, TextOutput};
use crate::console::{counted, say, write_out};
use crate::failure::Failure;
use crate::outputs;

/// Columns that state a point.
const POINT: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
const ILLUMINANCE: &str = "illuminance_lx";

/// Counts the hours in which each point has the threshold, and prints the share of points that have enough.
pub(crate) fn run(options: &AutonomyOptions) -> Result<(), Failure> {
    let AutonomyOptions { tables, threshold, share, output } = options;
    if !(0.0..=f64::MAX).contains(threshold) || !(0.0..=1.0).contains(share) {
        let help = "an illuminance is a number of lux, 0 or more, and a share is 0 to 1";
        return Err(refusal("the threshold or the share is not possible".to_owned(), help));
    }
    let inputs: Vec<(&Path, &'static str)> = tables.iter().map(|path| (path.as_path(), "a table")).collect();
    let written: Vec<&Path> = output.iter().filter_map(TextOutput::path).collect();
    outputs::check(&inputs, &written, &[])?;
    let mut points: Vec<Hours> = Vec::new();
    for (number, table) in tables.iter().enumerate() {
        add_hour(table, (number > 0).then_some(tables[0].as_path()), *threshold, &mut points)?;
    }
    let hours = tables.len();
    match output {
        Some(TextOutput::StandardOutput) => write_out(&text(&points, hours))?,
        Some(TextOutput::File(path)) => {
            output::write(path, text(&points, hours).as_bytes())
                .map_err(|error| Failure::work_error(&error))?;
        }
        None => {}
    }
    let has_enough = |point: &&Hours| point.reached as f64 / hours as f64 >= *share;
    let enough = points.iter().filter(has_enough).count();
    let percent = 100.0 * enough as f64 / points.len().max(1) as f64;
    say(format_args!(
        "photoncard: {percent:.1} % of {} have {threshold} lx or more in {:.0} % of {}",
        counted(points.len(), "point"),
        100.0 * share,
        counted(hours, "hour")
    ));
    Ok(())
}

/// A point and the number of hours in which it has the threshold.
struct Hours {
    point: [String; 6],
    reached: usize,
}

/// Adds the hour of a table, whose points must be those of the table `first`, if it is not the first.
fn add_hour(
    path: &Path,
    first: Option<&Path>,
    threshold: f64,
    points: &mut Vec<Hours>,
) -> Result<(), Failure> {
    let fault = |error: csv::Error| {
        let text = format!("cannot read the table {}: {error}", path.display());
        refusal(text, "give tables that photoncard measure has written")
    };
    let mut reader = ReaderBuilder::new().from_path(path).map_err(fault)?;
    let columns = Columns::of(reader.headers().map_err(fault)?, path)?;
    let mut count = 0;
    for record in reader.records() {
        let record = record.map_err(fault)?;
        let line = record.position().map_or(0, csv::Position::line);
        let at_line = |reason: String| {
            refusal(
                format!("{}, line {line}: {reason}", path.display()),
                "give tables of the same points, which photoncard measure has written",
            )
        };
        let (point, illuminance) = columns.read(&record).map_err(at_line)?;
        match (points.get(count), first) {
            (Some(hours), _) if hours.point != point => {
                let first = first.unwrap_or(path).display();
                return Err(at_line(format!("its point is not the one of {first}")));
            }
            (None, Some(first)) => {
                return Err(at_line(format!("{} has only {}", first.display(), counted(count, "point"))));
            }
            (None, None) => points.push(Hours { point, reached: 0 }),
            (Some(_), _) => {}
        }
        points[count].reached += usize::from(illuminance >= threshold);
        count += 1;
    }
    if count == 0 {
        let text = format!("{} has no points", path.display());
        return Err(refusal(text, "give tables that photoncard measure has written"));
    }
    if count < points.len() {
        let text =
            format!("{} has {} of the {} points", path.display(), counted(count, "point"), points.len());
        return Err(refusal(text, "put the parts of a table together, or measure the hour again"));
    }
    Ok(())
}

/// Places of the columns in a table.
struct Columns {
    point: [usize; 6],
    illuminance: usize,
}

impl Columns {
    fn of(head: &StringRecord, path: &Path) -> Result<Self, Failure> {
        let place = |name: &str| {
            head.iter().position(|other| other == name).ok_or_else(|| {
                let text = format!("{} names no column {name}", path.display());
                refusal(text, "give tables that photoncard measure has written")
            })
        };
        let mut point = [0; 6];
        for (column, name) in point.iter_mut().zip(POINT) {
            *column = place(name)?;
        }
        Ok(Self { point, illuminance: place(ILLUMINANCE)? })
    }

    fn read(&self, record: &StringRecord) -> Result<([String; 6], f64), String> {
        let field = |column: usize| record.get(column).unwrap_or_default();
        let illuminance = field(self.illuminance).parse().ok().filter(|lux: &f64| lux.is_finite());
        let illuminance =
            illuminance.ok_or_else(|| format!("{:?} is no illuminance", field(self.illuminance)))?;
        Ok((self.point.map(|column| field(column).to_owned()), illuminance))
    }
}

/// Table of the shares.
fn text(points: &[Hours], hours: usize) -> String {
    let mut text = format!("{},autonomy\n", POINT.join(","));
    for Hours { point, reached } in points {
        let _ = writeln!(text, "{},{}", point.join(","), *reached as f64 / hours as f64);
    }
    text
}

fn refusal(text: String, help: &'static str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}
