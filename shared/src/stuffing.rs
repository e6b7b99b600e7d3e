//! Consistent overhead byte stuffing (COBS; Cheshire, Baker 1999): an encoding without zero bytes.
//!
//! The plain bytes are cut at every zero byte, which is left out, and after 254 non-zero bytes in a row. Each piece
//! follows a code byte, its length plus one. A code below 255 stands for a zero byte after its piece, but for the last
//! piece.

use core::cell::Cell;

use heapless::Vec;

/// Code of a piece of 254 bytes, the longest: no zero byte follows it.
const FULL: u8 = 0xff;

/// Maximum stuffed length of `plain` bytes.
pub const fn max_stuffed_bytes(plain: usize) -> usize {
    plain + plain.div_ceil(FULL as usize - 1) + (plain == 0) as usize
}

/// Appends the stuffed bytes of `plain` to `wire`. Returns whether there was room; if not, `wire` holds a part of them.
pub fn stuff<const N: usize>(plain: impl IntoIterator<Item = u8>, wire: &mut Vec<u8, N>) -> bool {
    let mut piece = Vec::<u8, { FULL as usize - 1 }>::new();
    let mut is_open = true;
    for byte in plain {
        if !is_open {
            is_open = true;
            piece.clear();
        }
        if byte == 0 {
            if !write_piece(&piece, wire) {
                return false;
            }
            piece.clear();
        } else if piece.push(byte).is_ok() && piece.is_full() {
            // A full piece that ends the message has no piece after it: the next plain byte opens one.
            is_open = false;
            if !write_piece(&piece, wire) {
                return false;
            }
        }
    }
    !is_open || write_piece(&piece, wire)
}

fn write_piece<const N: usize>(piece: &[u8], wire: &mut Vec<u8, N>) -> bool {
    wire.push(piece.len() as u8 + 1).is_ok() && wire.extend_from_slice(piece).is_ok()
}

/// Decodes stuffed bytes, without the terminating zero, in place; `None` if they are not a COBS encoding.
pub fn unstuff(wire: &mut [u8]) -> Option<&mut [u8]> {
    let cells = Cell::from_mut(&mut *wire).as_slice_of_cells();
    // In place: the write position stays behind the read position, as every piece is preceded by a code byte.
    let (mut rest, mut targets) = (cells, cells.iter());
    let (mut length, mut ends_with_zero) = (0, false);
    while let Some((code, behind)) = rest.split_first() {
        let code = code.get();
        if ends_with_zero {
            targets.next()?.set(0);
            length += 1;
        }
        let (piece, behind) = behind.split_at_checked(usize::from(code.checked_sub(1)?))?;
        for (byte, target) in piece.iter().zip(&mut targets) {
            target.set(byte.get());
        }
        length += piece.len();
        ends_with_zero = code != FULL;
        rest = behind;
    }
    wire.get_mut(..length)
}
