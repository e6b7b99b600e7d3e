//! Gathers that wait in card memory (`--order buckets`): no pixel and no count of work depends on the room
//! for them, and all bytes that they take are counted.

use std::collections::BTreeMap;

use photoncard_driver::emulator::EmulatedKind;
use photoncard_driver::emulator::direct::{RenderedTile, render_tiles};
use photoncard_driver::layer::Layers;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon_map::{MappedImage, map_photons};
use photoncard_driver::render::{CardAddress, RenderError, RenderSettings, Rendering, Unobserved, render};
use photoncard_driver::scheduler::{GatherOrder, tiles};
use photoncard_firmware::chip::{Chip, Progress, least_waiting_lines};
use photoncard_firmware::fixed_point::ColourSum;
use photoncard_firmware::kind::ChipKind;
use photoncard_firmware::memory::{Counted, Dram};
use photoncard_firmware::render::RenderJob;
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::address::{LINE_BYTES, Line, Structure};
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Command, Drain, FaultCode, FrameParameters, Radiance, Tile};
use photoncard_tests::everything::everything;
use photoncard_tests::fuzz::image::{DRAM_LINES, frame as fuzzed_frame, images, is_rendered};
use photoncard_tests::wire::{Answer, Wire};
use proptest::prelude::*;

/// Card image, and a picture's frame.
struct World {
    scene: SceneImage,
    image: Vec<Line>,
    frame: FrameParameters,
    settings: RenderSettings,
}

/// Picture that a chip has rendered: pixels in steps of sums, work, and traffic.
struct Picture {
    pixels: Vec<[i64; 3]>,
    work: Counters,
    waiting: Traffic,
}

/// Bytes of what waits.
#[derive(Debug, PartialEq)]
struct Traffic {
    read: u64,
    written: u64,
}

impl World {
    fn new(change: impl FnOnce(&mut RenderSettings)) -> Self {
        Self::with_light_groups(&[], change)
    }

    /// World with these light groups.
    fn with_light_groups(groups: &[&str], change: impl FnOnce(&mut RenderSettings)) -> Self {
        let mut scene = everything();
        let groups: Vec<String> = groups.iter().map(|&group| group.to_owned()).collect();
        scene.set_light_groups(&groups).expect("there are these lights");
        let settings = RenderSettings::default().with(|s| {
            (s.picture.width, s.picture.height) = (18, 14);
            (s.photons.count, s.photons.neighbors) = (2000, 20);
            (s.photons.caustic_photons, s.photons.caustic_neighbors) = (Some(500), 20);
            (s.integrator.gather_rays, s.integrator.shadow_rays) = (8, 1);
            (s.integrator.samples, s.integrator.irradiance_error) = (1, None);
            s.picture.light_groups = scene.light_groups.names().to_vec();
            change(s);
        });
        let pack = if settings.picture.layers == Layers::all() {
            PackedScene::with_identities
        } else {
            PackedScene::new
        };
        let packed = pack(&scene).expect("packs");
        let mapped = map_photons(packed, &settings.photon_settings(&scene), &|_| true).expect("maps");
        let MappedImage { image, gathers, .. } = mapped;
        let camera = settings.camera(&scene).expect("a camera");
        let frame = settings.frame(&camera, &gathers);
        Self { scene: image.view().0, image: image.lines().to_vec(), frame, settings }
    }

    fn tiles(&self, side: u32) -> Vec<Tile> {
        tiles(self.settings.window(), side, GatherOrder::Sort)
    }

    /// Renders all tiles on a chip whose memory has `room` lines after the image.
    fn render<K: ChipKind>(
        &self,
        chip: &mut Chip<K>,
        frame: &FrameParameters,
        (side, room): (u32, usize),
    ) -> Picture {
        let mut lines = self.image.clone();
        lines.resize(self.image.len() + room, Line([0xa5; LINE_BYTES]));
        let mut memory = Counted::new(Dram::new(&mut lines));
        let first = self.image.len() as u32;
        chip.begin_frame(frame, first..first + room as u32);
        let mut work = Counters::ZERO;
        let mut parts: Vec<(u32, RenderedTile)> = Vec::new();
        let tiles = self.tiles(side);
        let job = &mut RenderJob { scene: &self.scene, memory: &mut memory, frame, outlet: None };
        render_tiles(chip, job, &tiles, |tile, rendered| {
            work.add(&rendered.counters);
            parts.push((tile.id, rendered));
            true
        })
        .expect("sound");
        assert_eq!(parts.len(), tiles.len());
        let pixels = tiles_of_film(&tiles, &parts, frame);
        let read = memory.traffic().sum(|_, structure| structure == Structure::Waiting).bytes;
        let written = memory.traffic().written_bytes(|structure| structure == Structure::Waiting);
        assert!(lines[..self.image.len()] == self.image, "the image is written");
        Picture { pixels, work, waiting: Traffic { read, written } }
    }
}

impl World {
    /// Returns whether a card whose memory has `room` lines after the image accepts a frame.
    fn is_accepted_by_card(&self, frame: &FrameParameters, room: usize) -> bool {
        let mut memory = vec![Line::ZERO; self.image.len() + room];
        let mut wire = Wire::new(&mut memory);
        wire.hello();
        assert_eq!(wire.load(&self.image).last(), Some(&Answer::ImageAccepted));
        match wire.say(&Command::BeginFrame(*frame))[..] {
            [Answer::FrameAccepted] => true,
            [Answer::Fault(FaultCode::Parameter)] => false,
            ref other => panic!("{other:?}"),
        }
    }

    /// Renders the picture on an emulated card whose memory has `room` lines after the image.
    fn render_on_card(&self, room: usize) -> Result<Rendering, RenderError> {
        let bytes = ((self.image.len() + room) * LINE_BYTES) as u64;
        let card = CardAddress::emulated(EmulatedKind::Micro).with_memory(bytes);
        let settings = self.settings.clone().with(|s| s.cards.addresses = vec![card]);
        render(&everything(), &settings, &Unobserved)
    }
}

/// Sums of all pixels, row by row, from those of tiles.
fn tiles_of_film(tiles: &[Tile], parts: &[(u32, RenderedTile)], frame: &FrameParameters) -> Vec<[i64; 3]> {
    let count = frame.form().sums_of_light() as usize;
    let mut pixels = BTreeMap::new();
    for (id, part) in parts {
        let tile = tiles.iter().find(|tile| tile.id == *id).expect("a tile");
        for (index, sums) in (0..).zip(part.sums.chunks(count)) {
            let place = (tile.y + index / tile.width, tile.x + index % tile.width);
            pixels.insert(place, sums.iter().map(ColourSum::bits).collect::<Vec<_>>());
        }
    }
    pixels.into_values().flatten().collect()
}

/// Counters without those of the queue.
fn work_of(counters: &Counters) -> Counters {
    Counters { drains: 0, most_waiting: 0, cycles: 0, ..*counters }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    /// Orders, rooms, numbers of blocks, queues and tiles of chips, with and without irradiance records,
    /// layers, several paths and several samples.
    #[test]
    fn pixels_and_work_do_not_depend_on_the_room_for_gathers(
        room in prop_oneof![Just(0_usize), 1..400_usize, 400..4000_usize, Just(60_000)],
        waiting_blocks in 1..9_u32,
        gather_queue in prop_oneof![8..60_u32, 60..3000_u32],
        limit in prop_oneof![Just(u32::MAX), 1..40_u32],
        side in 3..6_u32,
        irradiance_error in prop::sample::select(&[None, Some(0.1), Some(1e-4)][..]),
        has_layers: bool,
        is_adaptive: bool,
        groups in 0..3_usize,
    ) {
        let world = World::with_light_groups(&["key=lamp", "sky=environment"][..groups], |s| {
            s.integrator.irradiance_error = irradiance_error;
            s.picture.layers = if has_layers { Layers::all() } else { Layers::default() };
            if is_adaptive {
                (s.integrator.samples, s.integrator.adaptive_threshold) = (5, Some(0.5));
            }
        });
        let micro = EmulatedKind::Micro.emulated();
        let expected = world.render(&mut micro.chip(), &world.frame, (5, 0));
        let budget = Budget { waiting_blocks, gather_queue, ..*micro.budget() };
        let frame = FrameParameters { drain: Drain::Buckets, queue: limit, ..world.frame };
        let found = world.render(&mut micro.with_budget(budget).chip(), &frame, (side, room));
        prop_assert!(found.pixels == expected.pixels, "the picture differs");
        let immediate = FrameParameters { drain: Drain::Immediate, ..frame };
        let immediate = world.render(&mut micro.chip(), &immediate, (side, 0));
        prop_assert_eq!(work_of(&found.work), work_of(&immediate.work));
        prop_assert!(room < 60_000 || found.waiting.read > 0, "no gather has waited");
    }
}

/// A gather takes a fifth of a line, or an eighth without a lobe, and its result an eighth.
#[test]
fn each_line_of_gathers_and_results_is_written_and_read_once() {
    let world = World::new(|s| s.integrator.gather_rays = 64);
    let frame = FrameParameters { drain: Drain::Buckets, ..world.frame };
    let mut chip = EmulatedKind::Large.emulated().chip();
    let picture = world.render(&mut chip, &frame, (64, 200_000));
    let Counters { gathers: searches, tables, most_waiting: gathers, .. } = picture.work;
    // A gather whose first search finds too few photons searches again.
    assert!((5000..=searches - tables).contains(&gathers), "{gathers} of {searches}");
    let Traffic { read, written } = picture.waiting;
    assert_eq!(read, written);
    let lines = |of_gathers: u64| gathers.div_ceil(of_gathers) + gathers.div_ceil(8);
    let [least, most] = [8, 5].map(|of_gathers| lines(of_gathers) * LINE_BYTES as u64);
    assert!((least..most).contains(&read), "{read}, {least} to {most}");
}

/// From the least memory on which a card accepts the frame, more and more blocks wait together: the picture
/// stays, and more gathers are done in a round.
#[test]
fn as_many_blocks_wait_as_have_room() {
    for (irradiance_error, rays) in [(None, 64), (Some(0.1), 64)] {
        let world = World::new(|s| {
            (s.integrator.irradiance_error, s.integrator.gather_rays) = (irradiance_error, rays);
        });
        let frame = FrameParameters { drain: Drain::Buckets, ..world.frame };
        let micro = EmulatedKind::Micro.emulated();
        let expected = world.render(&mut micro.chip(), &world.frame, (4, 0));
        let least = least_waiting_lines(&frame, micro.budget()) as usize;
        let pictures = [1, 2, 4, 32].map(|times| world.render(&mut micro.chip(), &frame, (4, times * least)));
        for picture in &pictures {
            assert!(picture.pixels == expected.pixels);
            assert!(picture.waiting.read > 0, "no gather has waited");
        }
        let waiting = pictures.map(|picture| picture.work.most_waiting);
        assert!(waiting.is_sorted() && waiting[0] < waiting[3], "{waiting:?}");
    }
}

/// The figures of `docs/memory.md`.
#[test]
fn the_reference_chip_needs_a_megabyte_for_gathers_that_wait_and_more_with_records() {
    let megabytes = |irradiance_error| {
        let world = World::new(|s| s.integrator.irradiance_error = irradiance_error);
        let frame = FrameParameters { drain: Drain::Buckets, ..world.frame };
        let lines = least_waiting_lines(&frame, EmulatedKind::Reference.emulated().budget());
        (lines * LINE_BYTES as u64 + 50_000) / 100_000
    };
    assert_eq!([megabytes(None), megabytes(Some(0.1))], [8, 19]);
}

/// The card refuses the frame, and the host says what helps.
#[test]
fn a_frame_whose_gathers_have_no_room_is_refused() {
    for (irradiance_error, keep_records) in [(None, false), (Some(0.1), false), (Some(0.1), true)] {
        let world = World::new(|s| {
            s.integrator.irradiance_error = irradiance_error;
            (s.schedule.order, s.schedule.keep_records) = (GatherOrder::Buckets, keep_records);
        });
        let needed = least_waiting_lines(&world.frame, EmulatedKind::Micro.emulated().budget()) as usize;
        for (room, is_enough) in [(needed - 1, false), (needed, true)] {
            assert_eq!(world.is_accepted_by_card(&world.frame, room), is_enough);
            let in_queue = FrameParameters { drain: Drain::Sort, ..world.frame };
            let without_gathers = FrameParameters { gather_rays: 0, ..world.frame };
            assert!(world.is_accepted_by_card(&in_queue, room));
            assert!(world.is_accepted_by_card(&without_gathers, room));
            match world.render_on_card(room) {
                Ok(_) => assert!(is_enough),
                Err(RenderError::Setting { field, reason, remedy, .. }) => {
                    assert!(!is_enough && field == "schedule.order", "{field}: {reason}");
                    let bytes = [needed, room].map(|lines| (lines * LINE_BYTES).to_string());
                    assert!(bytes.iter().all(|bytes| reason.contains(bytes)), "{reason}");
                    assert!(remedy.contains("sort") && remedy.contains("with_memory"), "{remedy}");
                }
                Err(error) => panic!("{error}"),
            }
        }
    }
}

#[test]
fn tiles_that_are_dropped_leave_no_gather_behind() {
    /// Lines in which all gathers have room.
    const ROOM: usize = 20_000;
    let world = World::new(|s| s.integrator.irradiance_error = Some(0.1));
    let frame = FrameParameters { drain: Drain::Buckets, ..world.frame };
    let kind = EmulatedKind::Micro.emulated();
    let expected = world.render(&mut kind.chip(), &frame, (5, ROOM));
    assert!(expected.work.drains > 1 && expected.waiting.read > 0, "no gather has waited");
    let mut chip = kind.chip();
    let mut lines = world.image.clone();
    lines.resize(world.image.len() + ROOM, Line::ZERO);
    let first = world.image.len() as u32;
    for steps in [1, 50, 200, 1000, 3000, 10_000] {
        let mut memory = Dram::new(&mut lines);
        chip.begin_frame(&frame, first..first + ROOM as u32);
        let tiles = world.tiles(5);
        let mut next = tiles.iter();
        let job = &mut RenderJob { scene: &world.scene, memory: &mut memory, frame: &frame, outlet: None };
        for _ in 0..steps {
            if let Progress::Idle = chip.step(job).expect("sound") {
                match next.next() {
                    Some(tile) => assert!(chip.begin(job.memory, &frame, *tile)),
                    None => drop(chip.flush(&frame)),
                }
            }
        }
        let found = world.render(&mut chip, &frame, (5, ROOM));
        assert!(found.pixels == expected.pixels && found.work == expected.work, "after {steps} steps");
        assert_eq!(found.waiting, expected.waiting);
    }
}

/// Bits of all lines after the image are inverted at random while gathers and blocks wait: the frame ends, in
/// any picture or a fault.
#[test]
fn damage_of_what_waits_ends_in_a_picture_or_a_fault() {
    const ROOM: usize = 20_000;
    let world = World::new(|s| s.integrator.irradiance_error = Some(0.1));
    let frame = FrameParameters { drain: Drain::Buckets, ..world.frame };
    let first = world.image.len() as u32;
    let mut faults = 0;
    for seed in 0..60_u32 {
        let mut lines = world.image.clone();
        lines.resize(world.image.len() + ROOM, Line::ZERO);
        let mut chip = EmulatedKind::Micro.emulated().chip();
        chip.begin_frame(&frame, first..first + ROOM as u32);
        let tiles = world.tiles(5);
        let mut next = tiles.iter();
        let mut steps = 0..200_000_u32;
        let end = loop {
            let step = steps.next().expect("the frame ends");
            if step % (50 + seed) == 0 {
                let line = hash(seed ^ hash(step)) as usize % 4000;
                lines[world.image.len() + line].0[step as usize % LINE_BYTES] ^= 1 << (seed % 8);
            }
            let mut memory = Dram::new(&mut lines);
            let job =
                &mut RenderJob { scene: &world.scene, memory: &mut memory, frame: &frame, outlet: None };
            match chip.step(job) {
                Err(fault) => break Some(fault),
                Ok(Progress::Idle) => match next.next() {
                    Some(tile) => assert!(chip.begin(job.memory, &frame, *tile)),
                    None if chip.flush(&frame) => {}
                    None => break None,
                },
                Ok(_) => {}
            }
        };
        faults += u32::from(end.is_some());
    }
    assert!(faults > 0, "no damage was found");
}

/// Frames of fuzzed images, of which a card has memory for all gathers.
#[test]
fn gathers_of_fuzzed_frames_wait() {
    let mut frames = 0;
    for image in &images() {
        for choice in (0..=u8::MAX).filter(|&choice| fuzzed_frame(choice).drain == Drain::Buckets) {
            let mut memory = vec![Line::ZERO; DRAM_LINES];
            let is_done = is_rendered(choice, image.lines(), &mut memory);
            let lacks_points = fuzzed_frame(choice).radiance == Radiance::Precomputed;
            assert!(is_done || lacks_points, "{choice:#b}");
            let mut beyond = memory[image.lines().len()..].iter();
            assert!(!is_done || beyond.any(|line| *line != Line::ZERO), "{choice:#b}: no gather has waited");
            frames += u32::from(is_done);
        }
    }
    assert!(frames > 100, "{frames}");
}
