//! Card images in the program of a card, as constants.
//!
//! ```ignore
//! const FILE: &[u8] = include_bytes!("scene.card");
//! static IMAGE: [Line; lines_in(FILE)] = lines_of(FILE);
//! ```

use crate::address::{LINE_BYTES, Line};
use crate::image::MAGIC;

/// Alignment of the card image in the file of a prepared scene (`photoncard prepare`), bytes.
pub const FILE_ALIGNMENT: usize = 4096;

/// Offset in bytes of the card image in the file of a prepared scene: the first multiple of
/// [`FILE_ALIGNMENT`] at which [`MAGIC`] stands. The file's length if there is none.
const fn start(file: &[u8]) -> usize {
    let mut offset = 0;
    while offset + MAGIC.len() <= file.len() {
        let (_, image) = file.split_at(offset);
        if let Some(magic) = image.first_chunk()
            && u64::from_le_bytes(*magic) == u64::from_le_bytes(MAGIC)
        {
            return offset;
        }
        offset += FILE_ALIGNMENT;
    }
    file.len()
}

/// Number of lines of the card image in the file of a prepared scene; 0 if the file holds none.
pub const fn lines_in(file: &[u8]) -> usize {
    (file.len() - start(file)) / LINE_BYTES
}

/// First `N` lines of the card image in the file of a prepared scene. Lines past its end are zero.
pub const fn lines_of<const N: usize>(file: &[u8]) -> [Line; N] {
    let (_, mut rest) = file.split_at(start(file));
    let mut lines = [Line::ZERO; N];
    let mut left: &mut [Line] = &mut lines;
    while let (Some((line, after)), Some((next, others))) = (rest.split_first_chunk(), left.split_first_mut())
    {
        *next = Line(*line);
        (rest, left) = (after, others);
    }
    lines
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec;

    use super::*;

    #[test]
    fn an_image_is_found_behind_the_heading_of_its_file() {
        let mut file = vec![7; 3 * FILE_ALIGNMENT];
        file[2 * FILE_ALIGNMENT..][..8].copy_from_slice(&MAGIC);
        file.extend([9; LINE_BYTES + 1]);
        assert_eq!(lines_in(&file), FILE_ALIGNMENT / LINE_BYTES + 1);
        let lines = lines_of::<40>(&file);
        assert!(lines[0].0.starts_with(&MAGIC));
        assert_eq!((lines[32], lines[33]), (Line([9; LINE_BYTES]), Line::ZERO));
    }

    #[test]
    fn a_file_without_an_image_has_no_lines() {
        for length in [0, 7, 128, 5000] {
            assert_eq!(lines_in(&vec![1; length]), 0, "{length}");
            assert_eq!(lines_of::<1>(&vec![1; length]), [Line::ZERO]);
        }
    }
}
