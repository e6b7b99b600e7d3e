//! Card on a lossless link, to which a test sends one command after another.

use photoncard_firmware::card::Card;
use photoncard_firmware::kind::{FixedKind, Micro};
use photoncard_firmware::memory::Dram;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::message::{
    self, Command, Fault, FaultCode, LINES_PER_WRITE, MemoryTest, MemoryUse, PROTOCOL_VERSION, PixelForm,
    Reply,
};
use photoncard_shared::transport::Transport;

/// Card, and the host's end of its link.
pub struct Wire<'a, K: FixedKind = Micro> {
    /// The card.
    pub card: Box<Card<K, Dram<'a>>>,
    host: Transport,
    session: u32,
    /// Optional contents of the pixels of the last frame begun.
    form: PixelForm,
}

/// Content of a [`Reply`] that tests read, without its borrowed bytes.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// [`Reply::Hello`]: number of lines of card memory that were written, and use of on-chip memory.
    Hello(u32, Option<MemoryUse>),
    /// [`Reply::Checksums`]: bytes of the checksums of chunks of lines.
    Checksums(Vec<u8>),
    /// [`Reply::ImageAccepted`]: the image is well-formed.
    ImageAccepted,
    /// [`Reply::FrameAccepted`]: tiles may be sent.
    FrameAccepted,
    /// [`Reply::Pixels`]: number of pixels.
    Pixels(usize),
    /// [`Reply::TileDone`]: number of the tile.
    TileDone(u32),
    /// [`Reply::Fault`]: code of the fault.
    Fault(FaultCode),
    /// [`Reply::Computed`]: number of bytes of the results.
    Computed(usize),
    /// [`Reply::MemoryTested`]: progress of the test.
    MemoryTested(MemoryTest),
}

impl<'a> Wire<'a> {
    /// Creates a card of the micro chip, as after power-on, whose DRAM is `memory`.
    pub fn new(memory: &'a mut [Line]) -> Self {
        Self::of_kind(memory)
    }
}

impl<'a, K: FixedKind> Wire<'a, K> {
    /// Creates a card of kind `K`, as after power-on, whose DRAM is `memory`.
    pub fn of_kind(memory: &'a mut [Line]) -> Self {
        let card = Box::new(Card::new(Dram::new(memory)));
        Self { card, host: Transport::host(), session: 0, form: PixelForm::PLAIN }
    }

    /// Sends a command and runs the card until it is idle. Returns its answers.
    ///
    /// # Panics
    /// If the card sends anything but replies.
    pub fn say(&mut self, command: &Command) -> Vec<Answer> {
        self.say_all(std::slice::from_ref(command))
    }

    /// Sends all commands at once, and runs the card until it is idle. Returns its answers.
    ///
    /// # Panics
    /// If there are more commands than the link's window holds, or the card sends anything but replies.
    pub fn say_all(&mut self, commands: &[Command]) -> Vec<Answer> {
        for command in commands {
            if let Command::BeginFrame(frame) = command {
                self.form = frame.form();
            }
            assert!(self.host.send(|bytes| message::encode(command, bytes)), "there is room for a command");
        }
        self.work()
    }

    /// Sends arbitrary bytes as a message, and runs the card until it is idle. Returns its answers.
    ///
    /// # Panics
    /// If the message does not fit a frame of the link, or the card sends anything but replies.
    pub fn say_bytes(&mut self, message: &[u8]) -> Vec<Answer> {
        assert!(self.host.send(|bytes| {
            bytes.get_mut(..message.len())?.copy_from_slice(message);
            Some(message.len())
        }));
        self.work()
    }

    /// Runs the card until it is idle. Returns its answers.
    ///
    /// # Panics
    /// If the card sends anything but replies.
    pub fn work(&mut self) -> Vec<Answer> {
        let mut answers = Vec::new();
        loop {
            let to_card = self.host.outgoing().to_vec();
            self.host.sent(to_card.len());
            self.card.feed(&to_card);
            self.card.work();
            let to_host = self.card.outgoing().to_vec();
            self.card.sent(to_host.len());
            let mut rest = &to_host[..];
            while !rest.is_empty() {
                rest = &rest[self.host.receive(rest).0..];
                while let Some(payload) = self.host.take() {
                    let reply = message::decode(payload).expect("a card sends replies");
                    answers.push(answer(reply, self.form));
                }
            }
            if to_card.is_empty() && to_host.is_empty() && !self.card.is_busy() {
                self.card.acknowledge();
                self.host.acknowledge();
                if self.card.outgoing().is_empty() && self.host.outgoing().is_empty() {
                    return answers;
                }
            }
        }
    }

    /// Starts a session. Returns the number of lines of the card's memory that were written.
    ///
    /// # Panics
    /// If the card does not say hello.
    pub fn hello(&mut self) -> u32 {
        self.session += 1;
        self.host.open(self.session);
        match self.say(&Command::Hello { protocol: PROTOCOL_VERSION, layout: 1 })[..] {
            [Answer::Hello(written, _)] => written,
            ref other => panic!("{other:?}"),
        }
    }

    /// Loads a card image, its last lines first. Returns the card's answers.
    pub fn load(&mut self, lines: &[Line]) -> Vec<Answer> {
        let begin = Command::BeginImage { lines: lines.len() as u32, checksum: image_checksum(lines) };
        let mut answers = self.say(&begin);
        for (index, lines) in lines.chunks(LINES_PER_WRITE).enumerate().rev() {
            let mut data = [0; LINES_PER_WRITE * LINE_BYTES];
            for (target, line) in data.as_chunks_mut().0.iter_mut().zip(lines) {
                *target = line.0;
            }
            let data = &data[..lines.len() * LINE_BYTES];
            answers.extend(self.say(&Command::WriteLines { first: (LINES_PER_WRITE * index) as u32, data }));
        }
        answers.extend(self.say(&Command::EndImage));
        answers
    }
}

fn answer(reply: Reply, form: PixelForm) -> Answer {
    match reply {
        Reply::Hello { written_lines, memory_use, .. } => Answer::Hello(written_lines, memory_use),
        Reply::Checksums { data, .. } => Answer::Checksums(data.to_vec()),
        Reply::ImageAccepted => Answer::ImageAccepted,
        Reply::FrameAccepted => Answer::FrameAccepted,
        Reply::Pixels { data, .. } => Answer::Pixels(data.len() / form.record_bytes()),
        Reply::TileDone { tile, .. } => Answer::TileDone(tile),
        Reply::Fault(Fault { code, .. }) => Answer::Fault(code),
        Reply::Computed { results } => Answer::Computed(results.len()),
        Reply::MemoryTested(progress) => Answer::MemoryTested(progress),
    }
}
