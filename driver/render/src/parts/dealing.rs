//! Assignment of a picture's pixels to its parts, by a fixed rule, so that renders on different machines
//! agree without communication.
//!
//! The window is divided into square patches, which are numbered along a Hilbert curve. Of each `N`
//! consecutive patches, each of `N` parts gets one. A part thus has patches all over the picture, and costs
//! about as much as any other. Ascending and descending order of the parts alternate. Otherwise, because the
//! curve is regular, a part could always get the same positions of a repeated pattern in the picture.

use std::fmt;
use std::str::FromStr;

use photoncard_cards::scheduler::{GatherOrder, tiles};
use photoncard_picture::film::Window;
use photoncard_shared::message::Tile;

/// Maximum number of parts of a picture.
pub const MAX_PARTS: u32 = 1 << 16;
/// Maximum side of patches, pixels: the widest tile of a chip.
const WIDEST_PATCH: u32 = 64;
/// Minimum side of patches, pixels: the side of the coarsest cells of irradiance records. Narrower patches
/// would compute these records several times.
const NARROWEST_PATCH: u32 = 16;
/// Number of patches per part below which patches are halved, down to `NARROWEST_PATCH`. With more patches,
/// the costs of parts are more equal.
const PATCHES_OF_PART: u64 = 64;

/// A part of a picture: number `number`, counted from 1, of `count` parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Part {
    number: u32,
    count: u32,
}

impl Part {
    /// Part `number` of `count`; `None` unless `1 <= number <= count <=` [`MAX_PARTS`].
    pub fn new(number: u32, count: u32) -> Option<Self> {
        ((1..=MAX_PARTS).contains(&count) && (1..=count).contains(&number)).then_some(Self { number, count })
    }

    /// All parts of a picture with `count` parts.
    pub fn all(count: u32) -> impl Iterator<Item = Self> {
        (1..=count).map(move |number| Self { number, count })
    }

    /// Number of the part, counted from 1.
    pub fn number(self) -> u32 {
        self.number
    }

    /// Number of parts of the picture.
    pub fn count(self) -> u32 {
        self.count
    }

    /// Items of the part, of `all` numbered ones: the number of the first, from 0, and one behind the last.
    pub fn range(self, all: u64) -> [u64; 2] {
        let [number, count] = [self.number, self.count].map(u64::from);
        [number - 1, number].map(|number| all * number / count)
    }

    /// Patches of the part, along the Hilbert curve. The patches of all parts cover the window exactly once.
    pub fn patches(self, window: Window) -> Vec<Tile> {
        deal(window, self.count).filter(|(part, _)| *part == self).map(|(_, patch)| patch).collect()
    }

    /// Tiles of the part, numbered from 0, each with at most `side * side` pixels. Each tile lies in a single
    /// patch.
    pub fn tiles(self, window: Window, side: u32, order: GatherOrder) -> Vec<Tile> {
        let of_patch = |Tile { x, y, width, height, .. }: Tile| {
            tiles(Window { x0: x, x1: x + width, y0: y, y1: y + height }, side, order)
        };
        let all = self.patches(window).into_iter().flat_map(of_patch);
        all.zip(0..).map(|(tile, id)| Tile { id, ..tile }).collect()
    }
}

/// Lists the first parts by name, and the number of the others.
pub(crate) fn named(parts: &[Part]) -> String {
    const NAMED: usize = 8;
    let mut text = parts.iter().take(NAMED).map(Part::to_string).collect::<Vec<_>>().join(", ");
    if parts.len() > NAMED {
        text += &format!(" and {} more", parts.len() - NAMED);
    }
    text
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/');
        let part = numbers.and_then(|(number, count)| Self::new(number.parse().ok()?, count.parse().ok()?));
        part.ok_or_else(|| format!("a part is K/N, the K-th of N from 1 to {MAX_PARTS}, such as 3/8"))
    }
}

/// Patches of a window along the Hilbert curve, each with the part, of `count` parts, that it belongs to.
pub(super) fn deal(window: Window, count: u32) -> impl Iterator<Item = (Part, Tile)> {
    let side = patch_side(window, count);
    let mut patches = tiles(window, side, GatherOrder::Tiled);
    let along = |start: u32, first: u32| (start - first) / side;
    patches.sort_by_cached_key(|patch| hilbert([along(patch.x, window.x0), along(patch.y, window.y0)]));
    let part_of = move |index: u32| {
        let place = index % count;
        let is_forth = (index / count).is_multiple_of(2);
        Part { number: if is_forth { place + 1 } else { count - place }, count }
    };
    (0..).zip(patches).map(move |(index, patch)| (part_of(index), patch))
}

/// Side of the patches of a window with `count` parts, pixels.
fn patch_side(window: Window, count: u32) -> u32 {
    let patches =
        |side: u32| u64::from(window.width().div_ceil(side)) * u64::from(window.height().div_ceil(side));
    let narrower = |&side: &u32| {
        (side / 2 >= NARROWEST_PATCH && patches(side) < PATCHES_OF_PART * u64::from(count))
            .then_some(side / 2)
    };
    std::iter::successors(Some(WIDEST_PATCH), narrower).last().unwrap_or(WIDEST_PATCH)
}

/// Index of a point along the Hilbert curve through a quadrant of the plane. The coordinates of the point are
/// below 2^16.
fn hilbert([mut x, mut y]: [u32; 2]) -> u64 {
    let mut place = 0;
    for level in (0..16).rev() {
        let side = 1 << level;
        let [right, below] = [x & side != 0, y & side != 0];
        let quadrant: u64 = match (right, below) {
            (false, false) => 0,
            (false, true) => 1,
            (true, true) => 2,
            (true, false) => 3,
        };
        place += quadrant << (2 * level);
        [x, y] = [x & (side - 1), y & (side - 1)];
        if !below {
            if right {
                [x, y] = [side - 1 - x, side - 1 - y];
            }
            (x, y) = (y, x);
        }
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_every_point_once_and_steps_to_neighbours() {
        let mut points: Vec<[u32; 2]> = (0..32).flat_map(|x| (0..32).map(move |y| [x, y])).collect();
        points.sort_by_key(|&point| hilbert(point));
        for pair in points.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            assert_eq!(a[0].abs_diff(b[0]) + a[1].abs_diff(b[1]), 1, "{a:?} {b:?}");
            assert_ne!(hilbert(a), hilbert(b));
        }
    }

    #[test]
    fn parts_cover_the_window_exactly_once_with_tiles_of_any_size() {
        for (window, count) in [
            (Window::full(1, 1), 3),
            (Window { x0: 3, x1: 203, y0: 40, y1: 99 }, 1),
            (Window { x0: 3, x1: 203, y0: 40, y1: 99 }, 7),
            (Window::full(130, 257), 64),
        ] {
            for side in [5, 16, 100] {
                for order in [GatherOrder::Naive, GatherOrder::Sort] {
                    let mut film = vec![0; 257 * 203];
                    for part in Part::all(count) {
                        for (tile, id) in part.tiles(window, side, order).iter().zip(0..) {
                            assert_eq!(tile.id, id);
                            assert!(tile.pixels() <= u64::from(side * side));
                            for (x, y) in photoncard_picture::sink::pixel_positions(tile) {
                                film[(y * 203 + x) as usize] += 1;
                            }
                        }
                    }
                    for y in 0..257 {
                        for x in 0..203 {
                            assert_eq!(film[(y * 203 + x) as usize], u32::from(window.contains(x, y)));
                        }
                    }
                }
            }
        }
    }

    /// Costs are concentrated in a stripe, in a quarter, or in half of a checkerboard.
    #[test]
    fn parts_of_uneven_pictures_cost_alike() {
        let window = Window::full(1024, 1024);
        let costs: [fn(&Tile) -> u64; 3] = [
            |tile| if (400..600).contains(&tile.x) { 20 } else { 1 },
            |tile| if tile.x < 512 && tile.y >= 512 { 20 } else { 1 },
            |tile| if (tile.x / 64 + tile.y / 64).is_multiple_of(2) { 20 } else { 1 },
        ];
        for (cost, count) in costs.iter().flat_map(|cost| [4, 8, 13].map(|count| (cost, count))) {
            let each: Vec<u64> = Part::all(count)
                .map(|part| part.patches(window).iter().map(|patch| cost(patch) * patch.pixels()).sum())
                .collect();
            let (sum, most) = (each.iter().sum::<u64>(), each.iter().max().copied().unwrap_or(0));
            assert!(3 * most * u64::from(count) <= 4 * sum, "{count}: {each:?}");
        }
    }

    #[test]
    fn a_part_is_read_as_it_is_written() {
        for text in ["1/1", "3/8", "65536/65536"] {
            assert_eq!(text.parse::<Part>().map(|part| part.to_string()), Ok(text.to_owned()));
        }
        for text in ["", "3", "0/8", "9/8", "1/0", "1/65537", "-1/2", "1/2/3", "a/b"] {
            assert!(text.parse::<Part>().unwrap_err().contains("3/8"), "{text}");
        }
    }
}
