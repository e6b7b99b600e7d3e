//! Whatever befalls cards and links, a render ends in the same picture, or in a clear error when no card is left: real
//! sessions, real cards, and links whose every step and fault a seed decides, in one thread and in virtual time.
//!
//! A seed that fails is run again alone by `PHOTONCARD_SEEDS=SEED cargo test -p photoncard-driver --test simulation`, many
//! by `PHOTONCARD_SEEDS=1..10000`.

use std::collections::VecDeque;
use std::ops::Range;
use std::time::Duration;

use glam::Vec3;
use photoncard_driver::emitter::Emitters;
use photoncard_driver::film::{Film, PixelValue};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::{MappedImage, map_photons};
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scene::{Camera, Material, Scene, Triangle};
use photoncard_driver::scheduler::{Scheduler, tiles};
use photoncard_driver::session::{Job, LinkBytes, Picture, Session, SessionError};
use photoncard_firmware::card::MicroCard;
use photoncard_firmware::memory::{CardMemory, MemoryPort};
use photoncard_firmware::sampler::hash;
use photoncard_shared::address::{Line, LineAddress, Structure};
use photoncard_shared::budget::MICRO;
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FaultCode, FrameParameters};

/// Runs of each test, if nothing else is asked for.
const SEEDS: Range<u32> = 1..300;
/// Steps of a run after which it is taken for stuck.
const MOST_STEPS: u64 = 20_000_000;
/// Virtual time of a step.
const STEP: Duration = Duration::from_micros(100);

/// The seeds to run: those that are asked for.
fn seeds() -> Range<u32> {
    let Ok(asked) = std::env::var("PHOTONCARD_SEEDS") else { return SEEDS };
    let number = |text: &str| text.parse().expect("PHOTONCARD_SEEDS is a seed, or the first..past the last");
    match asked.split_once("..") {
        Some((first, end)) => number(first)..number(end),
        None => number(&asked)..number(&asked) + 1,
    }
}

/// A corner of floor and wall under a lamp.
fn scene() -> Scene {
    let quad = |a: Vec3, u: Vec3, v: Vec3, material| {
        [[a, a + u, a + u + v], [a, a + u + v, a + v]].map(|vertices| Triangle { vertices, material })
    };
    let material = |diffuse: f32, emission: f32| Material {
        name: "material".into(),
        diffuse: Vec3::splat(diffuse),
        specular: Vec3::ZERO,
        exponent: 0.0,
        emission: Vec3::splat(emission),
        double_sided: true,
    };
    let quads = [
        quad(Vec3::new(-1.0, -1.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 0),
        quad(Vec3::new(-1.0, -1.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0, 0),
        quad(Vec3::new(-0.3, 0.9, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6, 1),
    ];
    let camera = Camera {
        name: "camera".into(),
        origin: Vec3::new(0.0, 0.0, 2.0),
        right: Vec3::X,
        up: Vec3::Y,
        forward: Vec3::NEG_Z,
        vertical_fov: 1.0,
        aspect: None,
    };
    Scene {
        triangles: quads.concat(),
        materials: vec![material(0.7, 0.0), material(0.0, 5.0)],
        cameras: vec![camera],
        ..Scene::default()
    }
}

fn settings() -> RenderSettings {
    RenderSettings {
        width: 12,
        height: 10,
        tile: 3,
        photons: 60,
        neighbors: 8,
        gather_rays: 2,
        shadow_rays: 1,
        ..RenderSettings::default()
    }
}

/// Card memory of its own.
struct Memory {
    lines: Vec<Line>,
}

impl MemoryPort for Memory {
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        let fault = Fault { code: FaultCode::LineRange, detail: address.0 };
        self.lines.get(address.0 as usize).ok_or(fault)
    }
}

impl CardMemory for Memory {
    fn lines(&self) -> u32 {
        self.lines.len() as u32
    }

    fn stored(&self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.lines.get(first.0 as usize..first.0 as usize + count as usize)
    }

    fn write(&mut self, first: LineAddress, count: u32) -> Option<&mut [Line]> {
        self.lines.get_mut(first.0 as usize..first.0 as usize + count as usize)
    }
}

/// What the runs have in common.
struct Fixture {
    settings: RenderSettings,
    mapped: MappedImage,
    checksum: u64,
    frame: FrameParameters,
}

impl Fixture {
    fn new() -> Self {
        let (scene, settings) = (scene(), settings());
        let packed = PackedScene::new(&scene, &Emitters::new(&scene)).unwrap();
        let mapped = map_photons(packed, &settings.photon_settings(), &|_| true).unwrap();
        let frame = settings.frame(&scene.cameras[0], mapped.max_distance);
        let checksum = image_checksum(mapped.image.lines());
        Self { settings, mapped, checksum, frame }
    }

    fn job(&self) -> Job<'_> {
        Job { image: self.mapped.image.lines(), checksum: self.checksum, frame: &self.frame }
    }

    /// A card that was just switched on.
    fn card(&self) -> Box<MicroCard<Memory>> {
        let lines = self.mapped.image.lines().len();
        Box::new(MicroCard::new(MICRO, Memory { lines: vec![Line::ZERO; lines] }))
    }

    fn picture(&self) -> Picture {
        let RenderSettings { width, height, tile, order, .. } = self.settings;
        let window = self.settings.window();
        let film = Film::new(width, height, window).unwrap();
        Picture { scheduler: Scheduler::new(tiles(window, tile, order)), film, partial: None }
    }
}

/// Numbers that a seed decides.
struct Random(u32);

impl Random {
    /// A number from 0 to below `end`.
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        hash(self.0) as usize % end
    }

    fn happens(&mut self, per_million: usize) -> bool {
        per_million > 0 && self.below(1_000_000) < per_million
    }
}

/// What a line does to a million bytes, and what happens to cards in a million of their steps.
#[derive(Clone, Copy, Debug, Default)]
struct Faults {
    flips: usize,
    drops: usize,
    repeats: usize,
    stalls: usize,
    resets: usize,
    deaths: usize,
}

impl Faults {
    /// Some faults, many of them or few.
    fn of(random: &mut Random) -> Self {
        let rates = [0, 1, 10, 100, 1000];
        let lines = |random: &mut Random| rates[random.below(rates.len())];
        let [flips, drops, repeats] = [lines(random), lines(random), lines(random)];
        let cards = |random: &mut Random, most: usize| [0, 0, 1, most][random.below(4)];
        Self {
            flips,
            drops,
            repeats,
            stalls: cards(random, 10),
            resets: cards(random, 20),
            deaths: cards(random, 2),
        }
    }
}

/// One direction of a link: it holds few bytes, and may harm them.
struct Queue {
    bytes: VecDeque<u8>,
    capacity: usize,
}

impl Queue {
    fn new(random: &mut Random) -> Self {
        // From hardly any to more than a frame.
        Self { bytes: VecDeque::new(), capacity: 1 << random.below(13) }
    }

    /// Takes the first of `bytes`, at most `most`; returns how many.
    fn push(&mut self, bytes: &[u8], most: usize, faults: &Faults, random: &mut Random) -> usize {
        let count = bytes.len().min(most).min(self.capacity.saturating_sub(self.bytes.len()));
        for &byte in &bytes[..count] {
            if random.happens(faults.drops) {
                continue;
            }
            let byte = if random.happens(faults.flips) { byte ^ 1 << random.below(8) } else { byte };
            let copies = 1 + usize::from(random.happens(faults.repeats));
            self.bytes.extend(std::iter::repeat_n(byte, copies));
        }
        count
    }

    /// Gives the first bytes, at most `most`.
    fn pop(&mut self, most: usize) -> Vec<u8> {
        self.bytes.drain(..most.min(self.bytes.len())).collect()
    }
}

/// How a card is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Health {
    Well,
    /// It does nothing before this step.
    Stalled(u64),
    /// It does nothing any more.
    Dead,
}

/// A card, its link and its session.
struct Station<'a> {
    card: Box<MicroCard<Memory>>,
    session: Session<'a>,
    /// Whether it has been silent for too long, and not been heard since.
    is_lost: bool,
    health: Health,
    started: bool,
    to_card: Queue,
    to_host: Queue,
    /// Bytes that move in one step at most.
    burst: usize,
    /// How often this card gets a step.
    speed: usize,
}

impl<'a> Station<'a> {
    fn new(fixture: &Fixture, random: &mut Random) -> Self {
        Self {
            card: fixture.card(),
            session: Session::new(random.below(1 << 16) as u16, Duration::ZERO),
            is_lost: false,
            health: Health::Well,
            started: false,
            to_card: Queue::new(random),
            to_host: Queue::new(random),
            burst: 1 << random.below(12),
            speed: 1 << random.below(6),
        }
    }

    /// One step of the host, of the card or of its chip: whichever the seed says.
    fn step(&mut self, run: &Run<'a>, picture: &mut Picture, step: u64, random: &mut Random) {
        let bytes = 1 + random.below(self.burst);
        let now = STEP * u32::try_from(step).unwrap_or(u32::MAX);
        let what = random.below(5);
        if what < 2 {
            self.step_of_host(run, picture, (now, bytes, what), random);
            return;
        }
        self.befall(run, step, random);
        if self.health != Health::Well {
            return;
        }
        match what {
            2 => {
                let received = self.to_card.pop(bytes);
                if received.is_empty() {
                    self.card.acknowledge();
                }
                self.card.feed(&received);
            }
            3 => {
                let sent = self.to_host.push(self.card.outgoing(), bytes, &run.faults, random);
                self.card.sent(sent);
            }
            _ => self.card.work(),
        }
    }

    fn step_of_host(
        &mut self,
        run: &Run<'a>,
        picture: &mut Picture,
        (now, bytes, what): (Duration, usize, usize),
        random: &mut Random,
    ) {
        let session = &mut self.session;
        if session.budget().is_some() && !self.started {
            session.start(run.fixture.job(), now);
            self.started = true;
        }
        let result = if what == 0 {
            session.prepare(picture);
            let sent = self.to_card.push(session.outgoing(), bytes, &run.faults, random);
            session.sent(sent, now);
            Ok(())
        } else {
            let received = self.to_host.pop(bytes);
            if received.is_empty() {
                session.acknowledge();
            }
            session.receive(&received, picture, now).and_then(|()| session.tick(now))
        };
        if let Err(error) = result {
            assert!(matches!(error, SessionError::Silent(_)), "seed {}: {error}", run.seed);
            session.reset(picture, now);
            self.is_lost = true;
        } else if session.has_answered() {
            self.is_lost = false;
        }
    }

    /// What happens to the card in a step of its own.
    fn befall(&mut self, run: &Run, step: u64, random: &mut Random) {
        if self.health == Health::Dead {
            return;
        }
        if random.happens(run.faults.deaths) {
            self.health = Health::Dead;
        } else if random.happens(run.faults.resets) {
            // It forgets all, what its end of the line holds too.
            self.card = run.fixture.card();
            self.to_card.bytes.clear();
        } else if random.happens(run.faults.stalls) {
            // Half of them for longer than the host waits.
            self.health = Health::Stalled(step + random.below(200_000) as u64);
        } else if matches!(self.health, Health::Stalled(until) if until <= step) {
            self.health = Health::Well;
        }
    }
}

/// A run.
struct Run<'a> {
    fixture: &'a Fixture,
    faults: Faults,
    cards: usize,
    /// Cards, the first ones, that never do anything.
    stopped: usize,
    seed: u32,
}

/// What came of a run.
struct Outcome {
    /// `None` if no card was left.
    pixels: Option<Vec<PixelValue>>,
    /// Of all cards.
    counters: Counters,
    bytes: LinkBytes,
    /// Cards that rendered a tile.
    working: usize,
}

impl<'a> Run<'a> {
    fn new(fixture: &'a Fixture, cards: usize, seed: u32) -> Self {
        Self { fixture, faults: Faults::default(), cards, stopped: 0, seed }
    }

    fn go(&self) -> Outcome {
        let Self { fixture, cards, stopped, seed, .. } = *self;
        let random = &mut Random(hash(seed));
        let mut stations: Vec<_> = (0..cards).map(|_| Station::new(fixture, random)).collect();
        stations[..stopped].iter_mut().for_each(|station| station.health = Health::Dead);
        let mut picture = fixture.picture();
        let mut step = 0;
        while !picture.scheduler.is_complete() && stations.iter().any(|station| !station.is_lost) {
            let station = &mut stations[random.below(cards)];
            for _ in 0..station.speed {
                station.step(self, &mut picture, step, random);
            }
            step += 1;
            assert!(step < MOST_STEPS, "seed {seed}: {cards} cards have not ended, {:?}", self.faults);
        }
        let is_complete = picture.scheduler.is_complete();
        assert!(!is_complete || picture.film.is_complete(), "seed {seed}: pixels are missing");
        let mut outcome = Outcome {
            pixels: is_complete.then(|| picture.film.pixels().to_vec()),
            counters: Counters::ZERO,
            bytes: LinkBytes::default(),
            working: 0,
        };
        for station in &stations {
            outcome.counters.add(station.session.counters());
            outcome.bytes.add(&station.session.link_bytes());
            outcome.working += usize::from(station.session.counters().eye_rays > 0);
        }
        outcome
    }
}

/// Does some work on a thread with room on its stack for a card's buffers, which are built there.
fn with_room_for_a_card(work: impl FnOnce() + Send) {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(16 << 20).spawn_scoped(scope, work);
        thread.unwrap().join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
}

#[test]
fn any_delays_end_in_the_same_picture_and_nothing_is_sent_twice() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        assert!(alone.pixels.as_ref().unwrap().iter().any(|pixel| pixel.radiance[0] > 0.0));
        let (mut shared, mut runs) = (0, 0);
        for seed in seeds() {
            let cards = 1 + seed as usize % 5;
            let delayed = Run::new(&fixture, cards, seed).go();
            assert!(delayed.pixels == alone.pixels, "seed {seed}: other pixels on {cards} cards");
            assert_eq!(delayed.counters, alone.counters, "seed {seed}: other work on {cards} cards");
            let line = delayed.bytes.line;
            assert_eq!((line.repeated, line.damaged, delayed.bytes.resets), (0, 0, 0), "seed {seed}");
            shared += u32::from(delayed.working > 1);
            runs += 1;
        }
        // Delays may leave all to one card, but not as a rule.
        assert!(shared >= runs / 3, "{shared} of {runs} runs have several cards at work");
    });
}

#[test]
fn a_card_that_never_answers_holds_up_no_other() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        for seed in 0..20 {
            let run = Run { stopped: 2, ..Run::new(&fixture, 4, seed) };
            assert!(run.go().pixels == alone.pixels, "seed {seed}");
        }
    });
}

#[test]
fn faults_end_in_the_same_picture_or_with_no_card_left() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        let mut repaired = LinkBytes::default();
        let (mut complete, mut runs) = (0, 0);
        for seed in seeds() {
            let cards = 1 + seed as usize % 8;
            let faults = Faults::of(&mut Random(hash(!seed)));
            let outcome = Run { faults, ..Run::new(&fixture, cards, seed) }.go();
            match outcome.pixels {
                Some(pixels) => {
                    assert!(Some(pixels) == alone.pixels, "seed {seed}: other pixels, {faults:?}");
                    complete += 1;
                }
                None => assert!(
                    faults.deaths + faults.stalls > 0,
                    "seed {seed}: no card is left that never stopped, {faults:?}"
                ),
            }
            repaired.add(&outcome.bytes);
            runs += 1;
        }
        println!("{complete} of {runs} runs complete; repaired: {repaired:?}");
        assert!(4 * complete > 3 * runs, "only {complete} of {runs} runs ended in the picture");
        if runs > 50 {
            assert!(repaired.line.damaged > 0 && repaired.line.repeated > 0 && repaired.resets > 0);
        }
    });
}

/// The card is reset while the host is busy with something else, before there is a job.
#[test]
fn a_card_that_is_reset_before_the_start_is_greeted_again() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = Run::new(&fixture, 1, 0).go();
        let random = &mut Random(7);
        let run = Run::new(&fixture, 1, 7);
        let mut station = Station::new(&fixture, random);
        let mut picture = fixture.picture();
        // Greets, without starting.
        station.started = true;
        let mut step = 0;
        while station.session.budget().is_none() {
            station.step(&run, &mut picture, step, random);
            step += 1;
        }
        station.card = fixture.card();
        station.started = false;
        while !picture.scheduler.is_complete() {
            station.step(&run, &mut picture, step, random);
            step += 1;
            assert!(step < MOST_STEPS && !station.is_lost, "the card is not greeted again");
        }
        assert!(Some(picture.film.pixels().to_vec()) == alone.pixels);
        assert_eq!(station.session.link_bytes().resets, 1);
    });
}
