//! Chips without cards: tiles rendered straight from an image, for studies and for what no link could carry.

use photoncard_firmware::chip::{Progress, ReferenceChip};
use photoncard_firmware::fixed_point::ColourSum;
use photoncard_firmware::render::{Context, GatherOutlet};
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FaultCode, FrameParameters, Tile};

use super::memory_model::{MeasuredMemory, MemoryTraffic};

/// A rendered tile, and what it took.
pub struct RenderedTile {
    /// The light of its pixels, row by row, in the image's radiance units: a sum a pixel, or with layers
    /// [`photoncard_shared::budget::SUMS_WITH_LAYERS`].
    pub sums: Vec<ColourSum>,
    /// What was counted.
    pub counters: Counters,
    /// What was read, if the memory is modelled.
    pub traffic: MemoryTraffic,
}

/// Renders a tile on a chip with a memory of its own. The gathers of its pixels go to `outlet`, if there is one: whoever does
/// them completes the pixels.
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
    if !chip.begin(context.memory, frame, tile) {
        return Err(Fault { code: FaultCode::Tile, detail: tile.id });
    }
    while chip.step(&mut context)? == Progress::Busy {}
    if context.outlet.is_none() {
        // What a card reads to complete its pixels is counted here as well.
        for index in 0..tile.pixels() as usize {
            while chip.complete(&mut context, index)?.is_none() {}
        }
    }
    Ok(RenderedTile { sums: chip.sums().to_vec(), counters, traffic: memory.traffic() })
}
