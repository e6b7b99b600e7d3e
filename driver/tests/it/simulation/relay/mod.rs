//! Relays: whatever the tree, its faults and its hosts, a picture is that of one card.

mod hostile;
mod network;

use std::sync::Mutex;
use std::time::Duration;

use photoncard_driver::dispatcher::Dispatcher;
use photoncard_driver::film::PixelValue;
use photoncard_driver::render::relay::CardLink;
use photoncard_driver::scheduler::Standing;
use photoncard_driver::session::{Event, Session, SessionError};
use photoncard_firmware::sampler::hash;
use photoncard_firmware::self_test::arithmetic::compute_bytes;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::counters::Counters;
use photoncard_shared::link::{Port, PortError};
use photoncard_shared::message::OPERAND_BYTES;

use self::network::{End, Network, TOLD, Tree};
use super::conditions::Run;
use super::line::{Faults, Random};
use super::run::work;
use super::world::Fixture;
use super::{seeds, with_room_for_a_card};

/// Number of ticks after which a run counts as stuck.
const MAX_TICKS: u32 = 1_000_000;

/// Host of a tree.
struct Root {
    session: Session,
    end: End,
    has_job: bool,
    error: Option<SessionError>,
}

impl Root {
    fn new(end: End, number: u32, now: Duration) -> Self {
        Self { session: Session::new(number, now), end, has_job: false, error: None }
    }

    /// Moves bytes between session and link.
    fn exchange(&mut self, now: Duration) -> Result<(), SessionError> {
        let Self { session, end, .. } = self;
        session.prepare();
        let sent = end.write(session.outgoing(), Duration::ZERO).map_err(SessionError::Port)?;
        session.sent(sent, now);
        let mut buffer = [0; 4096];
        match end.read(&mut buffer, Duration::ZERO).map_err(SessionError::Port)? {
            0 => session.acknowledge(),
            count => session.receive(&buffer[..count], now)?,
        }
        session.tick(None, now)
    }

    fn step(&mut self, number: usize, fixture: &Fixture, dispatcher: &Dispatcher, now: Duration) {
        if self.error.is_some() {
            return;
        }
        if self.session.budget().is_some() && !std::mem::replace(&mut self.has_job, true) {
            self.session.start(fixture.job(), now);
        }
        dispatcher.supply(number, &mut self.session, now);
        let result = self.exchange(now);
        dispatcher.collect(number, &mut self.session, now).unwrap();
        if let Err(error) = result {
            self.session.give_back();
            dispatcher.collect(number, &mut self.session, now).unwrap();
            dispatcher.scheduler().set_standing(number, Standing::GivenUp);
            self.error = Some(error);
        }
    }
}

/// Renders a frame until it is complete, all hosts' links have failed, or `is_over` holds.
fn render_until(
    network: &mut Network,
    roots: &mut [Root],
    fixture: &Fixture,
    mut is_over: impl FnMut(&mut Network, &[Root]) -> bool,
) -> Option<(Vec<PixelValue>, Counters)> {
    let film = Mutex::new(fixture.film());
    let dispatcher = Dispatcher::new(fixture.scheduler(roots.len(), None, 0), vec![&film]);
    roots.iter_mut().for_each(|root| root.has_job = false);
    let end = network.ticks + MAX_TICKS;
    while !dispatcher.scheduler().is_complete() {
        if roots.iter().all(|root| root.error.is_some()) || is_over(network, roots) {
            return None;
        }
        network.tick(|now| {
            for (number, root) in roots.iter_mut().enumerate() {
                root.step(number, fixture, &dispatcher, now);
            }
        });
        assert!(network.ticks < end, "the render has not ended");
    }
    let counters = work(dispatcher.scheduler().counters());
    drop(dispatcher);
    Some((film.into_inner().unwrap().pixels().collect(), counters))
}

fn render(
    network: &mut Network,
    roots: &mut [Root],
    fixture: &Fixture,
) -> Option<(Vec<PixelValue>, Counters)> {
    render_until(network, roots, fixture, |_, _| false)
}

/// Pixels and counters of one card.
fn alone(fixture: &Fixture) -> (Vec<PixelValue>, Counters) {
    let outcome = Run::new(fixture, 1, 0).go();
    (outcome.pixels.unwrap(), outcome.counters)
}

/// A tree and its host.
fn plant(tree: &Tree, fixture: &Fixture) -> (Network, Root) {
    let mut network = Network::default();
    let end = network.add(tree, fixture);
    (network, Root::new(end, 1, Duration::ZERO))
}

/// Relays of one to three cards, and trees of several levels.
fn trees() -> Vec<Tree> {
    let mut trees: Vec<Tree> = (1..=3).map(Tree::of_cards).collect();
    trees.push(Tree::Relay(vec![Tree::of_cards(2), Tree::Card, Tree::Relay(vec![Tree::of_cards(1)])]));
    trees
}

#[test]
fn pictures_of_every_tree_are_those_of_one_card() {
    with_room_for_a_card(|| {
        let mut fixtures: Vec<Fixture> = Fixture::crowded().into();
        fixtures.extend([Fixture::new(), Fixture::adaptive()]);
        for (number, fixture) in fixtures.iter().enumerate() {
            let expected = alone(fixture);
            for tree in trees() {
                let (mut network, mut root) = plant(&tree, fixture);
                let rendered = render(&mut network, std::slice::from_mut(&mut root), fixture);
                assert!(rendered.is_some_and(|rendered| rendered == expected), "frame {number}, {tree:?}");
                assert_eq!(root.session.link_bytes().resets, 0);
            }
        }
        assert_eq!(TOLD.get(), 0, "cards are lost");
    });
}

#[test]
fn damaged_links_on_all_levels_change_nothing() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let expected = alone(&fixture);
        let mut repeated = 0;
        for seed in seeds(1..30) {
            let faults = Faults { stalls: 0, resets: 0, deaths: 0, ..Faults::of(&mut Random(hash(seed))) };
            let trees = trees();
            let (mut network, mut root) = plant(&trees[seed as usize % trees.len()], &fixture);
            network.damage(faults);
            let rendered = render(&mut network, std::slice::from_mut(&mut root), &fixture);
            assert!(rendered.is_some_and(|rendered| rendered == expected), "seed {seed}: {:?}", root.error);
            repeated += root.session.link_bytes().line.repeated;
        }
        assert!(repeated > 0);
    });
}

/// A moment of a render.
fn moment(tree: &Tree, fixture: &Fixture, random: &mut Random) -> u32 {
    let (mut network, mut root) = plant(tree, fixture);
    assert!(render(&mut network, std::slice::from_mut(&mut root), fixture).is_some());
    1 + random.below(network.ticks as usize - 1) as u32
}

/// End of a card among others.
#[derive(Clone, Copy)]
enum Loss {
    Silence,
    Closed,
    Reset,
}

#[test]
fn the_tiles_of_a_lost_card_are_rendered_by_others() {
    with_room_for_a_card(|| {
        let [mut told, mut runs] = [0; 2];
        let fixture = Fixture::new();
        let expected = alone(&fixture);
        for seed in seeds(1..30) {
            let random = &mut Random(hash(seed));
            let trees = trees();
            let (mut network, mut root) = plant(&trees[1 + seed as usize % 3], &fixture);
            let victim = random.below(network.leaves.len());
            let moment = moment(&trees[1 + seed as usize % 3], &fixture, random);
            let loss = [Loss::Silence, Loss::Closed, Loss::Reset][random.below(3)];
            TOLD.set(0);
            let rendered =
                render_until(&mut network, std::slice::from_mut(&mut root), &fixture, |network, _| {
                    let leaf = &mut network.leaves[victim];
                    match loss {
                        _ if network.ticks != moment => {}
                        Loss::Silence => leaf.is_dead = true,
                        Loss::Closed => {
                            let mut wire = leaf.end.wire.borrow_mut();
                            (wire.is_open, wire.can_open) = (false, false);
                        }
                        Loss::Reset => leaf.card = fixture.card(),
                    }
                    false
                });
            assert!(rendered.is_some_and(|rendered| rendered == expected), "seed {seed}: {:?}", root.error);
            told += usize::from(TOLD.get() > 0);
            // With its only card a relay is lost as well, on each level.
            assert!(TOLD.get() <= 3, "seed {seed}: other cards are lost");
            runs += 1;
        }
        assert!(2 * told > runs, "{told} of {runs} losses were noticed");
    });
}

#[test]
fn a_relay_that_has_lost_all_cards_leaves_its_host_and_returns_to_the_next() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let expected = alone(&fixture);
        let (mut network, root) = plant(&Tree::of_cards(2), &fixture);
        let other = network.add(&Tree::Card, &fixture);
        let mut roots = [root, Root::new(other, 2, Duration::ZERO)];
        let set_dead = |network: &mut Network, is_dead: bool| {
            for leaf in &mut network.leaves[..2] {
                leaf.is_dead = is_dead;
                leaf.end.wire.borrow_mut().can_open = !is_dead;
                leaf.end.wire.borrow_mut().is_open &= !is_dead;
            }
        };
        let rendered = render_until(&mut network, &mut roots, &fixture, |network, roots| {
            if roots[0].session.is_loaded() {
                set_dead(network, true);
            }
            false
        });
        assert!(rendered == Some(expected.clone()));
        assert!(
            matches!(roots[0].error, Some(SessionError::Port(PortError::Closed))),
            "{:?}",
            roots[0].error
        );
        for (is_dead, number) in [(true, 3), (false, 4)] {
            set_dead(&mut network, is_dead);
            let mut end = roots[0].end.clone();
            end.open();
            let mut root = Root::new(end, number, network.now());
            let rendered = render(&mut network, std::slice::from_mut(&mut root), &fixture);
            assert_eq!(rendered.is_none(), is_dead, "{:?}", root.error);
            assert!(rendered.is_none_or(|rendered| rendered == expected));
        }
    });
}

#[test]
fn a_host_finds_the_relay_as_an_earlier_one_has_left_it() {
    with_room_for_a_card(|| {
        let fixture = Fixture::of_photons(3000);
        let expected = alone(&fixture);
        let whole = (fixture.upload.lines().len() * LINE_BYTES) as u64;
        let mut sent_parts = 0;
        for seed in seeds(1..30) {
            let random = &mut Random(hash(seed));
            let other =
                if random.below(2) == 0 { fixture.changed(random) } else { Fixture::of_photons(3000) };
            let trees = trees();
            let (mut network, mut root) = plant(&trees[seed as usize % trees.len()], &fixture);
            let moment = moment(&trees[seed as usize % trees.len()], &other, random);
            render_until(&mut network, std::slice::from_mut(&mut root), &other, |network, _| {
                network.ticks == moment
            });
            // A card may hold other lines than its sisters, or none.
            let odd = random.below(network.leaves.len());
            match random.below(3) {
                0 => {
                    network.leaves[odd].card = fixture.card();
                    // A relay that finds its only card reset closes the link of the host that it still knows.
                    (0..1000).for_each(|_| network.tick(|_| {}));
                    root.end.open();
                }
                1 => network.leaves[odd].card.memory().damage(random.below(300)),
                _ => {}
            }
            let mut root = Root::new(root.end.clone(), 2, network.now());
            let rendered = render(&mut network, std::slice::from_mut(&mut root), &fixture);
            assert!(rendered.is_some_and(|rendered| rendered == expected), "seed {seed}: {:?}", root.error);
            sent_parts += u32::from(root.session.link_bytes().image < whole);
        }
        assert!(sent_parts > 5, "{sent_parts}");
    });
}

#[test]
fn frames_of_an_animation_take_the_changed_lines_alone() {
    with_room_for_a_card(|| {
        let mut changed = 0;
        for seed in seeds(1..12) {
            let random = &mut Random(hash(seed));
            let trees = trees();
            let mut fixture = Fixture::new();
            let (mut network, mut root) = plant(&trees[seed as usize % trees.len()], &fixture);
            for _ in 0..4 {
                let rendered = render(&mut network, std::slice::from_mut(&mut root), &fixture);
                assert!(rendered == Some(alone(&fixture)), "seed {seed}: {:?}", root.error);
                let next = fixture.changed(random);
                let (before, after) = (fixture.upload.lines(), next.upload.lines());
                let differs = |line: &usize| before.get(*line) != after.get(*line);
                let lacking = ((0..after.len()).filter(differs).count() * LINE_BYTES) as u64;
                let sent = root.session.link_bytes().image;
                render(&mut network, std::slice::from_mut(&mut root), &next);
                assert_eq!(root.session.link_bytes().image - sent, lacking, "seed {seed}");
                changed += u32::from(lacking > 0);
                fixture = next;
            }
        }
        assert!(changed > 4);
    });
}

/// Ticks, each of which moves one frame over every link, until all cards of a tree have accepted an image,
/// and the number of bytes that the host has sent until then.
fn time_to_load(tree: &Tree, fixture: &Fixture) -> (u32, usize) {
    let (mut network, mut root) = plant(tree, fixture);
    render_until(&mut network, std::slice::from_mut(&mut root), fixture, |_, roots| {
        roots[0].session.is_loaded()
    });
    assert!(root.session.is_loaded());
    let sent = root.end.wire.borrow().sent;
    (network.ticks, sent)
}

#[test]
fn an_image_reaches_64_cards_after_the_frames_of_one_and_some_for_each_level() {
    with_room_for_a_card(|| {
        let fixture = Fixture::of_photons(12_000);
        let frames = fixture.upload.lines().len().div_ceil(8) as u32;
        let (one, sent_to_one) = time_to_load(&Tree::Card, &fixture);
        let (all, sent_to_all) = time_to_load(&Tree::full(3, 4), &fixture);
        println!("{frames} frames: one card {one} ticks, 64 cards by a fan of 4 {all} ticks");
        assert!(frames > 100 && one >= frames, "{frames} frames in {one} ticks");
        // Greeting, image and frame pass three levels there and back.
        assert!(all <= one + 60, "{all} ticks for 64 cards, {one} for one");
        assert!(
            sent_to_all <= sent_to_one + sent_to_one / 20,
            "{sent_to_all} bytes, {sent_to_one} to one card"
        );
    });
}

#[test]
fn the_self_test_of_a_relay_is_that_of_all_cards() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let (mut network, mut root) = plant(&trees()[3], &fixture);
        let operands: Vec<[u8; OPERAND_BYTES]> = (0..8).map(|seed| [seed * 31; OPERAND_BYTES]).collect();
        let mut events = Vec::new();
        let mut is_asked = [false; 2];
        while !matches!(events.last(), Some(Event::MemoryTested(progress)) if progress.is_over()) {
            network.tick(|now| {
                root.exchange(now).unwrap();
                events.extend(std::iter::from_fn(|| root.session.next_event()));
                if root.session.budget().is_some() && !std::mem::replace(&mut is_asked[0], true) {
                    root.session.compute(&operands, now);
                } else if !events.is_empty() && !std::mem::replace(&mut is_asked[1], true) {
                    root.session.test_memory(now);
                }
            });
            assert!(network.ticks < MAX_TICKS);
        }
        let right: Vec<u8> = operands.iter().flat_map(compute_bytes).collect();
        assert_eq!(events[0], Event::Computed(right));
        let wrong = |event: &Event| matches!(event, Event::MemoryTested(report) if report.wrong.count > 0);
        assert!(events.len() > 5 && !events.iter().any(wrong));
    });
}
