//! Floating-point operations of a frame by Table 7.1: counted work times the table's constants.

use photoncard_shared::counters::Counters;
use serde::Serialize;

use super::{Cost, Symbols, Workload};

/// Floating-point operations of each unit of the chip, summed over all chips, by the constants of Table 7.1.
/// [`Arithmetic`](super::arithmetic::Arithmetic) has the operations of this firmware.
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
    /// Operations of the work in `counters`, by the constants of Table 7.1. `gather_rays` is the number of
    /// gather rays per sample.
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
