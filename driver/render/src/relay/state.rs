//! State of a relay: the commands of its host, and the answers of its cards.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use photoncard_cards::session::{Assignment, Event, SessionError};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::Budget;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::link::PortError;
use photoncard_shared::message::{
    self, Command, Fault, FaultCode, FrameParameters, Invariant, PROTOCOL_VERSION, Reply, Tile,
};

use super::answers::{Question, agreed_checksums, right_results, worst_results};
use super::budget::{common_budget, meets};
use super::card::{RelayedCard, Standing};
use super::host::HostEnd;
use super::link::{CardLink, HostLink};
use super::memory_test::MemoryTests;

/// Maximum time that a host waits for a card which can be reached, if another has answered the greeting.
/// Hosts wait 5 s for an answer to theirs.
const GREETING: Duration = Duration::from_secs(4);
/// Maximum time that a host waits for a lost card to be reached, if another has answered the greeting.
const REACHING: Duration = Duration::from_secs(1);
/// Maximum time for which one card may take no message while the others wait for it. Hosts wait 120 s for
/// progress.
const DELAY: Duration = Duration::from_secs(60);
/// Maximum wait for bytes of the host while cards work.
const WAIT: Duration = Duration::from_millis(1);
/// Maximum wait for bytes of the host while nothing is to be done.
const IDLE_WAIT: Duration = Duration::from_millis(20);
/// Wait for bytes of the host soon after others were moved, and between two parts of a card image. A
/// [`HostPort`](photoncard_cards::link::HostPort) is rarely read without a wait.
const SHORT_WAIT: Duration = Duration::from_micros(20);
/// Number of short waits before a longer one.
const SHORT_WAITS: u32 = 8;

/// Loading state of the card image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Image {
    None,
    /// The image has this number of lines, some of which have been forwarded.
    Loading(u32),
    Ready,
}

/// Answer that is due to the host, and delays its next command.
pub(super) enum Pending {
    Nothing,
    /// Greetings of the cards since this time.
    Greeting(Duration),
    Answers(Question),
    Test(MemoryTests),
}

/// A relay without threads and clock: [`Relay::step`] moves bytes between the link to the host and those to
/// the cards.
pub struct Relay<'a, L> {
    pub(super) budget: Budget,
    pub(super) cards: Vec<RelayedCard<L>>,
    host: HostEnd,
    pub(super) pending: Pending,
    /// True from the answer to a hello until the host is left.
    pub(super) is_open: bool,
    hangs_up: bool,
    /// Number of leading lines that all cards have written.
    pub(super) written: u32,
    pub(super) image: Image,
    pub(super) frame: Option<FrameParameters>,
    /// Tiles that no card has.
    pub(super) waiting: VecDeque<Tile>,
    pub(super) is_flushed: bool,
    /// Number of steps since the last in which bytes were moved.
    quiet_steps: u32,
    say: &'a dyn Fn(fmt::Arguments),
}

impl<'a, L: CardLink> Relay<'a, L> {
    /// Creates a relay of cards with names for messages, open links and budgets. `number` is a random number,
    /// which distinguishes the sessions with the cards from others. `say` receives messages about cards.
    /// Returns `None` if there is no card.
    pub fn new(
        cards: Vec<(String, L, Budget)>,
        number: u32,
        say: &'a dyn Fn(fmt::Arguments),
    ) -> Option<Self> {
        let budgets: Vec<Budget> = cards.iter().map(|(_, _, budget)| *budget).collect();
        let of_card = |(name, link, _)| RelayedCard::new(name, link, number);
        Some(Self {
            budget: common_budget(&budgets)?,
            cards: cards.into_iter().map(of_card).collect(),
            host: HostEnd::new(),
            pending: Pending::Nothing,
            is_open: false,
            hangs_up: false,
            written: 0,
            image: Image::None,
            frame: None,
            waiting: VecDeque::new(),
            is_flushed: false,
            quiet_steps: 0,
            say,
        })
    }

    /// Moves bytes once over each link, executes the commands that have arrived, and deals tiles. Waits for
    /// bytes of the host, at most 20 ms, if nothing else is to be done. `now` is the time since any fixed
    /// moment.
    ///
    /// # Errors
    /// If the link to the host fails for ever.
    pub fn step(&mut self, host: &mut impl HostLink, now: Duration) -> Result<(), PortError> {
        let mut has_moved = self.exchange_with_host(host, now)?;
        for card in 0..self.cards.len() {
            has_moved |= self.exchange_with_card(card, now);
        }
        self.conclude(now);
        self.lose_late_cards(now);
        self.deal();
        if std::mem::take(&mut self.hangs_up) {
            host.hang_up();
        }
        self.quiet_steps = if has_moved { 0 } else { self.quiet_steps.saturating_add(1) };
        Ok(())
    }

    /// Longest wait for bytes of the host.
    fn wait(&self) -> Duration {
        let is_loading = matches!(self.image, Image::Loading(_));
        match self.pending {
            _ if self.quiet_steps == 0 && !is_loading => Duration::ZERO,
            _ if self.quiet_steps < SHORT_WAITS => SHORT_WAIT,
            Pending::Nothing if !is_loading && !self.has_tiles() => IDLE_WAIT,
            _ => WAIT,
        }
    }

    fn exchange_with_host(&mut self, host: &mut impl HostLink, now: Duration) -> Result<bool, PortError> {
        self.host.prepare();
        let sent = match self.host.transport.outgoing() {
            [] => 0,
            outgoing => host.write(outgoing, Duration::ZERO)?,
        };
        self.host.transport.sent(sent);
        let wait = if self.host.transport.outgoing().is_empty() { self.wait() } else { Duration::ZERO };
        let mut buffer = [0; 8192];
        let received = host.read(&mut buffer, wait)?;
        if received == 0 {
            self.host.transport.acknowledge();
        }
        let mut rest = &buffer[..received];
        while !rest.is_empty() {
            let (taken, _) = self.host.transport.receive(rest);
            rest = &rest[taken..];
            self.execute_all(now);
        }
        self.execute_all(now);
        Ok(sent + received > 0)
    }

    /// Executes the commands that have arrived, as long as every card has room for them.
    fn execute_all(&mut self, now: Duration) {
        if self.host.begins_session() {
            self.forget();
        }
        while matches!(self.pending, Pending::Nothing)
            && self.host.has_room()
            && !self.here().any(RelayedCard::is_full)
            && let Some(payload) = self.host.transport.take().map(<[u8]>::to_vec)
        {
            let result = match message::decode::<Command>(&payload) {
                None => Err(Fault { code: FaultCode::Message, detail: payload.len() as u32 }),
                Some(command) => self.execute(&command, now),
            };
            if let Err(fault) = result {
                self.host.reply(&Reply::Fault(fault));
            }
        }
    }

    fn here(&self) -> impl Iterator<Item = &RelayedCard<L>> {
        self.cards.iter().filter(|card| card.is_here())
    }

    /// Drops the host's session and its work.
    pub(super) fn forget(&mut self) {
        self.pending = Pending::Nothing;
        self.is_open = false;
        self.image = Image::None;
        self.drop_frame();
    }

    pub(super) fn drop_frame(&mut self) {
        self.frame = None;
        self.waiting.clear();
        self.host.drop_tiles();
        self.is_flushed = false;
    }

    /// Number of tiles that the host waits for.
    pub(super) fn tiles(&self) -> usize {
        self.waiting.len() + self.host.tiles() + self.here().map(|card| card.session.tiles()).sum::<usize>()
    }

    pub(super) fn has_tiles(&self) -> bool {
        self.tiles() > 0
    }

    /// Moves bytes over the link to a card, and takes its answers. Returns whether any bytes were moved.
    fn exchange_with_card(&mut self, index: usize, now: Duration) -> bool {
        let passed = self.cards[index].pass(now);
        let card = &mut self.cards[index];
        if matches!(card.standing, Standing::Greeting { .. }) && card.session.is_greeted() {
            self.welcome(index);
        }
        // Answers that came before an error are valid.
        self.collect(index);
        passed.unwrap_or_else(|error| {
            self.fail(index, &error);
            true
        })
    }

    /// Takes in a card that has answered its greeting, if it is no less than the relay has stated.
    fn welcome(&mut self, index: usize) {
        let card = &mut self.cards[index];
        if card.session.budget().is_some_and(|budget| meets(budget, &self.budget)) {
            card.standing = Standing::Here;
            card.is_told = false;
        } else {
            self.lose(index, format_args!("it has less room than when the relay began"));
        }
    }

    fn collect(&mut self, index: usize) {
        while let Some(event) = self.cards[index].session.next_event() {
            match event {
                Event::Ready | Event::ImageAccepted => self.cards[index].answer = Some(Ok(Vec::new())),
                Event::Checksums(data) | Event::Computed(data) => self.cards[index].answer = Some(Ok(data)),
                Event::Refused(fault) => self.cards[index].answer = Some(Err(fault)),
                Event::TileDone(tile) if self.frame.is_some() => self.host.finish(tile),
                Event::TileLost { tile, .. } if self.frame.is_some() => self.waiting.push_front(tile),
                Event::TileDone(_) | Event::TileLost { .. } => {}
                Event::MemoryTested(report) => self.take_test(index, report),
            }
        }
    }

    fn take_test(&mut self, index: usize, report: message::MemoryTest) {
        let Pending::Test(tests) = &mut self.pending else { return };
        let bytes = u64::from(report.lines) * LINE_BYTES as u64;
        if bytes < self.budget.dram_bytes {
            return self.lose(index, format_args!("its memory has {bytes} bytes, fewer than its budget"));
        }
        if report.is_end_of_pattern() && report.wrong.count > 0 {
            let (name, wrong) = (&self.cards[index].name, report.wrong.count);
            (self.say)(format_args!("photoncard: {name}: {wrong} words of memory are wrong"));
        }
        tests.take(index, report);
        let here = (0..self.cards.len()).filter(|&card| self.cards[card].is_here());
        while let Some(report) = tests.next(here.clone()) {
            self.host.reply(&Reply::MemoryTested(report));
            if report.is_over() {
                self.pending = Pending::Nothing;
                return;
            }
        }
    }

    /// Handles the error of a card. A card that sends what no card sends may have sent wrong pixels before:
    /// the host is told, which can revoke them.
    fn fail(&mut self, index: usize, error: &SessionError) {
        let must_leave = self.exclude(index, format_args!("{error}"));
        match error {
            SessionError::Fault(fault) | SessionError::Memory(fault) if must_leave || error.is_wrong() => {
                self.end_by(*fault);
            }
            _ if error.is_wrong() => self.end_by(Invariant::Relayed.fault()),
            _ if must_leave => self.hang_up(),
            _ => {}
        }
    }

    /// Ends the host's session with a fault.
    fn end_by(&mut self, fault: Fault) {
        self.forget();
        self.host.reply(&Reply::Fault(fault));
    }

    /// Excludes a card until the next greeting, and leaves the host if that is necessary.
    fn lose(&mut self, index: usize, reason: fmt::Arguments) {
        if self.exclude(index, reason) {
            self.hang_up();
        }
    }

    /// Excludes a card until the next greeting. Its tiles go to the others. Returns whether the host must be
    /// left: there are no others, or the self-test, which is of all cards, cannot go on.
    fn exclude(&mut self, index: usize, reason: fmt::Arguments) -> bool {
        let card = &mut self.cards[index];
        let was_here = card.is_here();
        card.lose();
        if !std::mem::replace(&mut card.is_told, true) {
            (self.say)(format_args!("photoncard: {} is lost: {reason}; any others go on", card.name));
        }
        self.collect(index);
        let is_test = matches!(self.pending, Pending::Test(_) | Pending::Answers(Question::Compute(_)));
        let is_greeting = matches!(self.pending, Pending::Greeting(_));
        was_here && (is_test || self.here().next().is_none()) && !is_greeting
    }

    fn hang_up(&mut self) {
        self.forget();
        // A host whose link has no connection finds that its session is unknown, as after a reset.
        self.host = HostEnd::new();
        self.hangs_up = true;
    }

    /// Answers the host as soon as all cards have answered.
    fn conclude(&mut self, now: Duration) {
        match &self.pending {
            Pending::Greeting(since) => self.conclude_greeting(now.saturating_sub(*since)),
            Pending::Answers(question) if self.here().all(|card| card.answer.is_some()) => {
                let question = question.clone();
                self.pending = Pending::Nothing;
                self.answer(question);
            }
            _ => {}
        }
    }

    fn conclude_greeting(&mut self, waited: Duration) {
        let is_open =
            |card: &RelayedCard<L>| matches!(card.standing, Standing::Opening | Standing::Greeting { .. });
        let is_awaited = |card: &RelayedCard<L>| match card.standing {
            Standing::Opening => waited < REACHING,
            Standing::Greeting { .. } => waited < GREETING,
            Standing::Here | Standing::Lost => false,
        };
        let has_any = self.here().next().is_some();
        if self.cards.iter().any(is_awaited) || !has_any && self.cards.iter().any(is_open) {
            return;
        }
        for index in 0..self.cards.len() {
            if is_open(&self.cards[index]) {
                self.lose(index, format_args!("it has not answered the greeting"));
            }
        }
        self.pending = Pending::Nothing;
        let Some(written) = self.here().map(|card| card.session.written_lines()).min() else {
            return self.hang_up();
        };
        (self.written, self.is_open) = (written, true);
        let build =
            format!("photoncard-relay {} of {} cards", env!("CARGO_PKG_VERSION"), self.here().count());
        self.host.reply(&Reply::Hello {
            protocol: PROTOCOL_VERSION,
            layout: LAYOUT_VERSION,
            budget: self.budget,
            written_lines: written,
            memory_use: None,
            build: &build,
            board: None,
        });
    }

    /// Sends one answer to a question that all cards have answered. Cards that refuse what others accept are
    /// excluded. A refusal of all is the answer.
    fn answer(&mut self, question: Question) {
        let mut accepted = Vec::new();
        let mut refused = Vec::new();
        for (index, card) in self.cards.iter_mut().enumerate().filter(|(_, card)| card.is_here()) {
            match card.answer.take() {
                Some(Ok(data)) => accepted.push((index, data)),
                Some(Err(fault)) => refused.push((index, fault)),
                None => {}
            }
        }
        if let (&[(_, fault), ..], true) = (&refused[..], accepted.is_empty()) {
            return self.host.reply(&Reply::Fault(fault));
        }
        for (index, fault) in refused {
            self.lose(index, format_args!("it refuses what others accept: {fault}"));
        }
        let (indices, answers): (Vec<usize>, Vec<Vec<u8>>) = accepted.into_iter().unzip();
        match question {
            Question::Checksums(first) => {
                self.host.reply(&Reply::Checksums { first, data: &agreed_checksums(&answers) });
            }
            Question::Image => {
                self.image = Image::Ready;
                self.host.reply(&Reply::ImageAccepted);
            }
            Question::Frame(frame) => {
                self.frame = Some(frame);
                self.host.reply(&Reply::FrameAccepted);
            }
            Question::Compute(operands) => {
                let right = right_results(&operands);
                for (index, _) in indices.iter().zip(&answers).filter(|(_, answer)| **answer != right) {
                    (self.say)(format_args!("photoncard: {} computes wrongly", self.cards[*index].name));
                }
                self.host.reply(&Reply::Computed { results: &worst_results(&right, &answers) });
            }
        }
    }

    /// Excludes a card for which the others have waited too long.
    fn lose_late_cards(&mut self, now: Duration) {
        let asks = matches!(self.pending, Pending::Answers(_));
        let is_awaited = |card: &RelayedCard<L>| card.is_full() || asks && card.answer.is_none();
        let others_wait = self.here().any(|card| !is_awaited(card));
        for index in 0..self.cards.len() {
            let card = &mut self.cards[index];
            let is_late = others_wait && card.is_here() && is_awaited(card);
            if card.delay(is_late, now) > DELAY {
                self.lose(index, format_args!("the others have waited {} s for it", DELAY.as_secs()));
            }
        }
    }

    /// Deals waiting tiles, each to the card with the fewest. If no tile follows, makes the cards do the
    /// gathers that wait in their queues.
    fn deal(&mut self) {
        let Some(frame) = self.frame else { return };
        let mut has_room = true;
        while has_room && let Some(tile) = self.waiting.pop_front() {
            let free = self.cards.iter_mut().filter(|card| card.is_here() && card.session.wants_tile());
            match free.min_by_key(|card| card.session.tiles()) {
                Some(card) => {
                    card.session.give(Assignment { tile, is_suspect: false });
                    card.session.prepare();
                }
                None => {
                    self.waiting.push_front(tile);
                    has_room = false;
                }
            }
        }
        // A host sends no flush to a card without room.
        let is_full = self.tiles() >= frame.tiles_of(&self.budget) as usize;
        if self.waiting.is_empty() && (self.is_flushed || is_full) {
            let free = self.cards.iter_mut().filter(|card| card.is_here() && card.session.wants_tile());
            free.for_each(|card| card.session.flush());
        }
    }
}
