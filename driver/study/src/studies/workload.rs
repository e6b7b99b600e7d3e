//! Converts measured counts to workloads of the cost model of Steinhurst's dissertation (2007), Table 7.1.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_render::RenderSettings;
use photoncard_render::cost_model::arithmetic::{Arithmetic, Work};
use photoncard_render::cost_model::{Cost, Machine, Symbols, Workload};

use super::super::measure::{Measurement, TileMeasurement};

type Count<'a> = &'a dyn Fn(&TileMeasurement) -> f64;

/// Workload of one frame, estimated from its sample of tiles. Bytes on the host's link are those of Table
/// 7.1, because they do not depend on the scene.
pub(super) fn of_frame(measured: &Measurement, pixels: f64, symbols: &Symbols) -> Workload {
    let total = |count: Count| measured.total(count).value;
    // Tiles are counted as if they had the size of Table 7.1's, so that the tile rates of all frames can be
    // compared.
    of(&total, pixels / symbols.tile_pixels, pixels, symbols)
}

/// Symbols of Table 7.1 with the numbers of tiles, rays, neighbours and photons of a render.
pub(super) fn symbols(settings: &RenderSettings) -> Symbols {
    let RenderSettings { photons, integrator, .. } = settings;
    let window = settings.window();
    Symbols {
        tiles: f64::from(window.width()) * f64::from(window.height()) / Symbols::NOMINAL.tile_pixels,
        gather_rays: f64::from(integrator.gather_rays),
        neighbors: f64::from(photons.neighbors),
        shadow_rays: f64::from(integrator.shadow_rays),
        photons: photons.count as f64,
        ..Symbols::NOMINAL
    }
}

/// Symbols as in [`symbols`], but with the number of photons in the measured frame's map as `N_PM`.
pub(super) fn symbols_of(settings: &RenderSettings, measured: &Measurement) -> Symbols {
    Symbols { photons: measured.map.photons as f64, ..symbols(settings) }
}

pub(super) fn of_tile(tile: &TileMeasurement, symbols: &Symbols) -> Workload {
    of(&|count: Count| count(tile), 1.0, symbols.tile_pixels, symbols)
}

fn of(total: &dyn Fn(Count) -> f64, tiles: f64, pixels: f64, symbols: &Symbols) -> Workload {
    let tables = total(&|tile| tile.counters.tables as f64);
    let gathers = total(&|tile| tile.counters.gathers as f64);
    let found = total(&|tile| tile.counters.photons_found as f64);
    Workload {
        eye_rays: total(&|tile| tile.counters.eye_rays as f64),
        shadow_rays: total(&|tile| tile.counters.shadow_rays as f64),
        gather_rays: total(&|tile| tile.counters.gather_rays as f64),
        survey_rays: total(&|tile| tile.counters.survey_rays as f64),
        ray_gathers: gathers - tables,
        table_gathers: tables,
        photons_per_gather: if gathers > 0.0 { found / gathers } else { 0.0 },
        interpolated_samples: total(&|tile| tile.counters.interpolated_samples as f64),
        records: total(&|tile| tile.counters.records as f64),
        photon_map_bytes: total(&|tile| tile.photon_map().dram_bytes as f64),
        scene_bytes: total(&|tile| tile.scene().dram_bytes as f64),
        tiles,
        bytes_to_host: pixels * symbols.pixel_bytes,
        bytes_from_host: tiles * symbols.command_bytes,
    }
}

/// Cost of a measured frame. In the naive order the whole reflection function is evaluated for every photon,
/// as in the dissertation's naive frame.
pub(super) fn cost(workload: &Workload, symbols: &Symbols, order: GatherOrder) -> Cost {
    if order == GatherOrder::Naive { Cost::naive(workload, symbols) } else { Cost::new(workload, symbols) }
}

/// Cost of a tile by counted arithmetic.
pub(super) fn counted(tile: &TileMeasurement, symbols: &Symbols) -> Cost {
    Cost::counted(&of_tile(tile, symbols), &arithmetic(tile, symbols))
}

pub(super) fn arithmetic(tile: &TileMeasurement, symbols: &Symbols) -> Arithmetic {
    Arithmetic::of(&Work::new(&tile.counters, &tile.contents, symbols.gather_rays))
}

/// Time that a chip takes for each tile, seconds: `max(bytes from DRAM / bandwidth, counted FLOPs / FLOPS)`.
pub(super) fn tile_seconds(measured: &Measurement, symbols: &Symbols, machine: &Machine) -> Vec<f64> {
    let seconds = |tile: &TileMeasurement| {
        let cost = counted(tile, symbols).total();
        (cost.dram_bytes / machine.bandwidth).max(cost.flops / machine.flops)
    };
    measured.tiles.iter().map(seconds).collect()
}
