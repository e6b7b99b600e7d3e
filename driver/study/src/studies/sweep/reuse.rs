//! Reuse of cache lines at each point of a sweep: classes of misses, and distances between reads of a line.

use photoncard_picture::choice::Choice;
use photoncard_render::emulator::reuse::{BINS, ReuseCounts};
use photoncard_shared::address::Structure;

use super::super::super::measure::Measurement;
use super::super::super::report::{Block, Point, Section, Table, XScale, YScale};
use super::super::super::sample::Estimate;
use super::super::present::{cell, panel, plot, section, series, table, text};
use super::swept::Swept;

/// A million reads or misses.
const MILLION: f64 = 1e6;

/// Section on the reuse of lines; `None` if it was not counted.
pub(super) fn section_of(swept: &Swept) -> Option<Section> {
    let structures = counted(swept);
    if structures.is_empty() {
        return None;
    }
    let explanation = text(
        "The distance of a read is the number of other lines of the cache that were read since the last read of its line. Misses are \
         compulsory (first read of a line since the cache was emptied), of capacity (a fully associative cache of equal size, which \
         replaces the least recently used line, misses too) or conflicts (the others; negative where the cache hits more often than \
         a fully associative one).",
    );
    let blocks = vec![
        explanation,
        table("reuse", misses(swept, &structures)),
        histogram(swept, &structures),
        Block::Data { name: "reuse-distances".to_owned(), table: distances(swept, &structures) },
    ];
    Some(section("Reuse of lines", blocks))
}

/// Structures whose reuse was counted, with a read at any point.
fn counted(swept: &Swept) -> Vec<Structure> {
    let is_read = |structure: &Structure| {
        let all = swept.points.iter().flat_map(|point| &swept.results.traffic(point).tiles);
        let mut counts = all.filter_map(|tile| tile.reuse_of(*structure));
        counts.any(|counts| counts.compulsory > 0)
    };
    Structure::ALL.into_iter().filter(is_read).collect()
}

/// Estimate of a count of one structure in the frame.
fn total(measured: &Measurement, structure: Structure, count: impl Fn(&ReuseCounts) -> f64) -> Estimate {
    measured.total(|tile| tile.reuse_of(structure).map_or(0.0, &count))
}

/// Table with a row for each point and structure.
fn misses(swept: &Swept, structures: &[Structure]) -> Table {
    let heads = swept.heads(&[
        ("structure", ""),
        ("misses", "million"),
        ("compulsory", "million"),
        ("capacity", "million"),
        ("conflict", "million"),
    ]);
    let mut table = Table::new("Misses of a frame by structure and class", heads);
    for (indices, point) in swept.axes.combinations().zip(swept.points) {
        let measured = swept.results.traffic(point);
        for &structure in structures {
            let mut row = swept.values(&indices);
            row.extend([
                structure.name().into(),
                cell(total(measured, structure, |counts| counts.misses as f64), MILLION),
                cell(total(measured, structure, |counts| counts.compulsory as f64), MILLION),
                cell(total(measured, structure, |counts| counts.capacity as f64), MILLION),
                cell(total(measured, structure, |counts| counts.conflict() as f64), MILLION),
            ]);
            table.push(row);
        }
    }
    swept.identify(&mut table, structures.len());
    table
}

/// Number of bins up to the largest distance of any point.
fn bins(swept: &Swept) -> usize {
    let tiles = swept.points.iter().flat_map(|point| &swept.results.traffic(point).tiles);
    let counts = tiles.filter_map(|tile| tile.reuse.as_ref()).flat_map(|reuse| reuse.iter());
    counts.map(|counts| counts.distances.len()).max().unwrap_or(0).min(BINS)
}

fn reads(measured: &Measurement, structure: Structure, bin: usize) -> Estimate {
    total(measured, structure, |counts| counts.distances.get(bin).copied().unwrap_or(0) as f64)
}

/// Table with a row for each point, structure and bin of distances.
fn distances(swept: &Swept, structures: &[Structure]) -> Table {
    let heads = swept.heads(&[
        ("structure", ""),
        ("least distance", "lines"),
        ("largest distance", "lines"),
        ("reads", "million"),
    ]);
    let mut table = Table::new("Reads of a frame by structure and reuse distance", heads);
    let bins = bins(swept);
    for (indices, point) in swept.axes.combinations().zip(swept.points) {
        let measured = swept.results.traffic(point);
        for &structure in structures {
            for bin in 0..bins {
                let [least, largest] = ReuseCounts::bin(bin);
                let mut row = swept.values(&indices);
                let count = cell(reads(measured, structure, bin), MILLION);
                row.extend([structure.name().into(), least.into(), largest.into(), count]);
                table.push(row);
            }
        }
    }
    swept.identify(&mut table, structures.len() * bins);
    table
}

/// Plot of the reads of the first point over the distance, with a line for each structure.
fn histogram(swept: &Swept, structures: &[Structure]) -> Block {
    let measured = swept.results.traffic(&swept.points[0]);
    let lines = structures.iter().map(|&structure| {
        // A logarithmic axis has no 0: the first bin is left out.
        let points = (1..bins(swept)).map(|bin| {
            let reads = reads(measured, structure, bin).scaled(1.0 / MILLION);
            Point::with_half_width(ReuseCounts::bin(bin)[0] as f64, reads.value, reads.half_width)
        });
        series(structure.name(), points.collect())
    });
    let axes = panel(
        "",
        ("reuse distance", "lines", XScale::Log2),
        ("reads", "million a frame", YScale::LinearFromZero),
        lines.collect(),
    );
    let all: Vec<_> = (0..swept.axes.list().len()).collect();
    plot("reuse-distances", "Reads by reuse distance", &swept.caption(&all), vec![axes])
}
