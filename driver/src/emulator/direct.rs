//! Chips without cards and links: tiles rendered straight from a card image, for studies and for whole-frame
//! reordering.

use photoncard_firmware::chip::{Chip, Progress};
use photoncard_firmware::fixed_point::ColourSum;
use photoncard_firmware::kind::ChipKind;
use photoncard_firmware::render::{Context, GatherOutlet};
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FaultCode, FrameParameters, Tile};

use super::memory_model::{MeasuredMemory, MemoryTraffic};

/// A rendered tile, with its work and memory traffic.
pub struct RenderedTile {
    /// Light of the pixels, row by row, in the image's radiance units: one sum per pixel, or with layers
    /// [`photoncard_shared::budget::SUMS_WITH_LAYERS`].
    pub sums: Vec<ColourSum>,
    /// Counts of the work.
    pub counters: Counters,
    /// Memory traffic; zero for a memory that is not modelled.
    pub traffic: MemoryTraffic,
}

/// Renders a tile on a chip with a memory of its own. With an `outlet` the pixels' gathers are sent to it instead, and the
/// caller evaluates them and completes the pixels.
///
/// # Errors
/// If the card image is malformed, or the chip has no room for the tile.
pub fn render_tile<K: ChipKind>(
    chip: &mut Chip<K>,
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
        // Counts the reads with which a card completes its pixels.
        for index in 0..tile.pixels() as usize {
            while chip.complete(&mut context, index)?.is_none() {}
        }
    }
    Ok(RenderedTile { sums: chip.sums().to_vec(), counters, traffic: memory.traffic() })
}
