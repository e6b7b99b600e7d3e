//! Tiles to send to pages, numbered in the order of completion. All are of one picture: the newest [requested
//! picture](super::wish) that has a tile.
//!
//! The only state of a page is the number of its next tile. Outdated tiles are dropped, even if a page has
//! not been sent them. A slow page therefore receives fewer and newer tiles, and needs no buffer.

use std::collections::{HashMap, VecDeque};
use std::iter;
use std::sync::Arc;

use photoncard_driver::film::{Film, FilmPixel, Window};
use photoncard_driver::layer::Layer;
use photoncard_driver::sink::FinishedTile;
use photoncard_shared::budget::MAX_LIGHT_GROUPS;
use photoncard_shared::counters::Counters;

/// Factors of the light of each light group, by channel.
pub(super) type Gains = [[f32; 3]; MAX_LIGHT_GROUPS];

/// Quantity that a page shows: radiance or a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shown {
    Radiance,
    /// Radiance as it is rendered, also of tiles that are denoised.
    Rendered,
    /// Radiance whose light groups are mixed with these gains.
    Mix(Gains),
    Layer(Layer),
}

impl Shown {
    /// All quantities that a page can show: radiance, and the layers with channels.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let layers = Layer::ALL.into_iter().filter(|layer| !layer.channels().is_empty());
        iter::once(Self::Radiance).chain(layers.map(Self::Layer))
    }

    /// Name of the quantity in messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Radiance | Self::Rendered | Self::Mix(_) => "radiance",
            Self::Layer(layer) => layer.name(),
        }
    }

    /// Returns whether this is a layer that chips render only on request, such as `direct`.
    pub(super) fn is_of_chip(self) -> bool {
        match self {
            Self::Radiance | Self::Rendered | Self::Mix(_) => false,
            Self::Layer(layer) => layer.is_of_chip(),
        }
    }
}

/// Rendered picture that a tile belongs to: number of the request, kind of pass, resolution, number of
/// samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin {
    /// Number of the requested picture.
    pub(super) version: u32,
    /// True for a tile of [`Pass::Coarse`](super::refinement::Pass::Coarse), whose settings are cheaper than
    /// the final picture's.
    pub(super) is_coarse: bool,
    /// Side of the square that one rendered pixel covers, in pixels of the full picture.
    pub(super) step: u32,
    /// Samples per pixel.
    pub(super) samples: u32,
}

/// Work that a tile has cost, for all samples of its pixels so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileWork {
    /// Number of photon gathers, in the photon map and in the caustic map.
    gathers: u64,
    /// Number of irradiance records whose gather rays were cast.
    records: u64,
    /// Number of lines read from DRAM; `None` if memory is not modelled.
    dram_lines: Option<u64>,
}

impl TileWork {
    pub(super) fn new(counters: &Counters, dram_lines: Option<u64>) -> Self {
        let gathers = counters.gathers.saturating_add(counters.caustic_gathers);
        Self { gathers, records: counters.records, dram_lines }
    }

    /// Sum of the work on earlier samples (`self`) and on further samples (`more`).
    fn and(self, more: Self) -> Self {
        Self {
            gathers: self.gathers.saturating_add(more.gathers),
            records: self.records.saturating_add(more.records),
            dram_lines: self.dram_lines.zip(more.dram_lines).map(|(a, b)| a.saturating_add(b)),
        }
    }

    /// Returns the counts for a tile's header: gathers, irradiance records, DRAM lines. An unknown count is
    /// [`UNKNOWN`].
    fn words(self) -> [u32; 3] {
        [Some(self.gathers), Some(self.records), self.dram_lines]
            .map(|count| count.map_or(UNKNOWN, |count| count.min(u64::from(UNKNOWN - 1)) as u32))
    }
}

/// Tile with its origin and the card that rendered it.
#[derive(Debug)]
pub(super) struct Patch {
    pub(super) origin: Origin,
    /// Index of the card among the view's cards.
    card: u32,
    tile: FinishedTile,
    /// Denoised radiance of the tile's pixels, which pages show instead of the rendered radiance.
    denoised: Option<Vec<[f32; 3]>>,
    work: TileWork,
}

/// Value of an unknown count in the header of a tile.
const UNKNOWN: u32 = u32::MAX;
/// Size of a tile's header in a message to a page, bytes.
const HEADER: usize = 44;
/// Size of a pixel in a message to a page, bytes.
const PIXEL: usize = 12;

impl Patch {
    pub(super) fn new(origin: Origin, card: u32, tile: FinishedTile, work: TileWork) -> Self {
        Self { origin, card, tile, denoised: None, work }
    }

    /// Copy of the tile with denoised radiance; `at(x, y)` is the denoised radiance of a pixel of the
    /// picture.
    fn denoised(&self, at: &dyn Fn(u32, u32) -> [f32; 3]) -> Self {
        let denoised = Some(self.tile.pixels().map(|((x, y), _)| at(x, y)).collect());
        Self { tile: self.tile.clone(), denoised, ..*self }
    }

    /// Returns whether this tile has the request, pass and resolution of `earlier`, but more samples.
    fn goes_on(&self, earlier: &Self) -> bool {
        earlier.origin.samples < self.origin.samples
            && Origin { samples: self.origin.samples, ..earlier.origin } == self.origin
    }

    fn area(&self) -> Area {
        let tile = self.tile.tile();
        (tile.x, tile.y, tile.pixels())
    }

    /// Size of the tile's message, bytes.
    pub(super) fn bytes(&self) -> usize {
        HEADER + PIXEL * self.tile.tile().pixels() as usize
    }

    /// Returns the tile as a message, little-endian: a header, then three `f32` per pixel of the quantity
    /// `shown`.
    pub(super) fn message(&self, shown: Shown) -> Vec<u8> {
        let Origin { version, is_coarse: _, step, samples } = self.origin;
        let [gathers, records, lines] = self.work.words();
        let tile = self.tile.tile();
        let mut bytes = Vec::with_capacity(self.bytes());
        let place = [tile.x * step, tile.y * step, tile.width, tile.height];
        let header = [&[version, step][..], &place, &[samples, self.card, gathers, records, lines]];
        header.iter().copied().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
        let mut add = |values: [f32; 3]| values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        match &self.denoised {
            Some(denoised) if shown == Shown::Radiance => denoised.iter().copied().for_each(add),
            _ => self.tile.pixels().for_each(|(_, pixel)| add(values(&pixel, shown))),
        }
        bytes
    }

    /// Pixel of the tile that covers pixel `(x, y)` of the full picture; `None` if the tile does not cover
    /// it.
    fn pixel(&self, [x, y]: [u32; 2]) -> Option<FilmPixel> {
        let [x, y] = [x, y].map(|at| at / self.origin.step);
        let tile = self.tile.tile();
        let is_inside =
            (tile.x..tile.x + tile.width).contains(&x) && (tile.y..tile.y + tile.height).contains(&y);
        let index = || (y - tile.y) as usize * tile.width as usize + (x - tile.x) as usize;
        if is_inside { self.tile.pixels().nth(index()).map(|(_, pixel)| pixel) } else { None }
    }
}

/// Film of a picture of `width` x `height` pixels from all tiles of one pass; `None` if tiles are missing. A
/// pixel of a coarse pass fills its square.
pub(super) fn film_of(patches: &[Arc<Patch>], [width, height]: [u32; 2]) -> Option<Film> {
    let format = *patches.first()?.tile.format();
    let mut film = Film::new(width, height, Window::full(width, height), format).ok()?;
    for patch in patches {
        let step = patch.origin.step;
        for ((column, row), sums) in patch.tile.sums() {
            let [columns, rows] =
                [(column, width), (row, height)].map(|(at, side)| at * step..side.min((at + 1) * step));
            let square = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            for (x, y) in square {
                film.write(x, y, &sums).ok()?;
            }
        }
    }
    film.is_complete().then_some(film)
}

/// Returns three values of a pixel for a page. The value of a layer with one channel is repeated.
fn values(pixel: &FilmPixel, shown: Shown) -> [f32; 3] {
    let layer = match shown {
        Shown::Radiance | Shown::Rendered => return pixel.pixel.radiance,
        Shown::Mix(gains) => return mixed(pixel, &gains),
        Shown::Layer(layer) => layer,
    };
    match layer.channels() {
        [red, green, blue] => [red, green, blue].map(|channel| (channel.value)(pixel)),
        [channel, ..] => [(channel.value)(pixel); 3],
        [] => [0.0; 3],
    }
}

/// Radiance of a pixel with gains of its light groups, in the order in which `photoncard mix` adds them.
fn mixed(pixel: &FilmPixel, gains: &Gains) -> [f32; 3] {
    let [first, rest @ ..]: Gains = std::array::from_fn(|group| {
        let [light, gain] = [pixel.light_groups[group], gains[group]];
        [0, 1, 2].map(|channel: usize| light[channel] * gain[channel])
    });
    rest.into_iter().fold(first, |sum, group| [0, 1, 2].map(|channel: usize| sum[channel] + group[channel]))
}

/// Column and row of a tile's upper left corner, and the tile's number of pixels.
type Area = (u32, u32, u64);

/// Tiles of the newest requested picture that has any.
#[derive(Debug, Default)]
pub(super) struct Canvas {
    patches: VecDeque<(u64, Arc<Patch>)>,
    /// Numbers of the tiles of each area, the oldest first.
    by_area: HashMap<Area, Vec<u64>>,
    /// Number of the next tile.
    next: u64,
}

impl Canvas {
    /// Adds a tile, and drops the tiles of older requests. If the same area has an earlier tile with fewer
    /// samples of the same picture, the earlier tile's work is added to that of the new one.
    pub(super) fn put(&mut self, mut patch: Patch) {
        let version = patch.origin.version;
        if self.patches.front().is_some_and(|(_, oldest)| oldest.origin.version < version) {
            self.keep_version(version);
        }
        let of_area = self.by_area.get(&patch.area()).into_iter().flatten().rev();
        let mut of_area = of_area.filter_map(|&number| self.after(number));
        if let Some((_, earlier)) = of_area.find(|(_, earlier)| patch.goes_on(earlier)) {
            patch.work = earlier.work.and(patch.work);
        }
        self.push(patch);
    }

    fn push(&mut self, patch: Patch) {
        self.by_area.entry(patch.area()).or_default().push(self.next);
        self.patches.push_back((self.next, Arc::new(patch)));
        self.next += 1;
    }

    /// Replaces the tiles of a complete pass by denoised ones with new numbers. `at(x, y)` is the denoised
    /// radiance of a pixel.
    pub(super) fn denoise(&mut self, origin: Origin, at: &dyn Fn(u32, u32) -> [f32; 3]) {
        let of_pass = self.patches.iter().filter(|(_, patch)| patch.origin == origin);
        let denoised: Vec<_> = of_pass.map(|(_, patch)| patch.denoised(at)).collect();
        self.retain(|patch| patch.origin != origin);
        denoised.into_iter().for_each(|patch| self.push(patch));
    }

    pub(super) fn clear(&mut self) {
        self.retain(|_| false);
    }

    /// Drops the tiles of all requests but number `version`.
    pub(super) fn keep_version(&mut self, version: u32) {
        self.retain(|patch| patch.origin.version == version);
    }

    /// Drops the tiles of all passes but `origin`, which is complete.
    pub(super) fn keep(&mut self, origin: Origin) {
        self.retain(|patch| patch.origin == origin);
    }

    /// Removes the tile `id` of pass `origin`, which was revoked: its card was outvoted or sent wrong
    /// messages.
    pub(super) fn revoke(&mut self, origin: Origin, id: u32) {
        self.retain(|patch| !(patch.origin == origin && patch.tile.tile().id == id));
    }

    fn retain(&mut self, keeps: impl Fn(&Patch) -> bool) {
        self.patches.retain(|(_, patch)| keeps(patch));
        self.by_area.clear();
        for (number, patch) in &self.patches {
            self.by_area.entry(patch.area()).or_default().push(*number);
        }
    }

    /// Tiles of the pass `origin`.
    pub(super) fn of_pass(&self, origin: Origin) -> Vec<Arc<Patch>> {
        let of_pass = self.patches.iter().filter(|(_, patch)| patch.origin == origin);
        of_pass.map(|(_, patch)| patch.clone()).collect()
    }

    /// Oldest tile with a number of `from` or more, and its number.
    pub(super) fn after(&self, from: u64) -> Option<(u64, Arc<Patch>)> {
        let index = self.patches.partition_point(|(number, _)| *number < from);
        self.patches.get(index).cloned()
    }

    /// Depth at pixel `at`, metres, in the newest tile of request `version` that covers the pixel; `None`
    /// where no surface is seen.
    pub(super) fn depth(&self, version: u32, at: [u32; 2]) -> Option<f32> {
        let mut of_wish = self.patches.iter().rev().filter(|(_, patch)| patch.origin.version == version);
        let seen = of_wish.find_map(|(_, patch)| patch.pixel(at))?;
        Some(seen.pixel.depth).filter(|depth| depth.is_finite() && *depth > 0.0)
    }

    /// Number of stored tiles.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.patches.len()
    }
}

#[cfg(test)]
mod tests {
    use photoncard_driver::film::SumFormat;
    use photoncard_shared::message::Tile;

    use super::*;

    fn patch(samples: u32, x: u32, gathers: u64) -> Patch {
        let tile = Tile { id: x, x, y: 0, width: 1, height: 1 };
        let pixel = FilmPixel::default();
        let tile = FinishedTile::of_pixels(tile, [SumFormat::ONE.sums(&pixel)], SumFormat::ONE).unwrap();
        let origin = Origin { version: 1, is_coarse: false, step: 1, samples };
        Patch::new(origin, 0, tile, TileWork { gathers, ..TileWork::default() })
    }

    fn work(canvas: &Canvas) -> Vec<u64> {
        canvas.patches.iter().map(|(_, patch)| patch.work.gathers).collect()
    }

    #[test]
    fn the_work_of_a_tile_includes_earlier_samples() {
        let mut canvas = Canvas::default();
        for pass in [1, 2, 4] {
            (0..3).for_each(|x| canvas.put(patch(pass, x, 10 * u64::from(pass) + u64::from(x))));
            canvas.keep(patch(pass, 0, 0).origin);
        }
        assert_eq!(work(&canvas), [70, 73, 76]);
        // After a revocation, a tile's work is added to that of the pass before.
        canvas.put(patch(8, 1, 80));
        canvas.revoke(patch(8, 0, 0).origin, 1);
        canvas.put(patch(8, 1, 81));
        assert_eq!(work(&canvas), [70, 73, 76, 154]);
        canvas.clear();
        canvas.put(patch(16, 1, 5));
        assert_eq!(work(&canvas), [5]);
    }

    #[test]
    fn a_pixel_of_a_coarse_pass_fills_its_square_of_a_film() {
        let mut canvas = Canvas::default();
        for x in 0..3 {
            let tile = Tile { id: x, x, y: 0, width: 1, height: 1 };
            let mut pixel = FilmPixel::default();
            pixel.pixel.radiance = [x as f32; 3];
            let tile = FinishedTile::of_pixels(tile, [SumFormat::ONE.sums(&pixel)], SumFormat::ONE).unwrap();
            let origin = Origin { version: 1, is_coarse: true, step: 2, samples: 1 };
            canvas.put(Patch::new(origin, 0, tile, TileWork::default()));
        }
        let origin = canvas.after(0).unwrap().1.origin;
        let patches = canvas.of_pass(origin);
        let film = film_of(&patches, [5, 2]).unwrap();
        let row = [0.0, 0.0, 1.0, 1.0, 2.0];
        let shown: Vec<f32> = film.pixels().map(|pixel| pixel.radiance[0]).collect();
        assert_eq!(shown, [row, row].concat());
        assert!(film_of(&patches[1..], [5, 2]).is_none(), "a tile is missing");
        assert!(canvas.of_pass(Origin { step: 4, ..origin }).is_empty());
    }

    #[test]
    fn denoised_tiles_are_sent_again_with_their_work_and_layers() {
        let mut canvas = Canvas::default();
        (0..2).for_each(|x| canvas.put(patch(4, x, 7)));
        canvas.put(patch(8, 0, 9));
        canvas.denoise(patch(4, 0, 0).origin, &|x, _| [x as f32, 2.0, 5.0]);
        assert_eq!(canvas.len(), 3);
        let sent = |from: u64, shown| {
            let (number, tile) = canvas.after(from).unwrap();
            let message = tile.message(shown);
            let values = message[HEADER..].as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
            (number, tile.work.gathers, values.collect::<Vec<_>>())
        };
        assert_eq!(sent(3, Shown::Radiance), (3, 7, vec![0.0, 2.0, 5.0]));
        assert_eq!(sent(4, Shown::Radiance), (4, 7, vec![1.0, 2.0, 5.0]));
        assert_eq!(sent(4, Shown::Rendered), (4, 7, vec![0.0; 3]));
        assert_eq!(sent(4, Shown::Layer(Layer::Albedo)), (4, 7, vec![0.0; 3]));
        assert_eq!(sent(0, Shown::Radiance), (2, 9 + 7, vec![0.0; 3]));
    }
}
