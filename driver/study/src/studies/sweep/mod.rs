//! Sweep: a study of a user's scene, over any settings of the render and of the chip.

mod report;

use std::collections::BTreeSet;

use photoncard_picture::choice::Choice;
use photoncard_render::cost_model::Machine;
use serde_json::Value;

use super::super::axes::{Axes, Axis, AxisError};
use super::super::laboratory::Results;
use super::super::point::{Point, Task};
use super::super::report::Report;

/// Points that differ in the settings of some axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    axes: Axes,
    /// Points, in the order of [`Axes::combinations`]. Their task is [`Task::Traffic`].
    points: Vec<Point>,
}

impl Sweep {
    /// Creates the sweep over `axes`. `point` creates the point of a combination from the name and the value
    /// of each axis. The point's task must be [`Task::Traffic`].
    ///
    /// # Errors
    /// If the axes cannot form a sweep, or `point` fails.
    pub fn new<E: From<AxisError>>(
        axes: Vec<Axis>,
        point: impl FnMut(Vec<(&str, &str)>) -> Result<Point, E>,
    ) -> Result<Self, E> {
        let axes = Axes::new(axes)?;
        let points: Result<_, E> =
            axes.combinations().map(|indices| axes.values(&indices)).map(point).collect();
        Ok(Self { points: points?, axes })
    }

    /// Points of the sweep.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Creates the report on the results, without provenance. Times are those of one chip of `machine`.
    ///
    /// # Panics
    /// If `results` lack one of the points.
    pub(crate) fn report(&self, scene: &str, results: &Results, machine: &Machine) -> Report {
        report::report(scene, &self.axes, &self.points, results, machine)
    }

    /// Names and values of the points' settings, for a report's provenance. The value of a setting in which
    /// points differ is `varied`.
    pub(crate) fn rows(&self) -> Vec<(String, String)> {
        let all: Vec<_> = self.points.iter().map(settings).collect();
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

/// Names and values of a point's settings.
fn settings(point: &Point) -> Vec<(String, String)> {
    let text = |value: Value| match value {
        Value::String(text) => text,
        Value::Null => "default".to_owned(),
        other => other.to_string(),
    };
    let named = point.settings.of_pixels().into_iter().chain(point.settings.of_work());
    let mut rows: Vec<_> = named.map(|(name, value)| (name, text(value))).collect();
    let mut add = |name: &str, value: String| rows.push((name.to_owned(), value));
    add("set", point.assignments.join("; "));
    if let Task::Traffic { chip, caches, sample, least_tiles } = &point.task {
        add("card", chip.name().to_owned());
        add("cache", caches.to_string());
        add("sample", format!("{sample}, at least {least_tiles} tiles"));
    }
    rows
}
