//! A card on a wire that loses nothing.

use photoncard_firmware::card::MicroCard;
use photoncard_firmware::memory::Dram;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::budget::MICRO;
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::message::{
    self, Command, Fault, FaultCode, LINES_PER_WRITE, MemoryUse, PROTOCOL_VERSION, Reply, record_bytes,
};
use photoncard_shared::transport::Transport;

/// A card, the host's end of its link, and whoever gives the commands.
pub struct Wire<'a> {
    /// The card.
    pub card: Box<MicroCard<Dram<'a>>>,
    host: Transport,
    session: u32,
    /// Whether the frame that was begun last has layers.
    layers: bool,
}

/// A reply, without what it borrows.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// The lines that are written, and what the firmware takes of on-chip memory.
    Hello(u32, Option<MemoryUse>),
    /// Their bytes.
    Checksums(Vec<u8>),
    /// The image is sound.
    ImageAccepted,
    /// Tiles may come.
    FrameAccepted,
    /// Their number.
    Pixels(usize),
    /// Its number.
    TileDone(u32),
    /// Why not.
    Fault(FaultCode),
}

impl<'a> Wire<'a> {
    /// A card that was just switched on, with some memory.
    pub fn new(memory: &'a mut [Line]) -> Self {
        let card = Box::new(MicroCard::new(MICRO, Dram::new(memory)));
        Self { card, host: Transport::host(), session: 0, layers: false }
    }

    /// Sends a command and works until the card rests. Returns its answers.
    ///
    /// # Panics
    /// If the card's answers are no replies.
    pub fn say(&mut self, command: &Command) -> Vec<Answer> {
        if let Command::BeginFrame(frame) = command {
            self.layers = frame.layers;
        }
        assert!(self.host.send(|bytes| message::encode(command, bytes)), "there is room for a command");
        self.work()
    }

    /// Sends bytes that are no command.
    ///
    /// # Panics
    /// If they do not fit a frame.
    pub fn say_bytes(&mut self, message: &[u8]) -> Vec<Answer> {
        assert!(self.host.send(|bytes| {
            bytes.get_mut(..message.len())?.copy_from_slice(message);
            Some(message.len())
        }));
        self.work()
    }

    /// Works until the card rests. Returns its answers.
    ///
    /// # Panics
    /// If they are no replies.
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
                    answers.push(answer(reply, self.layers));
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

    /// Begins a session. Returns the lines that the card has written.
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

    /// Loads an image, in an order that is not that of its lines: from the last to the first.
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

fn answer(reply: Reply, layers: bool) -> Answer {
    match reply {
        Reply::Hello { written_lines, memory_use, .. } => Answer::Hello(written_lines, memory_use),
        Reply::Checksums { data, .. } => Answer::Checksums(data.to_vec()),
        Reply::ImageAccepted => Answer::ImageAccepted,
        Reply::FrameAccepted => Answer::FrameAccepted,
        Reply::Pixels { data, .. } => Answer::Pixels(data.len() / record_bytes(layers)),
        Reply::TileDone { tile, .. } => Answer::TileDone(tile),
        Reply::Fault(Fault { code, .. }) => Answer::Fault(code),
    }
}
