//! A card of a relay: its link, its session, and its answer to the command that all cards execute.

use std::time::Duration;

use photoncard_cards::session::{Session, SessionError};
use photoncard_shared::link::PortError;
use photoncard_shared::message::{Command, Fault};

use super::link::CardLink;

/// Number of waiting commands from which on a card delays the next command for all cards.
const MAX_WAITING: usize = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// The link is being opened.
    Opening,
    /// The hello is sent. `is_fresh` is true if the link was opened for it.
    Greeting { is_fresh: bool },
    /// The card has answered the greeting, and takes part.
    Here,
    /// The card takes no part until the next greeting.
    Lost,
}

pub(super) struct RelayedCard<L> {
    /// Name in messages.
    pub(super) name: String,
    link: L,
    pub(super) session: Session,
    pub(super) standing: Standing,
    /// Answer to the present question to all cards.
    pub(super) answer: Option<Result<Vec<u8>, Fault>>,
    /// True after the loss of the card was reported, until it is back.
    pub(super) is_told: bool,
    /// Number of the last session.
    number: u32,
    /// Number of messages that had passed the link, and time since which none has while others waited.
    passed: (u16, Duration),
}

impl<L: CardLink> RelayedCard<L> {
    /// Creates a card with an open link. `number` is a random number, from which those of its sessions
    /// follow.
    pub(super) fn new(name: String, link: L, number: u32) -> Self {
        Self {
            name,
            link,
            session: Session::relayed(number, Duration::ZERO),
            standing: Standing::Greeting { is_fresh: false },
            answer: None,
            is_told: false,
            number,
            passed: (0, Duration::ZERO),
        }
    }

    pub(super) fn is_here(&self) -> bool {
        self.standing == Standing::Here
    }

    /// Greets the card with a new session. The link of a lost card is opened first.
    pub(super) fn greet(&mut self, now: Duration) {
        match self.standing {
            Standing::Opening | Standing::Lost => self.standing = Standing::Opening,
            Standing::Greeting { .. } | Standing::Here => self.begin(false, now),
        }
    }

    fn begin(&mut self, is_fresh: bool, now: Duration) {
        self.number = self.number.wrapping_add(1);
        self.session = Session::relayed(self.number, now);
        self.standing = Standing::Greeting { is_fresh };
        self.answer = None;
    }

    /// Excludes the card until the next greeting, and closes its link.
    pub(super) fn lose(&mut self) {
        // An attempt to open the link goes on.
        if self.standing != Standing::Opening {
            self.link.close();
        }
        self.standing = Standing::Lost;
        self.session.give_back();
    }

    /// Moves bytes over the link once, without waiting. Returns whether any were moved. A link that fails
    /// before the answer to the first greeting on it since long is opened again.
    ///
    /// # Errors
    /// If the card fails, or cannot be reached.
    pub(super) fn pass(&mut self, now: Duration) -> Result<bool, SessionError> {
        match self.standing {
            Standing::Lost => Ok(false),
            Standing::Opening => {
                match self.link.open() {
                    None => {}
                    Some(true) => self.begin(true, now),
                    Some(false) => return Err(SessionError::Port(PortError::Closed)),
                }
                Ok(false)
            }
            standing => match self.exchange(now) {
                Err(SessionError::Port(_)) if standing == (Standing::Greeting { is_fresh: false }) => {
                    self.link.close();
                    self.standing = Standing::Opening;
                    Ok(true)
                }
                result => result,
            },
        }
    }

    fn exchange(&mut self, now: Duration) -> Result<bool, SessionError> {
        let Self { link, session, .. } = self;
        session.prepare();
        let sent = match session.outgoing() {
            [] => 0,
            outgoing => link.write(outgoing, Duration::ZERO).map_err(SessionError::Port)?,
        };
        session.sent(sent, now);
        let mut buffer = [0; 8192];
        let received = link.read(&mut buffer, Duration::ZERO).map_err(SessionError::Port)?;
        match received {
            0 => session.acknowledge(),
            count => session.receive(&buffer[..count], now)?,
        }
        session.tick(None, now)?;
        Ok(sent + received > 0)
    }

    /// Forwards a command of the relay's host.
    pub(super) fn forward(&mut self, command: &Command, now: Duration) {
        self.answer = None;
        self.session.forward(command, now);
    }

    /// Returns whether commands wait for the card to take earlier ones.
    pub(super) fn is_full(&self) -> bool {
        self.session.waiting_commands() >= MAX_WAITING
    }

    /// Time for which the card has taken and sent no message while others wait for it (`is_awaited`).
    pub(super) fn delay(&mut self, is_awaited: bool, now: Duration) -> Duration {
        let passed = self.session.passed();
        if !is_awaited || passed != self.passed.0 {
            self.passed = (passed, now);
        }
        now.saturating_sub(self.passed.1)
    }
}
