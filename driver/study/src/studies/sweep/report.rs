//! Report of a sweep: memory traffic by structure (kind of data), time and energy at every point, and plots
//! over each axis.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_picture::choice::Choice;
use photoncard_render::cost_model::{Cost, Prediction};
use photoncard_render::emulator::memory_model::CacheSettings;
use photoncard_shared::address::Structure;

use super::super::super::axes::Axis;
use super::super::super::measure::Measurement;
use super::super::super::point::{Point, Task};
use super::super::super::report::{self, Block, Cell, Report, Series, Table, XScale, YScale, slug};
use super::super::super::sample::Estimate;
use super::super::arithmetic;
use super::super::present::{
    cell, gigabyte_point, gigabytes, how_it_counts, page, panel, plot, section, series, table,
};
use super::super::workload::{of_frame, symbols};
use super::reuse;
use super::swept::{Hardware, Swept};

/// Maximum number of lines in a plot.
const MAX_LINES: usize = 8;

/// Frame rate for which chips are counted.
const RATE: f64 = 30.0;

pub(super) fn report(swept: &Swept) -> Report {
    let Swept { axes, hardware, .. } = *swept;
    let machine = &hardware[0].machine;
    let chip = match hardware.iter().all(|other| other.machine == *machine) {
        true => machine.to_string(),
        false => "the rates of its row".to_owned(),
    };
    let scene = swept.scene.name;
    let introduction = vec![
        format!("Work and memory traffic of {scene} in frames that differ in the settings below."),
        how_it_counts(),
        format!(
            "The time of a chip is that of {chip}, at its counted arithmetic. Memory and arithmetic work at once, so that a frame \
             takes the longer of both. Energy is that of bytes read from and written to caches, of bytes of DRAM, and of counted \
             operations: no leakage, no control, no buffers. It compares chips, and is a lower bound."
        ),
    ];
    let mut sections = vec![section("Points", vec![table("points", swept.totals())])];
    for (index, axis) in axes.list().iter().enumerate().filter(|(_, axis)| axis.values.len() > 1) {
        sections.push(section(
            &format!("By {}", axis.name),
            vec![swept.plot(index), swept.plot_of_structures(index)],
        ));
    }
    sections.push(section("Structures", vec![table("structures", swept.structures())]));
    sections.extend(reuse::section_of(swept));
    page(&format!("Sweep of {scene}"), introduction, sections)
}

impl Swept<'_> {
    /// Table with a row for each point.
    fn totals(&self) -> Table {
        let heads = self.heads(&[
            ("tiles rendered", ""),
            ("gather rays", "million"),
            ("gathers", "million"),
            ("photon map, raw", "GB"),
            ("photon map", "GB"),
            ("scene", "GB"),
            ("photon map and scene", "GB"),
            ("photon map", "bytes a gather"),
            ("chip's memory", "s"),
            ("chip's arithmetic", "s"),
            ("chips for 30 frames/s", "chips"),
            ("energy of caches", "J"),
            ("energy of DRAM", "J"),
            ("energy of arithmetic", "J"),
            ("energy", "J"),
            ("on-chip memory", "mm^2"),
        ]);
        let mut table = Table::new("Work, bytes from DRAM, time of a chip and energy, of a frame", heads);
        let points = self.axes.combinations().zip(self.points).zip(self.hardware);
        for ((indices, point), hardware) in points {
            let measured = self.results.traffic(point);
            let gathers = measured.gathers();
            let Demand { memory, arithmetic, chips, energy } = Demand::of(point, measured, hardware);
            let area = hardware.energy.sram_mm2(f64::from(point.chip().budget().sram_bytes));
            let mut row = self.values(&indices);
            row.extend([
                measured.rendered.into(),
                cell(measured.total(|tile| tile.counters.gather_rays as f64), 1e6),
                cell(gathers, 1e6),
                gigabytes(measured.raw_bytes()),
                gigabytes(measured.photon_map_bytes()),
                gigabytes(measured.scene_bytes()),
                gigabytes(measured.dram_bytes()),
                (gathers.value > 0.0).then(|| measured.photon_map_bytes().value / gathers.value).into(),
                memory.into(),
                arithmetic.into(),
                chips.into(),
            ]);
            row.extend(energy.map(Cell::from));
            row.extend([energy.iter().sum::<f64>().into(), area.into()]);
            table.push(row);
        }
        self.identify(&mut table, 1);
        table
    }

    /// Structures (kinds of data) that a chip reads at any point of the sweep.
    fn read_structures(&self) -> Vec<Structure> {
        let is_read = |structure: &Structure| {
            let mut measured = self.points.iter().map(|point| self.results.traffic(point));
            measured.any(|measured| measured.tiles.iter().any(|tile| tile.reads_of(*structure).requests > 0))
        };
        Structure::ALL.into_iter().filter(is_read).collect()
    }

    /// Table with a row for each point and structure.
    fn structures(&self) -> Table {
        let heads = self.heads(&[
            ("structure", ""),
            ("requests", "million"),
            ("raw", "GB"),
            ("from DRAM", "GB"),
            ("from DRAM", "% of the point"),
        ]);
        let mut table = Table::new("Reads of a frame by structure", heads);
        let structures = self.read_structures();
        for (indices, point) in self.axes.combinations().zip(self.points) {
            let measured = self.results.traffic(point);
            let all = measured.dram_bytes().value;
            for &structure in &structures {
                let bytes = measured.total(|tile| tile.reads_of(structure).dram_bytes as f64);
                let mut row = self.values(&indices);
                row.extend([
                    structure.name().into(),
                    cell(measured.total(|tile| tile.reads_of(structure).requests as f64), 1e6),
                    gigabytes(measured.total(|tile| tile.reads_of(structure).raw_bytes as f64)),
                    gigabytes(bytes),
                    (all > 0.0).then(|| 100.0 * bytes.value / all).into(),
                ]);
                table.push(row);
            }
        }
        self.identify(&mut table, structures.len());
        table
    }

    /// Plot of the bytes of photon map and scene over the values of one axis, with a line for each
    /// combination of the other axes' values. An axis with which the plot would have more than [`MAX_LINES`]
    /// lines keeps its first value.
    fn plot(&self, axis: usize) -> Block {
        let (varied, kept) = self.other_axes(axis);
        let lines: Vec<Vec<usize>> = (self.axes.combinations())
            .filter(|indices| (0..indices.len()).all(|at| varied.contains(&at) || indices[at] == 0))
            .collect();
        let of = |title: &str, bytes: fn(&Measurement) -> Estimate| {
            let lines = lines.iter().map(|indices| {
                let name: Vec<_> = (self.axes.values(indices).into_iter().enumerate())
                    .filter(|(at, _)| varied.contains(at))
                    .map(|(_, (name, value))| format!("{name} {value}"))
                    .collect();
                self.line(name.join(", "), axis, indices, bytes)
            });
            let label = (self.axes.list()[axis].name.as_str(), "", scale(&self.axes.list()[axis]));
            panel(title, label, ("from DRAM", "GB a frame", YScale::Log10), lines.collect())
        };
        let panels =
            vec![of("photon map", Measurement::photon_map_bytes), of("scene", Measurement::scene_bytes)];
        let name = &self.axes.list()[axis].name;
        plot(
            &format!("by-{}", slug(name)),
            &format!("Bytes from DRAM by {name}"),
            &self.caption(&kept),
            panels,
        )
    }

    /// Plot of the bytes from DRAM over the values of one axis, with a line for each structure. The other
    /// axes have their first value.
    fn plot_of_structures(&self, axis: usize) -> Block {
        let first = vec![0; self.axes.list().len()];
        let lines = self.read_structures().into_iter().map(|structure| {
            self.line(structure.name().to_owned(), axis, &first, |measured| {
                measured.total(|tile| tile.reads_of(structure).dram_bytes as f64)
            })
        });
        let Axis { name, .. } = &self.axes.list()[axis];
        let label = (name.as_str(), "", scale(&self.axes.list()[axis]));
        let axes = panel("", label, ("from DRAM", "GB a frame", YScale::Log10), lines.collect());
        let others: Vec<_> = (0..first.len()).filter(|&other| other != axis).collect();
        let title = format!("Bytes from DRAM of each structure by {name}");
        plot(&format!("structures-by-{}", slug(name)), &title, &self.caption(&others), vec![axes])
    }

    /// Line of `bytes` over the values of one axis. The other axes have the values of the combination
    /// `indices`.
    fn line(
        &self,
        name: String,
        axis: usize,
        indices: &[usize],
        bytes: impl Fn(&Measurement) -> Estimate,
    ) -> Series {
        let mut indices = indices.to_vec();
        let mut points: Vec<report::Point> = places(&self.axes.list()[axis])
            .into_iter()
            .enumerate()
            .map(|(value, x)| {
                indices[axis] = value;
                gigabyte_point(x, bytes(self.measured(&indices)))
            })
            .collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        series(name, points)
    }

    /// Returns the indices of the axes other than `axis`, in two lists: axes whose values differ between the
    /// lines of a plot, and axes that keep their first value.
    fn other_axes(&self, axis: usize) -> (Vec<usize>, Vec<usize>) {
        let (mut varied, mut kept, mut lines) = (Vec::new(), Vec::new(), 1);
        for (other, Axis { values, .. }) in
            self.axes.list().iter().enumerate().filter(|(other, _)| *other != axis)
        {
            if lines * values.len() <= MAX_LINES {
                lines *= values.len();
                varied.push(other);
            } else {
                kept.push(other);
            }
        }
        (varied, kept)
    }
}

/// Horizontal positions of the values: the values if all are positive numbers or sizes, otherwise their
/// indices.
fn places(axis: &Axis) -> Vec<f64> {
    numbers(axis).unwrap_or_else(|| (0..axis.values.len()).map(|index| index as f64).collect())
}

fn scale(axis: &Axis) -> XScale {
    match numbers(axis) {
        Some(_) => XScale::Log2,
        None => XScale::Categories(axis.values.clone()),
    }
}

/// Converts the values to positive numbers; `None` if any is not one. The suffixes K and M multiply a number
/// by 2^10 and 2^20, as in sizes of caches.
fn numbers(axis: &Axis) -> Option<Vec<f64>> {
    let number = |text: &String| {
        let (digits, unit) = match text.strip_suffix('K') {
            Some(digits) => (digits, 1024.0),
            None => text.strip_suffix('M').map_or((text.as_str(), 1.0), |digits| (digits, 1_048_576.0)),
        };
        let value = digits.parse::<f64>().ok()? * unit;
        (value > 0.0 && value.is_finite()).then_some(value)
    };
    axis.values.iter().map(number).collect()
}

/// Demand of a frame on the hardware.
struct Demand {
    /// Time that the memory of one chip takes, seconds.
    memory: f64,
    /// Time that the arithmetic of one chip takes, seconds.
    arithmetic: f64,
    /// Chips for [`RATE`] frames a second; `None` if the host's link does not carry them.
    chips: Option<u64>,
    /// Energies of caches, of DRAM and of arithmetic, J.
    energy: [f64; 3],
}

impl Demand {
    fn of(point: &Point, measured: &Measurement, Hardware { machine, energy, .. }: &Hardware) -> Self {
        let symbols = symbols(&point.settings);
        let workload = of_frame(measured, symbols.pixels(), &symbols);
        let cost = Cost::counted(&workload, &arithmetic::of_frame(measured, &symbols));
        let total = cost.total();
        let caches = cache_traffic(point, measured);
        let caches = caches.map(|(traffic, bytes)| energy.sram_joules(traffic, bytes)).iter().sum();
        Self {
            memory: total.dram_bytes / machine.bandwidth,
            arithmetic: total.flops / machine.flops,
            chips: Prediction::new(&workload, &cost, machine).chips_needed(RATE).overall,
            energy: [
                caches,
                energy.dram_joules(measured.dram_bytes().value),
                energy.flop_joules(total.flops),
            ],
        }
    }
}

/// Bytes that are read from, or filled into, the caches of photon map and scene in a frame, and the sizes of
/// these caches, bytes.
fn cache_traffic(point: &Point, measured: &Measurement) -> [(f64, f64); 2] {
    let waits = point.settings.schedule.order == GatherOrder::Buckets;
    let sizes = match point.task {
        Task::Traffic { caches: CacheSettings::Split { by_work: Some(caches), .. }, .. } if waits => {
            // Gathers read the photon map, and rays the scene.
            [caches.gathering.bytes, caches.casting.bytes]
        }
        Task::Traffic { caches: CacheSettings::Split { photon, scene, .. }, .. } => {
            [photon.bytes, scene.bytes]
        }
        Task::Traffic { caches: CacheSettings::Unified(both), .. } => [both.bytes; 2],
        Task::Quality { .. } => [0; 2],
    };
    let photon_map =
        measured.total(|tile| (tile.photon_map().raw_bytes + tile.photon_map().dram_bytes) as f64);
    let scene = measured.total(|tile| (tile.scene().raw_bytes + tile.scene().dram_bytes) as f64);
    [(photon_map.value, f64::from(sizes[0])), (scene.value, f64::from(sizes[1]))]
}
