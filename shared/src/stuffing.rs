//! Consistent overhead byte stuffing (Cheshire, Baker 1999): bytes without a zero byte among them.
//!
//! The bytes are cut where they are zero and after 254 others. Each piece comes behind a code, its length plus one; after
//! a piece whose code is below 255, and which is not the last, a zero is meant.

use core::cell::Cell;

use heapless::Vec;

const FULL: u8 = 0xff;

/// Bytes that `plain` bytes take at most.
pub const fn max_stuffed_bytes(plain: usize) -> usize {
    plain + plain.div_ceil(FULL as usize - 1) + (plain == 0) as usize
}

/// Writes the stuffed bytes of `plain` behind what `wire` holds. Returns whether there was room; if not, the last piece
/// may be missing.
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
            // Whether another piece follows is told by the next byte.
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

/// Turns stuffed bytes, without their final zero, into what they stand for, in place; `None` if they stand for nothing.
pub fn unstuff(wire: &mut [u8]) -> Option<&mut [u8]> {
    let cells = Cell::from_mut(&mut *wire).as_slice_of_cells();
    // The plain bytes are fewer than the stuffed ones that have been read: what is written is not read again.
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
