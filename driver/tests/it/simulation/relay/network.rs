//! Trees of relays and cards, in one thread and in virtual time, over links that move a limited number of
//! bytes in each tick.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use photoncard_driver::emulator::Emulated;
use photoncard_driver::render::Budget;
use photoncard_driver::render::relay::{CardLink, HostLink, Relay, common_budget};
use photoncard_firmware::card::Card;
use photoncard_shared::frame::MAX_FRAME;
use photoncard_shared::link::{Port, PortError};

use crate::simulation::line::{Faults, Queue, Random};
use crate::simulation::world::{BUDGET, Fixture, Memory};

/// Virtual time of a tick.
const TICK: Duration = Duration::from_millis(1);
/// Number of steps of each party in a tick.
const STEPS: usize = 4;

/// One direction of a link.
struct Pipe {
    /// Bytes of this tick.
    leaving: Queue,
    arrived: VecDeque<u8>,
    /// Number of bytes that it still takes in this tick.
    room: usize,
}

impl Pipe {
    fn new() -> Self {
        Self { leaving: Queue::of(MAX_FRAME), arrived: VecDeque::new(), room: MAX_FRAME }
    }

    fn tick(&mut self) {
        self.arrived.extend(self.leaving.bytes.drain(..));
        self.room = MAX_FRAME;
    }
}

/// A link between a host and a card.
pub(crate) struct Wire {
    /// To the card, and to the host.
    pipes: [Pipe; 2],
    pub(crate) is_open: bool,
    /// True if the host can open the link again.
    pub(crate) can_open: bool,
    pub(crate) faults: Faults,
    random: Random,
    /// Number of bytes that the host has sent.
    pub(crate) sent: usize,
}

impl Wire {
    fn tick(&mut self) {
        self.pipes.iter_mut().for_each(Pipe::tick);
    }
}

/// The host's or the card's end of a link. The card's end is not told that the link is closed.
#[derive(Clone)]
pub(crate) struct End {
    pub(crate) wire: Rc<RefCell<Wire>>,
    is_host: bool,
}

impl Port for End {
    fn read(&mut self, buffer: &mut [u8], _: Duration) -> Result<usize, PortError> {
        let wire = &mut *self.wire.borrow_mut();
        let arrived = &mut wire.pipes[usize::from(self.is_host)].arrived;
        if arrived.is_empty() && !wire.is_open && self.is_host {
            return Err(PortError::Closed);
        }
        let count = buffer.len().min(arrived.len());
        arrived.drain(..count).zip(buffer).for_each(|(byte, place)| *place = byte);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8], _: Duration) -> Result<usize, PortError> {
        let Wire { pipes, is_open, faults, random, sent, .. } = &mut *self.wire.borrow_mut();
        if !*is_open {
            return if self.is_host { Err(PortError::Closed) } else { Ok(bytes.len()) };
        }
        let pipe = &mut pipes[usize::from(!self.is_host)];
        let count = pipe.leaving.push(bytes, pipe.room, faults, random);
        pipe.room -= count;
        *sent += if self.is_host { count } else { 0 };
        Ok(count)
    }
}

impl CardLink for End {
    fn close(&mut self) {
        self.wire.borrow_mut().is_open = false;
    }

    fn open(&mut self) -> Option<bool> {
        let mut wire = self.wire.borrow_mut();
        wire.is_open = wire.can_open;
        wire.pipes = [Pipe::new(), Pipe::new()];
        Some(wire.is_open)
    }
}

impl HostLink for End {
    fn hang_up(&mut self) {
        self.wire.borrow_mut().is_open = false;
    }
}

/// Shape of a tree.
#[derive(Clone, Debug)]
pub(crate) enum Tree {
    Card,
    Relay(Vec<Tree>),
}

impl Tree {
    /// A relay of this number of cards.
    pub(crate) fn of_cards(cards: usize) -> Self {
        Self::Relay(vec![Self::Card; cards])
    }

    /// A tree of this number of levels of relays, with `fan` below each.
    pub(crate) fn full(levels: usize, fan: usize) -> Self {
        if levels == 0 { Self::Card } else { Self::Relay(vec![Self::full(levels - 1, fan); fan]) }
    }
}

pub(crate) struct Leaf {
    pub(crate) card: Box<Card<Emulated, Memory>>,
    pub(crate) end: End,
    /// True if the card does nothing.
    pub(crate) is_dead: bool,
}

impl Leaf {
    fn step(&mut self) {
        let Self { card, end, is_dead: false } = self else { return };
        let mut buffer = [0; 4096];
        match end.read(&mut buffer, TICK) {
            Ok(count @ 1..) => card.feed(&buffer[..count]),
            _ => card.acknowledge(),
        }
        for _ in 0..8 {
            if !card.outgoing().is_empty() {
                break;
            }
            card.work();
        }
        let sent = end.write(card.outgoing(), TICK).unwrap_or(0);
        card.sent(sent);
    }
}

/// All relays, cards and links of a run.
#[derive(Default)]
pub(crate) struct Network {
    wires: Vec<Rc<RefCell<Wire>>>,
    pub(crate) leaves: Vec<Leaf>,
    pub(crate) relays: Vec<(Relay<'static, End>, End)>,
    pub(crate) ticks: u32,
}

thread_local! {
    /// Number of messages of relays about cards.
    pub(crate) static TOLD: Cell<usize> = const { Cell::new(0) };
}

impl Network {
    /// Adds a tree, and returns the host's end of the link to it.
    pub(crate) fn add(&mut self, tree: &Tree, fixture: &Fixture) -> End {
        self.grow(tree, fixture).0
    }

    fn grow(&mut self, tree: &Tree, fixture: &Fixture) -> (End, Budget) {
        let number = self.wires.len() as u32;
        let wire = Wire {
            pipes: [Pipe::new(), Pipe::new()],
            is_open: true,
            can_open: true,
            faults: Faults::default(),
            random: Random(number),
            sent: 0,
        };
        let wire = Rc::new(RefCell::new(wire));
        self.wires.push(wire.clone());
        let [host, card] = [true, false].map(|is_host| End { wire: wire.clone(), is_host });
        let Tree::Relay(trees) = tree else {
            self.leaves.push(Leaf { card: fixture.card(), end: card, is_dead: false });
            return (host, BUDGET);
        };
        let below: Vec<_> = trees.iter().map(|tree| self.grow(tree, fixture)).collect();
        let budgets: Vec<Budget> = below.iter().map(|(_, budget)| *budget).collect();
        let cards = below.into_iter().map(|(end, budget)| ("card".into(), end, budget)).collect();
        let relay = Relay::new(cards, number << 16, &|_| TOLD.set(TOLD.get() + 1)).unwrap();
        self.relays.push((relay, card));
        (host, common_budget(&budgets).unwrap())
    }

    pub(crate) fn now(&self) -> Duration {
        TICK * self.ticks
    }

    /// Sets the faults of all links.
    pub(crate) fn damage(&mut self, faults: Faults) {
        self.wires.iter().for_each(|wire| wire.borrow_mut().faults = faults);
    }

    /// Lets all links move the bytes of a tick, with all relays and cards at work. `host` is called as often.
    pub(crate) fn tick(&mut self, mut host: impl FnMut(Duration)) {
        self.ticks += 1;
        self.wires.iter().for_each(|wire| wire.borrow_mut().tick());
        let now = self.now();
        for _ in 0..STEPS {
            host(now);
            self.relays.iter_mut().for_each(|(relay, end)| relay.step(end, now).unwrap());
            self.leaves.iter_mut().for_each(Leaf::step);
        }
    }
}
