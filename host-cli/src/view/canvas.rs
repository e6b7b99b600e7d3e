//! The tiles that pages are shown: those of the newest wish that has any, numbered in the order in which they were finished.
//!
//! A page needs to remember one number alone, that of the next tile: tiles that are outdated are gone when it asks. So a slow page gets
//! fewer and newer tiles, and takes no memory.

use std::collections::VecDeque;
use std::sync::Arc;

use photoncard_driver::film::FilmPixel;
use photoncard_driver::sink::FinishedTile;

/// Radiance or a layer, as a page shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shown {
    Radiance,
    Layer(photoncard_driver::layer::Layer),
}

/// Origin of tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin {
    /// Number of the wish.
    pub(super) version: u32,
    /// Side of the square that a pixel stands for.
    pub(super) step: u32,
    /// Samples of a pixel.
    pub(super) samples: u32,
}

/// A tile with its origin.
#[derive(Debug)]
pub(super) struct Patch {
    pub(super) origin: Origin,
    /// Number of the card.
    card: u32,
    tile: FinishedTile,
}

/// Bytes of a tile's header.
const HEADER: usize = 32;
/// Bytes of a pixel.
const PIXEL: usize = 12;

impl Patch {
    pub(super) fn new(origin: Origin, card: u32, tile: FinishedTile) -> Self {
        Self { origin, card, tile }
    }

    /// Bytes of the message that shows the tile.
    pub(super) fn bytes(&self) -> usize {
        HEADER + PIXEL * self.tile.tile().pixels() as usize
    }

    /// Message that shows the tile.
    pub(super) fn message(&self, shown: Shown) -> Vec<u8> {
        let Origin { version, step, samples } = self.origin;
        let tile = self.tile.tile();
        let mut bytes = Vec::with_capacity(self.bytes());
        let header =
            [version, step, tile.x * step, tile.y * step, tile.width, tile.height, samples, self.card];
        header.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        for (_, pixel) in self.tile.pixels() {
            values(&pixel, shown).iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        }
        bytes
    }

    /// The pixel at `(x, y)` of the full picture.
    fn pixel(&self, [x, y]: [u32; 2]) -> Option<FilmPixel> {
        let [x, y] = [x, y].map(|at| at / self.origin.step);
        let tile = self.tile.tile();
        let is_inside =
            (tile.x..tile.x + tile.width).contains(&x) && (tile.y..tile.y + tile.height).contains(&y);
        let index = || (y - tile.y) as usize * tile.width as usize + (x - tile.x) as usize;
        if is_inside { self.tile.pixels().nth(index()).map(|(_, pixel)| pixel) } else { None }
    }
}

/// Values of a pixel as a page shows them; a scalar is repeated.
fn values(pixel: &FilmPixel, shown: Shown) -> [f32; 3] {
    let Shown::Layer(layer) = shown else { return pixel.pixel.radiance };
    match layer.channels() {
        [red, green, blue] => [red, green, blue].map(|channel| (channel.value)(pixel)),
        [channel, ..] => [(channel.value)(pixel); 3],
        [] => [0.0; 3],
    }
}

/// The tiles of the newest wish that has any.
#[derive(Debug, Default)]
pub(super) struct Canvas {
    patches: VecDeque<(u64, Arc<Patch>)>,
    /// Number of the next tile.
    next: u64,
}

impl Canvas {
    /// Adds a tile, and drops those of older wishes.
    pub(super) fn put(&mut self, patch: Patch) {
        let version = patch.origin.version;
        if self.patches.front().is_some_and(|(_, oldest)| oldest.origin.version < version) {
            self.keep_version(version);
        }
        self.patches.push_back((self.next, Arc::new(patch)));
        self.next += 1;
    }

    /// Drops all tiles.
    pub(super) fn clear(&mut self) {
        self.patches.clear();
    }

    /// Drops the tiles of other wishes.
    pub(super) fn keep_version(&mut self, version: u32) {
        self.patches.retain(|(_, patch)| patch.origin.version == version);
    }

    /// Drops the tiles of other passes, once the picture of a pass is complete.
    pub(super) fn keep(&mut self, origin: Origin) {
        self.patches.retain(|(_, patch)| patch.origin == origin);
    }

    /// Drops a tile that was revoked.
    pub(super) fn revoke(&mut self, origin: Origin, id: u32) {
        self.patches.retain(|(_, patch)| !(patch.origin == origin && patch.tile.tile().id == id));
    }

    /// The oldest tile from the number `from` on, and its number.
    pub(super) fn after(&self, from: u64) -> Option<(u64, Arc<Patch>)> {
        let index = self.patches.partition_point(|(number, _)| *number < from);
        self.patches.get(index).cloned()
    }

    /// Depth of the newest pixel of a wish that shows `at`, metres; `None` where nothing is seen.
    pub(super) fn depth(&self, version: u32, at: [u32; 2]) -> Option<f32> {
        let mut of_wish = self.patches.iter().rev().filter(|(_, patch)| patch.origin.version == version);
        let seen = of_wish.find_map(|(_, patch)| patch.pixel(at))?;
        Some(seen.pixel.depth).filter(|depth| depth.is_finite() && *depth > 0.0)
    }

    /// Number of tiles.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.patches.len()
    }
}
