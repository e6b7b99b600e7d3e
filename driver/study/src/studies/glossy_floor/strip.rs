//! Traffic of the lowest strip of the picture, which shows only the glossy floor.
//!
//! The traffic of other parts of the picture hardly depends on the exponent of the floor. Curves of the whole
//! picture are therefore flatter.

use photoncard_picture::film::Window;

use super::super::super::laboratory::Results;
use super::super::super::point::{Point, Task};
use super::super::super::report::{Block, Figure, Table, slug};
use super::super::super::sample::{Estimate, SampleRate};
use super::super::super::scale::Scale;
use super::super::present::{GLOSSY, columns, gigabytes, key, say, table, text};
use super::line::{self, LINES, Line, change, exponents, line_name, spread};

/// Height of the picture divided by the height of the strip at its lower edge.
const DIVISOR: u32 = 32;
/// Maximum of `greatest value / least value` for a curve that the report calls nearly flat.
const NEARLY_FLAT: f64 = 1.1;

/// Point that renders all tiles of the strip, without the irradiance cache.
fn point(scale: &Scale, line: Line, exponent: u32) -> Point {
    let mut point = line::point(scale, line, false, exponent);
    let full = Window::full(scale.side, scale.side);
    point.settings.picture.crop = Some(Window { y0: scale.side - scale.side / DIVISOR, ..full });
    if let Task::Traffic { sample, .. } = &mut point.task {
        *sample = SampleRate::ALL;
    }
    point
}

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    let at = |exponent| LINES.map(|line| point(scale, line, exponent));
    exponents(scale).into_iter().flat_map(at).collect()
}

/// Bytes of the photon map fetched from DRAM, at each exponent.
fn curve(scale: &Scale, results: &Results, line: Line) -> Vec<Estimate> {
    let of = |exponent| results.traffic(&point(scale, line, exponent)).photon_map_bytes();
    exponents(scale).into_iter().map(of).collect()
}

pub(super) fn blocks(scale: &Scale, results: &Results) -> Vec<Block> {
    let (first, last) = ends(scale);
    let first = format!("n = {first}");
    let last = format!("n = {last}");
    let heads = [
        ("line", ""),
        (first.as_str(), "GB"),
        (last.as_str(), "GB"),
        ("last over first", ""),
        ("greatest over least", ""),
    ];
    let rows = scale.side / DIVISOR;
    let title = format!("Photon map from DRAM of the lowest {rows} rows, which show the floor alone");
    let mut flatness = Table::new(title, columns(&heads));
    for line in LINES {
        let curve = curve(scale, results, line);
        let [first, last] = [curve.first(), curve.last()].map(|value| value.copied().unwrap_or_default());
        flatness.push(vec![
            line_name(line).into(),
            gigabytes(first),
            gigabytes(last),
            change(&curve).into(),
            spread(&curve).into(),
        ]);
    }
    vec![text(verdict(scale, results)), table("floor-alone", flatness)]
}

/// First and last exponent.
fn ends(scale: &Scale) -> (u32, u32) {
    let exponents = exponents(scale);
    let [first, last] = [exponents.first(), exponents.last()].map(|end| end.copied().unwrap_or_default());
    (first, last)
}

/// Sentence that states which reordered lines are nearly flat over the floor.
fn verdict(scale: &Scale, results: &Results) -> String {
    let named = |line| (line_name(line), curve(scale, results, line));
    let naive = named(LINES[0]).1;
    // `tiled` reorders pixels, not gathers: each gather is done when its ray ends.
    let reordered = LINES.into_iter().filter(|(order, _)| order.has_bins());
    let (flat, other): (Vec<_>, Vec<_>) =
        reordered.map(named).partition(|(_, curve)| spread(curve) <= NEARLY_FLAT);
    let list = |curves: &[(String, Vec<Estimate>)]| {
        let named = curves.iter().map(|(name, curve)| format!("{name} ({})", say(change(curve))));
        if curves.is_empty() { "none".to_owned() } else { named.collect::<Vec<_>>().join(", ") }
    };
    let (first, last) = ends(scale);
    let published =
        if scale.is_nominal() { " The dissertation calls the reordered lines nearly flat." } else { "" };
    format!(
        "Bytes of the photon map at n = {last} over those at n = {first}, over the floor alone and without the irradiance cache: \
         naive {}.{published} Reordered lines within {} % from least to greatest: {}; not: {}.",
        say(change(&naive)),
        say(100.0 * (NEARLY_FLAT - 1.0)),
        list(&flat),
        list(&other)
    )
}

pub(super) fn figures(scale: &Scale, results: &Results) -> Vec<Figure> {
    let mut figures: Vec<_> = LINES
        .iter()
        .flat_map(|&line| {
            let at = |exponent| results.traffic(&point(scale, line, exponent));
            let measured: Vec<_> = exponents(scale).into_iter().map(at).collect();
            let name =
                |quantity: &str| format!("figure-6.17.{quantity}.floor-alone.{}", slug(&line_name(line)));
            line::figures(&measured, name)
        })
        .collect();
    figures.push(Figure::new("figure-6.17.verdict", key(GLOSSY), verdict(scale, results), ""));
    figures
}
