//! Table of a measurement: a line a point, CSV.

use std::f64::consts::PI;
use std::io::{self, BufWriter, Write};

use miette::{MietteDiagnostic, Report};
use photoncard_driver::output::{OutputError, PendingFile};
use photoncard_driver::render::measure::{PROBE_ORDERS, Point, Reading, probe};
use photoncard_driver::scene::Scene;

use crate::arguments::{TextOutput, UnitOptions};
use crate::failure::Failure;

/// Names of the columns, with their units. `error_lx` is the standard error of `illuminance_lx`.
const HEAD: &str = "x,y,z,nx,ny,nz,illuminance_lx,direct_lx,indirect_lx,error_lx,\
                    direct_r_w_m2,direct_g_w_m2,direct_b_w_m2,indirect_r_w_m2,indirect_g_w_m2,indirect_b_w_m2";

/// Conversion of irradiance to illuminance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Photometry {
    /// Luminous efficacy, lm/W.
    pub(super) lumens_per_watt: f64,
    /// Weights of red, green and blue.
    pub(super) weights: [f64; 3],
}

impl Photometry {
    /// Conversion by options, or by the units of the scene's lights.
    pub(super) fn new(options: &UnitOptions, scene: &Scene) -> Result<Self, Failure> {
        let lumens_per_watt = options.lumens_per_watt.unwrap_or(scene.lumens_per_watt().into());
        let weights = options.weights;
        let is_possible = lumens_per_watt.is_finite()
            && lumens_per_watt > 0.0
            && weights.iter().all(|weight| *weight >= 0.0)
            && weights.iter().sum::<f64>() > 0.0;
        if is_possible {
            return Ok(Self { lumens_per_watt, weights });
        }
        let text = "lumens per watt are a positive number, and weights are not negative";
        let help =
            "leave out --lumens-per-watt and --weights, or give 179 and 0.265,0.670,0.065 for Radiance";
        Err(Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help))))
    }

    /// Illuminance of an irradiance, lx.
    pub(super) fn lux(&self, irradiance: [f64; 3]) -> f64 {
        let weighted: f64 = self.weights.iter().zip(irradiance).map(|(weight, light)| weight * light).sum();
        self.lumens_per_watt * weighted
    }
}

/// Table that is being written. A file appears once it is whole.
pub(super) enum Table {
    File(BufWriter<PendingFile>, std::path::PathBuf),
    StandardOutput(BufWriter<io::Stdout>),
}

impl Table {
    /// Creates the table, with the names of its columns if `has_names`: of probes, or of points.
    pub(super) fn create(output: &TextOutput, has_names: bool, are_probes: bool) -> Result<Self, Failure> {
        let mut table = match output {
            TextOutput::StandardOutput => Self::StandardOutput(BufWriter::new(io::stdout())),
            TextOutput::File(path) => {
                let file = PendingFile::create(path).map_err(|error| Failure::work_error(&error))?;
                Self::File(BufWriter::new(file), path.clone())
            }
        };
        if has_names {
            table.line(&if are_probes { head_of_probes() } else { HEAD.to_owned() })?;
        }
        Ok(table)
    }

    /// Writes the line of a point.
    pub(super) fn write(
        &mut self,
        point: &Point,
        reading: &Reading,
        photometry: &Photometry,
    ) -> Result<(), Failure> {
        let Reading { direct, indirect, error } = *reading;
        let exact = [point.position, point.normal].into_iter().flatten().map(|number| number.to_string());
        let illuminances = [reading.irradiance(), direct, indirect].map(|light| photometry.lux(light));
        let error = photometry.lumens_per_watt * error;
        let measured = illuminances.into_iter().chain([error]).chain(direct).chain(indirect);
        // As many digits as a measurement has.
        let text = |number: f64| if number.is_nan() { String::new() } else { (number as f32).to_string() };
        let measured = measured.map(text);
        self.line(&exact.chain(measured).collect::<Vec<_>>().join(","))
    }

    /// Writes the line of a probe: its place, and its coefficients by the readings of its directions. Returns
    /// the mean irradiance of all normals, W/m^2.
    pub(super) fn write_probe(&mut self, point: &Point, readings: &[Reading]) -> Result<[f64; 3], Failure> {
        let exact = point.position.into_iter().map(|number| number.to_string());
        let coefficients = probe(readings);
        let measured = coefficients.iter().flatten().map(|number| (*number as f32).to_string());
        self.line(&exact.chain(measured).collect::<Vec<_>>().join(","))?;
        let [mean, ..] = coefficients;
        Ok(mean.map(|value| value / (4.0 * PI).sqrt()))
    }

    /// Completes the table.
    pub(super) fn finish(self) -> Result<(), Failure> {
        match self {
            Self::StandardOutput(mut out) => out.flush().map_err(|error| Failure::output(&error)),
            Self::File(file, path) => {
                let file = file.into_inner().map_err(|error| not_written(path, error.into_error()))?;
                file.commit().map_err(|error| Failure::work_error(&error))
            }
        }
    }

    fn line(&mut self, line: &str) -> Result<(), Failure> {
        match self {
            Self::StandardOutput(out) => writeln!(out, "{line}").map_err(|error| Failure::output(&error)),
            Self::File(file, path) => {
                writeln!(file, "{line}").map_err(|source| not_written(path.clone(), source))
            }
        }
    }
}

/// Names of the columns of probes: `l2_m-1_g` is the green coefficient of degree 2 and order -1.
fn head_of_probes() -> String {
    let names = PROBE_ORDERS
        .iter()
        .flat_map(|[degree, order]| ["r", "g", "b"].map(|channel| format!("l{degree}_m{order}_{channel}")));
    ["x", "y", "z"].map(str::to_owned).into_iter().chain(names).collect::<Vec<_>>().join(",")
}

fn not_written(path: std::path::PathBuf, source: io::Error) -> Failure {
    Failure::work_error(&OutputError::Write { path, source })
}
