//! Decoder of attribute streams, versions 0 and 1. Elements are coded in blocks. Lane i of a block is byte i
//! of each element, stored as differences between successive elements.

/// Number of elements whose differences share a bit width.
const GROUP: usize = 16;

/// Maximum number of elements of a block.
const MAX_BLOCK: usize = 256;

/// Maximum size of a block, bytes.
const BLOCK_BYTES: usize = 8192;

/// First bytes of streams of versions 0 and 1.
const HEADERS: [u8; 2] = [0xa0, 0xa1];

/// Minimum size of the tail of a stream (first baseline and channel modes) in versions 0 and 1, bytes.
const TAILS: [usize; 2] = [32, 24];

/// Bit widths of a group's differences, indexed by the group's two-bit code. The rows are for version 0, and
/// for lane modes 0 and 1 of version 1.
const WIDTHS: [[u32; 4]; 3] = [[0, 2, 4, 8], [0, 1, 2, 4], [1, 2, 4, 8]];

/// Lane mode of version 1 whose differences are all zero.
const CONTROL_ZERO: u8 = 2;
const CONTROL_LITERAL: u8 = 3;

/// Decodes elements of `stride` bytes; `None` if the stream is damaged.
pub(super) fn decode(mut stream: &[u8], stride: usize, decoded: &mut [u8]) -> Option<()> {
    let header = stream.split_off_first()?;
    let version = HEADERS.iter().position(|known| known == header)?;
    let tail_bytes = stride + version * stride / 4;
    let padded = tail_bytes.max(TAILS[version]);
    let tail = stream.split_off(stream.len().checked_sub(padded)?..)?;
    let (baseline, channels) = tail.get(padded - tail_bytes..)?.split_at_checked(stride)?;
    let mut last = baseline.to_vec();
    let block = (BLOCK_BYTES / stride / GROUP * GROUP).min(MAX_BLOCK);
    let mut lanes = vec![0; block * stride];
    for elements in decoded.chunks_mut(block * stride) {
        let count = elements.len() / stride;
        let aligned = count.next_multiple_of(GROUP);
        read_lanes(&mut stream, version, stride, count, &mut lanes)?;
        for (index, element) in elements.chunks_exact_mut(stride).enumerate() {
            add(&lanes, aligned, index, channels, &mut last)?;
            element.copy_from_slice(&last);
        }
    }
    stream.is_empty().then_some(())
}

/// Reads the differences of a block, one lane for each byte of an element.
fn read_lanes(
    stream: &mut &[u8],
    version: usize,
    stride: usize,
    count: usize,
    lanes: &mut [u8],
) -> Option<()> {
    let controls = stream.split_off(..version * stride / 4)?;
    let aligned = count.next_multiple_of(GROUP);
    for (index, lane) in lanes.chunks_exact_mut(aligned).take(stride).enumerate() {
        let control = controls.get(index / 4).map_or(0, |byte| byte >> (2 * (index % 4)) & 3);
        match control {
            CONTROL_ZERO => lane.fill(0),
            CONTROL_LITERAL => lane[..count].copy_from_slice(stream.split_off(..count)?),
            _ => read_groups(stream, WIDTHS[version * (1 + usize::from(control))], lane)?,
        }
    }
    Some(())
}

/// Reads a lane in groups. Each group has one of the four bit widths.
fn read_groups(stream: &mut &[u8], widths: [u32; 4], lane: &mut [u8]) -> Option<()> {
    let codes = stream.split_off(..(lane.len() / GROUP).div_ceil(4))?;
    for (index, group) in lane.chunks_exact_mut(GROUP).enumerate() {
        let code = codes[index / 4] >> (2 * (index % 4)) & 3;
        match widths[usize::from(code)] {
            0 => group.fill(0),
            8 => group.copy_from_slice(stream.split_off(..GROUP)?),
            width => read_narrow(stream, width, group)?,
        }
    }
    Some(())
}

/// Reads a group of differences of 1, 2 or 4 bits. If all bits of a difference are set, its value is instead
/// a byte that follows the group.
fn read_narrow(stream: &mut &[u8], width: u32, group: &mut [u8]) -> Option<()> {
    let each = 8 / width;
    let packed = stream.split_off(..GROUP / each as usize)?;
    let escape = (1 << width) - 1;
    for (index, difference) in (0..).zip(group) {
        let place = index % each;
        // Single bits are stored from the least significant one on, wider differences from the most
        // significant.
        let shift = if width == 1 { place } else { 8 - width * (place + 1) };
        let value = packed[(index / each) as usize] >> shift & escape;
        *difference = if value == escape { *stream.split_off_first()? } else { value };
    }
    Some(())
}

/// Adds the difference at `index` of each lane to `last`, the bytes of the previous element. `channels` has
/// one mode for each four bytes of an element; it is empty in version 0.
fn add(lanes: &[u8], lane_bytes: usize, index: usize, channels: &[u8], last: &mut [u8]) -> Option<()> {
    for (channel, word) in last.as_chunks_mut::<4>().0.iter_mut().enumerate() {
        let difference = [0, 1, 2, 3].map(|byte| lanes[(4 * channel + byte) * lane_bytes + index]);
        let form = channels.get(channel).copied().unwrap_or(0);
        *word = match form & 3 {
            0 => [0, 1, 2, 3].map(|byte| word[byte].wrapping_add(signed_byte(difference[byte]))),
            1 => {
                let half = |at: usize| {
                    let difference = u16::from_le_bytes([difference[at], difference[at + 1]]);
                    u16::from_le_bytes([word[at], word[at + 1]]).wrapping_add(signed_half(difference))
                };
                let ([a, b], [c, d]) = (half(0).to_le_bytes(), half(2).to_le_bytes());
                [a, b, c, d]
            }
            2 => {
                let turned = u32::from_le_bytes(difference).rotate_right(u32::from(form >> 4));
                (u32::from_le_bytes(*word) ^ turned).to_le_bytes()
            }
            _ => return None,
        };
    }
    Some(())
}

/// Decodes the zigzag code of a signed byte, in two's complement.
fn signed_byte(code: u8) -> u8 {
    (code >> 1) ^ (code & 1).wrapping_neg()
}

fn signed_half(code: u16) -> u16 {
    (code >> 1) ^ (code & 1).wrapping_neg()
}
