//! Whatever the delays of cards and links, a render ends, and in the same picture: real sessions, real cards, and links
//! whose every step a seed decides, in one thread.

use std::collections::VecDeque;
use std::time::Duration;

use glam::Vec3;
use photoncard_driver::emitter::Emitters;
use photoncard_driver::film::{Film, PixelValue};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::{MappedImage, map_photons};
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scene::{Camera, Material, Scene, Triangle};
use photoncard_driver::scheduler::{Scheduler, tiles};
use photoncard_driver::session::{Job, Picture, Session};
use photoncard_firmware::card::MicroCard;
use photoncard_firmware::memory::Dram;
use photoncard_firmware::sampler::hash;
use photoncard_shared::address::Line;
use photoncard_shared::budget::MICRO;
use photoncard_shared::counters::Counters;
use photoncard_shared::frame::Checksum;
use photoncard_shared::message::FrameParameters;

const SEEDS: u32 = 300;
/// Steps of a run after which it is taken for stuck: the longest here takes a fortieth.
const MOST_STEPS: u32 = 5_000_000;

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

/// What the runs have in common.
struct Fixture {
    settings: RenderSettings,
    mapped: MappedImage,
    checksum: u32,
    frame: FrameParameters,
}

impl Fixture {
    fn new() -> Self {
        let (scene, settings) = (scene(), settings());
        let packed = PackedScene::new(&scene, &Emitters::new(&scene)).unwrap();
        let mapped = map_photons(packed, &settings.photon_settings(), &|_| true).unwrap();
        let frame = settings.frame(&scene.cameras[0], mapped.max_distance);
        let mut checksum = Checksum::default();
        mapped.image.lines().iter().for_each(|line| checksum.update(&line.0));
        Self { settings, mapped, checksum: checksum.value(), frame }
    }

    fn job(&self) -> Job<'_> {
        Job { image: self.mapped.image.lines(), checksum: self.checksum, frame: &self.frame }
    }

    fn picture(&self) -> Picture {
        let RenderSettings { width, height, tile, order, .. } = self.settings;
        let window = self.settings.window();
        let film = Film::new(width, height, window).unwrap();
        Picture { scheduler: Scheduler::new(tiles(window, tile, order)), film }
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
}

/// One direction of a link: it holds few bytes.
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
    fn push(&mut self, bytes: &[u8], most: usize) -> usize {
        let count = bytes.len().min(most).min(self.capacity - self.bytes.len());
        self.bytes.extend(&bytes[..count]);
        count
    }

    /// The first `most` bytes.
    fn front(&self, most: usize) -> Vec<u8> {
        self.bytes.iter().take(most).copied().collect()
    }

    fn remove(&mut self, count: usize) {
        self.bytes.drain(..count);
    }
}

/// A card, its link and its session.
struct Station<'a> {
    card: Box<MicroCard<Dram<'a>>>,
    session: Session<'a>,
    started: bool,
    to_card: Queue,
    to_host: Queue,
    /// Bytes that move in one step at most.
    burst: usize,
    /// How often this card gets a step.
    speed: usize,
}

impl<'a> Station<'a> {
    fn new(memory: &'a mut [Line], random: &mut Random) -> Self {
        Self {
            card: Box::new(MicroCard::new(MICRO, Dram::new(memory))),
            session: Session::new(Duration::ZERO),
            started: false,
            to_card: Queue::new(random),
            to_host: Queue::new(random),
            burst: 1 << random.below(12),
            speed: 1 << random.below(6),
        }
    }

    /// One step of the host, of the card or of its chip: whichever the seed says.
    fn step(&mut self, job: Job<'a>, picture: &mut Picture, now: Duration, random: &mut Random) {
        let bytes = 1 + random.below(self.burst);
        match random.below(5) {
            0 => {
                if self.session.budget().is_some() && !self.started {
                    self.session.start(job, now);
                    self.started = true;
                }
                self.session.prepare(picture);
                let sent = self.to_card.push(self.session.outgoing(), bytes);
                self.session.sent(sent, now);
            }
            1 => {
                let received = self.to_host.front(bytes);
                self.to_host.remove(received.len());
                self.session.receive(&received, picture, now).expect("what a card answers");
            }
            2 => {
                let taken = self.card.feed(&self.to_card.front(bytes));
                self.to_card.remove(taken);
            }
            3 => {
                let sent = self.to_host.push(self.card.outgoing(), bytes);
                self.card.sent(sent);
            }
            _ => self.card.work(),
        }
    }
}

/// What came of a run.
struct Outcome {
    pixels: Vec<PixelValue>,
    /// Of all cards.
    counters: Counters,
    /// Cards that rendered a tile.
    working: usize,
}

/// Renders on some cards, the first `stopped` of which never get a step.
fn run(fixture: &Fixture, cards: usize, stopped: usize, seed: u32) -> Outcome {
    let random = &mut Random(hash(seed));
    let mut memories = vec![vec![Line::ZERO; fixture.mapped.image.lines().len()]; cards];
    let mut stations: Vec<_> = memories.iter_mut().map(|memory| Station::new(memory, random)).collect();
    let mut picture = fixture.picture();
    let mut steps = 0;
    while !stations[stopped..].iter().all(|station| station.session.is_done()) {
        let now = Duration::from_micros(steps as u64);
        let index = stopped + random.below(cards - stopped);
        let station = &mut stations[index];
        for _ in 0..station.speed {
            station.step(fixture.job(), &mut picture, now, random);
        }
        steps += 1;
        assert!(steps < MOST_STEPS, "seed {seed}: {cards} cards have not ended");
    }
    let (done, total) = picture.scheduler.progress();
    assert!(done == total && picture.film.is_complete(), "seed {seed}: {done} of {total} tiles");
    let mut counters = Counters::ZERO;
    stations.iter().for_each(|station| counters.add(station.session.counters()));
    let working = stations.iter().filter(|station| station.session.counters().eye_rays > 0).count();
    Outcome { pixels: picture.film.pixels().to_vec(), counters, working }
}

/// Does some work on a thread with room on its stack for a card's buffers, which are built there.
fn with_room_for_a_card(work: impl FnOnce() + Send) {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(16 << 20).spawn_scoped(scope, work);
        thread.unwrap().join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
}

#[test]
fn any_delays_end_in_the_same_picture() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = run(&fixture, 1, 0, 0);
        assert!(alone.pixels.iter().any(|pixel| pixel.radiance[0] > 0.0));
        let mut shared = 0;
        for seed in 1..=SEEDS {
            let cards = 1 + seed as usize % 5;
            let delayed = run(&fixture, cards, 0, seed);
            assert!(delayed.pixels == alone.pixels, "seed {seed}: other pixels on {cards} cards");
            assert_eq!(delayed.counters, alone.counters, "seed {seed}: other work on {cards} cards");
            shared += u32::from(delayed.working > 1);
        }
        // Delays may leave all to one card, but not as a rule.
        assert!(shared > SEEDS / 3, "{shared} runs of several cards at work");
    });
}

#[test]
fn a_card_that_never_answers_holds_up_no_other() {
    with_room_for_a_card(|| {
        let fixture = Fixture::new();
        let alone = run(&fixture, 1, 0, 0);
        for seed in 0..20 {
            assert!(run(&fixture, 4, 2, seed).pixels == alone.pixels, "seed {seed}");
        }
    });
}
