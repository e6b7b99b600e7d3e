//! Study of each technique by itself and of all together: rays, traffic and error, at equal numbers of rays
//! and at equal quality.

mod technique;
mod worth;

use self::technique::{
    ALL_IN_LINES, ALL_ON_LARGE, BY_CACHE_ERROR, CACHE, COMBINED, EXACT, LINES, MAX_TRAFFIC_RAYS, NAIVE,
    TILED, Technique, techniques,
};
use self::worth::{AtQuality, Measured};
use super::super::laboratory::Results;
use super::super::point::Point;
use super::super::report::{self, Block, Cell, Figure, NOT_REACHED, Report, Table, XScale, YScale, slug};
use super::super::sample::Ratio;
use super::super::scale::Scale;
use super::present::{
    GIGA, SCENES, cell, columns, gigabytes, how_it_counts, key, page, panel, plot, say, section, series,
    table, text,
};

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    let mut points = Vec::new();
    for (scene, _) in SCENES {
        for technique in techniques() {
            let traffic = technique.traffic_sweep(scale).into_iter();
            points.extend(traffic.map(|rays| technique.traffic(scale, scene, rays)));
            let quality = technique.sweep(scale).into_iter();
            points.extend(quality.flat_map(|rays| technique.quality(scale, scene, rays)));
        }
    }
    points
}

pub(super) fn report(scale: &Scale, results: &Results) -> Report {
    let introduction = vec![
        "What each technique saves alone, and all together, in three scenes: at as many gather rays, and at the quality that \
         the naive render has."
            .to_owned(),
        how_it_counts(),
        format!(
            "Quality is the root of the mean square error of indirect light, the light that gather rays bring from the photon map, of pixels \
             over all three channels, over its mean, against the same eye rays with {} gather rays by combined sampling and no irradiance \
             cache, in {} tiles of 16x16 pixels with each of {} seeds, which have photons and a reference of their own; pixels that show an emitter or nothing are left out. Direct light is in none of the \
             pictures that are compared: its noise is that of shadow rays. The reference's own noise is estimated and subtracted. Only \
             sampling, rays, the irradiance cache and precomputed irradiance change pixels. The \
             rays and bytes at equal quality lie on lines through the logarithms of error and rays, and of bytes and rays, the \
             last of which goes on beyond {} rays. Factors and rays have 95 % intervals, of the sampled tiles and by the jackknife over the tiles that \
             are compared.",
            scale.reference_rays, scale.quality_tiles, scale.quality_seeds, MAX_TRAFFIC_RAYS
        ),
    ];
    let scenes = SCENES.map(|(scene, name)| (Measured { scale, results, scene }, name));
    let mut together = vec![table("together", together(&scenes))];
    together.extend(scenes.iter().map(|(measured, name)| text(format!("{name}: {}.", verdicts(measured)))));
    together.extend(
        scenes.iter().filter_map(|(measured, name)| Some(text(format!("{name}: {}", best_error(measured)?)))),
    );
    if scale.is_nominal() {
        together.push(text(
            "The dissertation says almost two orders of magnitude for its three techniques together.",
        ));
    }
    let mut sections = vec![section("Together", together)];
    for (index, (measured, name)) in scenes.iter().enumerate() {
        let file = |kind: &str| format!("{kind}-{}", index + 1);
        let blocks = vec![
            table(&file("techniques"), at_equal_rays(measured, name)),
            table(&file("bytes"), bytes(measured, name)),
            text(reference(measured)),
            table(&file("equal-quality"), at_equal_quality(measured, name)),
            curves(&file("curves"), measured, name),
        ];
        sections.push(section(name, blocks));
    }
    let figures = scenes.iter().flat_map(|(measured, _)| figures(measured)).collect();
    Report { figures, ..page("The techniques, alone and together", introduction, sections) }
}

fn at_equal_rays(measured: &Measured, name: &str) -> Table {
    let heads = [
        ("technique", ""),
        ("gather rays", "million"),
        ("gathers", "million"),
        ("less than naive", "times"),
        ("RMSE", ""),
        ("mean", ""),
    ];
    let rays = measured.scale.gather_rays;
    let title = format!(
        "{name}: a frame at {rays} gather rays; RMSE of indirect light over its mean, mean over the same"
    );
    let mut table = Table::new(title, columns(&heads));
    for technique in techniques() {
        let traffic = measured.traffic(technique, rays);
        let quality = measured.quality(technique, rays);
        table.push(vec![
            technique.name.into(),
            cell(traffic.total(|tile| tile.counters.gather_rays as f64), 1e6),
            cell(traffic.gathers(), 1e6),
            measured.factor_at_equal_rays(technique).value.into(),
            quality.rmse().into(),
            quality.mean().into(),
        ]);
    }
    table
}

fn bytes(measured: &Measured, name: &str) -> Table {
    let heads = [("technique", ""), ("photon map", "GB"), ("scene", "GB"), ("all", "GB")];
    let rays = measured.scale.gather_rays;
    let title = format!("{name}: bytes from DRAM of a frame at {rays} gather rays");
    let mut table = Table::new(title, columns(&heads));
    for technique in techniques() {
        let traffic = measured.traffic(technique, rays);
        let bytes = [traffic.photon_map_bytes(), traffic.scene_bytes(), traffic.dram_bytes()];
        table.push(std::iter::once(technique.name.into()).chain(bytes.map(gigabytes)).collect());
    }
    table
}

/// Sentence that states the naive render's error and the noise of the reference.
fn reference(measured: &Measured) -> String {
    let quality = measured.quality(&NAIVE, measured.scale.gather_rays);
    format!(
        "The naive render's error is {} of the mean; the reference's own noise, which is subtracted, is {}.",
        say(quality.rmse()),
        say(quality.reference_noise())
    )
}

/// Cells with a ratio and its interval.
fn ratio_cells(ratio: Option<Ratio>) -> [Cell; 3] {
    match ratio {
        Some(Ratio { value, lower, upper }) => [value, lower, upper].map(Cell::from),
        None => [const { Cell::Empty }; 3],
    }
}

fn at_equal_quality(measured: &Measured, name: &str) -> Table {
    let heads = [
        ("technique", ""),
        ("rays", ""),
        ("rays from", ""),
        ("rays to", ""),
        ("from DRAM", "GB"),
        ("less than naive", "times"),
        ("from", "times"),
        ("to", "times"),
        ("note", ""),
    ];
    let title =
        format!("{name}: what each technique is worth at the RMSE of the naive render, with 95 % intervals");
    let mut table = Table::new(title, columns(&heads));
    for technique in techniques() {
        let worth = measured.worth(technique);
        let note = match worth.at {
            AtQuality::Met(_) => "",
            AtQuality::AtMost(_) => "at least: better with the fewest rays",
            AtQuality::Missed(_) => "not reached with the most rays",
        };
        let mut row = vec![Cell::from(technique.name)];
        row.extend(ratio_cells(Some(worth.rays())));
        row.push((worth.bytes.value / GIGA).into());
        row.extend(ratio_cells(measured.factor_at_quality(technique)));
        row.push(note.into());
        table.push(row);
    }
    table
}

fn curves(file: &str, measured: &Measured, name: &str) -> Block {
    let line = |technique: &Technique| {
        let on_curve = |rays| {
            let bytes = measured.traffic(technique, rays).dram_bytes();
            report::Point::new(bytes.value / GIGA, measured.quality(technique, rays).rmse())
        };
        series(technique.name, technique.traffic_sweep(measured.scale).into_iter().map(on_curve).collect())
    };
    let sampled = techniques().filter(|technique| technique.in_flight.is_none());
    let axes = panel(
        "",
        ("from DRAM", "GB a frame", XScale::Log10),
        ("RMSE over mean", "", YScale::Log10),
        sampled.map(line).collect(),
    );
    let caption = "Each line goes through the numbers of gather rays that were rendered; techniques that change no pixel are \
                   one point. Lower and farther left is better.";
    plot(file, &format!("{name}: error of indirect light by traffic"), caption, vec![axes])
}

/// Table of combinations in all scenes: exact reordering, all techniques on the reference chip, on the large
/// chip with several tiles in flight, and with gathers in card memory.
fn together(scenes: &[(Measured, &str)]) -> Table {
    let heads = [
        ("scene", ""),
        ("technique", ""),
        ("from DRAM, equal rays", "GB"),
        ("less than naive, equal rays", "times"),
        ("rays at equal quality", ""),
        ("less than naive, equal quality", "times"),
        ("from", "times"),
        ("to", "times"),
    ];
    let title = "All bytes from DRAM, against naive; tiles in flight and gathers in card memory: whole frames on one chip";
    let mut table = Table::new(title, columns(&heads));
    for (measured, name) in scenes {
        for technique in [&EXACT, &ALL_IN_LINES, &ALL_ON_LARGE].into_iter().chain(&BY_CACHE_ERROR) {
            let equal_rays = measured.traffic(technique, measured.scale.gather_rays).dram_bytes();
            let mut row = vec![
                (*name).into(),
                technique.name.into(),
                gigabytes(equal_rays),
                measured.factor_at_equal_rays(technique).value.into(),
                measured.worth(technique).at.rays().into(),
            ];
            row.extend(ratio_cells(measured.factor_at_quality(technique)));
            table.push(row);
        }
    }
    table
}

/// Technique with the fewest bytes at the naive render's error among those that differ in the error bound of
/// the irradiance cache; `None` if no such technique reaches it.
fn best_by_cache_error(measured: &Measured) -> Option<(&'static Technique, Ratio)> {
    let factors = BY_CACHE_ERROR
        .iter()
        .filter_map(|technique| Some((technique, measured.factor_at_quality(technique)?)));
    factors.max_by(|(_, first), (_, second)| first.value.total_cmp(&second.value))
}

/// Sentence that names the best error bound of the irradiance cache, and those from which no difference is
/// shown.
fn best_error(measured: &Measured) -> Option<String> {
    let error = |technique: &Technique| {
        technique.irradiance_error.map_or_else(String::new, |error| error.to_string())
    };
    let (best, factor) = best_by_cache_error(measured)?;
    let is_close = |technique: &&Technique| {
        let other = measured.factor_over(technique, best);
        technique.name != best.name && other.is_some_and(|other| other.lower <= 1.0)
    };
    let close: Vec<_> = BY_CACHE_ERROR.iter().filter(is_close).map(error).collect();
    let close = if close.is_empty() {
        "the others read more".to_owned()
    } else {
        format!("no difference is shown from {}", close.join(" and "))
    };
    Some(format!(
        "with gathers in card memory and errors of the irradiance cache of {}, {} reads the fewest bytes at equal quality, {} times \
         less than naive ({} to {}); {close}.",
        BY_CACHE_ERROR.each_ref().map(error).join(", "),
        error(best),
        say(factor.value),
        say(factor.lower),
        say(factor.upper),
    ))
}

/// Comparisons at equal quality whose outcome the report states in words: name, base, technique.
const COMPARISONS: [(&str, &Technique, &Technique); 3] = [
    ("irradiance cache alone, against tiles without it", &TILED, &CACHE),
    ("combined sampling alone, against naive", &NAIVE, &COMBINED),
    ("all techniques, against exact reordering alone", &EXACT, &ALL_IN_LINES),
];

fn verdicts(measured: &Measured) -> String {
    let verdict = |(name, base, technique)| format!("{name}, {}", measured.verdict(base, technique));
    COMPARISONS.map(verdict).join("; ")
}

/// Figure of a factor at equal quality; `None` if that quality is not reached.
fn factor_figure(name: &str, scene: &str, factor: Option<Ratio>) -> Figure {
    match factor {
        Some(Ratio { value, lower, upper }) => {
            Figure::new(name, key(scene), value, "times").within(lower, upper)
        }
        None => Figure::new(name, key(scene), NOT_REACHED, ""),
    }
}

fn figures(measured: &Measured) -> Vec<Figure> {
    let Measured { scale, scene, .. } = *measured;
    let error = measured.naive_error();
    let noise = measured.quality(&NAIVE, scale.gather_rays).reference_noise();
    let figure =
        |name: &str, value: f64, unit| Figure::new(format!("techniques.{name}"), key(scene), value, unit);
    let rmse = figure("rmse", error.value, "").within(error.lower, error.upper);
    let mut figures = vec![rmse, figure("reference-noise", noise, "")];
    for technique in techniques() {
        let slug = slug(technique.name);
        let bytes = measured.traffic(technique, scale.gather_rays).dram_bytes().scaled(1.0 / GIGA);
        let worth = measured.worth(technique);
        let gigabytes = figure(&format!("gigabytes.{slug}"), bytes.value, "GB");
        figures.push(gigabytes.within(bytes.value - bytes.half_width, bytes.value + bytes.half_width));
        let Ratio { value, lower, upper } = worth.rays();
        figures.push(figure(&format!("rays-at-equal-quality.{slug}"), value, "").within(lower, upper));
        let factor = measured.factor_at_equal_rays(technique);
        figures.push(
            figure(&format!("factor.{slug}"), factor.value, "times").within(factor.lower, factor.upper),
        );
        let name = format!("techniques.factor-at-equal-quality.{slug}");
        figures.push(factor_figure(&name, scene, measured.factor_at_quality(technique)));
    }
    let Ratio { value, lower, upper } = measured.bytes_over(&CACHE, &TILED);
    let saved = figure("saved-share.irradiance-cache", 1.0 - value, "");
    figures.push(saved.within(1.0 - upper, 1.0 - lower));
    let Ratio { value, lower, upper } = measured.bytes_over(&LINES, &EXACT);
    figures.push(figure("lines-over-reordering", value, "times").within(lower, upper));
    let over_exact = "techniques.factor-over-exact-reordering.all-techniques";
    figures.push(factor_figure(over_exact, scene, measured.factor_over(&EXACT, &ALL_IN_LINES)));
    let best = best_by_cache_error(measured).and_then(|(technique, _)| technique.irradiance_error);
    figures.extend(
        best.map(|error| Figure::new("techniques.best-cache-error", key(scene), error.to_string(), "")),
    );
    figures.extend(COMPARISONS.map(|(name, base, technique)| {
        let name = format!("techniques.verdict.{}", slug(name));
        Figure::new(name, key(scene), measured.verdict(base, technique), "")
    }));
    figures
}
