//! Cost model of the dissertation (chapter 7): arithmetic and memory traffic of a frame, and the number of
//! chips that they need.
//!
//! [`Symbols`] are the parameters of Table 7.1. A [`Workload`] counts the rays, gathers and bytes of one
//! frame. A [`Cost`] is the number of FLOPs and DRAM bytes of this work in each unit of the chip. A
//! [`Prediction`] is the speed of a [`Machine`] at such a cost. [`Flops`] are the operations of a measured
//! run by the constants of Table 7.1; [`arithmetic`] counts those of this firmware. A [`Distribution`] gives
//! the time of an upload to all chips, and [`Energy`] the energy of a frame. `docs/scaling.md` has the
//! formulas.

pub mod arithmetic;
mod distribution;
mod energy;
mod prediction;
mod rates;
mod symbols;
pub mod timing;
mod workload;

pub use distribution::Distribution;
pub use energy::Energy;
pub use prediction::{ChipsNeeded, Machine, Prediction, Resource};
pub use rates::Rates;
pub use symbols::{Origin, Symbol, SymbolError, Symbols};
pub use workload::Workload;

use photoncard_shared::counters::Counters;
use serde::Serialize;

use self::arithmetic::{Arithmetic, ChipPart};

/// Number of colour channels. The reflection function is evaluated once per channel.
const CHANNELS: f64 = 3.0;

/// Cost of one frame in one unit of the chip, summed over all chips.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnitCost {
    /// Floating-point operations.
    pub flops: f64,
    /// Bytes from DRAM.
    pub dram_bytes: f64,
}

/// Cost of one frame in each unit of the chip, summed over all chips.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Cost of all rays in the ray caster.
    pub ray_caster: UnitCost,
    /// Cost of importance tables and the irradiance cache in the controller. Both are on the chip and read no
    /// DRAM.
    pub controller: UnitCost,
    /// Cost of the photon gather unit: photon searches, including those for importance tables, and all
    /// reflection.
    pub gather_unit: UnitCost,
}

impl Cost {
    /// Cost if reflection functions are evaluated in two stages. The first stage is evaluated once at the end
    /// of a gather ray, the second for each photon.
    pub fn new(workload: &Workload, symbols: &Symbols) -> Self {
        let [stage_1, stage_2] = [symbols.reflection_stage_1, symbols.reflection_stage_2];
        let of_gather = stage_1 + workload.photons_per_gather * stage_2;
        let reflection = workload.ray_gathers * of_gather + reflected_rays(workload) * (stage_1 + stage_2);
        Self {
            controller: UnitCost { flops: controller_flops(workload, symbols), dram_bytes: 0.0 },
            ..Self::of_units(workload, symbols, reflection)
        }
    }

    /// Cost if the whole reflection function is evaluated for every photon, without irradiance cache and
    /// importance tables.
    ///
    /// For [`Workload::naive`] this is
    /// `T P [(1 + N_FG + N_S) C_RayCast + N_FG C_G + (N_FG k + N_FG + N_S) 3 (C_B1 + C_B2)]` FLOPs per frame,
    /// which gives the dissertation's 7.4 TFLOPS at 30 frames/s. The dissertation's own formula is not in the
    /// public excerpts: this formula is a hypothesis that gives the published number.
    pub fn naive(workload: &Workload, symbols: &Symbols) -> Self {
        let evaluations = workload.ray_gathers * workload.photons_per_gather + reflected_rays(workload);
        let reflection = evaluations * (symbols.reflection_stage_1 + symbols.reflection_stage_2);
        Self::of_units(workload, symbols, reflection)
    }

    /// Cost by counted arithmetic instead of the constants of Table 7.1. The ray caster intersects boxes and
    /// triangles and evaluates surfaces. The gather unit searches for photons and computes all reflection.
    /// The controller computes directions, irradiance cache and pixels.
    pub fn counted(workload: &Workload, arithmetic: &Arithmetic) -> Self {
        let flops = |part: ChipPart| arithmetic.sum(|unit| unit.part() == part).flops();
        Self {
            ray_caster: UnitCost { flops: flops(ChipPart::RayCaster), dram_bytes: workload.scene_bytes },
            controller: UnitCost { flops: flops(ChipPart::Controller), dram_bytes: 0.0 },
            gather_unit: UnitCost {
                flops: flops(ChipPart::GatherUnit),
                dram_bytes: workload.photon_map_bytes,
            },
        }
    }

    /// Cost of ray caster and gather unit. `reflection` is the FLOPs per channel of all reflection functions.
    fn of_units(workload: &Workload, symbols: &Symbols, reflection: f64) -> Self {
        Self {
            ray_caster: UnitCost {
                flops: workload.rays() * symbols.ray_cast,
                dram_bytes: workload.scene_bytes,
            },
            controller: UnitCost::default(),
            gather_unit: UnitCost {
                flops: workload.gathers() * symbols.gather + CHANNELS * reflection,
                dram_bytes: workload.photon_map_bytes,
            },
        }
    }

    /// Sum of the costs of all units.
    pub fn total(&self) -> UnitCost {
        let units = [self.ray_caster, self.controller, self.gather_unit];
        UnitCost {
            flops: units.iter().map(|unit| unit.flops).sum(),
            dram_bytes: units.iter().map(|unit| unit.dram_bytes).sum(),
        }
    }
}

/// Number of gather and shadow rays. Their light is reflected at the point that an eye ray hits.
fn reflected_rays(workload: &Workload) -> f64 {
    workload.gather_rays + workload.shadow_rays
}

/// FLOPs of importance tables and irradiance cache. The formula and its constants are those of this project,
/// because the public excerpts of the dissertation do not contain its formula.
fn controller_flops(workload: &Workload, symbols: &Symbols) -> f64 {
    let table = workload.photons_per_gather * symbols.table_photon + symbols.table_cells * symbols.table_cell;
    let interpolation = symbols.records_per_pixel * symbols.interpolation;
    let record = symbols.gather_rays * symbols.record_ray;
    workload.table_gathers * table + workload.interpolated_samples * interpolation + workload.records * record
}

/// Floating-point operations of each unit of the chip by the constants of Table 7.1, summed over all chips.
/// [`Arithmetic`] has the operations of this firmware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Flops {
    /// Operations of all rays.
    pub ray_caster: f64,
    /// Operations of importance tables and the irradiance cache.
    pub controller: f64,
    /// Operations of photon searches and all reflection.
    pub gather_unit: f64,
}

impl Flops {
    /// Operations of the work that `counters` count, by the constants of Table 7.1. `gather_rays` is the
    /// number of gather rays per sample.
    pub fn by_table(counters: &Counters, gather_rays: u32) -> Self {
        let symbols = Symbols { gather_rays: f64::from(gather_rays), ..Symbols::NOMINAL };
        let cost = Cost::new(&Workload::counted(counters), &symbols);
        Self {
            ray_caster: cost.ray_caster.flops,
            controller: cost.controller.flops,
            gather_unit: cost.gather_unit.flops,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_naive_hypothesis_makes_7_4_tflops() {
        let symbols = Symbols::NOMINAL;
        let cost = Cost::naive(&Workload::naive(&symbols), &symbols).total();
        let tflops = symbols.frames_per_second * cost.flops / 1e12;
        assert!((tflops - 7.408).abs() < 0.0005, "{tflops}");
    }

    #[test]
    fn a_cost_grows_with_every_symbol() {
        let nominal = Symbols::NOMINAL;
        let total = |symbols: &Symbols| Cost::new(&Workload::nominal(symbols), symbols).total();
        let before = total(&nominal);
        let of_flops = [
            "P",
            "T",
            "N_FG",
            "k",
            "N_S",
            "C_J",
            "R_FG",
            "L_IC",
            "C_B1",
            "C_B2",
            "C_RayCast",
            "C_G",
            "C_IC",
            "C_IR",
            "C_T1",
            "C_T2",
        ];
        let of_bytes = ["P", "T", "N_FG", "N_S", "R_FG", "B_G", "B_R"];
        for (symbol, value) in nominal.rows() {
            let mut symbols = nominal;
            symbols.set(&format!("{}={}", symbol.notation, 1.5 * value)).unwrap();
            let after = total(&symbols);
            // An interpolated pixel costs less than one with a final gather.
            let falls = symbol.notation == "R_IC";
            assert_eq!(after.flops > before.flops, of_flops.contains(&symbol.notation), "{symbol:?}");
            assert_eq!(
                after.dram_bytes > before.dram_bytes,
                of_bytes.contains(&symbol.notation),
                "{symbol:?}"
            );
            assert_eq!(
                after.flops < before.flops || after.dram_bytes < before.dram_bytes,
                falls,
                "{symbol:?}"
            );
        }
    }

    #[test]
    fn two_stages_evaluate_the_first_once_per_gather() {
        let symbols = Symbols::NOMINAL;
        let workload = Workload::naive(&symbols);
        let saved =
            Cost::naive(&workload, &symbols).total().flops - Cost::new(&workload, &symbols).total().flops;
        let expected = 3.0 * 12.0 * 99.0 * workload.ray_gathers;
        assert!((saved / expected - 1.0).abs() < 1e-9, "{saved} {expected}");
    }

    #[test]
    fn a_measured_frame_costs_its_counted_arithmetic() {
        let symbols = Symbols::NOMINAL;
        let workload = Workload { eye_rays: 2.0, survey_rays: 3.0, scene_bytes: 70.0, ..Workload::default() };
        let cost = Cost::new(&workload, &symbols);
        assert_eq!(cost.ray_caster, UnitCost { flops: 5.0 * 330.0, dram_bytes: 70.0 });
        assert_eq!(cost.total(), cost.ray_caster);
    }
}
