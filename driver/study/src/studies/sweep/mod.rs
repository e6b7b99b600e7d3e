//! Sweep: a study of a user's scene, over any settings of the render and of the chip.

mod report;
mod reuse;
mod swept;

use std::collections::BTreeSet;

use photoncard_render::cost_model::Energy;
use serde_json::Value;

pub use self::swept::Hardware;
use self::swept::Swept;
pub(crate) use self::swept::SweptScene;
use super::super::axes::{Axes, Axis, AxisError};
use super::super::laboratory::Results;
use super::super::point::{Point, Task};
use super::super::report::Report;
use super::super::scale::machine_row;

/// Points that differ in the settings of some axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    axes: Axes,
    /// Points, in the order of [`Axes::combinations`]. Their task is [`Task::Traffic`].
    points: Vec<Point>,
    /// Hardware of each point.
    hardware: Vec<Hardware>,
}

impl Sweep {
    /// Creates the sweep over `axes`. `point` creates the point of a combination and its hardware from the
    /// name and the value of each axis. The point's task must be [`Task::Traffic`].
    ///
    /// # Errors
    /// If the axes cannot form a sweep, or `point` fails.
    pub fn new<E: From<AxisError>>(
        axes: Vec<Axis>,
        point: impl FnMut(Vec<(&str, &str)>) -> Result<(Point, Hardware), E>,
    ) -> Result<Self, E> {
        let axes = Axes::new(axes)?;
        let points: Result<Vec<_>, E> =
            axes.combinations().map(|indices| axes.values(&indices)).map(point).collect();
        let (points, hardware) = points?.into_iter().unzip();
        Ok(Self { axes, points, hardware })
    }

    /// Points of the sweep.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Creates the report on the results, without provenance. Times are those of one chip of each point's
    /// hardware.
    ///
    /// # Panics
    /// If `results` lack one of the points.
    pub(crate) fn report(&self, scene: SweptScene, results: &Results) -> Report {
        let Self { axes, points, hardware } = self;
        report::report(&Swept { scene, axes, points, hardware, results })
    }

    /// Names and values of the points' settings, for a report's provenance. The value of a setting in which
    /// points differ is `varied`.
    pub(crate) fn rows(&self) -> Vec<(String, String)> {
        let points = self.points.iter().zip(&self.hardware);
        let all: Vec<_> = points.map(|(point, hardware)| settings(point, hardware)).collect();
        let names: BTreeSet<_> = all.iter().flatten().map(|(name, _)| name).collect();
        let value = |name: &String| {
            let values: BTreeSet<_> =
                all.iter().flatten().filter(|row| row.0 == *name).map(|row| &row.1).collect();
            match values.first() {
                Some(value) if values.len() == 1 => (*value).clone(),
                _ => "varied".to_owned(),
            }
        };
        names.into_iter().map(|name| (name.clone(), value(name))).collect()
    }
}

/// Names and values of a point's settings and hardware.
fn settings(point: &Point, hardware: &Hardware) -> Vec<(String, String)> {
    let text = |value: Value| match value {
        Value::String(text) => text,
        Value::Null => "default".to_owned(),
        other => other.to_string(),
    };
    let named = point.settings.of_pixels().into_iter().chain(point.settings.of_work());
    let mut rows: Vec<_> = named.map(|(name, value)| (name, text(value))).collect();
    let mut add = |name: &str, value: String| rows.push((name.to_owned(), value));
    add("set", point.assignments.join("; "));
    add("card", hardware.chip.clone());
    let (name, machine) = machine_row(&hardware.machine);
    add(&name, machine);
    let Energy { sram_pj_per_byte, dram_pj_per_byte, flop_pj, sram_mm2_per_mb } = hardware.energy;
    let sram = sram_pj_per_byte.map_or("published by size".to_owned(), |energy| energy.to_string());
    add("energy of a byte of a cache (pJ)", sram);
    add("energy of a byte of DRAM (pJ)", dram_pj_per_byte.to_string());
    add("energy of an operation (pJ)", flop_pj.to_string());
    add("area of on-chip memory (mm^2/MB)", sram_mm2_per_mb.to_string());
    if let Task::Traffic { caches, sample, least_tiles, .. } = &point.task {
        add("cache", caches.to_string());
        add("sample", format!("{sample}, at least {least_tiles} tiles"));
    }
    rows
}
