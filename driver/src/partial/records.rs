//! The records of finished tiles in their file: `magic number | x, y, width, height | pixels | CRC-32C`.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek};

use photoncard_firmware::kind::REFERENCE;
use photoncard_shared::checksum::checksum;
use photoncard_shared::message::{PixelRecord, Tile, record_bytes};

use crate::film::Film;
use crate::sink::{FinishedTile, pixel_positions};

/// What a record begins with. As of a PNG file, a transfer that alters the ends of lines or the eighth bits is found out.
pub(super) const MAGIC: [u8; 8] = *b"\x89TILE\r\n\x1a";
/// Bytes of the magic number, and of the tile's place and size.
pub(super) const HEAD_BYTES: usize = MAGIC.len() + 16;
pub(super) const CHECKSUM_BYTES: usize = 4;
/// Pixels of a tile at the most: no chip has a larger budget.
const MAX_PIXELS: u64 = REFERENCE.tile_pixels as u64;
/// Bytes that a file may make a reader take for tiles in vain, besides as many as it has: some hundred of the largest tiles.
/// Without an end a hostile file would take hours.
const MAX_IN_VAIN: u64 = 32 << 20;

/// What is kept of a finished tile.
pub(super) fn record(finished: &FinishedTile) -> Vec<u8> {
    let Tile { x, y, width, height, .. } = *finished.tile();
    let mut bytes = MAGIC.to_vec();
    bytes.extend([x, y, width, height].map(u32::to_le_bytes).as_flattened());
    bytes.extend(finished.records());
    bytes.extend(checksum(&bytes).to_le_bytes());
    bytes
}

/// Reads all sound tiles of a file, from `start` on, into the film. Returns where the last one ends. After what is no sound
/// record the next one is looked for behind the magic number. What is behind a file's worth of bytes, and [`MAX_IN_VAIN`] more,
/// that were taken for tiles in vain is given up.
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

/// Goes on behind the next magic number. Returns the bytes up to there; `None` if the file ends before.
fn skip_magic(reader: &mut impl BufRead) -> io::Result<Option<u64>> {
    let (mut skipped, mut matched) = (0, 0);
    loop {
        let buffer = reader.fill_buf()?;
        let length = buffer.len();
        if length == 0 {
            return Ok(None);
        }
        for (byte, count) in buffer.iter().zip(1..) {
            // Its first byte is not among its others: where a match fails none has begun within it.
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

/// Reads what follows a magic number into the film, at most `available` bytes. Returns how many it was; `None` if it is damaged.
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
        // The tile lies inside the window, and records have their length.
        let _ = PixelRecord::read(record).map(|record| film.write_record(x, y, &record));
    }
    Ok(Some(behind_magic))
}

/// The tile of a place and a size, if the film and a chip have room for it.
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

/// Fills a buffer. Returns whether there were so many bytes.
fn read_all(reader: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match reader.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}
