//! Floating-point operations of a frame by Table 7.1: counted work at the table's constants.

use photoncard_shared::counters::Counters;
use serde::Serialize;

use super::{Cost, Symbols, Workload};

/// Floating-point operations of each unit of the chip, on all chips together, by the constants of Table 7.1.
/// The firmware's own operations are [`Arithmetic`](super::arithmetic::Arithmetic).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Flops {
    /// All rays.
    pub ray_caster: f64,
    /// Importance tables and the irradiance cache.
    pub controller: f64,
    /// Searches of the photon map and all reflection.
    pub gather_unit: f64,
}

impl Flops {
    /// Operations of counted work with `gather_rays` gather rays a sample, each piece at the table's cost.
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
