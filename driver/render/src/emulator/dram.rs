//! DRAM of an emulated card, with copy-on-write of the host's card image.
//!
//! A host and its emulated cards are in one process, and the DRAM of each card contains the same card image.
//! A card gets the image in one of two ways. It can get the image by reference before its first line is
//! written, and checks it like a received one. Or it receives the image line by line over its link. As long
//! as the received lines equal the lines of the host's image at the same addresses, the card stores no copy
//! and reads the host's lines. Lines beyond the image are the card's own. At the first line of the image that
//! differs, the card switches to lines of its own, so that it always reads what was written.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use photoncard_firmware::memory::{CardMemory, Lines, MemoryPort, copy_lines};
use photoncard_map::pack::CardImage;
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{Fault, FaultCode};

use super::memory_model::{MeasuredMemory, MemoryTraffic};

/// Handle to a card image of the host; empty before [`Self::give`].
#[derive(Clone, Default)]
pub(crate) struct SharedImage(Arc<OnceLock<Given>>);

/// A card image, and its checksum if already known.
struct Given {
    image: Arc<CardImage>,
    checksum: Option<u64>,
}

impl SharedImage {
    /// Shares the image with all cards that have this handle. Later calls have no effect. A card with the
    /// image need not compute a known checksum again.
    pub(crate) fn give(&self, image: Arc<CardImage>, checksum: Option<u64>) {
        // Cards that receive another image store it themselves.
        let _ = self.0.set(Given { image, checksum });
    }
}

/// DRAM that takes host memory only for written lines, and none as long as these equal the shared image.
pub(super) struct EmulatedDram<'a> {
    lines: Stored<'a>,
    limit: u32,
    shared: SharedImage,
    /// Image that the memory contains by reference while no line is written; empty until an image is given.
    held: SharedImage,
}

/// Stored lines, from line 0 to the last written one.
enum Stored<'a> {
    Own(Vec<Line>),
    /// Lines of a card image, borrowed until one of them is written, and lines after them.
    Lent {
        image: &'a [Line],
        beyond: Vec<Line>,
    },
    /// The first `written` lines of an image, by reference, and lines after the whole image.
    Shared {
        image: Arc<CardImage>,
        written: usize,
        beyond: Vec<Line>,
    },
}

impl<'a> EmulatedDram<'a> {
    /// Creates a memory of `bytes` bytes, or as many as `image` needs, that begins with the lines of `image`.
    /// The first write to one of these copies all.
    pub(super) fn lent(Lines(image): Lines<'a>, bytes: u64) -> Self {
        let lines = (bytes / LINE_BYTES as u64).max(image.len() as u64);
        let limit = u32::try_from(lines).unwrap_or(u32::MAX);
        let (shared, held) = (SharedImage::default(), SharedImage::default());
        Self { lines: Stored::Lent { image, beyond: Vec::new() }, limit, shared, held }
    }

    pub(super) fn new(bytes: u64, shared: SharedImage, held: SharedImage) -> Self {
        Self {
            lines: Stored::Own(Vec::new()),
            limit: u32::try_from(bytes / LINE_BYTES as u64).unwrap_or(u32::MAX),
            shared,
            held,
        }
    }

    /// Image that the memory contains by reference; `None` after a line was written.
    fn held(&self) -> Option<&Given> {
        self.held.0.get().filter(|_| matches!(&self.lines, Stored::Own(own) if own.is_empty()))
    }

    /// Treats all lines of the held card image as written, without a copy, if no line was written.
    #[cold]
    fn adopt(&mut self) {
        if let Some(Given { image, .. }) = self.held() {
            let image = image.clone();
            let written = image.lines().len();
            self.lines = Stored::Shared { image, written, beyond: Vec::new() };
        }
    }

    #[inline(always)]
    fn get(&self, address: LineAddress) -> Option<&Line> {
        match &self.lines {
            Stored::Lent { image, beyond } => {
                let line = image.get(address.0 as usize);
                line.or_else(|| beyond.get((address.0 as usize).checked_sub(image.len())?))
            }
            Stored::Own(lines) => lines.get(address.0 as usize),
            Stored::Shared { image, written, beyond } => {
                let line = image.lines().get(..*written)?.get(address.0 as usize);
                line.or_else(|| beyond.get((address.0 as usize).checked_sub(image.lines().len())?))
            }
        }
    }

    /// All lines except those beyond a shared image.
    fn all(&self) -> &[Line] {
        if let Some(Given { image, .. }) = self.held() {
            return image.lines();
        }
        match &self.lines {
            Stored::Lent { image, .. } => image,
            Stored::Own(lines) => lines,
            Stored::Shared { image, written, .. } => &image.lines()[..*written],
        }
    }

    /// Stores lines by reference if they equal the lines of the shared image at the same addresses, and
    /// `first` is at most the number of lines written so far. Returns whether the lines are stored.
    fn share(&mut self, first: usize, lines: &[[u8; LINE_BYTES]]) -> bool {
        if matches!(&self.lines, Stored::Own(own) if own.is_empty())
            && let Some(Given { image, .. }) = self.shared.0.get()
        {
            self.lines = Stored::Shared { image: image.clone(), written: 0, beyond: Vec::new() };
        }
        let Stored::Shared { image, written, .. } = &mut self.lines else { return false };
        let end = first + lines.len();
        let is_same = |image: &[Line]| image.iter().zip(lines).all(|(line, bytes)| line.0 == *bytes);
        let shares = first <= *written && image.lines().get(first..end).is_some_and(is_same);
        if shares {
            *written = end.max(*written);
        }
        shares
    }

    /// Returns the vector of the card's own lines to which line `first` belongs, and the index of that line
    /// in it. If line `first` is in a shared or borrowed image, the lines of the image are copied before.
    fn own_from(&mut self, first: usize) -> (&mut Vec<Line>, usize) {
        if let Stored::Shared { image, written, beyond } = &self.lines
            && first < image.lines().len()
        {
            let mut own = image.lines()[..*written].to_vec();
            if !beyond.is_empty() {
                own.resize(image.lines().len(), Line::ZERO);
                own.extend_from_slice(beyond);
            }
            self.lines = Stored::Own(own);
        }
        if let Stored::Lent { image, beyond } = &self.lines
            && first < image.len()
        {
            self.lines = Stored::Own([image, &beyond[..]].concat());
        }
        match &mut self.lines {
            Stored::Shared { image, beyond, .. } => (beyond, first - image.lines().len()),
            Stored::Own(own) => (own, first),
            Stored::Lent { image, beyond } => (beyond, first - image.len()),
        }
    }
}

impl MemoryPort for EmulatedDram<'_> {
    #[inline(always)]
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        if matches!(&self.lines, Stored::Own(own) if own.is_empty()) {
            self.adopt();
        }
        self.get(address).ok_or(Fault { code: FaultCode::LineRange, detail: address.0 })
    }

    #[inline(always)]
    fn near(&self, address: LineAddress) -> Option<&Line> {
        self.get(address)
    }

    fn write(&mut self, _: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        let first = first.0 as usize;
        first.checked_add(lines.len()).filter(|&end| end <= self.limit as usize)?;
        self.adopt();
        if !self.share(first, lines) {
            let (own, first) = self.own_from(first);
            let end = first + lines.len();
            if own.len() < end {
                own.try_reserve(end - own.len()).ok()?;
                own.resize(end, Line::ZERO);
            }
            copy_lines(lines, &mut own[first..end]);
        }
        Some(())
    }
}

impl MeasuredMemory for EmulatedDram<'_> {
    fn traffic(&self) -> MemoryTraffic {
        MemoryTraffic::ZERO
    }
}

impl CardMemory for EmulatedDram<'_> {
    fn lines(&self) -> u32 {
        self.limit
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        let end = first.0.checked_add(count)?;
        self.all().get(first.0 as usize..end as usize)
    }

    fn known_checksum(&self, lines: u32) -> Option<u64> {
        self.held().filter(|given| given.image.lines().len() == lines as usize)?.checksum
    }
}

#[cfg(test)]
mod tests {
    use photoncard_shared::layout::PhotonGrid;

    use photoncard_map::pack::PackedScene;
    use photoncard_map::photon::Photons;
    use photoncard_map::photon_map::store_photons;
    use photoncard_scene::gltf;

    use super::*;

    fn image() -> Arc<CardImage> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/cornell.gltf");
        let scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
        let packed = PackedScene::new(&scene).expect("packs");
        Arc::new(store_photons(packed, Photons::new(PhotonGrid::UNIT, 1.0, []), 1).expect("packs"))
    }

    fn is_shared(dram: &EmulatedDram) -> bool {
        matches!(dram.lines, Stored::Shared { .. })
    }

    /// Writes lines to a DRAM with a shared image and to one without, and compares the contents.
    fn write(drams: &mut [EmulatedDram; 2], first: usize, lines: &[[u8; LINE_BYTES]]) {
        let address = LineAddress(first as u32);
        for dram in drams.iter_mut() {
            assert_eq!(dram.write(Structure::Header, address, lines), Some(()));
        }
        let [shared, own] = drams;
        for line in 0..own.all().len() as u32 + 2 {
            let line = LineAddress(line);
            let read = |dram: &mut EmulatedDram| dram.read(Structure::Header, line, 0..1).copied();
            assert!(read(shared) == read(own));
            // `stored` has no lines beyond the shared image.
            if (line.0 as usize) < shared.all().len() - 1 {
                assert!(shared.stored(line, 2) == own.stored(line, 2));
            }
        }
    }

    #[test]
    fn a_card_shares_equal_lines_and_reads_what_was_written() {
        let image = image();
        let bytes: Vec<[u8; LINE_BYTES]> = image.lines().iter().map(|line| line.0).collect();
        let shared = SharedImage::default();
        shared.give(image, None);
        let mut other = bytes.clone();
        other[3][7] ^= 1;
        // First line, lines, and whether the DRAM shares the image afterwards.
        type Step<'a> = (usize, &'a [[u8; LINE_BYTES]], bool);
        let end = bytes.len();
        let beyond = [[1; LINE_BYTES]; 3];
        let runs: [&[Step]; 7] = [
            &[(0, &bytes, true), (end, &beyond, true), (end + 1, &beyond, true), (3, &bytes[3..], true)],
            &[(0, &bytes, true), (end, &beyond, true), (3, &other[3..4], false), (end, &bytes[..9], false)],
            &[(0, &bytes, true), (2, &bytes[2..4], true)],
            &[
                (0, &bytes[..2], true),
                (2, &bytes[2..5], true),
                (1, &bytes[1..3], true),
                (5, &bytes[5..], true),
            ],
            &[(0, &bytes[..5], true), (3, &other[3..4], false), (3, &bytes[3..4], false)],
            &[(0, &bytes[..2], true), (3, &bytes[3..4], false), (2, &bytes[2..3], false)],
            &[(1, &bytes[1..2], false), (0, &other, false)],
        ];
        for run in runs {
            let new =
                |shared: &SharedImage| EmulatedDram::new(1 << 20, shared.clone(), SharedImage::default());
            let mut drams = [new(&shared), new(&SharedImage::default())];
            for &(first, lines, is_shared_then) in run {
                write(&mut drams, first, lines);
                assert_eq!([is_shared(&drams[0]), is_shared(&drams[1])], [is_shared_then, false]);
            }
        }
    }

    #[test]
    fn a_memory_holds_an_image_by_reference_until_it_is_written() {
        let image = image();
        let held = SharedImage::default();
        let mut dram = EmulatedDram::new(1 << 20, SharedImage::default(), held.clone());
        assert!(dram.read(Structure::Header, LineAddress(0), 0..1).is_err());
        held.give(image.clone(), Some(7));
        let lines = image.lines().len() as u32;
        assert_eq!(
            [lines - 1, lines, lines + 1].map(|lines| dram.known_checksum(lines)),
            [None, Some(7), None]
        );
        assert!(dram.stored(LineAddress(0), 2).is_some_and(|lines| lines == &image.lines()[..2]));
        let last = lines - 1;
        assert_eq!(dram.read(Structure::Header, LineAddress(last), 0..1), Ok(&image.lines()[last as usize]));
        assert!(is_shared(&dram));
        assert_eq!(dram.write(Structure::Header, LineAddress(1), &[[7; LINE_BYTES]]), Some(()));
        let mut expected = image.lines().to_vec();
        expected[1].0 = [7; LINE_BYTES];
        assert!(dram.all() == expected && !is_shared(&dram));
        assert_eq!(dram.known_checksum(lines), None);
    }

    #[test]
    fn lines_outside_the_memory_are_refused() {
        let mut dram =
            EmulatedDram::new(2 * LINE_BYTES as u64, SharedImage::default(), SharedImage::default());
        assert_eq!(dram.write(Structure::Header, LineAddress(1), &[[1; LINE_BYTES]; 2]), None);
        assert!(dram.stored(LineAddress(0), 1).is_none());
    }
}
