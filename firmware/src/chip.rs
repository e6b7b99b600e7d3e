//! One chip: the state of a tile, and its stages.

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::budget::{Budget, MICRO, REFERENCE, gather_candidates};
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FrameParameters, Pixel, Tile};

use crate::fixed_point::ColourSum;
use crate::memory::MemoryPort;
use crate::photon::Candidate;
use crate::render::{Context, PixelSample, direct, eye, final_gather};
use crate::scene::{SceneImage, Surface};

/// The chip of [`REFERENCE`].
pub type ReferenceChip = Chip<{ REFERENCE.tile_pixels as usize }, { gather_candidates(REFERENCE.neighbors) }>;
/// The chip of [`MICRO`].
pub type MicroChip = Chip<{ MICRO.tile_pixels as usize }, { gather_candidates(MICRO.neighbors) }>;

/// A chip's tile buffers: `TILE_PIXELS` pixels, `CANDIDATES` photons of a gather.
pub struct Chip<const TILE_PIXELS: usize, const CANDIDATES: usize> {
    /// What each pixel of the tile sees, in the present sample.
    surfaces: Vec<Option<Surface>, TILE_PIXELS>,
    sums: Vec<PixelSum, TILE_PIXELS>,
    candidates: Vec<Candidate, CANDIDATES>,
    tile: Tile,
    position: Position,
    counters: Counters,
}

/// What is known of a pixel so far: sums over its samples.
#[derive(Clone, Copy, Debug)]
struct PixelSum {
    /// Emission and what shadow rays bring, W/(sr m^2); samples come in their order.
    direct: Vec3,
    /// What gather rays bring, in radiance units; they come in any order.
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
    pixel: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Eye,
    Direct,
    FinalGather,
}

impl<const TILE_PIXELS: usize, const CANDIDATES: usize> Default for Chip<TILE_PIXELS, CANDIDATES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const TILE_PIXELS: usize, const CANDIDATES: usize> Chip<TILE_PIXELS, CANDIDATES> {
    /// A chip without a tile.
    pub const fn new() -> Self {
        Self {
            surfaces: Vec::new(),
            sums: Vec::new(),
            candidates: Vec::new(),
            tile: Tile { id: 0, x: 0, y: 0, width: 0, height: 0 },
            position: Position { sample: 0, stage: Stage::Eye, pixel: 0 },
            counters: Counters::ZERO,
        }
    }

    /// Pixels that a tile may have.
    pub const fn tile_pixels(&self) -> u64 {
        TILE_PIXELS as u64
    }

    /// What was counted since [`Self::reset_counters`].
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Counts from zero again.
    pub fn reset_counters(&mut self) {
        self.counters = Counters::ZERO;
    }

    /// Begins a tile. Returns whether it has pixels and its buffers suffice.
    #[must_use]
    pub fn begin(&mut self, tile: Tile) -> bool {
        self.tile = tile;
        self.position = Position { sample: 0, stage: Stage::Eye, pixel: 0 };
        self.surfaces.clear();
        self.sums.clear();
        let Ok(pixels) = usize::try_from(tile.pixels()) else { return false };
        pixels > 0
            && self.surfaces.resize(pixels, None).is_ok()
            && self.sums.resize(pixels, PixelSum::ZERO).is_ok()
    }

    /// Does the present stage of one pixel. Returns whether the tile is complete.
    ///
    /// # Errors
    /// If the image is not sound.
    pub fn step(
        &mut self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        frame: &FrameParameters,
    ) -> Result<bool, Fault> {
        let Position { sample, stage, pixel } = self.position;
        if sample >= frame.samples {
            return Ok(true);
        }
        let at = PixelSample {
            x: self.tile.x + pixel % self.tile.width.max(1),
            y: self.tile.y + pixel / self.tile.width.max(1),
            sample,
        };
        let mut context = Context { scene, memory, frame, counters: &mut self.counters };
        let (surfaces, sums) = (&mut self.surfaces, &mut self.sums);
        if let (Some(seen), Some(sum)) = (surfaces.get_mut(pixel as usize), sums.get_mut(pixel as usize)) {
            match (stage, &*seen) {
                (Stage::Eye, _) => *seen = see(&mut context, at, sum)?,
                (Stage::Direct, Some(surface)) => {
                    sum.direct += direct::reflected(&mut context, at, surface)?;
                }
                (Stage::FinalGather, Some(surface)) => {
                    for index in 0..frame.gather_rays {
                        if let Some(point) = final_gather::cast(&mut context, at, surface, index)? {
                            sum.gathered.add(final_gather::radiance(
                                &mut context,
                                &point,
                                &mut self.candidates,
                            )?);
                        }
                    }
                }
                (_, None) => {}
            }
        }
        self.advance();
        Ok(self.position.sample >= frame.samples)
    }

    /// Every pixel goes through a stage before the next stage begins, every stage before the next sample.
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
            radiance: ((sum.direct + gathered) * per_sample).to_array(),
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
