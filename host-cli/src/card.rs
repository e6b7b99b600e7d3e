//! Command `photoncard card`.

use std::time::Duration;

use photoncard_driver::emulator::EmulatedKind;
use photoncard_driver::render::{CardAddress, MAX_BINS, MemoryUse, card_info, card_ping};

use crate::console::print;
use crate::failure::Failure;

/// Prints the budget that a card reports, the memory use that a board measures and, for an emulated card, the
/// sizes of the firmware's buffers.
pub(crate) fn info(address: &CardAddress) -> Result<(), Failure> {
    let info = card_info(address)?;
    let budget = info.budget;
    let kind = match address {
        CardAddress::Emulated { kind, .. } => Some(*kind),
        CardAddress::Remote(_) => None,
    };
    let mut lines = vec![
        format!("build           {}", info.build),
        format!("sram            {} bytes", budget.sram_bytes),
        format!("  photon cache  {} bytes", budget.photon_cache_bytes),
        format!("  scene cache   {} bytes", budget.scene_cache_bytes),
    ];
    lines.extend(kind.map(|kind| format!("  cache tags    {} bytes", kind.tag_bytes())));
    lines.push(format!("  stack         {} bytes", budget.stack_bytes));
    lines.extend(info.memory_use.iter().flat_map(measured_rows));
    lines.extend(kind.into_iter().flat_map(|kind| sram_rows(kind, budget.sram_bytes as usize)));
    lines.extend([
        format!("dram            {} bytes", budget.dram_bytes),
        format!(
            "tile            {} pixels, {} tiles in flight, {} at once",
            budget.tile_pixels, budget.in_flight, budget.tiles
        ),
        format!("neighbors       {}", budget.neighbors),
        format!("gather rays     {} a sample", budget.gather_rays),
        format!("bins            {MAX_BINS} of directions"),
        format!("gather queue    {} gathers", budget.gather_queue),
        format!("records         {} of irradiance a tile in flight", budget.irradiance_records),
        format!("shadow rays     {} a sample", budget.shadow_rays),
        format!("samples         {} a pixel", budget.samples),
    ]);
    print(&lines)
}

/// Table rows with the on-chip memory of a board's firmware, as the board measures it.
fn measured_rows(memory_use: &MemoryUse) -> [String; 2] {
    let MemoryUse { static_bytes, stack_bytes, stack_used } = memory_use;
    [
        format!("    used        {stack_used} bytes at most of {stack_bytes}"),
        format!("  static data   {static_bytes} bytes"),
    ]
}

/// Table rows with the on-chip memory of the firmware's buffers, which the host knows for emulated chips.
fn sram_rows(kind: EmulatedKind, sram_bytes: usize) -> [String; 5] {
    let techniques = kind.techniques();
    [
        format!("  buffers       {} bytes", kind.buffer_bytes()),
        format!("    reordering  {} bytes: gathers that wait", techniques.reordering),
        format!("    cache       {} bytes: irradiance records", techniques.irradiance_cache),
        format!("    sampling    {} bytes: tables of directions", techniques.importance_sampling),
        format!("  free          {} bytes", sram_bytes - kind.sram_bytes()),
    ]
}

/// Greets a card `count` times and prints the time of each answer.
pub(crate) fn ping(address: &CardAddress, count: u16) -> Result<(), Failure> {
    let answers = card_ping(address, count.into())?;
    let mut lines = Vec::new();
    for (number, answer) in (1..).zip(&answers) {
        lines.push(format!("hello {number:<9} {}", milliseconds(*answer)));
    }
    let mean = answers.iter().sum::<Duration>() / u32::from(count.max(1));
    for (name, time) in
        [("least", answers.iter().min()), ("mean", Some(&mean)), ("most", answers.iter().max())]
    {
        lines.extend(time.map(|time| format!("{name:<15} {}", milliseconds(*time))));
    }
    print(&lines)
}

fn milliseconds(time: Duration) -> String {
    format!("{:.3} ms", time.as_secs_f64() * 1e3)
}
