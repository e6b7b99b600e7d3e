//! Scripted card: a test defines its answers.

use photoncard_firmware::kind::MICRO;
use photoncard_shared::frame::MAX_PAYLOAD;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::{self, Command, PROTOCOL_VERSION, Reply};
use photoncard_shared::transport::Transport;

/// Answer of a card to a command, if any.
pub(crate) type Answer = fn(&Command) -> Option<Reply<'static>>;

/// Card whose answers are a function of the command.
pub(crate) struct Card {
    transport: Transport,
    answer: Answer,
    /// True once a frame was received.
    pub(crate) has_frame: bool,
}

impl Card {
    pub(crate) fn new(answer: Answer) -> Self {
        Self { transport: Transport::card(), answer, has_frame: false }
    }

    /// Receives bytes and answers them. Returns the bytes to send.
    pub(crate) fn step(&mut self, mut bytes: &[u8]) -> Vec<u8> {
        while !bytes.is_empty() {
            let (taken, _) = self.transport.receive(bytes);
            bytes = &bytes[taken..];
            while let Some(message) = self.transport.take() {
                let command = message::decode::<Command>(message).expect("the host sends commands");
                self.has_frame |= matches!(command, Command::BeginFrame(_));
                let reply = (self.answer)(&command);
                if let Some(reply) = reply {
                    assert!(self.transport.send(|bytes| message::encode(&reply, bytes)));
                }
            }
        }
        self.transport.acknowledge();
        let mut sent = Vec::new();
        while !self.transport.outgoing().is_empty() {
            sent.extend(self.transport.outgoing());
            self.transport.sent(MAX_PAYLOAD * 2);
        }
        sent
    }
}

/// Answers of a card that accepts any image and renders no tile.
pub(crate) fn sound(command: &Command) -> Option<Reply<'static>> {
    match command {
        Command::Hello { .. } => Some(Reply::Hello {
            protocol: PROTOCOL_VERSION,
            layout: LAYOUT_VERSION,
            budget: MICRO,
            written_lines: 0,
            memory_use: None,
            build: "a card",
            board: None,
        }),
        Command::EndImage => Some(Reply::ImageAccepted),
        Command::BeginFrame(_) => Some(Reply::FrameAccepted),
        _ => None,
    }
}
