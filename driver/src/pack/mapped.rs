//! Lines of a file that is mapped into memory: processes of one machine share its pages.
//!
//! The library's only module with `unsafe` code. The file must stay as it is while it is mapped: this program writes prepared scenes whole, under another
//! name, and never changes one in place. Lines that change all the same are found by the card's checksum; a file that is cut off meanwhile ends the process.
#![allow(unsafe_code, reason = "a mapped file is memory that others can reach")]

use std::fs::File;
use std::io;
use std::ops::Deref;

use memmap2::{Mmap, MmapOptions};
use photoncard_shared::address::Line;

/// Lines of a file.
pub(crate) struct MappedLines(Mmap);

impl MappedLines {
    /// Maps the lines of a file from `offset` on, a multiple of a line's size, to its end.
    ///
    /// # Errors
    /// If the system refuses.
    pub(crate) fn new(file: &File, offset: u64) -> io::Result<Self> {
        let bytes = file.metadata()?.len().saturating_sub(offset);
        let bytes = usize::try_from(bytes).map_err(io::Error::other)?;
        if bytes == 0 {
            return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "no lines follow"));
        }
        // SAFETY: the memory is only read, as bytes, of which every value is valid; the module's description says what else must hold.
        let map = unsafe { MmapOptions::new().offset(offset).len(bytes).map(file)? };
        Ok(Self(map))
    }
}

impl Deref for MappedLines {
    type Target = [Line];

    fn deref(&self) -> &[Line] {
        // SAFETY: a line is an array of bytes, of which every value is valid. Pages are aligned to more than a line.
        let (_, lines, _) = unsafe { self.0.align_to::<Line>() };
        lines
    }
}
