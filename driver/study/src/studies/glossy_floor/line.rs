//! Lines of figure 6.17: the renders of each line, and measures of the flatness of a curve.

use photoncard_cards::scheduler::GatherOrder::{self, DirectionBins, Hash, Naive, Sort, Tiled};
use photoncard_picture::choice::Choice;
use photoncard_render::Sampling;

use super::super::super::laboratory::Results;
use super::super::super::point::Point;
use super::super::super::report::Figure;
use super::super::super::sample::{Estimate, Ratio};
use super::super::super::scale::Scale;
use super::super::present::{GLOSSY, key};

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
    change_within(curve).value
}

/// Ratio of the last value of a curve to its first, with its confidence interval.
fn change_within(curve: &[Estimate]) -> Ratio {
    let [first, last] = [curve.first(), curve.last()].map(|end| end.copied().unwrap_or_default());
    Ratio::new(last, first, 0.0)
}

/// Key figures of a curve: its change, with the confidence interval, and its spread. `name` returns the name
/// of a quantity's figure.
pub(super) fn figures(curve: &[Estimate], name: impl Fn(&str) -> String) -> [Figure; 2] {
    let Ratio { value, lower, upper } = change_within(curve);
    [
        Figure::new(name("last-over-first"), key(GLOSSY), value, "").within(lower, upper),
        Figure::new(name("greatest-over-least"), key(GLOSSY), spread(curve), ""),
    ]
}

/// Ratio of the maximum of a curve to its minimum.
pub(super) fn spread(curve: &[Estimate]) -> f64 {
    let greatest = curve.iter().map(|estimate| estimate.value).fold(0.0, f64::max);
    greatest / curve.iter().map(|estimate| estimate.value).fold(f64::INFINITY, f64::min)
}
