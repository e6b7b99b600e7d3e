//! Which card renders which tile.
//!
//! Tiles wait in one queue. A card with a free credit takes the next one; no card waits for another, and results come in
//! any order. A tile's pixels do not depend on who renders it, nor when.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use photoncard_shared::message::{Drain, Tile};

use crate::film::Window;

/// In which order photon gathers are done. The picture is the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GatherOrder {
    /// Pixels along scanlines, the rays of each in the sampler's order.
    Naive,
    /// The same within square tiles.
    Tiled,
    /// Within a tile, the rays of one direction bin for all pixels, then those of the next.
    DirectionBins,
    /// Rays by direction bins; gathers wait in the queue and are done by a spatial hash of their place.
    Hash,
    /// Rays by direction bins; gathers wait in the queue and are done along a Hilbert curve.
    Sort,
    /// All gathers of the frame along one Hilbert curve: on emulated cards alone, which leave them to the host.
    Hilbert,
}

impl GatherOrder {
    /// When a chip does its gathers.
    pub fn drain(self) -> Drain {
        match self {
            Self::Naive | Self::Tiled | Self::DirectionBins => Drain::Immediate,
            Self::Hash => Drain::Hash,
            Self::Sort | Self::Hilbert => Drain::Sort,
        }
    }

    /// Whether gathers wait in a chip's queue.
    pub fn has_queue(self) -> bool {
        matches!(self, Self::Hash | Self::Sort)
    }

    /// Whether rays are cast by direction bins.
    pub fn has_bins(self) -> bool {
        !matches!(self, Self::Naive | Self::Tiled)
    }
}

/// The tiles of a window, each at most `side * side` pixels, numbered from 0.
pub fn tiles(window: Window, side: u32, order: GatherOrder) -> Vec<Tile> {
    let side = side.max(1);
    let (tile_width, tile_height) = match order {
        GatherOrder::Naive => (side.saturating_mul(side), 1),
        _ => (side, side),
    };
    let mut tiles = Vec::new();
    for y in (window.y0..window.y1).step_by(tile_height as usize) {
        for x in (window.x0..window.x1).step_by(tile_width as usize) {
            tiles.push(Tile {
                id: tiles.len() as u32,
                x,
                y,
                width: tile_width.min(window.x1 - x),
                height: tile_height.min(window.y1 - y),
            });
        }
    }
    tiles
}

/// The tiles of a picture, and how far they are: shared by the threads of all cards.
#[derive(Debug)]
pub struct Scheduler {
    state: Mutex<State>,
    /// A tile waits again, or all are done.
    changed: Condvar,
    total: usize,
}

#[derive(Debug)]
struct State {
    waiting: VecDeque<Tile>,
    done: usize,
}

impl Scheduler {
    /// All tiles wait.
    pub fn new(tiles: Vec<Tile>) -> Self {
        let total = tiles.len();
        let state = Mutex::new(State { waiting: tiles.into(), done: 0 });
        Self { state, changed: Condvar::new(), total }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // A thread that panicked holding the lock has left whole tiles.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next tile for a card with a free credit.
    pub fn take(&self) -> Option<Tile> {
        self.lock().waiting.pop_front()
    }

    /// A tile's pixels are all there.
    pub fn complete(&self) {
        let mut state = self.lock();
        state.done += 1;
        if state.done == self.total {
            self.changed.notify_all();
        }
    }

    /// A tile waits again: before all others, as it has waited longest.
    pub fn give_back(&self, tile: Tile) {
        self.lock().waiting.push_front(tile);
        self.changed.notify_all();
    }

    /// Whether all tiles are done.
    pub fn is_complete(&self) -> bool {
        self.lock().done == self.total
    }

    /// Tiles that are done, and all of them.
    pub fn progress(&self) -> (usize, usize) {
        (self.lock().done, self.total)
    }

    /// Waits until a tile waits or all are done, not longer than `most`.
    pub fn wait_for_tile(&self, most: Duration) {
        self.wait_while(most, |state| state.waiting.is_empty() && state.done < self.total);
    }

    /// Waits until all tiles are done, not longer than `most`.
    pub fn wait_for_end(&self, most: Duration) {
        self.wait_while(most, |state| state.done < self.total);
    }

    fn wait_while(&self, most: Duration, must_wait: impl Fn(&State) -> bool) {
        let waited = self.changed.wait_timeout_while(self.lock(), most, |state| must_wait(state));
        drop(waited);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    #[test]
    fn tiles_cover_every_pixel_once() {
        let window = Window { x0: 3, x1: 40, y0: 5, y1: 22 };
        for order in [GatherOrder::Naive, GatherOrder::Tiled] {
            for side in [1, 2, 8, 16, 100] {
                let mut covered = vec![0; 40 * 22];
                for tile in tiles(window, side, order) {
                    assert!(tile.pixels() <= (side * side) as u64);
                    for y in tile.y..tile.y + tile.height {
                        for x in tile.x..tile.x + tile.width {
                            covered[(y * 40 + x) as usize] += 1;
                        }
                    }
                }
                for y in 0..22 {
                    for x in 0..40 {
                        let inside = (3..40).contains(&x) && (5..22).contains(&y);
                        assert_eq!(covered[y * 40 + x], usize::from(inside));
                    }
                }
            }
        }
    }

    #[test]
    fn waits_end_with_what_they_wait_for() {
        let tile = Tile { id: 0, x: 0, y: 0, width: 1, height: 1 };
        let scheduler = Scheduler::new(vec![tile, tile]);
        let long = Duration::from_secs(60);
        scheduler.wait_for_tile(long);
        let [first, _] = [scheduler.take().unwrap(), scheduler.take().unwrap()];
        scheduler.wait_for_tile(Duration::ZERO);
        let begin = Instant::now();
        std::thread::scope(|scope| {
            scope.spawn(|| scheduler.wait_for_end(long));
            scope.spawn(|| {
                scheduler.wait_for_tile(long);
                assert_eq!(scheduler.take(), Some(first));
                scheduler.complete();
                scheduler.complete();
            });
            scheduler.give_back(first);
        });
        assert!(begin.elapsed() < long && scheduler.is_complete());
    }
}
