//! The tiles at a card.

use photoncard_shared::message::{FrameParameters, PixelRecord, Tile, record_bytes};

use super::{Picture, SessionError};

/// The tiles at a card, in the order in which it was given them.
#[derive(Default)]
pub(super) struct TilesInFlight(Vec<TileInFlight>);

struct TileInFlight {
    tile: Tile,
    /// Pixels that have come.
    pixels: u64,
}

impl TilesInFlight {
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn push(&mut self, tile: Tile) {
        self.0.push(TileInFlight { tile, pixels: 0 });
    }

    /// Takes a tile's next pixels, with layers if the film has any.
    pub(super) fn take_pixels(
        &mut self,
        id: u32,
        first: u32,
        data: &[u8],
        picture: &Picture,
    ) -> Result<(), SessionError> {
        let in_flight = self.0.iter_mut().find(|in_flight| in_flight.tile.id == id);
        let in_flight = in_flight.ok_or(SessionError::Unexpected("pixels of another tile"))?;
        let mut film = picture.film();
        let pixels = data.chunks_exact(record_bytes(film.has_layers()));
        let is_whole = pixels.remainder().is_empty();
        let end = first as u64 + pixels.len() as u64;
        let are_next = first as u64 == in_flight.pixels && end <= in_flight.tile.pixels();
        if !are_next || data.is_empty() || !is_whole {
            return Err(SessionError::Unexpected("pixels that are not the next"));
        }
        in_flight.pixels = end;
        let Tile { x, y, width, .. } = in_flight.tile;
        for (index, pixel) in (first..).zip(pixels) {
            let record = PixelRecord::read(pixel).unwrap_or_default();
            film.write_record(x + index % width, y + index / width, &record)?;
        }
        Ok(())
    }

    /// The card is done with a tile: it must have sent all pixels.
    pub(super) fn complete(&mut self, id: u32, picture: &Picture) -> Result<(), SessionError> {
        let is_complete =
            |in_flight: &TileInFlight| in_flight.tile.id == id && in_flight.pixels == in_flight.tile.pixels();
        let index = self.0.iter().position(is_complete);
        let index = index.ok_or(SessionError::Unexpected("a tile that is not complete"))?;
        picture.complete(&self.0.remove(index).tile);
        Ok(())
    }

    /// Gives back all tiles. The one that the card was at is the next to be taken: if it is what the card crashes at, no other
    /// tile is completed between two crashes.
    pub(super) fn give_back(&mut self, picture: &Picture) {
        for in_flight in self.0.drain(..).rev() {
            picture.scheduler().give_back(in_flight.tile);
        }
    }

    /// The rays of the largest tile, roughly.
    pub(super) fn most_rays(&self, frame: &FrameParameters) -> u64 {
        let pixels = self.0.iter().map(|in_flight| in_flight.tile.pixels()).max().unwrap_or(0);
        let rays_of_sample = 2 + u64::from(frame.shadow_rays) + u64::from(frame.gather_rays);
        pixels.saturating_mul(u64::from(frame.samples)).saturating_mul(rays_of_sample)
    }
}
