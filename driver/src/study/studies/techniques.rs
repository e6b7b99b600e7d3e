//! Each technique alone and all together: rays, traffic and error, at equal numbers of rays and at equal quality.

use super::super::laboratory::Results;
use super::super::point::Point;
use super::super::report::{self, Block, Cell, Report, Table, XScale, YScale};
use super::super::scale::{IRRADIANCE_ERROR, Scale, WIDEST_TILE};
use super::present::{
    GIGA, cell, columns, gigabytes, how_it_counts, page, panel, plot, say, section, series, table, text,
};
use super::scenes::SCENES;
use crate::photon_map::PhotonLayout;
use crate::render::{Radiance, RenderSettings, Sampling};
use crate::scheduler::GatherOrder;

/// A combination of techniques.
struct Technique {
    name: &'static str,
    order: GatherOrder,
    sampling: Sampling,
    /// Error bound of the irradiance cache; `None` without the cache.
    irradiance_error: Option<f32>,
    radiance: Radiance,
    layout: PhotonLayout,
    tile: u32,
}

/// Side of the dissertation's tiles, pixels.
const TILE: u32 = 16;
const NAIVE: Technique = Technique {
    name: "naive",
    order: GatherOrder::Naive,
    sampling: Sampling::Reflection,
    irradiance_error: None,
    radiance: Radiance::Density,
    layout: PhotonLayout::Jensen,
    tile: TILE,
};
const ALL: Technique = Technique {
    name: "all techniques, jensen",
    order: GatherOrder::Sort,
    sampling: Sampling::Product,
    irradiance_error: Some(IRRADIANCE_ERROR),
    radiance: Radiance::Density,
    layout: PhotonLayout::Jensen,
    tile: WIDEST_TILE,
};
const ALL_IN_LINES: Technique =
    Technique { name: "all techniques, lines", layout: PhotonLayout::Lines, ..ALL };
/// The combinations that are measured. The irradiance cache has square tiles: rows of pixels share few records.
const TECHNIQUES: [Technique; 11] = [
    NAIVE,
    Technique { name: "sort", order: GatherOrder::Sort, ..NAIVE },
    Technique {
        name: "irradiance cache, tiled",
        order: GatherOrder::Tiled,
        irradiance_error: Some(IRRADIANCE_ERROR),
        ..NAIVE
    },
    Technique { name: "combined sampling", sampling: Sampling::Product, ..NAIVE },
    Technique { name: "lines", layout: PhotonLayout::Lines, ..NAIVE },
    Technique {
        name: "sort, lines, largest tiles",
        order: GatherOrder::Sort,
        layout: PhotonLayout::Lines,
        tile: WIDEST_TILE,
        ..NAIVE
    },
    Technique {
        name: "sort, lines, largest tiles, precomputed irradiance",
        order: GatherOrder::Sort,
        radiance: Radiance::Precomputed,
        layout: PhotonLayout::Lines,
        tile: WIDEST_TILE,
        ..NAIVE
    },
    ALL,
    ALL_IN_LINES,
    Technique { name: "all techniques, lines, cache error 0.1", irradiance_error: Some(0.1), ..ALL_IN_LINES },
    Technique {
        name: "all techniques, lines, precomputed irradiance",
        radiance: Radiance::Precomputed,
        ..ALL_IN_LINES
    },
];

impl Technique {
    fn settings(&self, scale: &Scale, gather_rays: u32) -> RenderSettings {
        scale.settings(self.order).with(|s| {
            s.photons.radiance = self.radiance;
            s.photons.layout = self.layout;
            s.integrator.gather_rays = gather_rays;
            s.integrator.sampling = self.sampling;
            s.integrator.irradiance_error = self.irradiance_error;
            s.schedule.tile = self.tile;
        })
    }

    fn traffic(&self, scale: &Scale, scene: &'static str, rays: u32) -> Point {
        scale.traffic(scene, self.settings(scale, rays))
    }

    /// The point of the technique's error. Order, layout and tiles do not change pixels: techniques that differ in them
    /// alone share the point.
    fn quality(&self, scale: &Scale, scene: &'static str, rays: u32) -> Point {
        let settings = self.settings(scale, rays);
        let shared = scale.settings(GatherOrder::Sort);
        let settings = settings.with(|s| {
            s.photons.layout = shared.photons.layout;
            s.schedule.order = shared.schedule.order;
            s.schedule.tile = shared.schedule.tile;
        });
        scale.quality(scene, settings)
    }

    /// Returns whether the technique's pixels differ from those of the naive render.
    fn changes_pixels(&self) -> bool {
        self.irradiance_error.is_some() || self.sampling != NAIVE.sampling || self.radiance != NAIVE.radiance
    }

    /// Numbers of gather rays that the technique is measured with, ascending.
    fn sweep(&self, scale: &Scale) -> Vec<u32> {
        if !self.changes_pixels() {
            return vec![scale.gather_rays];
        }
        let mut rays = scale.pick(&[6, 12, 25, 50, 100, 200], &[6, 12, 25, 50, 100]);
        rays.push(scale.gather_rays);
        rays.sort_unstable();
        rays.dedup();
        rays
    }
}

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    let mut points = Vec::new();
    for (scene, _) in SCENES {
        for technique in &TECHNIQUES {
            for rays in technique.sweep(scale) {
                points.push(technique.traffic(scale, scene, rays));
                points.push(technique.quality(scale, scene, rays));
            }
        }
    }
    points
}

/// Rays and bytes that a technique takes to reach an error.
#[derive(Clone, Copy, Debug, PartialEq)]
enum AtQuality {
    /// The error is reached with these rays and bytes.
    Met { rays: f64, bytes: f64 },
    /// The error is already reached with the fewest rays that were measured: fewer may do.
    AtMost { rays: f64, bytes: f64 },
    /// The error is not reached with the most rays that were measured.
    Missed { rays: f64, bytes: f64 },
}

/// A point of the curve of a technique: gather rays, RMSE, bytes from DRAM.
type OnCurve = [f64; 3];

/// First crossing of an error by a curve in ascending order of rays, interpolated linearly in the logarithms; `None`
/// for an empty curve.
fn at_quality(curve: &[OnCurve], rmse: f64) -> Option<AtQuality> {
    let &[rays, first, bytes] = curve.first()?;
    if first <= rmse {
        let is_only = curve.len() == 1;
        return Some(if is_only {
            AtQuality::Met { rays, bytes }
        } else {
            AtQuality::AtMost { rays, bytes }
        });
    }
    for pair in curve.windows(2) {
        let &[[rays, high, bytes], [more_rays, low, more_bytes]] = pair else { continue };
        if low <= rmse {
            let share = (high / rmse).ln() / (high / low).ln();
            let between = |from: f64, to: f64| from * (to / from).powf(share);
            return Some(AtQuality::Met {
                rays: between(rays, more_rays),
                bytes: between(bytes, more_bytes),
            });
        }
    }
    curve.last().map(|&[rays, _, bytes]| AtQuality::Missed { rays, bytes })
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
             cache, in {} tiles of 16x16 pixels; pixels that show an emitter or nothing are left out. Direct light is in none of the \
             pictures that are compared: its noise is that of shadow rays. The reference's own noise is estimated and subtracted. Only \
             sampling, rays, the irradiance cache and precomputed irradiance change pixels. The \
             bytes at equal quality lie on a line through the logarithms of error and bytes, between the numbers of rays \
             that were rendered.",
            scale.reference_rays, scale.quality_tiles
        ),
    ];
    let mut sections = vec![section("Together", vec![text(summary(scale, results))])];
    for (index, (scene, name)) in SCENES.into_iter().enumerate() {
        let file = |kind: &str| format!("{kind}-{}", index + 1);
        let blocks = vec![
            table(&file("techniques"), at_equal_rays(scale, results, scene, name)),
            table(&file("bytes"), bytes(scale, results, scene, name)),
            table(&file("equal-quality"), at_equal_quality(scale, results, scene, name)),
            curves(&file("curves"), scale, results, (scene, name)),
        ];
        sections.push(section(name, blocks));
    }
    page("The techniques, alone and together", introduction, sections)
}

fn naive_bytes(scale: &Scale, results: &Results, scene: &'static str) -> f64 {
    results.traffic(&NAIVE.traffic(scale, scene, scale.gather_rays)).dram_bytes().value
}

fn curve(scale: &Scale, results: &Results, scene: &'static str, technique: &Technique) -> Vec<OnCurve> {
    let on_curve = |rays| {
        let quality = results.quality(&technique.quality(scale, scene, rays));
        let bytes = results.traffic(&technique.traffic(scale, scene, rays)).dram_bytes();
        [f64::from(rays), quality.rmse(), bytes.value]
    };
    technique.sweep(scale).into_iter().map(on_curve).collect()
}

fn target(scale: &Scale, results: &Results, scene: &'static str) -> f64 {
    results.quality(&NAIVE.quality(scale, scene, scale.gather_rays)).rmse()
}

fn at_equal_rays(scale: &Scale, results: &Results, scene: &'static str, name: &str) -> Table {
    let heads = [
        ("technique", ""),
        ("gather rays", "million"),
        ("gathers", "million"),
        ("less than naive", "times"),
        ("RMSE", ""),
        ("mean", ""),
    ];
    let title = format!(
        "{name}: a frame at {} gather rays; RMSE over the reference's mean, mean over the same",
        scale.gather_rays
    );
    let mut table = Table::new(title, columns(&heads));
    let naive = naive_bytes(scale, results, scene);
    for technique in &TECHNIQUES {
        let measured = results.traffic(&technique.traffic(scale, scene, scale.gather_rays));
        let quality = results.quality(&technique.quality(scale, scene, scale.gather_rays));
        table.push(vec![
            technique.name.into(),
            cell(measured.total(|tile| tile.counters.gather_rays as f64), 1e6),
            cell(measured.gathers(), 1e6),
            (naive / measured.dram_bytes().value).into(),
            quality.rmse().into(),
            quality.mean().into(),
        ]);
    }
    table
}

fn bytes(scale: &Scale, results: &Results, scene: &'static str, name: &str) -> Table {
    let heads = [("technique", ""), ("photon map", "GB"), ("scene", "GB"), ("both", "GB")];
    let title = format!("{name}: bytes from DRAM of a frame at {} gather rays", scale.gather_rays);
    let mut table = Table::new(title, columns(&heads));
    for technique in &TECHNIQUES {
        let measured = results.traffic(&technique.traffic(scale, scene, scale.gather_rays));
        let bytes = [measured.photon_map_bytes(), measured.scene_bytes(), measured.dram_bytes()];
        table.push(std::iter::once(technique.name.into()).chain(bytes.map(gigabytes)).collect());
    }
    table
}

fn at_equal_quality(scale: &Scale, results: &Results, scene: &'static str, name: &str) -> Table {
    let heads =
        [("technique", ""), ("rays", ""), ("from DRAM", "GB"), ("less than naive", "times"), ("note", "")];
    let rmse = target(scale, results, scene);
    let title = format!("{name}: at the RMSE of the naive render, {} of the mean", say(rmse));
    let mut table = Table::new(title, columns(&heads));
    let naive = naive_bytes(scale, results, scene);
    for technique in &TECHNIQUES {
        let Some(found) = at_quality(&curve(scale, results, scene, technique), rmse) else { continue };
        let (rays, bytes, note) = match found {
            AtQuality::Met { rays, bytes } => (rays, bytes, ""),
            AtQuality::AtMost { rays, bytes } => (rays, bytes, "at least: better with the fewest rays"),
            AtQuality::Missed { rays, bytes } => (rays, bytes, "not reached with the most rays"),
        };
        let factor =
            if matches!(found, AtQuality::Missed { .. }) { Cell::Empty } else { (naive / bytes).into() };
        table.push(vec![technique.name.into(), rays.into(), (bytes / GIGA).into(), factor, note.into()]);
    }
    table
}

fn curves(file: &str, scale: &Scale, results: &Results, (scene, name): (&'static str, &str)) -> Block {
    let line = |technique: &Technique| {
        let points = curve(scale, results, scene, technique)
            .into_iter()
            .map(|[_, rmse, bytes]| report::Point::new(bytes / GIGA, rmse));
        series(technique.name, points.collect())
    };
    let axes = panel(
        "",
        ("from DRAM", "GB a frame", XScale::Log10),
        ("RMSE over mean", "", YScale::Log10),
        TECHNIQUES.iter().map(line).collect(),
    );
    let caption = "Each line goes through the numbers of gather rays that were rendered; techniques that change no pixel are \
                   one point. Lower and farther left is better.";
    plot(file, &format!("{name}: error by traffic"), caption, vec![axes])
}

fn summary(scale: &Scale, results: &Results) -> String {
    let all = &ALL_IN_LINES;
    let factors = SCENES.map(|(scene, name)| {
        let naive = naive_bytes(scale, results, scene);
        let same_rays = results.traffic(&all.traffic(scale, scene, scale.gather_rays)).dram_bytes().value;
        let curve = curve(scale, results, scene, all);
        let quality = match at_quality(&curve, target(scale, results, scene)) {
            Some(AtQuality::Met { bytes, .. }) => format!("{} times", say(naive / bytes)),
            Some(AtQuality::AtMost { bytes, .. }) => format!("at least {} times", say(naive / bytes)),
            Some(AtQuality::Missed { .. }) | None => "not reached".to_owned(),
        };
        format!("{name}: {} times less at as many rays, at equal quality {quality}", say(naive / same_rays))
    });
    let published = if scale.is_nominal() {
        " The dissertation says almost two orders of magnitude for its three techniques together."
    } else {
        ""
    };
    format!(
        "All techniques with photons in leaves that fill a line, against naive, photon map and scene together. {}.{published}",
        factors.join("; ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_quality_lies_between_the_points_of_a_curve() {
        // The error of independent rays.
        let curve: Vec<OnCurve> =
            [25.0, 100.0, 400.0].map(|rays: f64| [rays, rays.powf(-0.5), 7.0 * rays]).into();
        let Some(AtQuality::Met { rays, bytes }) = at_quality(&curve, 1.0 / 8.0) else { panic!() };
        assert!((rays - 64.0).abs() < 1e-9 && (bytes - 448.0).abs() < 1e-9, "{rays} {bytes}");
        assert_eq!(at_quality(&curve, 0.3), Some(AtQuality::AtMost { rays: 25.0, bytes: 175.0 }));
        assert_eq!(at_quality(&curve, 0.01), Some(AtQuality::Missed { rays: 400.0, bytes: 2800.0 }));
        assert_eq!(at_quality(&curve[..1], 0.2), Some(AtQuality::Met { rays: 25.0, bytes: 175.0 }));
        assert_eq!(at_quality(&[], 0.2), None);
    }
}
