//! `photoncard card info`.

use photoncard_driver::emulator::ChipKind;
use photoncard_driver::render::{CardAddress, MOST_BINS, card_info};

use crate::console::print;
use crate::failure::Failure;

/// Prints what a card says of itself in its hello, and what its firmware takes of the chip.
pub(crate) fn info(address: &CardAddress) -> Result<(), Failure> {
    let info = card_info(*address)?;
    let CardAddress::Emulated { kind, .. } = *address;
    let budget = info.budget;
    let techniques = kind.techniques();
    let lines = [
        format!("build           {}", info.build),
        format!("sram            {} bytes", budget.sram_bytes),
        format!("  photon cache  {} bytes", budget.photon_cache_bytes),
        format!("  scene cache   {} bytes", budget.scene_cache_bytes),
        format!("  cache tags    {} bytes", kind.tag_bytes()),
        format!("  stack         {} bytes", budget.stack_bytes),
        format!("  buffers       {} bytes", ChipKind::buffer_bytes(kind)),
        format!("    reordering  {} bytes: gathers that wait", techniques.reordering),
        format!("    cache       {} bytes: irradiance records", techniques.irradiance_cache),
        format!("    sampling    {} bytes: tables of directions", techniques.importance_sampling),
        format!("  free          {} bytes", budget.sram_bytes as usize - ChipKind::sram_bytes(kind)),
        format!("dram            {} bytes", budget.dram_bytes),
        format!("tile            {} pixels, {} tiles at once", budget.tile_pixels, budget.tiles),
        format!("neighbors       {}", budget.neighbors),
        format!("gather rays     {} a sample", budget.gather_rays),
        format!("bins            {MOST_BINS} of directions"),
        format!("gather queue    {} gathers", budget.gather_queue),
        format!(
            "records         {} of irradiance, {} gathered at once",
            budget.irradiance_records, budget.gathered_records
        ),
        format!("shadow rays     {} a sample", budget.shadow_rays),
        format!("samples         {} a pixel", budget.samples),
    ];
    print(&(lines.join("\n") + "\n"))
}
