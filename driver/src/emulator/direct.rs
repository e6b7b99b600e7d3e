//! Chips without cards: tiles rendered straight from an image, for studies and for what no link could carry.

use photoncard_firmware::chip::{PixelSum, Progress, ReferenceChip};
use photoncard_firmware::render::{Context, GatherOutlet};
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FaultCode, FrameParameters, Tile};

use super::memory_model::{MeasuredMemory, MemoryTraffic};

/// A rendered tile, and what it took.
pub struct RenderedTile {
    /// Its pixels, row by row.
    pub sums: Vec<PixelSum>,
    /// What was counted.
    pub counters: Counters,
    /// What was read, if the memory is modelled.
    pub traffic: MemoryTraffic,
}

/// Renders a tile on a chip with a memory of its own. The gathers of its pixels go to `outlet`, if there is one.
///
/// # Errors
/// If the image is not sound, or the chip has no room for the tile.
pub fn render_tile(
    chip: &mut ReferenceChip,
    scene: &SceneImage,
    mut memory: impl MeasuredMemory,
    frame: &FrameParameters,
    tile: Tile,
    outlet: Option<&mut (dyn GatherOutlet + 'static)>,
) -> Result<RenderedTile, Fault> {
    let mut counters = Counters::ZERO;
    let outlet = outlet.map(|outlet| outlet as &mut dyn GatherOutlet);
    let mut context = Context { scene, memory: &mut memory, frame, counters: &mut counters, outlet };
    chip.begin_frame(&mut context)?;
    if !chip.begin(context.memory, tile) {
        return Err(Fault { code: FaultCode::Tile, detail: tile.id });
    }
    while chip.step(&mut context)? == Progress::Busy {}
    let sums = (0..tile.pixels() as usize).map_while(|index| chip.sum(index).copied()).collect();
    Ok(RenderedTile { sums, counters, traffic: memory.traffic() })
}
