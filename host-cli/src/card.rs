//! `photoncard card info`.

use photoncard_driver::emulator::ChipKind;
use photoncard_driver::render::{CardAddress, card_info};

use crate::failure::Failure;

/// Prints what a card says of itself in its hello, and what its firmware takes of the chip.
pub(crate) fn info(address: &CardAddress) -> Result<(), Failure> {
    let info = card_info(*address)?;
    let CardAddress::Emulated { kind, .. } = *address;
    let budget = info.budget;
    println!("build           {}", info.build);
    println!("sram            {} bytes", budget.sram_bytes);
    println!("  photon cache  {} bytes", budget.photon_cache_bytes);
    println!("  scene cache   {} bytes", budget.scene_cache_bytes);
    println!("  stack         {} bytes", budget.stack_bytes);
    println!("  buffers       {} bytes", ChipKind::buffer_bytes(kind));
    println!("  free          {} bytes", budget.sram_bytes as usize - ChipKind::sram_bytes(kind));
    println!("dram            {} bytes", budget.dram_bytes);
    println!("tile            {} pixels, {} tiles at once", budget.tile_pixels, budget.tiles);
    println!("neighbors       {}", budget.neighbors);
    println!("gather rays     {} a sample", budget.gather_rays);
    println!("shadow rays     {} a sample", budget.shadow_rays);
    println!("samples         {} a pixel", budget.samples);
    Ok(())
}
