//! Card memory whose first lines are a card image in flash, read in place.

use core::ops::Range;

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{Fault, FaultCode};

use super::{CardMemory, MemoryPort};

/// Card memory that begins with a read-only card image, followed by the lines of `M`. The image survives
/// power-off and takes no room in `M`: a host that brings an equal one finds all of its lines written and
/// sends none. Another image is refused with [`FaultCode::Memory`].
pub struct Resident<'a, M> {
    image: Option<&'a [Line]>,
    rest: M,
    /// Line of the image at which the last write differed.
    refused: Option<u32>,
}

impl<'a, M> Resident<'a, M> {
    /// Memory of an image followed by `rest`.
    pub const fn new(image: &'a [Line], rest: M) -> Self {
        Self { image: Some(image), rest, refused: None }
    }

    /// Memory without an image: that of a static card until its board gives it one.
    pub const fn without_image(rest: M) -> Self {
        Self { image: None, rest, refused: None }
    }

    /// Lines of the image.
    fn image(&self) -> &'a [Line] {
        self.image.unwrap_or_default()
    }

    /// The address in the image, or else that in the rest.
    fn place(&self, address: LineAddress) -> Result<usize, LineAddress> {
        let index = address.0 as usize;
        let image = self.image().len();
        if index < image { Ok(index) } else { Err(LineAddress((index - image) as u32)) }
    }
}

impl<M: MemoryPort> MemoryPort for Resident<'_, M> {
    #[inline(always)]
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        match self.image().get(address.0 as usize) {
            Some(line) => Ok(line),
            None => {
                let image = self.image().len() as u32;
                self.rest.read(structure, LineAddress(address.0.wrapping_sub(image)), used)
            }
        }
    }

    #[inline(always)]
    fn near(&self, address: LineAddress) -> Option<&Line> {
        match self.place(address) {
            Ok(index) => self.image().get(index),
            Err(rest) => self.rest.near(rest),
        }
    }

    fn write(&mut self, structure: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.refused = None;
        let index = match self.place(first) {
            Err(rest) => return self.rest.write(structure, rest, lines),
            Ok(index) => index,
        };
        let image = self.image().get(index..).unwrap_or_default();
        let differs = image.iter().zip(lines).position(|(line, written)| line.0 != *written);
        if let Some(place) = differs {
            self.refused = Some((index + place) as u32);
            return None;
        }
        match lines.get(image.len()..) {
            None | Some([]) => Some(()),
            Some(after) => self.rest.write(structure, LineAddress(0), after),
        }
    }
}

impl<M: CardMemory> CardMemory for Resident<'_, M> {
    fn lines(&self) -> u32 {
        u32::try_from(self.image().len()).unwrap_or(u32::MAX).saturating_add(self.rest.lines())
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        let image = self.image();
        match self.place(first) {
            Err(rest) => self.rest.stored(rest, count),
            Ok(index) => {
                let end = index.checked_add(count as usize)?;
                let is_inside = end <= self.lines() as usize;
                image.get(index..end.min(image.len())).filter(|_| is_inside)
            }
        }
    }

    fn resident_lines(&self) -> u32 {
        u32::try_from(self.image().len()).unwrap_or(u32::MAX)
    }

    fn failure(&self) -> Option<Fault> {
        let refused = self.refused.map(|line| Fault { code: FaultCode::Memory, detail: line });
        refused.or_else(|| self.rest.failure())
    }
}
