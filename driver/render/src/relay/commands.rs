//! Commands of a relay's host: checked as a card checks them, and forwarded to all cards.

use std::time::Duration;

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::message::{
    CASES_PER_COMMAND, CHECKSUMS_PER_REPLY, CHUNK_LINES, Command, Fault, FaultCode, OPERAND_BYTES, Tile,
};

use super::answers::Question;
use super::link::CardLink;
use super::memory_test::MemoryTests;
use super::state::{Image, Pending, Relay};

const OUT_OF_ORDER: Fault = Fault { code: FaultCode::Order, detail: 0 };

impl<L: CardLink> Relay<'_, L> {
    /// Executes a command of the host, in the same states as a card does.
    pub(super) fn execute(&mut self, command: &Command, now: Duration) -> Result<(), Fault> {
        if let Command::Hello { .. } = command {
            self.forget();
            self.cards.iter_mut().for_each(|card| card.greet(now));
            self.pending = Pending::Greeting(now);
            return Ok(());
        }
        if !self.is_open {
            return Err(OUT_OF_ORDER);
        }
        match *command {
            Command::Hello { .. } => {}
            Command::ReadChecksums { first, count } => {
                self.check_chunks(first, count)?;
                self.ask(command, Question::Checksums(first), now);
            }
            Command::BeginImage { lines, .. } => self.begin_image(command, lines, now)?,
            Command::WriteLines { first, data } => {
                let end = self.check_lines(first, data)?;
                self.forward(command, now);
                self.written = self.written.max(end);
            }
            Command::EndImage => {
                let Image::Loading(_) = self.image else { return Err(OUT_OF_ORDER) };
                self.image = Image::None;
                self.ask(command, Question::Image, now);
            }
            Command::BeginFrame(frame) => {
                if self.image != Image::Ready {
                    return Err(OUT_OF_ORDER);
                }
                self.drop_frame();
                self.ask(command, Question::Frame(frame), now);
            }
            Command::RenderTile(tile) => {
                self.check_tile(&tile)?;
                self.waiting.push_back(tile);
                self.is_flushed = false;
            }
            Command::Flush => self.is_flushed = true,
            Command::Compute { operands } => {
                self.check_operands(operands)?;
                self.ask(command, Question::Compute(operands.to_vec()), now);
            }
            Command::TestMemory => {
                self.drop_frame();
                self.image = Image::None;
                self.written = 0;
                self.forward(command, now);
                self.pending = Pending::Test(MemoryTests::new(self.cards.len()));
            }
        }
        Ok(())
    }

    fn forward(&mut self, command: &Command, now: Duration) {
        self.cards.iter_mut().filter(|card| card.is_here()).for_each(|card| card.forward(command, now));
    }

    fn ask(&mut self, command: &Command, question: Question, now: Duration) {
        self.forward(command, now);
        self.pending = Pending::Answers(question);
    }

    fn begin_image(&mut self, command: &Command, lines: u32, now: Duration) -> Result<(), Fault> {
        self.drop_frame();
        self.image = Image::None;
        let most = self.budget.dram_bytes / LINE_BYTES as u64;
        if lines == 0 || u64::from(lines) > most {
            return Err(Fault { code: FaultCode::ImageTooLarge, detail: most as u32 });
        }
        self.image = Image::Loading(lines);
        self.forward(command, now);
        Ok(())
    }

    fn check_chunks(&self, first: u32, count: u32) -> Result<(), Fault> {
        if self.has_tiles() {
            return Err(OUT_OF_ORDER);
        }
        let in_all = self.written.div_ceil(CHUNK_LINES);
        let is_written = first.checked_add(count).is_some_and(|end| end <= in_all);
        let is_valid = is_written && (1..=CHECKSUMS_PER_REPLY).contains(&count);
        if is_valid { Ok(()) } else { Err(Fault { code: FaultCode::Chunks, detail: first }) }
    }

    /// Returns the index past the last line of a write.
    fn check_lines(&self, first: u32, data: &[u8]) -> Result<u32, Fault> {
        let Image::Loading(lines) = self.image else { return Err(OUT_OF_ORDER) };
        let end = first.checked_add((data.len() / LINE_BYTES) as u32);
        let is_whole = data.len().is_multiple_of(LINE_BYTES);
        let fault = Fault { code: FaultCode::Lines, detail: first };
        end.filter(|&end| is_whole && end <= lines).ok_or(fault)
    }

    fn check_tile(&self, tile: &Tile) -> Result<(), Fault> {
        let frame = self.frame.ok_or(OUT_OF_ORDER)?;
        let fits =
            |first: u32, count: u32, size: u32| first.checked_add(count).is_some_and(|end| end <= size);
        let is_inside = fits(tile.x, tile.width, frame.width) && fits(tile.y, tile.height, frame.height);
        let most = u64::from(self.budget.pixels_of_tile(frame.form().sums_of_light()));
        if !is_inside || !(1..=most).contains(&tile.pixels()) {
            return Err(Fault { code: FaultCode::Tile, detail: tile.id });
        }
        let has_room = self.tiles() < frame.tiles_of(&self.budget) as usize;
        if has_room { Ok(()) } else { Err(Fault { code: FaultCode::TooManyTiles, detail: tile.id }) }
    }

    fn check_operands(&self, operands: &[u8]) -> Result<(), Fault> {
        if self.has_tiles() {
            return Err(OUT_OF_ORDER);
        }
        let (cases, rest) = operands.as_chunks::<OPERAND_BYTES>();
        let is_valid = (1..=CASES_PER_COMMAND).contains(&cases.len()) && rest.is_empty();
        let fault = Fault { code: FaultCode::Operands, detail: operands.len() as u32 };
        if is_valid { Ok(()) } else { Err(fault) }
    }
}
