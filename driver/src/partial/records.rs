//! Records of finished tiles in a partial render: `magic number | x, y, width, height | pixels | CRC-32C`.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek};

use photoncard_firmware::kind::REFERENCE;
use photoncard_shared::checksum::checksum;
use photoncard_shared::message::{PixelRecord, Tile, record_bytes};

use crate::film::Film;
use crate::sink::{FinishedTile, pixel_positions};

/// Magic number of a record. As in PNG, a transfer that alters line ends or eighth bits destroys it.
pub(super) const MAGIC: [u8; 8] = *b"\x89TILE\r\n\x1a";
/// Size of magic number, position and size of the tile, bytes.
pub(super) const HEAD_BYTES: usize = MAGIC.len() + 16;
pub(super) const CHECKSUM_BYTES: usize = 4;
/// Maximum number of pixels of a tile: the largest budget of a chip.
const MAX_PIXELS: u64 = REFERENCE.tile_pixels as u64;
/// Limit of the bytes that a reader may spend on invalid tiles, in addition to the file's size: some hundred of the largest
/// tiles. Without a limit, a hostile file would take hours.
const MAX_IN_VAIN: u64 = 32 << 20;

/// Encodes the record of a finished tile.
pub(super) fn record(finished: &FinishedTile) -> Vec<u8> {
    let Tile { x, y, width, height, .. } = *finished.tile();
    let mut bytes = MAGIC.to_vec();
    bytes.extend([x, y, width, height].map(u32::to_le_bytes).as_flattened());
    bytes.extend(finished.records());
    bytes.extend(checksum(&bytes).to_le_bytes());
    bytes
}

/// Reads all valid tiles from offset `start` on into the film. Returns the end of the last one. After invalid bytes the
/// search continues at the next magic number. It stops when the invalid tiles exceed the file's size plus [`MAX_IN_VAIN`].
pub(super) fn read_tiles(reader: &mut BufReader<&File>, start: u64, film: &mut Film) -> io::Result<u64> {
    let end = reader.get_ref().metadata()?.len();
    let (mut at, mut sound) = (start, start);
    let mut in_vain = end + MAX_IN_VAIN;
    while let Some(skipped) = skip_magic(reader)? {
        at += skipped;
        match read_tile(reader, end.saturating_sub(at), film)? {
            Some(bytes) => {
                at += bytes;
                sound = at;
            }
            None => {
                let read = reader.stream_position()? - at;
                reader.seek_relative(-(read as i64))?;
                in_vain = in_vain.saturating_sub(read);
                if in_vain == 0 {
                    break;
                }
            }
        }
    }
    Ok(sound)
}

/// Skips to the end of the next magic number. Returns the number of bytes skipped; `None` if the file ends before.
fn skip_magic(reader: &mut impl BufRead) -> io::Result<Option<u64>> {
    let (mut skipped, mut matched) = (0, 0);
    loop {
        let buffer = reader.fill_buf()?;
        let length = buffer.len();
        if length == 0 {
            return Ok(None);
        }
        for (byte, count) in buffer.iter().zip(1..) {
            // The first byte of the magic number does not recur in it: no other match can begin within a failed one.
            matched = if *byte == MAGIC[matched] { matched + 1 } else { usize::from(*byte == MAGIC[0]) };
            if matched == MAGIC.len() {
                reader.consume(count);
                return Ok(Some(skipped + count as u64));
            }
        }
        reader.consume(length);
        skipped += length as u64;
    }
}

/// Reads a tile after its magic number into the film, at most `available` bytes. Returns their number; `None` if it is
/// invalid.
fn read_tile(reader: &mut impl Read, available: u64, film: &mut Film) -> io::Result<Option<u64>> {
    let mut bytes = MAGIC.to_vec();
    bytes.resize(HEAD_BYTES, 0);
    if !read_all(reader, &mut bytes[MAGIC.len()..])? {
        return Ok(None);
    }
    let pixel_bytes = record_bytes(film.has_layers());
    let Some(tile) = tile_at(&bytes[MAGIC.len()..], film) else { return Ok(None) };
    let length = (HEAD_BYTES + CHECKSUM_BYTES) as u64 + tile.pixels() * pixel_bytes as u64;
    let behind_magic = length - MAGIC.len() as u64;
    if behind_magic > available {
        return Ok(None);
    }
    bytes.resize(length as usize, 0);
    if !read_all(reader, &mut bytes[HEAD_BYTES..])? {
        return Ok(None);
    }
    let (bytes, sum) = bytes.split_at(length as usize - CHECKSUM_BYTES);
    if checksum(bytes).to_le_bytes() != sum {
        return Ok(None);
    }
    for ((x, y), record) in pixel_positions(&tile).zip(bytes[HEAD_BYTES..].chunks_exact(pixel_bytes)) {
        // Cannot fail: the tile lies inside the window, and records have their full length.
        let _ = PixelRecord::read(record).map(|record| film.write_record(x, y, &record));
    }
    Ok(Some(behind_magic))
}

/// Decodes position and size of a tile; `None` unless it lies in the film's window and within a chip's budget.
fn tile_at(bytes: &[u8], film: &Film) -> Option<Tile> {
    let number = |index: usize| bytes.as_chunks().0.get(index).map(|bytes| u32::from_le_bytes(*bytes));
    let tile = Tile { id: 0, x: number(0)?, y: number(1)?, width: number(2)?, height: number(3)? };
    let window = film.window();
    let fits = |first: u32, count: u32, [low, high]: [u32; 2]| {
        count > 0 && first >= low && first.checked_add(count).is_some_and(|end| end <= high)
    };
    let is_inside =
        fits(tile.x, tile.width, [window.x0, window.x1]) && fits(tile.y, tile.height, [window.y0, window.y1]);
    (is_inside && tile.pixels() <= MAX_PIXELS).then_some(tile)
}

/// Fills a buffer. Returns false at the end of the file.
fn read_all(reader: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match reader.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}
