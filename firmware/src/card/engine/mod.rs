//! Engine of a card: executes commands, and does the work that they start.

#[cfg(test)]
mod tests;

use heapless::Deque;
use photoncard_shared::budget::MAX_WAITING_BLOCKS;
use photoncard_shared::counters::Counters;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::{
    self, Board, CASES_PER_COMMAND, Command, Fault, FaultCode, FrameParameters, Invariant, MemoryUse,
    OPERAND_BYTES, PIXELS_BYTES, PROTOCOL_VERSION, PixelSums, RESULT_BYTES, Reply, Tile,
};
use photoncard_shared::transport::Transport;

use super::frame::check_frame;
use super::load::{CHECKSUMS_BYTES, Checksums, ImageState, Loader, OUT_OF_ORDER};
use crate::chip::{Chip, Progress};
use crate::kind::ChipKind;
use crate::memory::CardMemory;
use crate::render::RenderJob;
use crate::self_test::MemoryTester;
use crate::self_test::arithmetic::compute_bytes;
use crate::slot::Slot;

/// Maximum number of queued tile commands of a card, whatever its kind of chip.
pub const MAX_TILES: usize = MAX_WAITING_BLOCKS as usize;

/// Engine of a card: its chip, and the card image, frame and tiles that commands set.
pub(super) struct Engine<K: ChipKind> {
    chip: Chip<K>,
    image: ImageState,
    /// Function that measures on-chip memory; `None` if the board has no such function.
    pub(super) measure: Option<fn() -> MemoryUse>,
    pub(super) board: Option<Board<'static>>,
    /// Function that reads a counter of processor cycles; `None` if the board has no such counter.
    pub(super) cycles: Option<fn() -> u32>,
    /// Processor cycles of the chip's work since it last ended a tile.
    spent: u64,
    /// Number of leading lines of card memory that were written since the card was switched on.
    written: u32,
    checksums: Option<Checksums>,
    frame: Slot<FrameParameters>,
    /// Tiles that the chip has not begun.
    tiles: Deque<Tile, MAX_TILES>,
    /// Number of tiles that the chip has begun and whose [`Reply::TileDone`] was not sent yet.
    begun: usize,
    /// Tile whose pixels were all sent, but whose [`Reply::TileDone`] was not; with the tile's counters.
    finished: Option<(u32, Counters)>,
    /// True if the host has announced that no tile follows for now.
    is_flushed: bool,
    /// True if tiles are in flight, but the chip can do nothing for them before the next command.
    waits: bool,
    /// Number of the tile whose pixels are in `data`, and row-major index of the first of these pixels in the
    /// tile.
    first: (u32, u32),
    /// Data of the next reply: consecutive pixels of a tile, checksums, or results of a computation.
    data: heapless::Vec<u8, DATA_BYTES>,
}

/// Maximum length of the data in one reply, bytes.
const DATA_BYTES: usize = PIXELS_BYTES;
const _: () = assert!(CHECKSUMS_BYTES <= DATA_BYTES && CASES_PER_COMMAND * RESULT_BYTES <= DATA_BYTES);

impl<K: ChipKind> Engine<K> {
    pub(super) const fn new(chip: Chip<K>) -> Self {
        Self {
            chip,
            image: ImageState::None,
            measure: None,
            board: None,
            cycles: None,
            spent: 0,
            written: 0,
            checksums: None,
            frame: Slot::Empty,
            tiles: Deque::new(),
            begun: 0,
            finished: None,
            is_flushed: false,
            waits: false,
            first: (0, 0),
            data: heapless::Vec::new(),
        }
    }

    /// Executes a command. Returns the reply; `None` if `work` sends it later or the command has none.
    ///
    /// # Errors
    /// The fault to be sent in place of a reply.
    pub(super) fn execute(
        &mut self,
        memory: &mut impl CardMemory,
        command: &Command,
    ) -> Result<Option<Reply<'_>>, Fault> {
        match *command {
            Command::Hello { .. } => {
                self.forget();
                self.written = self.written.max(memory.resident_lines());
                Ok(Some(self.hello()))
            }
            Command::ReadChecksums { first, count } => {
                if self.is_at_work() {
                    return Err(OUT_OF_ORDER);
                }
                self.data.clear();
                self.checksums = Some(Checksums::new(first, count, self.written)?);
                Ok(None)
            }
            Command::BeginImage { lines, checksum } => {
                self.forget();
                self.image = ImageState::Loading(Loader::new(memory, lines, checksum)?);
                Ok(None)
            }
            Command::WriteLines { first, data } => {
                let end = self.image.loader()?.write(memory, first, data)?;
                self.written = self.written.max(end);
                Ok(None)
            }
            Command::EndImage => {
                self.image = ImageState::Checking(self.image.loader()?.check());
                Ok(None)
            }
            Command::BeginFrame(frame) => {
                let scene = self.image.scene().filter(|_| self.checksums.is_none()).ok_or(OUT_OF_ORDER)?;
                check_frame(self.chip.kind().budget(), &scene.header, memory.lines(), &frame)?;
                let room = scene.header.lines..memory.lines();
                self.drop_tiles();
                self.chip.begin_frame(&frame, room);
                self.frame = Slot::Full(frame);
                Ok(Some(Reply::FrameAccepted))
            }
            Command::RenderTile(tile) => self.accept(tile).map(|()| None),
            Command::Flush => {
                self.is_flushed = true;
                self.waits = false;
                Ok(None)
            }
            Command::Compute { operands } => self.compute(operands).map(Some),
            Command::TestMemory => {
                self.forget();
                self.written = 0;
                self.image = ImageState::Testing(MemoryTester::new(memory)?);
                Ok(None)
            }
        }
    }

    fn hello(&self) -> Reply<'static> {
        Reply::Hello {
            protocol: PROTOCOL_VERSION,
            layout: LAYOUT_VERSION,
            budget: *self.chip.kind().budget(),
            written_lines: self.written,
            memory_use: self.measure.map(|measure| measure()),
            build: concat!("photoncard-firmware ", env!("CARGO_PKG_VERSION")),
            board: self.board,
        }
    }

    /// Computes the results of the arithmetic self-test for encoded triples of operands.
    fn compute(&mut self, operands: &[u8]) -> Result<Reply<'_>, Fault> {
        if self.is_at_work() {
            return Err(OUT_OF_ORDER);
        }
        let (cases, rest) = operands.as_chunks::<OPERAND_BYTES>();
        if !(1..=CASES_PER_COMMAND).contains(&cases.len()) || !rest.is_empty() {
            return Err(Fault { code: FaultCode::Operands, detail: operands.len() as u32 });
        }
        self.data.clear();
        for case in cases {
            // The buffer cannot be full here: the assertion on `DATA_BYTES` proves that the results of all
            // cases fit. No test can show the fault.
            self.data.extend_from_slice(&compute_bytes(case)).map_err(|_| Invariant::Reply.fault())?;
        }
        Ok(Reply::Computed { results: &self.data })
    }

    fn forget(&mut self) {
        self.image = ImageState::None;
        self.checksums = None;
        self.frame = Slot::Empty;
        self.chip.forget_records();
        self.drop_tiles();
    }

    /// Drops all tiles, including those that the chip has not begun.
    fn drop_tiles(&mut self) {
        self.tiles.clear();
        self.drop_begun();
    }

    fn drop_begun(&mut self) {
        self.chip.clear();
        self.begun = 0;
        self.spent = 0;
        self.finished = None;
        self.is_flushed = false;
        self.waits = false;
        self.data.clear();
    }

    /// Returns true while tiles are queued or in flight.
    fn has_tiles(&self) -> bool {
        self.begun > 0 || !self.tiles.is_empty()
    }

    /// Returns true while tiles are queued or in flight, or checksums are being computed.
    fn is_at_work(&self) -> bool {
        self.has_tiles() || self.checksums.is_some()
    }

    /// Returns true while `work` can proceed without a further command.
    pub(super) fn has_work(&self) -> bool {
        self.has_tiles() && !self.waits
            || self.checksums.is_some()
            || matches!(self.image, ImageState::Checking(_) | ImageState::Testing(_))
    }

    fn accept(&mut self, tile: Tile) -> Result<(), Fault> {
        let frame = *self.frame.as_ref().ok_or(OUT_OF_ORDER)?;
        let fits =
            |first: u32, count: u32, size: u32| first.checked_add(count).is_some_and(|end| end <= size);
        let is_inside = fits(tile.x, tile.width, frame.width) && fits(tile.y, tile.height, frame.height);
        if !is_inside || tile.pixels() == 0 || tile.pixels() > self.chip.tile_pixels(&frame) {
            return Err(Fault { code: FaultCode::Tile, detail: tile.id });
        }
        let too_many = Fault { code: FaultCode::TooManyTiles, detail: tile.id };
        if self.tiles.len() + self.begun >= frame.tiles_of(self.chip.kind().budget()) as usize {
            return Err(too_many);
        }
        if !self.is_at_work() {
            // Results of a computation that were sent.
            self.data.clear();
        }
        self.is_flushed = false;
        self.waits = false;
        self.tiles.push_back(tile).map_err(|_| too_many)
    }

    /// Does the next piece of work: checksums, the check of a card image, a memory test, or rendering. If
    /// rendering fails, the tiles that the chip has begun are dropped.
    ///
    /// # Errors
    /// The fault to be sent.
    pub(super) fn work(
        &mut self,
        memory: &mut impl CardMemory,
        transport: &mut Transport,
    ) -> Result<(), Fault> {
        if let Some(checksums) = &mut self.checksums {
            let result = match checksums.step(memory, self.written) {
                Ok((checksum, is_last)) => {
                    let bytes = checksum.to_le_bytes();
                    self.data
                        .extend_from_slice(&bytes)
                        .map_err(|_| Invariant::Reply.fault())
                        .map(|()| is_last)
                }
                Err(fault) => Err(fault),
            };
            if matches!(result, Ok(false)) {
                return Ok(());
            }
            if result.is_ok() {
                send(transport, &Reply::Checksums { first: checksums.first, data: &self.data });
            }
            self.checksums = None;
            // The next reply may be of a tile that the host has sent meanwhile.
            self.data.clear();
            return result.map(|_| ());
        }
        match &self.image {
            ImageState::Checking(_) => return self.check(memory, transport),
            ImageState::Testing(_) => return self.test(memory, transport),
            ImageState::None | ImageState::Loading(_) | ImageState::Ready(_) => {}
        }
        // Waiting for the host's next command is no work.
        let cycles = self.cycles.filter(|_| self.has_work());
        let start = cycles.map(|cycles| cycles());
        let result = self.render(memory, transport);
        if let (Some(cycles), Some(start)) = (cycles, start) {
            self.spent = self.spent.wrapping_add(cycles().wrapping_sub(start).into());
        }
        if result.is_err() {
            self.drop_begun();
        }
        result
    }

    /// Checks the next lines of a received card image.
    fn check(&mut self, memory: &mut impl CardMemory, transport: &mut Transport) -> Result<(), Fault> {
        let ImageState::Checking(check) = &mut self.image else { return Ok(()) };
        let result = check.step(memory);
        if let Ok(None) = result {
            return Ok(());
        }
        self.image = ImageState::None;
        if let Some(scene) = result? {
            // An emulated card's memory may hold lines that were never sent to the card.
            self.written = self.written.max(scene.header.lines);
            self.image = ImageState::Ready(scene);
            send(transport, &Reply::ImageAccepted);
        }
        Ok(())
    }

    /// Tests the next lines of the memory.
    fn test(&mut self, memory: &mut impl CardMemory, transport: &mut Transport) -> Result<(), Fault> {
        let ImageState::Testing(tester) = &mut self.image else { return Ok(()) };
        let result = tester.step(memory);
        if result.is_err() || matches!(&result, Ok(Some(progress)) if progress.is_over()) {
            self.image = ImageState::None;
        }
        if let Some(progress) = result? {
            send(transport, &Reply::MemoryTested(progress));
        }
        Ok(())
    }

    /// Does the next piece of the chip's work. Sends at most one reply.
    fn render(&mut self, memory: &mut impl CardMemory, transport: &mut Transport) -> Result<(), Fault> {
        let (Some(scene), Some(frame)) = (self.image.scene(), self.frame.as_ref()) else { return Ok(()) };
        if let Some((tile, mut counters)) = self.finished.take() {
            counters.cycles = core::mem::take(&mut self.spent);
            send(transport, &Reply::TileDone { tile, counters });
            self.begun = self.begun.checked_sub(1).ok_or(Invariant::Flight.fault())?;
            return Ok(());
        }
        if !self.has_tiles() {
            return Ok(());
        }
        match self.chip.step(&mut RenderJob { scene, memory, frame, outlet: None })? {
            Progress::Busy => {}
            Progress::Pixel(pixel) => {
                let sums = pixel.sums(frame);
                self.add_pixel((pixel.tile, pixel.index), &sums, transport)?;
            }
            Progress::Tile(tile, counters) => {
                memory.end_tile(tile);
                self.send_pixels(transport);
                self.finished = Some((tile, counters));
            }
            Progress::Idle => match self.tiles.pop_front() {
                Some(tile) if !self.chip.begin(memory, frame, tile) => {
                    return Err(Fault { code: FaultCode::Tile, detail: tile.id });
                }
                Some(_) => self.begun += 1,
                None => self.waits = !(self.is_flushed && self.chip.flush(frame)),
            },
        }
        Ok(())
    }

    /// Adds the sums of a pixel, given by tile and index, to the buffer of pixels to be sent. The buffer is
    /// sent first if the pixel does not directly follow the buffered ones, and sent afterwards if the buffer
    /// has no room for another pixel.
    fn add_pixel(
        &mut self,
        (tile, index): (u32, u32),
        sums: &PixelSums,
        transport: &mut Transport,
    ) -> Result<(), Fault> {
        let bytes = sums.form().record_bytes();
        let (first_tile, first) = self.first;
        let next = first + (self.data.len() / bytes) as u32;
        if (tile, index) != (first_tile, next) {
            self.send_pixels(transport);
        }
        if self.data.is_empty() {
            self.first = (tile, index);
        }
        // There is room: a full buffer is sent at once, below.
        let mut has_room = true;
        sums.write(&mut |bytes| has_room &= self.data.extend_from_slice(bytes).is_ok());
        if !has_room {
            return Err(Invariant::Reply.fault());
        }
        // A buffer has room for several pixels, so that the first pixel of a new reply does not fill it: this
        // call sends at most one reply.
        if self.data.len() + bytes > self.data.capacity() {
            self.send_pixels(transport);
        }
        Ok(())
    }

    fn send_pixels(&mut self, transport: &mut Transport) {
        if !self.data.is_empty() {
            let (tile, first) = self.first;
            send(transport, &Reply::Pixels { tile, first, data: &self.data });
            self.data.clear();
        }
    }
}

/// Sends a reply. The transport's window must have room for it.
pub(super) fn send(transport: &mut Transport, reply: &Reply) {
    // Every reply fits a frame, as tests of the longest replies show.
    transport.send(|bytes| message::encode(reply, bytes));
}
