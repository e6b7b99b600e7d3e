//! Consistent overhead byte stuffing (COBS; Cheshire, Baker 1999): an encoding without zero bytes.
//!
//! The plain bytes are cut into pieces at every zero byte, which is dropped, and after every 254 non-zero
//! bytes in a row. A code byte, the piece's length plus one, precedes each piece. After a piece with a code
//! below 255, unless it is the last, the decoder inserts the dropped zero byte.

use heapless::Vec;

/// Code of a piece of 254 bytes, the longest. No zero byte follows such a piece.
const FULL: u8 = 0xff;

/// Returns the maximum length of `plain` bytes after stuffing.
pub const fn max_stuffed_bytes(plain: usize) -> usize {
    plain + plain.div_ceil(FULL as usize - 1) + (plain == 0) as usize
}

/// Stuffs the concatenation of `parts` and appends the result to `wire`. Returns false, and appends nothing,
/// if there is no room.
pub fn stuff<const N: usize>(parts: &[&[u8]], wire: &mut Vec<u8, N>) -> bool {
    let begin = wire.len();
    let plain = parts.iter().map(|part| part.len()).sum();
    // The new length fits: it is at most the capacity.
    let _ = wire.resize_default(N.min(begin + max_stuffed_bytes(plain)));
    let written = wire.get_mut(begin..).and_then(|room| write_pieces(parts, room));
    wire.truncate(begin + written.unwrap_or(0));
    written.is_some()
}

/// Writes the stuffed bytes to the front of `room`. Returns their number; `None` if there is no room.
fn write_pieces(parts: &[&[u8]], room: &mut [u8]) -> Option<usize> {
    let (mut code, mut place) = (0, 1);
    for &part in parts {
        for &byte in part {
            // A full piece that ends the message has no piece after it: the next plain byte opens one.
            if place - code == usize::from(FULL) {
                code = place;
                place += 1;
            }
            // No branch depends on whether a byte is zero, because it would be mispredicted. A zero byte is
            // written to the position of the next code, which replaces it.
            *room.get_mut(place)? = byte;
            *room.get_mut(code)? = (place - code) as u8 + u8::from(byte != 0);
            code = if byte == 0 { place } else { code };
            place += 1;
        }
    }
    *room.get_mut(code)? = (place - code) as u8;
    Some(place)
}

/// Decodes stuffed bytes, without the terminating zero, in place; `None` if they are not a COBS encoding.
/// `wire` must hold no zero byte.
pub fn unstuff(wire: &mut [u8]) -> Option<&mut [u8]> {
    // Each plain byte stays in place, and each code but the first is overwritten by the zero byte before its
    // piece. There is no such zero byte after a full piece: the code there is removed, and the bytes before
    // it move up by one.
    let mut begin = 1;
    let mut place = 0;
    let mut is_zero = false;
    while place < wire.len() {
        let code = core::mem::take(wire.get_mut(place)?);
        if place > 0 && !is_zero {
            // The slice is never empty, but the compiler cannot see that; `rotate_right` panics on an empty
            // slice.
            if let Some(moved @ [_, ..]) = wire.get_mut(begin..=place) {
                moved.rotate_right(1);
            }
            begin += 1;
        }
        is_zero = code != FULL;
        place += usize::from(code.checked_sub(1)?) + 1;
    }
    if place == wire.len() { wire.get_mut(begin.min(place)..) } else { None }
}
