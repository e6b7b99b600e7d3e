//! Loading of a card image: lines in order, a checksum over all, and a header that is sound.

use photoncard_shared::address::{LINE_BYTES, LineAddress, Structure};
use photoncard_shared::frame::Checksum;
use photoncard_shared::image::{Header, HeaderError};
use photoncard_shared::message::{Fault, FaultCode};

use super::OUT_OF_ORDER;
use crate::memory::{CardMemory, MemoryPort, Stage};
use crate::scene::SceneImage;

/// The image in memory.
pub(super) enum ImageState {
    None,
    Loading(Loader),
    Ready(SceneImage),
}

impl ImageState {
    /// The loader.
    ///
    /// # Errors
    /// If no image is being loaded.
    pub(super) fn loader(&mut self) -> Result<&mut Loader, Fault> {
        match self {
            Self::Loading(loader) => Ok(loader),
            _ => Err(OUT_OF_ORDER),
        }
    }

    /// The scene, if one is loaded.
    pub(super) fn scene(&self) -> Option<&SceneImage> {
        match self {
            Self::Ready(scene) => Some(scene),
            _ => None,
        }
    }
}

/// An image on its way into memory.
pub(super) struct Loader {
    lines: u32,
    written: u32,
    expected: u32,
    checksum: Checksum,
}

impl Loader {
    pub(super) fn new(memory: &impl CardMemory, lines: u32, expected: u32) -> Result<Self, Fault> {
        let available = memory.lines();
        if lines == 0 || lines > available {
            return Err(Fault { code: FaultCode::ImageTooLarge, detail: available });
        }
        Ok(Self { lines, written: 0, expected, checksum: Checksum::default() })
    }

    pub(super) fn write(
        &mut self,
        memory: &mut impl CardMemory,
        first: u32,
        data: &[u8],
    ) -> Result<(), Fault> {
        let fault = Fault { code: FaultCode::LineOrder, detail: self.written };
        let (lines, rest) = data.as_chunks::<LINE_BYTES>();
        let count = u32::try_from(lines.len()).map_err(|_| fault)?;
        if first != self.written || !rest.is_empty() || count > self.lines - self.written {
            return Err(fault);
        }
        let target = memory.write(LineAddress(first), count).ok_or(fault)?;
        for (line, bytes) in target.iter_mut().zip(lines) {
            line.0 = *bytes;
        }
        self.checksum.update(data);
        self.written += count;
        Ok(())
    }

    pub(super) fn finish(&self, memory: &mut impl MemoryPort) -> Result<SceneImage, Fault> {
        if self.written != self.lines {
            return Err(Fault { code: FaultCode::LineOrder, detail: self.written });
        }
        let found = self.checksum.value();
        if found != self.expected {
            return Err(Fault { code: FaultCode::ImageChecksum, detail: found });
        }
        memory.enter(Stage::Begin);
        let line = memory.read(Structure::Header, LineAddress(0), 0..LINE_BYTES as u32)?;
        let unsound = |detail: u32| Fault { code: FaultCode::ImageHeader, detail };
        let header = Header::read(line).map_err(|error| match error {
            HeaderError::Version(version) => unsound(version as u32),
            _ => unsound(0),
        })?;
        if header.lines != self.lines {
            return Err(unsound(0));
        }
        Ok(SceneImage { header })
    }
}
