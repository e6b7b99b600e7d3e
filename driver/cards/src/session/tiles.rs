//! Tiles assigned to a card.

use std::collections::VecDeque;

use photoncard_picture::sink::FinishedTile;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{FrameParameters, PixelSums};

use super::pixel_limits::{BadValue, PixelLimits};
use super::{Assignment, Event, SessionError};

/// Tiles assigned to a card, in the order of assignment.
#[derive(Default)]
pub(super) struct TilesInFlight(Vec<TileInFlight>);

struct TileInFlight {
    assignment: Assignment,
    /// Records of all pixels, valid where `is_received`.
    records: Vec<u8>,
    /// Flags of the pixels whose records were received.
    is_received: Vec<bool>,
}

impl TilesInFlight {
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn push(&mut self, assignment: Assignment) {
        self.0.push(TileInFlight { assignment, records: Vec::new(), is_received: Vec::new() });
    }

    /// Returns whether cards have crashed before at the card's first tile. Such a tile is assigned alone.
    pub(super) fn is_at_suspect(&self) -> bool {
        self.0.first().is_some_and(|in_flight| in_flight.assignment.is_suspect)
    }

    /// Stores consecutive pixels of a tile, of which the first has the index `first`. Fails if a pixel is
    /// outside the tile, has an impossible value, or was received before.
    pub(super) fn take_pixels(
        &mut self,
        id: u32,
        first: u32,
        data: &[u8],
        limits: &PixelLimits,
    ) -> Result<(), SessionError> {
        let in_flight = self.0.iter_mut().find(|in_flight| in_flight.assignment.tile.id == id);
        let in_flight = in_flight.ok_or(SessionError::Unexpected("pixels of another tile"))?;
        let tile = in_flight.assignment.tile;
        let bytes = limits.format().record_bytes();
        let pixels = data.chunks_exact(bytes);
        let range = first as usize..first as usize + pixels.len();
        if range.is_empty() || !pixels.remainder().is_empty() || range.end as u64 > tile.pixels() {
            return Err(SessionError::Unexpected("pixels outside their tile"));
        }
        // A tile has at most as many pixels as the card's budget allows; memory is allocated with its first
        // pixels.
        in_flight.is_received.resize(tile.pixels() as usize, false);
        in_flight.records.resize(tile.pixels() as usize * bytes, 0);
        if in_flight.is_received[range.clone()].contains(&true) {
            return Err(SessionError::Unexpected("pixels that it has sent before"));
        }
        for (index, pixel) in (first..).zip(pixels) {
            let wrong_order = SessionError::Unexpected("pixels whose identities are not in order");
            let sums = PixelSums::read(limits.format().form, pixel).ok_or(wrong_order)?;
            if let Some(BadValue { channel, value }) = limits.find_bad(&sums) {
                let (x, y) = (tile.x + index % tile.width, tile.y + index / tile.width);
                return Err(SessionError::Value { tile, x, y, channel, value });
            }
        }
        in_flight.records[range.start * bytes..range.end * bytes].copy_from_slice(data);
        in_flight.is_received[range].fill(true);
        Ok(())
    }

    /// Removes and returns a tile. All its pixels must have been received.
    pub(super) fn complete(
        &mut self,
        id: u32,
        counters: Counters,
        limits: &PixelLimits,
    ) -> Result<FinishedTile, SessionError> {
        let not_complete = SessionError::Unexpected("a tile that is not complete");
        let index = self.0.iter().position(|in_flight| in_flight.assignment.tile.id == id);
        let Some(index) = index else { return Err(not_complete) };
        let TileInFlight { assignment, is_received, .. } = &self.0[index];
        let tile = assignment.tile;
        if is_received.len() as u64 != tile.pixels() || is_received.contains(&false) {
            return Err(not_complete);
        }
        let TileInFlight { records, .. } = self.0.remove(index);
        FinishedTile::new(tile, records, *limits.format(), counters).ok_or(not_complete)
    }

    /// Removes all tiles and adds an event `TileLost` for each, the newest first. The card was working on the
    /// `at_work` oldest ones.
    pub(super) fn give_back(&mut self, at_work: usize, events: &mut VecDeque<Event>) {
        while let Some(TileInFlight { assignment, .. }) = self.0.pop() {
            let was_at_work = self.0.len() < at_work;
            events.push_back(Event::TileLost { tile: assignment.tile, was_at_work });
        }
    }

    /// Maximum number of replies about the tiles: each contains at least a pixel, or ends a tile.
    pub(super) fn most_replies(&self) -> u64 {
        self.0.iter().map(|in_flight| in_flight.assignment.tile.pixels() + 1).sum()
    }

    /// Approximate number of rays of the `at_work` largest tiles. All of them may finish at the same time.
    pub(super) fn most_rays(&self, at_work: usize, frame: &FrameParameters) -> u64 {
        let mut pixels: Vec<u64> =
            self.0.iter().map(|in_flight| in_flight.assignment.tile.pixels()).collect();
        pixels.sort_unstable_by(|a, b| b.cmp(a));
        let pixels = pixels.into_iter().take(at_work).fold(0, u64::saturating_add);
        let rays_of_path = 2 + u64::from(frame.shadow_rays) + u64::from(frame.gather_rays);
        pixels.saturating_mul(frame.max_paths()).saturating_mul(rays_of_path)
    }
}

#[cfg(test)]
mod tests {
    use photoncard_shared::image::Header;
    use photoncard_shared::layout::PhotonGrid;
    use photoncard_shared::message::{Camera, Drain, Filter, PIXEL_BYTES, Radiance, Sampling, Tile};

    use super::*;

    const TILE: Tile = Tile { id: 3, x: 0, y: 0, width: 5, height: 2 };

    fn frame() -> FrameParameters {
        let camera = Camera::pinhole([0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]);
        FrameParameters {
            width: 5,
            height: 2,
            camera,
            seed: 0,
            first_sample: 0,
            samples: 1,
            planned_samples: 1,
            gather_rays: 1,
            shadow_rays: 1,
            neighbors: 2,
            max_distance: 1.0,
            sampling: Sampling::Reflection,
            irradiance_error: None,
            bins: 1,
            drain: Drain::Sort,
            queue: 1,
            radiance: Radiance::Density,
            caustics: None,
            layers: false,
            light_groups: 0,
            filter: Filter::Box,
            in_flight: 2,
            keep_records: false,
            adaptive_threshold: None,
            transparent: false,
            position: false,
            coverage: false,
            identities: false,
            irradiance: false,
            near_distance: 0.0,
        }
    }

    fn limits() -> PixelLimits {
        let photon_grid = PhotonGrid { origin: [0; 3], cell: 1e-6 };
        PixelLimits::new(&Header { reach: 1.0, photon_grid, ..Header::EMPTY }, &frame())
    }

    fn in_flight(tiles: &[Tile]) -> TilesInFlight {
        let mut in_flight = TilesInFlight::default();
        tiles.iter().for_each(|&tile| in_flight.push(Assignment { tile, is_suspect: false }));
        in_flight
    }

    /// Records of pixels without a surface; red is the index in the tile.
    fn pixels(indices: std::ops::Range<u32>) -> Vec<u8> {
        let of_pixel = |index: u32| {
            let mut bytes = [0; PIXEL_BYTES];
            bytes[36..40].copy_from_slice(&index.to_le_bytes());
            bytes
        };
        indices.flat_map(of_pixel).collect()
    }

    #[test]
    fn parts_of_a_tile_may_come_in_any_order_and_each_pixel_once() {
        let mut tiles = in_flight(&[TILE]);
        for part in [7..10, 0..2, 2..3] {
            tiles.take_pixels(3, part.start, &pixels(part.clone()), &limits()).unwrap();
            assert!(tiles.complete(3, Counters::ZERO, &limits()).is_err(), "pixels are missing");
        }
        for part in [0..1, 2..4, 6..8, 9..10] {
            let error = tiles.take_pixels(3, part.start, &pixels(part.clone()), &limits()).unwrap_err();
            assert!(error.to_string().contains("before"), "{part:?}: {error}");
        }
        tiles.take_pixels(3, 3, &pixels(3..7), &limits()).unwrap();
        let finished = tiles.complete(3, Counters::ZERO, &limits()).unwrap();
        assert_eq!(finished.records(), pixels(0..10));
        assert!(tiles.is_empty());
    }

    #[test]
    fn pixels_outside_a_tile_are_refused() {
        let mut tiles = in_flight(&[TILE]);
        for (first, data) in
            [(10, pixels(0..1)), (9, pixels(0..2)), (u32::MAX, pixels(0..1)), (0, Vec::new())]
        {
            assert!(tiles.take_pixels(3, first, &data, &limits()).is_err(), "{first}");
        }
        assert!(tiles.take_pixels(3, 0, &pixels(0..2)[1..], &limits()).is_err());
        assert!(tiles.take_pixels(4, 0, &pixels(0..2), &limits()).is_err());
    }

    #[test]
    fn a_lost_card_was_working_on_its_tiles_in_flight_alone() {
        let tile = |id| Tile { id, ..TILE };
        for at_work in 1..4 {
            let mut events = VecDeque::new();
            in_flight(&[7, 2, 5].map(tile)).give_back(at_work, &mut events);
            let lost = |id, place| Event::TileLost { tile: tile(id), was_at_work: place < at_work };
            assert_eq!(events, [lost(5, 2), lost(2, 1), lost(7, 0)]);
        }
    }
}
