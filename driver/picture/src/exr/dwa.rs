//! Checks the sizes stated in blocks with DWA compression (`OpenEXR`, "DWAA and DWAB compression") before the
//! blocks are decoded.
//!
//! The `exr` crate allocates as much memory as a block states. A few bytes could therefore end the process: a
//! failed allocation aborts it and, unlike a panic, cannot be caught.

use std::io::Cursor;

use exr::block::chunk::CompressedBlock;
use exr::error::Result;
use exr::meta::BlockDescription;
use exr::meta::header::Header;
use exr::prelude::Compression;

/// Uncompressed size, bytes, up to which a picture with DWA compression is read, however short its file is.
pub(super) const PLAIN_BYTES: u64 = 4 << 20;

/// Number of samples in a block of the discrete cosine transform.
const SAMPLES: u64 = 64;

/// Side of a block of the discrete cosine transform, pixels.
const SIDE: usize = 8;

/// Number of 64-bit counters at the beginning of a block of pixels with DWA compression.
const COUNTERS: usize = 11;

pub(super) fn is_dwa(compression: Compression) -> bool {
    matches!(compression, Compression::DWAA(_) | Compression::DWAB(_))
}

/// Memory that the transform of a block of pixels takes, bytes: 32-bit floats of three channels.
pub(super) fn transform_bytes(header: &Header) -> u64 {
    let [width, height] = padded(header);
    width.saturating_mul(height).saturating_mul(3 * size_of::<f32>() as u64)
}

/// Returns whether all sizes stated in a file's blocks with DWA compression are possible.
pub(super) fn states_possible_sizes(bytes: &[u8]) -> Result<bool> {
    let reader = exr::block::read(Cursor::new(bytes), false)?;
    let headers = reader.headers().to_vec();
    // Blocks are found by the file's offset tables, as the decoder finds them.
    for chunk in reader.filter_chunks(false, |_, _, _| true)? {
        let chunk = chunk?;
        let Some(header) = headers.get(chunk.layer_index).filter(|header| is_dwa(header.compression)) else {
            continue;
        };
        let pixels = match &chunk.compressed_block {
            CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
            CompressedBlock::Tile(block) => &block.compressed_pixels_le,
            // Deep data is not read.
            _ => continue,
        };
        if !is_possible(header, pixels) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Returns whether the sizes in a block's counters are at most those that its pixels can have. Counters
/// beyond the end of the block count as 0: such blocks are not decoded. A block as long as its plain pixels
/// is not compressed, and always possible.
fn is_possible(header: &Header, pixels: &[u8]) -> bool {
    let mut counters = [0; COUNTERS];
    for (counter, bytes) in counters.iter_mut().zip(pixels.as_chunks().0) {
        *counter = u64::from_le_bytes(*bytes);
    }
    let [_, unknown, _, _, _, _, encoded, raw, varying, constant, _] = counters;
    let block = header.max_block_byte_size() as u64;
    let [width, height] = padded(header);
    let samples = width.saturating_mul(height).saturating_mul(header.channels.list.len() as u64);
    // A run-length code takes at most two bytes for a run of one, and one byte more for 127 literals.
    let longest = block.saturating_mul(2);
    unknown <= block
        && raw <= block
        && encoded <= longest
        && varying <= samples
        && constant <= samples.div_ceil(SAMPLES)
        || pixels.len() as u64 == block
}

/// Width and height of the largest block of pixels, padded to whole blocks of the transform.
fn padded(header: &Header) -> [u64; 2] {
    let size = match header.blocks {
        BlockDescription::Tiles(tiles) => [tiles.tile_size.width(), tiles.tile_size.height()],
        BlockDescription::ScanLines => [header.layer_size.width(), header.compression.scan_lines_per_block()],
    };
    size.map(|side| side.div_ceil(SIDE).saturating_mul(SIDE) as u64)
}
