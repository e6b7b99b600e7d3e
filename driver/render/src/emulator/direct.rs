//! Renders tiles on emulated chips straight from a card image, without cards and links, for studies.

use photoncard_firmware::chip::{Chip, FinishedPixel, PixelView, Progress};
use photoncard_firmware::fixed_point::ColourSum;
use photoncard_firmware::kind::ChipKind;
use photoncard_firmware::memory::{CardMemory, MemoryPort};
use photoncard_firmware::render::{GatherOutlet, RenderJob};
use photoncard_firmware::scene::SceneImage;
use photoncard_map::pack::CardImage;
use photoncard_picture::sums::{FilmPixel, SumFormat};
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FaultCode, FrameParameters, Tile};
use rayon::prelude::*;

use super::dram::EmulatedDram;
use super::measured::Measured;
use super::memory_model::{CacheSettings, MeasuredMemory, MemoryTraffic};
use super::reuse::{Delivered, Reuse, Reused};
use super::{EmulatedChip, EmulatedKind};

/// A rendered tile, with the work and memory traffic of rendering it.
pub struct RenderedTile {
    /// Sums of light over the samples of each pixel, row by row, in the card image's radiance units. A pixel
    /// has [`photoncard_shared::message::PixelForm::sums_of_light`] sums.
    pub sums: Vec<ColourSum>,
    /// Albedo, normal and depth of the pixels, row by row.
    pub views: Vec<PixelView>,
    /// Counters of the work.
    pub counters: Counters,
    /// Memory traffic; zero if the memory is not modelled.
    pub traffic: MemoryTraffic,
    /// Reuse of cache lines, if it is counted.
    pub reuse: Option<Box<Reuse>>,
}

/// Model of the memory of chips that render tiles.
#[derive(Clone, Copy, Debug)]
pub struct TileMemory<'a> {
    /// Caches between chip and DRAM.
    pub caches: &'a CacheSettings,
    /// True to count the reuse of cache lines, which takes time.
    pub has_reuse: bool,
}

impl<'a> From<&'a CacheSettings> for TileMemory<'a> {
    fn from(caches: &'a CacheSettings) -> Self {
        Self { caches, has_reuse: false }
    }
}

impl TileMemory<'_> {
    /// Puts the model over a memory, and returns the counts that the model delivers.
    fn over<'m, M: CardMemory + MeasuredMemory + Send + 'm>(&self, memory: M) -> (Measured<'m>, Delivered) {
        let delivered = Delivered::default();
        let cached = self.caches.over(memory);
        let measured = match self.has_reuse {
            true => Measured::new(Reused::new(cached, self.caches, delivered.clone())),
            false => Measured::new(cached),
        };
        (measured, delivered)
    }

    /// Takes the counts of a model that was dropped.
    fn reuse(&self, delivered: &Delivered, traffic: &MemoryTraffic) -> Option<Box<Reuse>> {
        self.has_reuse.then(|| Box::new(delivered.take(traffic)))
    }
}

impl RenderedTile {
    /// Assembles a tile from complete pixels in any order.
    fn new(mut pixels: Vec<FinishedPixel>, frame: &FrameParameters, counters: Counters) -> Self {
        pixels.sort_by_key(|pixel| pixel.index);
        let mut sums = Vec::with_capacity(pixels.len() * frame.form().sums_of_light() as usize);
        pixels.iter().for_each(|pixel| sums.extend_from_slice(pixel.light.sums(frame)));
        let views = pixels.into_iter().map(|pixel| pixel.view).collect();
        Self { sums, views, counters, traffic: MemoryTraffic::ZERO, reuse: None }
    }

    /// Values of the pixels, row by row. `format` is the format of the frame's sums.
    pub fn pixels(&self, format: SumFormat) -> impl Iterator<Item = FilmPixel> {
        let sums = self.sums.chunks(format.form.sums_of_light() as usize);
        let values = move |(view, light): (&PixelView, &[ColourSum])| {
            format.values(&view.sums(format.form, light), [0.0; 3])
        };
        self.views.iter().zip(sums).map(values)
    }
}

/// Error of [`render_tiles_apart`].
#[derive(Debug, thiserror::Error)]
pub enum DirectError {
    /// The card image is malformed, or the chip has no room for a tile.
    #[error("{0}")]
    Fault(Fault),
    /// The caller stopped the work.
    #[error("the render was stopped")]
    Stopped,
}

impl From<Fault> for DirectError {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

/// Renders tiles on chips of a kind, one chip per thread of the current pool and one tile at a time. With `model`, the
/// memory is modelled, and caches are empty at the beginning of each tile. `is_stopped` is polled before each
/// tile.
///
/// # Errors
/// If the card image is malformed, a chip has no room for a tile, or the work is stopped.
pub fn render_tiles_apart(
    kind: EmulatedKind,
    image: &CardImage,
    frame: &FrameParameters,
    tiles: &[Tile],
    model: Option<TileMemory>,
    is_stopped: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<RenderedTile>, DirectError> {
    let render_one = |chip: &mut EmulatedChip, &tile: &Tile| {
        if is_stopped() {
            return Err(DirectError::Stopped);
        }
        Ok(render_tile_of(chip, image, model, frame, tile, None)?)
    };
    let new_chip = || kind.emulated().chip();
    tiles.par_iter().with_max_len(1).map_init(new_chip, render_one).collect()
}

/// Renders tiles on one chip of a kind with modelled memory, as many at a time as the frame and the chip
/// allow. `take` is called with each finished tile, without its traffic, and returns whether to continue.
/// Returns the traffic of all tiles, and the reuse of cache lines if it is counted.
///
/// # Errors
/// If the card image is malformed, or the chip has no room for a tile.
pub fn render_tiles_in_flight(
    kind: EmulatedKind,
    image: &CardImage,
    frame: &FrameParameters,
    tiles: &[Tile],
    model: TileMemory,
    take: &mut dyn FnMut(&Tile, RenderedTile) -> bool,
) -> Result<(MemoryTraffic, Option<Box<Reuse>>), Fault> {
    let (scene, lines) = image.view();
    let chip = &mut kind.emulated().chip();
    let dram = EmulatedDram::lent(lines, kind.budget().dram_bytes);
    chip.begin_frame(frame, scene.header.lines..dram.lines());
    let (mut memory, delivered) = model.over(dram);
    let job = &mut RenderJob { scene: &scene, memory: &mut memory, frame, outlet: None };
    render_tiles(chip, job, tiles, take)?;
    let traffic = memory.traffic();
    drop(memory);
    let reuse = model.reuse(&delivered, &traffic);
    Ok((traffic, reuse))
}

/// Renders a tile from a card image, like [`render_tile`]. With `model`, the memory is modelled.
///
/// # Errors
/// As [`render_tile`].
pub fn render_tile_of(
    chip: &mut EmulatedChip,
    image: &CardImage,
    model: Option<TileMemory>,
    frame: &FrameParameters,
    tile: Tile,
    outlet: Option<&mut (dyn GatherOutlet + 'static)>,
) -> Result<RenderedTile, Fault> {
    let (scene, lines) = image.view();
    let Some(model) = model else {
        return render_tile(chip, &scene, EmulatedDram::lent(lines, 0), frame, tile, outlet);
    };
    let (memory, delivered) = model.over(lines);
    let rendered = render_tile(chip, &scene, memory, frame, tile, outlet)?;
    let reuse = model.reuse(&delivered, &rendered.traffic);
    Ok(RenderedTile { reuse, ..rendered })
}

/// Renders a tile on a chip that reads `memory`. With an `outlet`, the photon gathers of the pixels are
/// passed to the outlet and not done. The caller must then do them, and add the results to the sums.
///
/// # Errors
/// If the card image is malformed, or the chip has no room for the tile.
pub fn render_tile(
    chip: &mut EmulatedChip,
    scene: &SceneImage,
    mut memory: impl MeasuredMemory,
    frame: &FrameParameters,
    tile: Tile,
    outlet: Option<&mut (dyn GatherOutlet + 'static)>,
) -> Result<RenderedTile, Fault> {
    let outlet = outlet.map(|outlet| outlet as &mut dyn GatherOutlet);
    let job = &mut RenderJob { scene, memory: &mut memory, frame, outlet };
    let mut rendered = None;
    render_tiles(chip, job, &[tile], |_, tile| {
        rendered = Some(tile);
        true
    })?;
    let rendered = rendered.ok_or(Fault { code: FaultCode::Tile, detail: tile.id })?;
    Ok(RenderedTile { traffic: memory.traffic(), ..rendered })
}

/// Renders tiles on a chip, as many at a time as the frame and the chip allow. `take` is called with each
/// finished tile, in any order and without its traffic, and returns whether to continue.
///
/// # Errors
/// If the card image is malformed, or the chip has no room for a tile.
pub fn render_tiles<K: ChipKind, M: MemoryPort>(
    chip: &mut Chip<K>,
    job: &mut RenderJob<M>,
    tiles: &[Tile],
    mut take: impl FnMut(&Tile, RenderedTile) -> bool,
) -> Result<(), Fault> {
    chip.clear();
    let mut next = tiles.iter();
    let mut in_flight: Vec<(&Tile, Vec<FinishedPixel>)> = Vec::new();
    loop {
        match chip.step(job)? {
            Progress::Busy => {}
            Progress::Pixel(pixel) => {
                let of_tile = in_flight.iter_mut().find(|(tile, _)| tile.id == pixel.tile);
                of_tile.into_iter().for_each(|(_, pixels)| pixels.push(pixel));
            }
            Progress::Tile(id, counters) => {
                let Some(index) = in_flight.iter().position(|(tile, _)| tile.id == id) else { continue };
                let (tile, pixels) = in_flight.remove(index);
                if !take(tile, RenderedTile::new(pixels, job.frame, counters)) {
                    return Ok(());
                }
            }
            Progress::Idle => match next.next() {
                Some(tile) => {
                    if !chip.begin(job.memory, job.frame, *tile) {
                        return Err(Fault { code: FaultCode::Tile, detail: tile.id });
                    }
                    in_flight.push((tile, Vec::with_capacity(tile.pixels() as usize)));
                }
                None if chip.flush(job.frame) => {}
                None => return Ok(()),
            },
        }
    }
}
