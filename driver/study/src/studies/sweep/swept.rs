//! Points of a sweep with their hardware and results, and the cells that all tables of the report share.

use photoncard_render::cost_model::{Energy, Machine};
use photoncard_render::{ChipModel, PROGRAM};
use photoncard_shared::image::LAYOUT_VERSION;

use super::super::super::axes::{Axes, Axis};
use super::super::super::laboratory::Results;
use super::super::super::measure::Measurement;
use super::super::super::point::Point;
use super::super::super::report::{Cell, Column, Table};
use super::super::present::columns;

/// Hardware on which a point of a sweep is computed to run. No measurement depends on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Hardware {
    /// Name of the chip, as the option `--card` takes it.
    pub chip: String,
    /// Machine for which times are computed.
    pub machine: Machine,
    /// Energies and area of the chip's parts.
    pub energy: Energy,
}

impl Hardware {
    /// Chips of a model, whose times are those of `machine`.
    pub fn new(model: &ChipModel, machine: Machine) -> Self {
        Self { chip: model.to_string(), machine, energy: model.energy() }
    }
}

/// Scene of a sweep in each row of its files.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SweptScene<'a> {
    pub(crate) name: &'a str,
    pub(crate) checksum: &'a str,
}

/// Points of a sweep, with their hardware and results.
pub(super) struct Swept<'a> {
    pub(super) scene: SweptScene<'a>,
    pub(super) axes: &'a Axes,
    pub(super) points: &'a [Point],
    pub(super) hardware: &'a [Hardware],
    pub(super) results: &'a Results,
}

impl Swept<'_> {
    pub(super) fn measured(&self, indices: &[usize]) -> &Measurement {
        self.results.traffic(&self.points[self.axes.point(indices)])
    }

    /// Columns of the axes, followed by `others`.
    pub(super) fn heads(&self, others: &[(&str, &str)]) -> Vec<Column> {
        let axes = self.axes.list().iter().map(|axis| Column::new(axis.name.as_str(), ""));
        axes.chain(columns(others)).collect()
    }

    /// Cells with the values of a combination. All cells of an axis are numbers, or all are texts.
    pub(super) fn values(&self, indices: &[usize]) -> Vec<Cell> {
        let axes = self.axes.list().iter().zip(indices);
        axes.map(|(Axis { values, .. }, &index)| typed(values, index)).collect()
    }

    /// Adds what identifies each row without the page to the files of a table, whose rows are `rows` for each
    /// point. A column whose name is that of an axis is left out: the axis has it.
    pub(super) fn identify(&self, table: &mut Table, rows: usize) {
        type Of = fn(&SweptScene, &Point, &Hardware) -> Cell;
        let columns: [(&str, Of); 7] = [
            ("scene", |scene, _, _| scene.name.into()),
            ("scene-checksum", |scene, _, _| scene.checksum.into()),
            ("seed", |_, point, _| point.settings.integrator.seed.into()),
            ("photons", |_, point, _| point.settings.photons.count.into()),
            ("chip", |_, _, hardware| hardware.chip.as_str().into()),
            ("program", |_, _, _| PROGRAM.into()),
            ("card-image-layout", |_, _, _| LAYOUT_VERSION.into()),
        ];
        let is_axis = |name: &str| self.axes.list().iter().any(|axis| axis.name == name);
        for (name, of) in columns.into_iter().filter(|(name, _)| !is_axis(name)) {
            let points = self.points.iter().zip(self.hardware);
            let cells = points.flat_map(|(point, hardware)| vec![of(&self.scene, point, hardware); rows]);
            table.add_to_files(Column::new(name, ""), cells.collect());
        }
    }

    /// Caption with the values of the axes that keep their first value.
    pub(super) fn caption(&self, kept: &[usize]) -> String {
        let axes = kept.iter().map(|&axis| &self.axes.list()[axis]);
        let values: Vec<_> = axes.map(|axis| format!("{} {}", axis.name, axis.values[0])).collect();
        if values.is_empty() { String::new() } else { format!("With {}.", values.join(", ")) }
    }
}

/// Cell with the value of an axis at an index: a number if all of its values are numbers.
fn typed(values: &[String], index: usize) -> Cell {
    let value = &values[index];
    if values.iter().all(|value| value.parse::<i64>().is_ok()) {
        return value.parse::<i64>().ok().into();
    }
    let number = |value: &String| value.parse::<f64>().ok().filter(|number| number.is_finite());
    if values.iter().all(|value| number(value).is_some()) {
        number(value).into()
    } else {
        value.as_str().into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_values_of_an_axis_are_all_numbers_or_all_texts() {
        let all = |values: &[&str]| {
            let values: Vec<_> = values.iter().map(|&value| value.to_owned()).collect();
            (0..values.len()).map(|index| typed(&values, index)).collect::<Vec<_>>()
        };
        assert_eq!(all(&["1", "-2"]), [Cell::Integer(1), Cell::Integer(-2)]);
        assert_eq!(all(&["1", "0.50"]), [Cell::from(1.0), Cell::from(0.5)]);
        assert_eq!(all(&["1", "auto"]), [Cell::from("1"), Cell::from("auto")]);
        assert_eq!(all(&["inf", "1"]), [Cell::from("inf"), Cell::from("1")]);
    }
}
