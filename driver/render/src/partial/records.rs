//! Records of finished tiles in a partial render:
//! `magic number | x, y, width, height | first sample, samples | pixels | CRC-32C`.
//!
//! The CRC-32C of a record also covers the checksum of the head of its file. If a copy of another file over
//! this one was interrupted, the remaining records of this file are therefore invalid.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek};

use photoncard_firmware::kind::REFERENCE;
use photoncard_picture::film::Window;
use photoncard_picture::sink::{FinishedTile, pixel_positions};
use photoncard_picture::sums::SumFormat;
use photoncard_shared::checksum::Checksum;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{PixelSums, Tile};

use super::samples::{KeptSamples, SampleRange};

/// Magic number of a record. As in PNG, a transfer that changes line ends or clears the eighth bit destroys
/// it.
pub(super) const MAGIC: [u8; 8] = *b"\x89TILE\r\n\x1a";
/// Number of bytes of a record before its pixels: magic number, position and size of the tile, and range of
/// samples.
pub(super) const HEAD_BYTES: usize = MAGIC.len() + 24;
pub(super) const CHECKSUM_BYTES: usize = 4;
/// Maximum number of pixels of a tile, over all kinds of chips.
const MAX_PIXELS: u64 = REFERENCE.tile_pixels as u64;
/// Maximum number of bytes that are read for invalid records, in addition to the size of the file: some
/// hundred of the largest tiles. Without this limit, a hostile file would take hours.
const MAX_IN_VAIN: u64 = 32 << 20;

/// Encodes the record of a finished tile. The tile's samples begin with number `first_sample`; `file` is the
/// checksum of the file's head.
pub(crate) fn record(finished: &FinishedTile, first_sample: u32, file: u32) -> Vec<u8> {
    let mut bytes = head(finished.tile(), first_sample, finished.format().samples);
    bytes.extend(finished.records());
    bytes.extend(checksum(file, &bytes));
    bytes
}

/// CRC-32C of the checksum of a file's head followed by the bytes of a record.
fn checksum(file: u32, record: &[u8]) -> [u8; CHECKSUM_BYTES] {
    let mut sum = Checksum::default();
    sum.update(&file.to_le_bytes());
    sum.update(record);
    sum.value().to_le_bytes()
}

/// Encodes the part of a tile's record before its pixels.
fn head(tile: &Tile, first_sample: u32, samples: u32) -> Vec<u8> {
    let Tile { x, y, width, height, .. } = *tile;
    let mut bytes = MAGIC.to_vec();
    bytes.extend([x, y, width, height, first_sample, samples].map(u32::to_le_bytes).as_flattened());
    bytes
}

pub(crate) fn record_bytes(tile: &Tile, format: &SumFormat) -> u64 {
    (HEAD_BYTES + CHECKSUM_BYTES) as u64 + tile.pixels() * format.record_bytes() as u64
}

/// Decodes the record of the tile `tile` with all samples of `format`. `file` is the checksum of the file's
/// head. Returns `None` if the record is incomplete, invalid or of another tile.
pub(crate) fn decode(record: &[u8], tile: &Tile, format: SumFormat, file: u32) -> Option<FinishedTile> {
    let (bytes, sum) = record.split_last_chunk::<CHECKSUM_BYTES>()?;
    let pixels = bytes.strip_prefix(&*head(tile, 0, format.samples))?;
    let is_sound = checksum(file, bytes) == *sum;
    is_sound.then(|| FinishedTile::new(*tile, pixels.to_vec(), format, Counters::ZERO)).flatten()
}

/// Reads all valid tiles from offset `start` on into `kept`. Returns the offset of the end of the last one.
/// `file` is the checksum of the file's head. After invalid bytes the search continues at the next magic
/// number. It ends when more bytes were read for invalid records than the file's size plus [`MAX_IN_VAIN`].
pub(super) fn read_tiles(
    reader: &mut BufReader<&File>,
    start: u64,
    file: u32,
    kept: &mut KeptSamples,
) -> io::Result<u64> {
    let end = reader.get_ref().metadata()?.len();
    let (mut at, mut sound) = (start, start);
    let mut in_vain = end + MAX_IN_VAIN;
    while let Some(skipped) = skip_magic(reader)? {
        at += skipped;
        match read_tile(reader, file, end.saturating_sub(at), kept)? {
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

/// Returns whether the file has a record after the reader's position.
pub(super) fn has_record(reader: &mut impl BufRead) -> io::Result<bool> {
    Ok(skip_magic(reader)?.is_some())
}

/// Skips to the end of the next magic number. Returns the number of bytes skipped; `None` if the file ends
/// first.
fn skip_magic(reader: &mut impl BufRead) -> io::Result<Option<u64>> {
    let (mut skipped, mut matched) = (0, 0);
    loop {
        let buffer = reader.fill_buf()?;
        let length = buffer.len();
        if length == 0 {
            return Ok(None);
        }
        for (byte, count) in buffer.iter().zip(1..) {
            // The first byte of the magic number occurs in it only once. After a mismatch, a match can
            // therefore begin only at the current byte.
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

/// Reads the record after a magic number, at most `available` bytes, and writes its pixels into the film of
/// its samples. Returns the number of bytes read; `None` if the record is invalid.
fn read_tile(
    reader: &mut impl Read,
    file: u32,
    available: u64,
    kept: &mut KeptSamples,
) -> io::Result<Option<u64>> {
    let mut bytes = MAGIC.to_vec();
    bytes.resize(HEAD_BYTES, 0);
    if !read_all(reader, &mut bytes[MAGIC.len()..])? {
        return Ok(None);
    }
    let form = kept.format().form;
    let pixel_bytes = form.record_bytes();
    let Some((tile, samples)) = tile_at(&bytes[MAGIC.len()..], kept.window()) else { return Ok(None) };
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
    if checksum(file, bytes) != sum {
        return Ok(None);
    }
    let records = bytes[HEAD_BYTES..].chunks_exact(pixel_bytes);
    let all = records.map(|record| PixelSums::read(form, record)).collect::<Option<Vec<_>>>();
    let Some(all) = all else { return Ok(None) };
    if let Some(film) = kept.film_of(samples) {
        for ((x, y), sums) in pixel_positions(&tile).zip(&all) {
            // Writing cannot fail: the tile lies inside the window.
            let _ = film.write(x, y, sums);
        }
    }
    Ok(Some(behind_magic))
}

/// Decodes position and size of a tile, and its range of samples. Returns `None` if the tile is not inside
/// the window, is too large for any chip, or if the range is empty.
fn tile_at(bytes: &[u8], window: Window) -> Option<(Tile, SampleRange)> {
    let number = |index: usize| bytes.as_chunks().0.get(index).map(|bytes| u32::from_le_bytes(*bytes));
    let tile = Tile { id: 0, x: number(0)?, y: number(1)?, width: number(2)?, height: number(3)? };
    let samples = SampleRange { first: number(4)?, count: number(5)? };
    let fits = |first: u32, count: u32, [low, high]: [u32; 2]| {
        count > 0 && first >= low && first.checked_add(count).is_some_and(|end| end <= high)
    };
    let is_inside =
        fits(tile.x, tile.width, [window.x0, window.x1]) && fits(tile.y, tile.height, [window.y0, window.y1]);
    let is_range = fits(samples.first, samples.count, [0, u32::MAX]);
    (is_inside && is_range && tile.pixels() <= MAX_PIXELS).then_some((tile, samples))
}

/// Fills a buffer. Returns false at the end of the file.
fn read_all(reader: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match reader.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}
