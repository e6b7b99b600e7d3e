//! Tables of counted arithmetic: operations of each unit per ray and per gather, compared with the constants
//! of Table 7.1.

use photoncard_picture::choice::Choice;
use photoncard_render::cost_model::arithmetic::{Arithmetic, ChipPart, Operations, Unit, Work};
use photoncard_render::cost_model::{Cost, Symbols, Workload};

use super::super::measure::Measurement;
use super::super::report::{Cell, Table};
use super::present::columns;

/// Arithmetic of one frame, estimated from its sample of tiles.
pub(super) fn of_frame(measured: &Measurement, symbols: &Symbols) -> Arithmetic {
    let mut sum = Arithmetic::default();
    for tile in &measured.tiles {
        let work = Work::new(&tile.counters, &tile.contents, symbols.gather_rays);
        sum.add(&Arithmetic::of(&work).times(tile.stands_for as f64));
    }
    sum
}

/// A frame whose arithmetic was counted.
pub(super) struct CountedFrame<'a> {
    pub(super) name: &'a str,
    pub(super) workload: &'a Workload,
    /// Cost by Table 7.1's constants.
    pub(super) nominal: &'a Cost,
    pub(super) arithmetic: &'a Arithmetic,
}

/// Table of the operations of each unit per piece of work: per ray in the ray caster, per gather in the
/// gather unit, per gather ray in the controller.
pub(super) fn operations(frames: &[CountedFrame]) -> Table {
    let heads = [
        ("frame", ""),
        ("of a", ""),
        ("unit", ""),
        ("add", ""),
        ("multiply", ""),
        ("divide", ""),
        ("square root", ""),
        ("compare", ""),
        ("FLOPs", ""),
        ("conversions", ""),
    ];
    let mut table = Table::new(
        "Operations of each unit: of a ray, of a gather with the reflection of direct light, and of the controller for a gather ray",
        columns(&heads),
    );
    for frame in frames {
        let pieces = [
            ("ray", frame.workload.rays(), ChipPart::RayCaster),
            ("gather", frame.workload.gathers(), ChipPart::GatherUnit),
            ("gather ray", frame.workload.gather_rays, ChipPart::Controller),
        ];
        for (piece, count, part) in pieces {
            let mut sum = Operations::default();
            for &unit in Unit::ALL.iter().filter(|unit| unit.part() == part) {
                let operations = frame.arithmetic.unit(unit).times(1.0 / count.max(1.0));
                sum.add(&operations);
                table.push(row(frame.name, piece, unit.name(), &operations));
            }
            table.push(row(frame.name, piece, "all", &sum));
        }
    }
    table
}

fn row(frame: &str, piece: &str, unit: &str, operations: &Operations) -> Vec<Cell> {
    let [add, multiply, divide, square_root, compare, convert] = operations.to_array();
    let numbers = [add, multiply, divide, square_root, compare, operations.flops(), convert];
    let names = [frame, piece, unit].map(Cell::from);
    names.into_iter().chain(numbers.map(Cell::from)).collect()
}

/// Table of the FLOPs per ray, per gather and per frame, by Table 7.1's constants and as counted.
pub(super) fn comparison(frames: &[CountedFrame]) -> Table {
    let heads = [
        ("frame", ""),
        ("ray, Table 7.1", "FLOPs"),
        ("ray, counted", "FLOPs"),
        ("gather, Table 7.1", "FLOPs"),
        ("gather, counted", "FLOPs"),
        ("frame, Table 7.1", "GFLOP"),
        ("frame, counted", "GFLOP"),
        ("counted over Table 7.1", ""),
    ];
    let mut table = Table::new("FLOPs by Table 7.1's constants and counted", columns(&heads));
    for CountedFrame { name, workload, nominal, arithmetic } in frames {
        let of_ray = |flops: f64| flops / workload.rays().max(1.0);
        let of_gather = |flops: f64| flops / workload.gathers().max(1.0);
        let flops = |part: ChipPart| arithmetic.sum(|unit| unit.part() == part).flops();
        let counted = arithmetic.sum(|_| true).flops();
        let assumed = nominal.total().flops;
        table.push(vec![
            (*name).into(),
            of_ray(nominal.ray_caster.flops).into(),
            of_ray(flops(ChipPart::RayCaster)).into(),
            of_gather(nominal.gather_unit.flops).into(),
            of_gather(flops(ChipPart::GatherUnit)).into(),
            (assumed / 1e9).into(),
            (counted / 1e9).into(),
            (counted / assumed).into(),
        ]);
    }
    table
}
