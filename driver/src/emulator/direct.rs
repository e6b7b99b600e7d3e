//! Chips without cards and links: tiles rendered straight from a card image, for studies and for whole-frame
//! reordering.

use photoncard_firmware::chip::{Chip, Progress};
use photoncard_firmware::fixed_point::ColourSum;
use photoncard_firmware::kind::ChipKind;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::render::{Context, GatherOutlet};
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FaultCode, FrameParameters, Tile};
use rayon::ThreadPool;
use rayon::prelude::*;

use super::memory_model::{MeasuredMemory, MemoryTraffic};
use crate::pack::CardImage;

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

/// Error of [`render_tiles`].
#[derive(Debug, thiserror::Error)]
pub enum TileError {
    /// Error of a malformed image, or of a tile that is too large.
    #[error("{0}")]
    Fault(Fault),
    /// The work was stopped.
    #[error("the render was stopped")]
    Stopped,
}

impl From<Fault> for TileError {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

/// Renders tiles on chips of the kind `K`, one a thread of `pool`, whose stacks must hold a chip while it is built. Each tile has a new
/// memory that `model` makes, so that it begins with empty caches. `is_stopped` is polled before each.
///
/// # Errors
/// If the card image is malformed, or the work is stopped.
pub fn render_tiles<'a, K: ChipKind, M: MeasuredMemory>(
    pool: &ThreadPool,
    image: &'a CardImage,
    frame: &FrameParameters,
    tiles: &[Tile],
    model: &(impl Fn(Lines<'a>) -> M + Sync),
    is_stopped: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<RenderedTile>, TileError> {
    let (scene, memory) = image.view();
    let new_chip = || Box::new(Chip::<K>::new());
    let render_one = |chip: &mut Box<Chip<K>>, &tile: &Tile| {
        if is_stopped() {
            return Err(TileError::Stopped);
        }
        Ok(render_tile(chip, &scene, model(memory), frame, tile, None)?)
    };
    pool.install(|| tiles.par_iter().with_max_len(1).map_init(new_chip, render_one).collect())
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
