//! Lines of a card image: in the process's own memory, or mapped from a file.

use std::ops::Deref;
use std::sync::Arc;

use photoncard_shared::address::Line;

use super::mapped::MappedLines;

/// Lines of a card image.
#[derive(Clone)]
pub(super) enum ImageLines {
    /// Lines in the process's own memory.
    Own(Vec<Line>),
    /// Lines of a file.
    Mapped(Arc<MappedLines>),
}

impl ImageLines {
    /// The lines in the process's own memory.
    pub(super) fn into_vec(self) -> Vec<Line> {
        match self {
            Self::Own(lines) => lines,
            Self::Mapped(lines) => lines.to_vec(),
        }
    }

    /// The lines, to be changed; those of a file are copied first.
    pub(super) fn make_mut(&mut self) -> &mut [Line] {
        if let Self::Mapped(lines) = self {
            *self = Self::Own(lines.to_vec());
        }
        match self {
            Self::Own(lines) => lines,
            Self::Mapped(_) => &mut [],
        }
    }
}

impl Deref for ImageLines {
    type Target = [Line];

    fn deref(&self) -> &[Line] {
        match self {
            Self::Own(lines) => lines,
            Self::Mapped(lines) => lines,
        }
    }
}
