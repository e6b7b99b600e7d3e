//! Tiles assigned to a card.

use std::collections::VecDeque;

use photoncard_shared::counters::Counters;
use photoncard_shared::message::{FrameParameters, PixelRecord};

use super::pixel_limits::{BadValue, PixelLimits};
use super::{Assignment, Event, SessionError};
use crate::sink::FinishedTile;

/// Tiles assigned to a card, in the order of assignment.
#[derive(Default)]
pub(super) struct TilesInFlight(Vec<TileInFlight>);

struct TileInFlight {
    assignment: Assignment,
    /// Records of the pixels received so far, all valid.
    records: Vec<u8>,
}

impl TilesInFlight {
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn push(&mut self, assignment: Assignment) {
        self.0.push(TileInFlight { assignment, records: Vec::new() });
    }

    /// Returns whether cards have crashed before at the tile that the card is working on.
    pub(super) fn is_at_suspect(&self) -> bool {
        self.0.first().is_some_and(|in_flight| in_flight.assignment.is_suspect)
    }

    /// Receives the next pixels of a tile.
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
        let bytes = limits.record_bytes();
        let pixels = data.chunks_exact(bytes);
        let end = u64::from(first) + pixels.len() as u64;
        let come = (in_flight.records.len() / bytes) as u64;
        if u64::from(first) != come
            || end > tile.pixels()
            || data.is_empty()
            || !pixels.remainder().is_empty()
        {
            return Err(SessionError::Unexpected("pixels that are not the next"));
        }
        for (index, pixel) in (first..).zip(pixels) {
            let record = PixelRecord::read(pixel).unwrap_or_default();
            if let Some(BadValue { channel, value }) = limits.find_bad(&record) {
                let (x, y) = (tile.x + index % tile.width, tile.y + index / tile.width);
                return Err(SessionError::Value { tile, x, y, channel, value });
            }
        }
        in_flight.records.extend_from_slice(data);
        Ok(())
    }

    /// Completes a tile, whose pixels must all have been received.
    pub(super) fn complete(
        &mut self,
        id: u32,
        counters: Counters,
        limits: &PixelLimits,
    ) -> Result<FinishedTile, SessionError> {
        let not_complete = SessionError::Unexpected("a tile that is not complete");
        let index = self.0.iter().position(|in_flight| in_flight.assignment.tile.id == id);
        let Some(index) = index else { return Err(not_complete) };
        let TileInFlight { assignment, records } = self.0.remove(index);
        let tile = assignment.tile;
        let bytes = tile.pixels() * limits.record_bytes() as u64;
        if records.len() as u64 != bytes {
            self.0.insert(index, TileInFlight { assignment, records });
            return Err(not_complete);
        }
        FinishedTile::new(tile, records, limits.has_layers(), counters).ok_or(not_complete)
    }

    /// Returns all tiles as events, in reverse order; the one that the card was working on is the last.
    pub(super) fn give_back(&mut self, events: &mut VecDeque<Event>) {
        while let Some(TileInFlight { assignment, .. }) = self.0.pop() {
            events.push_back(Event::TileLost { tile: assignment.tile, was_at_work: self.0.is_empty() });
        }
    }

    /// Approximate number of rays of the largest tile.
    pub(super) fn most_rays(&self, frame: &FrameParameters) -> u64 {
        let pixels = self.0.iter().map(|in_flight| in_flight.assignment.tile.pixels()).max().unwrap_or(0);
        let rays_of_sample = 2 + u64::from(frame.shadow_rays) + u64::from(frame.gather_rays);
        pixels.saturating_mul(u64::from(frame.samples)).saturating_mul(rays_of_sample)
    }
}
