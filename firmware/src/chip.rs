//! One chip: the state of a tile, and its stages.

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::{Budget, MICRO, REFERENCE, gather_candidates};
use photoncard_shared::counters::Counters;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::BvhNode;
use photoncard_shared::message::{Drain, Fault, FrameParameters, Pixel, Tile};

use crate::fixed_point::ColourSum;
use crate::gather::{DirectionBins, GatherQueue, GatherRequest, KeyScale};
use crate::memory::MemoryPort;
use crate::photon::Candidate;
use crate::render::{Context, PixelSample, direct, eye, final_gather};
use crate::scene::{SceneImage, Surface};

/// The chip of [`REFERENCE`].
pub type ReferenceChip = Chip<
    { REFERENCE.tile_pixels as usize },
    { gather_candidates(REFERENCE.neighbors) },
    { REFERENCE.gather_queue as usize },
>;
/// The chip of [`MICRO`].
pub type MicroChip = Chip<
    { MICRO.tile_pixels as usize },
    { gather_candidates(MICRO.neighbors) },
    { MICRO.gather_queue as usize },
>;

/// A chip's tile buffers: `TILE_PIXELS` pixels, `CANDIDATES` photons of a gather, `QUEUE` gathers that wait.
pub struct Chip<const TILE_PIXELS: usize, const CANDIDATES: usize, const QUEUE: usize> {
    /// What each pixel of the tile sees, in the present sample.
    surfaces: Vec<Option<Surface>, TILE_PIXELS>,
    sums: Vec<PixelSum, TILE_PIXELS>,
    candidates: Vec<Candidate, CANDIDATES>,
    queue: GatherQueue<QUEUE>,
    bins: DirectionBins,
    key_scale: Option<KeyScale>,
    tile: Tile,
    position: Position,
    counters: Counters,
}

/// Waiting gathers that one step does.
const GATHERS_PER_STEP: usize = 64;

/// What is known of a pixel so far: sums over its samples.
#[derive(Clone, Copy, Debug)]
struct PixelSum {
    /// Emission and what shadow rays bring, W/(sr m^2); samples come in their order.
    direct: Vec3,
    /// The mean of what gather rays bring, in radiance units; they come in any order.
    gathered: ColourSum,
    albedo: Vec3,
    normal: Vec3,
    depth: f32,
    surfaces: u32,
}

impl PixelSum {
    const ZERO: Self = Self {
        direct: Vec3::ZERO,
        gathered: ColourSum::ZERO,
        albedo: Vec3::ZERO,
        normal: Vec3::ZERO,
        depth: 0.0,
        surfaces: 0,
    };
}

/// How far a tile has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Position {
    sample: u32,
    stage: Stage,
    /// The direction bin, in the final gather.
    bin: u32,
    pixel: u32,
}

impl Position {
    const START: Self = Self { sample: 0, stage: Stage::Eye, bin: 0, pixel: 0 };
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Eye,
    Direct,
    FinalGather,
}

impl<const TILE_PIXELS: usize, const CANDIDATES: usize, const QUEUE: usize> Default
    for Chip<TILE_PIXELS, CANDIDATES, QUEUE>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<const TILE_PIXELS: usize, const CANDIDATES: usize, const QUEUE: usize>
    Chip<TILE_PIXELS, CANDIDATES, QUEUE>
{
    /// A chip without a tile.
    pub const fn new() -> Self {
        Self {
            surfaces: Vec::new(),
            sums: Vec::new(),
            candidates: Vec::new(),
            queue: GatherQueue::new(),
            bins: DirectionBins::new(),
            key_scale: None,
            tile: Tile { id: 0, x: 0, y: 0, width: 0, height: 0 },
            position: Position::START,
            counters: Counters::ZERO,
        }
    }

    /// Pixels that a tile may have.
    pub const fn tile_pixels(&self) -> u64 {
        TILE_PIXELS as u64
    }

    /// What was counted since [`Self::begin_frame`].
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Begins a frame: counts from zero, groups the gather rays in bins, reads the scene's box.
    ///
    /// # Errors
    /// If the image is not sound.
    pub fn begin_frame(
        &mut self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        frame: &FrameParameters,
    ) -> Result<(), Fault> {
        self.counters = Counters::ZERO;
        self.bins.set(frame.gather_rays, frame.bins);
        let root = scene.record::<LINE_BYTES, 1>(memory, SectionKind::Nodes, 0)?;
        self.key_scale = Some(KeyScale::new(&BvhNode::read(root)));
        Ok(())
    }

    /// Begins a tile. Returns whether it has pixels and its buffers suffice.
    #[must_use]
    pub fn begin(&mut self, tile: Tile) -> bool {
        self.tile = tile;
        self.position = Position::START;
        self.surfaces.clear();
        self.sums.clear();
        self.queue.clear();
        let Ok(pixels) = usize::try_from(tile.pixels()) else { return false };
        pixels > 0
            && self.surfaces.resize(pixels, None).is_ok()
            && self.sums.resize(pixels, PixelSum::ZERO).is_ok()
    }

    /// Does the next piece of the tile: one stage of one pixel, of the final gather the rays of one direction bin, or
    /// some of the gathers that wait. Returns whether the tile is complete.
    ///
    /// # Errors
    /// If the image is not sound.
    pub fn step(
        &mut self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        frame: &FrameParameters,
    ) -> Result<bool, Fault> {
        let all_cast = self.position.sample >= frame.samples;
        if self.queue.is_draining() || all_cast && !self.queue.is_empty() {
            self.drain(scene, memory, frame)?;
        } else if !all_cast {
            self.cast(scene, memory, frame)?;
            self.advance();
        }
        Ok(self.position.sample >= frame.samples && self.queue.is_empty())
    }

    /// The present stage of the present pixel.
    fn cast(
        &mut self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        frame: &FrameParameters,
    ) -> Result<(), Fault> {
        let Position { sample, stage, pixel, .. } = self.position;
        let width = self.tile.width.max(1);
        let at = PixelSample { x: self.tile.x + pixel % width, y: self.tile.y + pixel / width, sample };
        let mut context = Context { scene, memory, frame, counters: &mut self.counters };
        let seen = self.surfaces.get_mut(pixel as usize);
        let (Some(seen), Some(sum)) = (seen, self.sums.get_mut(pixel as usize)) else { return Ok(()) };
        match (stage, *seen) {
            (Stage::Eye, _) => *seen = see(&mut context, at, sum)?,
            (Stage::Direct, Some(surface)) => sum.direct += direct::reflected(&mut context, at, &surface)?,
            (Stage::FinalGather, Some(surface)) => self.final_gather(scene, memory, frame, at, &surface)?,
            (_, None) => {}
        }
        Ok(())
    }

    /// The gather rays of the present bin, for one pixel.
    fn final_gather(
        &mut self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        frame: &FrameParameters,
        at: PixelSample,
        surface: &Surface,
    ) -> Result<(), Fault> {
        let Position { bin, pixel, .. } = self.position;
        for place in 0..self.bins.rays(bin).len() {
            let Some(&ray) = self.bins.rays(bin).get(place) else { break };
            let mut context = Context { scene, memory: &mut *memory, frame, counters: &mut self.counters };
            // A tile has at most TILE_PIXELS pixels, which 16 bits tell apart.
            let end = final_gather::cast(&mut context, at, pixel as u16, surface, ray as u32)?;
            let Some(end) = end else { continue };
            if let Some(sum) = self.sums.get_mut(pixel as usize) {
                sum.gathered.add(end.direct);
            }
            if let Some(request) = end.request {
                self.gather_or_wait(scene, memory, frame, request)?;
            }
        }
        Ok(())
    }

    /// Does a gather at once, or lets it wait. A queue that is full is drained first.
    fn gather_or_wait(
        &mut self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        frame: &FrameParameters,
        request: GatherRequest,
    ) -> Result<(), Fault> {
        let Some(scale) = self.key_scale.filter(|_| frame.drain != Drain::Immediate) else {
            return self.gather(scene, memory, frame, &request);
        };
        if self.queue.len() >= (frame.queue as usize).clamp(1, QUEUE) {
            self.queue.begin_drain();
            while self.queue.is_draining() {
                self.drain(scene, memory, frame)?;
            }
        }
        let key = scale.key(frame.drain, request.position.into(), self.queue.len() as u32);
        match self.queue.push(key, request) {
            Ok(()) => Ok(()),
            Err(request) => self.gather(scene, memory, frame, &request),
        }
    }

    /// Some of the gathers that wait.
    fn drain(
        &mut self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        frame: &FrameParameters,
    ) -> Result<(), Fault> {
        if !self.queue.is_draining() {
            self.queue.begin_drain();
        }
        for _ in 0..GATHERS_PER_STEP {
            let Some(request) = self.queue.take() else { break };
            self.gather(scene, memory, frame, &request)?;
        }
        Ok(())
    }

    /// One gather, added to its pixel.
    fn gather(
        &mut self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        frame: &FrameParameters,
        request: &GatherRequest,
    ) -> Result<(), Fault> {
        let mut context = Context { scene, memory, frame, counters: &mut self.counters };
        let gathered = final_gather::gathered(&mut context, request, &mut self.candidates)?;
        if let Some(sum) = self.sums.get_mut(request.pixel as usize) {
            sum.gathered.add(gathered);
        }
        Ok(())
    }

    /// Every pixel goes through a stage before the next stage begins, through a bin before the next bin, and through
    /// every stage before the next sample.
    fn advance(&mut self) {
        let position = &mut self.position;
        position.pixel += 1;
        if (position.pixel as usize) < self.sums.len() {
            return;
        }
        position.pixel = 0;
        position.stage = match position.stage {
            Stage::Eye => Stage::Direct,
            Stage::Direct => Stage::FinalGather,
            Stage::FinalGather => {
                position.bin += 1;
                if position.bin < self.bins.len() {
                    return;
                }
                position.bin = 0;
                position.sample += 1;
                Stage::Eye
            }
        };
    }

    /// Pixel `index` of the complete tile, counted in rows.
    pub fn pixel(&self, index: usize, scene: &SceneImage, frame: &FrameParameters) -> Option<Pixel> {
        let sum = self.sums.get(index)?;
        let per_sample = 1.0 / frame.samples.max(1) as f32;
        let gathered = sum.gathered.value() * scene.header.radiance_unit;
        let per_surface = 1.0 / sum.surfaces as f32;
        Some(Pixel {
            radiance: (sum.direct * per_sample + gathered).to_array(),
            albedo: (sum.albedo * per_sample).to_array(),
            normal: (sum.normal * per_sample).to_array(),
            depth: if sum.surfaces > 0 { sum.depth * per_surface } else { f32::INFINITY },
        })
    }
}

/// The eye stage of one pixel: what it sees, and what of that goes straight into the picture.
fn see<M: MemoryPort>(
    context: &mut Context<M>,
    at: PixelSample,
    sum: &mut PixelSum,
) -> Result<Option<Surface>, Fault> {
    let surface = eye::see(context, at)?;
    if let Some(surface) = &surface {
        sum.direct += surface.emission;
        sum.albedo += surface.reflection.diffuse + surface.reflection.specular;
        sum.normal += surface.normal;
        sum.depth += eye::depth(context, surface);
        sum.surfaces += 1;
    }
    Ok(surface)
}

/// On-chip memory that a card of `card_bytes` takes under a budget: its statics, caches and stack.
pub const fn sram_bytes(budget: &Budget, card_bytes: usize) -> usize {
    card_bytes
        + budget.photon_cache_bytes as usize
        + budget.scene_cache_bytes as usize
        + budget.stack_bytes as usize
}
