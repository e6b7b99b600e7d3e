//! Figure 6.17: memory traffic as a function of the exponent of a glossy floor.

mod line;
mod strip;

use photoncard_cards::scheduler::GatherOrder::{DirectionBins, Hash, Sort, Tiled};
use photoncard_picture::choice::Choice;
use photoncard_render::Sampling;

use self::line::{LINES, Line, bytes, change, curve, exponents, line_name, point, spread, sums_by_tile};
use super::super::laboratory::Results;
use super::super::measure::Measurement;
use super::super::point::Point;
use super::super::report::{Figure, Panel, Report, Table, XScale, YScale, slug};
use super::super::sample::{Estimate, Ratio, product_of_ratios};
use super::super::scale::Scale;
use super::present::{
    GIGA, GLOSSY, columns, gigabyte_point, gigabytes, how_it_counts, key, page, panel, plot, say, section,
    series, table, text,
};

/// Panels of the figure: whether the irradiance cache is on, and the title.
const PANELS: [(bool, &str); 2] =
    [(false, "without the irradiance cache"), (true, "with the irradiance cache")];

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    let mut points = Vec::new();
    for exponent in exponents(scale) {
        for (is_cached, _) in PANELS {
            points.extend(LINES.map(|line| point(scale, line, is_cached, exponent)));
        }
    }
    points.extend(strip::points(scale));
    points
}

pub(super) fn report(scale: &Scale, results: &Results) -> Report {
    let introduction = vec![
        "How the memory traffic of the photon map depends on how sharply a glossy floor reflects: the modified Cornell box \
         of figure 6.17, seen by the camera on its floor, with Phong exponents from 1 to 128, Jensen's kd-tree and a cache of \
         128 KB."
            .to_owned(),
        how_it_counts(),
        "The lines without a note sample gather rays by the reflection; those of combined importance sampling are marked."
            .to_owned(),
    ];
    let figure = |name: &str, title: &str, bytes: fn(&Measurement) -> Estimate| {
        let caption = "Left without, right with the irradiance cache.";
        plot(name, title, caption, panels(scale, results, bytes))
    };
    let dram = figure("dram", "Photon map from DRAM by the floor's exponent", Measurement::photon_map_bytes);
    let raw = figure("raw", "Raw bytes of the photon map by the floor's exponent", Measurement::raw_bytes);
    let flatness = table("claims", claims_table(scale, results));
    let claims = if scale.is_nominal() {
        let mut blocks = vec![text(
            "The figure is cited for three claims: the naive traffic falls as the reflection sharpens, that of the reordered \
             gathers is nearly flat, and both hold with the irradiance cache.",
        )];
        blocks.extend(PANELS.map(|(is_cached, name)| text(check(scale, results, is_cached, name))));
        blocks.push(flatness);
        section("The claims", blocks)
    } else {
        section("Flatness", vec![flatness])
    };
    let sections = vec![
        section("Bytes from DRAM", vec![dram, table("traffic", traffic(scale, results))]),
        section("Raw bytes", vec![raw]),
        claims,
        section("The floor alone", strip::blocks(scale, results)),
    ];
    let mut figures = strip::figures(scale, results);
    figures.push(reordering_over_exponent(scale, results));
    for (is_cached, _) in PANELS {
        figures.extend(LINES.iter().flat_map(|&line| picture_figures(scale, results, line, is_cached)));
    }
    Report { figures, ..page("Figure 6.17: a glossy floor", introduction, sections) }
}

/// Measurements of a line at each exponent.
fn measured<'a>(scale: &Scale, results: &'a Results, line: Line, is_cached: bool) -> Vec<&'a Measurement> {
    let at = |exponent| results.traffic(&point(scale, line, is_cached, exponent));
    exponents(scale).into_iter().map(at).collect()
}

/// Figure of what the order `hash` saves, compared with `tiled`, over what the greatest exponent saves of the
/// order `tiled`, compared with the least.
fn reordering_over_exponent(scale: &Scale, results: &Results) -> Figure {
    let [tiled, hash] =
        [Tiled, Hash].map(|order| measured(scale, results, (order, Sampling::Reflection), false));
    let (first, last) = (&tiled[0].tiles, &tiled[tiled.len() - 1].tiles);
    let ends = last.iter().map(bytes).zip(first.iter().map(bytes));
    let sums = sums_by_tile(&tiled).into_iter().zip(sums_by_tile(&hash));
    let of_tile = |((last, first), ((tiled, weight), (hash, _)))| ([tiled, hash, last, first], weight);
    let sample: Vec<_> = ends.zip(sums).map(of_tile).collect();
    let Ratio { value, lower, upper } = product_of_ratios(&sample);
    Figure::new("figure-6.17.reordering-over-exponent", key(GLOSSY), value, "times").within(lower, upper)
}

/// Key figures of a line in one of the panels.
fn picture_figures(scale: &Scale, results: &Results, line: Line, is_cached: bool) -> Vec<Figure> {
    let panel = if is_cached { "with-cache" } else { "without-cache" };
    let name = |quantity: &str| format!("figure-6.17.{quantity}.{panel}.{}", slug(&line_name(line)));
    let measured = measured(scale, results, line, is_cached);
    let sum = Estimate::of_total(&sums_by_tile(&measured));
    let Ratio { value, lower, upper } = sum.scaled(1.0 / measured.len() as f64 / GIGA).with_ends();
    let mean = Figure::new(name("mean-gigabytes"), key(GLOSSY), value, "GB").within(lower, upper);
    line::figures(&measured, name).into_iter().chain([mean]).collect()
}

fn panels(scale: &Scale, results: &Results, bytes: fn(&Measurement) -> Estimate) -> Vec<Panel> {
    let one = |(is_cached, name): (bool, &str)| {
        let lines = LINES.map(|line| {
            let points = exponents(scale).into_iter().map(|exponent| {
                let measured = results.traffic(&point(scale, line, is_cached, exponent));
                gigabyte_point(f64::from(exponent), bytes(measured))
            });
            series(line_name(line), points.collect())
        });
        let y = ("photon map", "GB a frame", YScale::LinearFromZero);
        panel(name, ("exponent n", "", XScale::Log2), y, lines.to_vec())
    };
    PANELS.map(one).to_vec()
}

fn traffic(scale: &Scale, results: &Results) -> Table {
    let heads = [
        ("irradiance cache", ""),
        ("line", ""),
        ("exponent", ""),
        ("gathers", "million"),
        ("raw", "GB"),
        ("from DRAM", "GB"),
    ];
    let mut table = Table::new("Photon map traffic of a frame", columns(&heads));
    for (is_cached, _) in PANELS {
        for line in LINES {
            for exponent in exponents(scale) {
                let measured = results.traffic(&point(scale, line, is_cached, exponent));
                table.push(vec![
                    if is_cached { "on" } else { "off" }.into(),
                    line_name(line).into(),
                    exponent.into(),
                    (measured.gathers().value / 1e6).into(),
                    gigabytes(measured.raw_bytes()),
                    gigabytes(measured.photon_map_bytes()),
                ]);
            }
        }
    }
    table
}

/// Bytes of the photon map fetched from DRAM at the first exponent, minus those at the last. Both renders
/// have the same tiles. The estimate uses the difference of each tile (paired samples), so that the variance
/// between tiles cancels.
fn fall(scale: &Scale, results: &Results, line: Line, is_cached: bool) -> Estimate {
    let of = |exponent| results.traffic(&point(scale, line, is_cached, exponent));
    let exponents = exponents(scale);
    let (first, last) = (of(exponents[0]), of(exponents[exponents.len() - 1]));
    let pairs = first.tiles.iter().zip(&last.tiles);
    let differences: Vec<_> =
        pairs.map(|(first, last)| (bytes(first) - bytes(last), first.stands_for)).collect();
    Estimate::of_total(&differences)
}

fn check(scale: &Scale, results: &Results, is_cached: bool, name: &str) -> String {
    let of = |line| curve(scale, results, line, is_cached);
    let naive = of(LINES[0]);
    let (first, last) = (naive[0], naive[naive.len() - 1]);
    let fall = fall(scale, results, LINES[0], is_cached);
    let verdict = match (fall.value.abs() > fall.half_width, fall.value > 0.0) {
        (true, true) => "it falls",
        (true, false) => "it rises",
        (false, _) => "its change is within the sampling error",
    };
    let reordered = [DirectionBins, Hash, Sort].map(|order| {
        let curve = of((order, Sampling::Reflection));
        let highest = curve.iter().map(|estimate| estimate.value).fold(0.0, f64::max);
        let range = spread(&curve);
        let share = 100.0 * (highest - highest / range) / first.value;
        format!(
            "{} by a factor of {} from its least to its greatest, a range of {} % of the naive value at n = 1",
            order.name(),
            say(range),
            say(share)
        )
    });
    format!(
        "Panel {name}. Naive: {} GB at n = 1 and {} GB at n = {}, a ratio of {}: {verdict} (by {} ± {} GB, of the same tiles). Reordered: {}.",
        say(first.value / 1e9),
        say(last.value / 1e9),
        exponents(scale).last().copied().unwrap_or(1),
        say(change(&naive)),
        say(fall.value / 1e9),
        say(fall.half_width / 1e9),
        reordered.join("; "),
    )
}

fn claims_table(scale: &Scale, results: &Results) -> Table {
    let heads = [
        ("irradiance cache", ""),
        ("line", ""),
        ("last over first exponent", ""),
        ("greatest over least", ""),
        ("naive over this, mean of all exponents", "times"),
    ];
    let mut table = Table::new("How flat the lines are", columns(&heads));
    for (is_cached, _) in PANELS {
        let naive = curve(scale, results, LINES[0], is_cached);
        for line in LINES {
            let curve = curve(scale, results, line, is_cached);
            let ratios = naive.iter().zip(&curve).map(|(naive, this)| naive.value / this.value);
            let mean = ratios.sum::<f64>() / curve.len() as f64;
            table.push(vec![
                if is_cached { "on" } else { "off" }.into(),
                line_name(line).into(),
                change(&curve).into(),
                spread(&curve).into(),
                mean.into(),
            ]);
        }
    }
    table
}
