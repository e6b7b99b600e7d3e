//! The records of finished tiles in their file: `tile: x, y, width, height | pixels | CRC-32C`.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Seek};

use photoncard_shared::budget::REFERENCE;
use photoncard_shared::checksum::checksum;
use photoncard_shared::message::{PixelRecord, Tile, record_bytes};

use crate::film::Film;
use crate::sink::{FinishedTile, places};

pub(super) const PLACE_BYTES: usize = 16;
pub(super) const CHECKSUM_BYTES: usize = 4;
/// Pixels of a tile at the most: no chip has a larger budget.
const MOST_PIXELS: u64 = REFERENCE.tile_pixels as u64;
/// Bytes that a file may make a reader take for tiles in vain, besides as many as it has: some hundred of the largest tiles.
/// Without an end a hostile file would take hours.
const MOST_IN_VAIN: u64 = 32 << 20;

/// What is kept of a finished tile.
pub(super) fn record(finished: &FinishedTile) -> Vec<u8> {
    let Tile { x, y, width, height, .. } = *finished.tile();
    let mut bytes = [x, y, width, height].map(u32::to_le_bytes).concat();
    bytes.extend(finished.records());
    bytes.extend(checksum(&bytes).to_le_bytes());
    bytes
}

/// Reads all sound tiles of a file, from `start` on, into the film. Returns where the last one ends. After what is no sound tile
/// the next one is looked for at every byte: its place in the picture and its checksum tell it. What is behind a file's worth of
/// bytes, and [`MOST_IN_VAIN`] more, that were taken for tiles in vain is given up.
pub(super) fn read_tiles(reader: &mut BufReader<&File>, start: u64, film: &mut Film) -> io::Result<u64> {
    let end = reader.get_ref().metadata()?.len();
    let (mut at, mut sound) = (start, start);
    let mut in_vain = end + MOST_IN_VAIN;
    while at < end && in_vain > 0 {
        let position = reader.stream_position()?;
        reader.seek_relative(at as i64 - position as i64)?;
        match read_tile(reader, end - at, film)? {
            Found::Tile(bytes) => {
                at += bytes;
                sound = at;
            }
            Found::Nothing(bytes) => {
                at += 1;
                in_vain = in_vain.saturating_sub(bytes);
            }
        }
    }
    Ok(sound)
}

/// What was found at a byte, and how many bytes were looked at.
enum Found {
    Tile(u64),
    Nothing(u64),
}

/// Reads a tile of at most `most` bytes into the film.
fn read_tile(reader: &mut impl Read, most: u64, film: &mut Film) -> io::Result<Found> {
    let mut place = [0; PLACE_BYTES];
    if most < PLACE_BYTES as u64 || !read_all(reader, &mut place)? {
        return Ok(Found::Nothing(0));
    }
    let number = |index: usize| place.as_chunks().0.get(index).map_or(0, |bytes| u32::from_le_bytes(*bytes));
    let tile = Tile { id: 0, x: number(0), y: number(1), width: number(2), height: number(3) };
    let window = film.window();
    let fits = |first: u32, count: u32, [low, high]: [u32; 2]| {
        count > 0 && first >= low && first.checked_add(count).is_some_and(|end| end <= high)
    };
    let is_inside =
        fits(tile.x, tile.width, [window.x0, window.x1]) && fits(tile.y, tile.height, [window.y0, window.y1]);
    if !is_inside || tile.pixels() > MOST_PIXELS {
        return Ok(Found::Nothing(0));
    }
    let pixel_bytes = record_bytes(film.has_layers());
    let length = (PLACE_BYTES + CHECKSUM_BYTES) as u64 + tile.pixels() * pixel_bytes as u64;
    if length > most {
        return Ok(Found::Nothing(0));
    }
    let mut bytes = place.to_vec();
    bytes.resize(length as usize, 0);
    if !read_all(reader, &mut bytes[PLACE_BYTES..])? {
        return Ok(Found::Nothing(length));
    }
    let (bytes, sum) = bytes.split_at(length as usize - CHECKSUM_BYTES);
    if checksum(bytes).to_le_bytes() != sum {
        return Ok(Found::Nothing(length));
    }
    for ((x, y), record) in places(&tile).zip(bytes[PLACE_BYTES..].chunks_exact(pixel_bytes)) {
        // The tile lies inside the window, and records have their length.
        let _ = PixelRecord::read(record).map(|record| film.write_record(x, y, &record));
    }
    Ok(Found::Tile(length))
}

/// Fills a buffer. Returns whether there were so many bytes.
fn read_all(reader: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match reader.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}
