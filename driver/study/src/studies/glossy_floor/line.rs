//! Lines of figure 6.17: the renders of each line, and measures of the flatness of a curve.

use photoncard_cards::scheduler::GatherOrder::{self, DirectionBins, Hash, Naive, Sort, Tiled};
use photoncard_picture::choice::Choice;
use photoncard_render::Sampling;

use super::super::super::laboratory::Results;
use super::super::super::measure::{Measurement, TileMeasurement};
use super::super::super::point::Point;
use super::super::super::report::Figure;
use super::super::super::sample::{Estimate, Ratio};
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
    scale.pick(&[1, 2, 4, 8, 16, 32, 64, 128], &[1, 16, 128])
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

/// Key figures of measurements over the exponent: change, with the confidence interval of the tiles that all
/// have in common, spread, and greatest value. `name` returns the name of a quantity's figure.
pub(super) fn figures(measured: &[&Measurement], name: impl Fn(&str) -> String) -> Vec<Figure> {
    let bytes = |tile: &TileMeasurement| tile.photon_map().dram_bytes as f64;
    let curve: Vec<_> = measured.iter().map(|measured| measured.photon_map_bytes()).collect();
    let greatest = curve.iter().map(|estimate| estimate.value).fold(0.0, f64::max);
    let change = measured.last().zip(measured.first()).map(|(last, first)| last.over(first, bytes));
    let change = change.map(|Ratio { value, lower, upper }| {
        Figure::new(name("last-over-first"), key(GLOSSY), value, "").within(lower, upper)
    });
    let others = [
        Figure::new(name("greatest-over-least"), key(GLOSSY), spread(&curve), ""),
        Figure::new(name("greatest-gigabytes"), key(GLOSSY), greatest / GIGA, "GB"),
    ];
    change.into_iter().chain(others).collect()
}

/// Ratio of the maximum of a curve to its minimum.
pub(super) fn spread(curve: &[Estimate]) -> f64 {
    let greatest = curve.iter().map(|estimate| estimate.value).fold(0.0, f64::max);
    greatest / curve.iter().map(|estimate| estimate.value).fold(f64::INFINITY, f64::min)
}
