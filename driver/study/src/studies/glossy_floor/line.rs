//! Lines of figure 6.17: the renders of each line, and measures of the flatness of a curve.

use photoncard_cards::scheduler::GatherOrder::{self, DirectionBins, Hash, Naive, Sort, Tiled};
use photoncard_picture::choice::Choice;
use photoncard_render::Sampling;

use super::super::super::laboratory::Results;
use super::super::super::measure::{Measurement, TileMeasurement};
use super::super::super::point::Point;
use super::super::super::report::Figure;
use super::super::super::sample::{Estimate, Ratio, greatest};
use super::super::super::scale::Scale;
use super::super::present::{GIGA, GLOSSY, key};

/// A line of the figure: order of the gathers, and sampling of the rays.
pub(super) type Line = (GatherOrder, Sampling);

/// The seven lines of figure 6.17.
pub(super) const LINES: [Line; 7] = [
    (Naive, Sampling::Reflection),
    (Tiled, Sampling::Reflection),
    (DirectionBins, Sampling::Reflection),
    (Hash, Sampling::Reflection),
    (Sort, Sampling::Reflection),
    (DirectionBins, Sampling::Product),
    (Hash, Sampling::Product),
];
/// Phong exponents of the floor.
pub(super) fn exponents(scale: &Scale) -> Vec<u32> {
    scale.pick(&[1, 4, 32, 128], &[1, 16, 128])
}

/// Name of a line in the report.
pub(super) fn line_name((order, sampling): Line) -> String {
    match sampling {
        Sampling::Product => format!("{}, combined", order.name()),
        _ => order.name().to_owned(),
    }
}

/// Point of a line at an exponent, with or without the irradiance cache.
pub(super) fn point(scale: &Scale, (order, sampling): Line, is_cached: bool, exponent: u32) -> Point {
    let settings = scale.settings(order).with(|s| {
        s.picture.camera = Some("floor".to_owned());
        s.integrator.sampling = sampling;
        s.integrator.irradiance_error = scale.all_on().integrator.irradiance_error.filter(|_| is_cached);
    });
    let assignments = vec![format!("floor.exponent={exponent}")];
    Point { assignments, ..scale.traffic(GLOSSY, settings) }
}

/// Bytes of the photon map fetched from DRAM for a picture, at each exponent.
pub(super) fn curve(scale: &Scale, results: &Results, line: Line, is_cached: bool) -> Vec<Estimate> {
    let of = |exponent| results.traffic(&point(scale, line, is_cached, exponent)).photon_map_bytes();
    exponents(scale).into_iter().map(of).collect()
}

/// Ratio of the last value of a curve to its first.
pub(super) fn change(curve: &[Estimate]) -> f64 {
    curve.last().zip(curve.first()).map_or(f64::NAN, |(last, first)| last.value / first.value)
}

/// Key figures of measurements over the exponent: change, spread, and greatest value. Their confidence
/// intervals are of the tiles that all measurements have in common. `name` returns the name of a quantity's
/// figure.
pub(super) fn figures(measured: &[&Measurement], name: impl Fn(&str) -> String) -> Vec<Figure> {
    let change = measured.last().zip(measured.first()).map(|(last, first)| last.over(first, bytes));
    let pairs = measured.iter().flat_map(|one| measured.iter().map(|other| one.over(other, bytes)));
    let greatest_bytes = greatest(measured.iter().map(|one| one.photon_map_bytes().with_ends()));
    let figure = |quantity: &str, Ratio { value, lower, upper }: Ratio, giga: f64, unit| {
        let figure = Figure::new(name(quantity), key(GLOSSY), value / giga, unit);
        figure.within(lower / giga, upper / giga)
    };
    let others = [
        figure("greatest-over-least", greatest(pairs), 1.0, ""),
        figure("greatest-gigabytes", greatest_bytes, GIGA, "GB"),
    ];
    change.map(|change| figure("last-over-first", change, 1.0, "")).into_iter().chain(others).collect()
}

/// Bytes of the photon map that a tile fetches from DRAM.
pub(super) fn bytes(tile: &TileMeasurement) -> f64 {
    tile.photon_map().dram_bytes as f64
}

/// Bytes of the photon map of each tile, summed over measurements of the same tiles, and the tiles' weights.
pub(super) fn sums_by_tile(measured: &[&Measurement]) -> Vec<(f64, usize)> {
    let Some(first) = measured.first() else { return Vec::new() };
    let sum = |index: usize| measured.iter().map(|measured| bytes(&measured.tiles[index])).sum();
    first.tiles.iter().enumerate().map(|(index, tile)| (sum(index), tile.stands_for)).collect()
}

/// Ratio of the maximum of a curve to its minimum.
pub(super) fn spread(curve: &[Estimate]) -> f64 {
    let greatest = curve.iter().map(|estimate| estimate.value).fold(0.0, f64::max);
    greatest / curve.iter().map(|estimate| estimate.value).fold(f64::INFINITY, f64::min)
}
