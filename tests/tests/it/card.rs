//! A card answers any command with pixels or a fault, and renders a valid tile afterwards.

use glam::Vec3;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon::trace;
use photoncard_driver::photon_map::{GatherParameters, store_photons};
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_firmware::kind::{Large, MICRO};
use photoncard_shared::address::Line;
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::image::{Header, SectionKind};
use photoncard_shared::layout::{BvhNode, Links, NodeBox};
use photoncard_shared::message::{
    CASES_PER_COMMAND, CHUNK_LINES, Command, FaultCode, FrameParameters, MemoryUse, OPERAND_BYTES,
    PROTOCOL_VERSION, RESULT_BYTES, Radiance, Tile,
};
use photoncard_tests::wire::{Answer, Wire};
use photoncard_tests::{camera, lambertian, room, scene, with_room_for_a_card};
use proptest::prelude::*;

const DRAM_LINES: usize = 4096;

/// Card image of a lit room with a few photons.
fn image() -> CardImage {
    let mut lamp = lambertian("lamp", 0.5);
    lamp.emission = Vec3::ONE;
    let scene =
        scene(room([0, 0, 0, 1, 0, 0]), vec![lambertian("wall", 0.5), lamp], camera(Vec3::ZERO, Vec3::NEG_Z));
    let packed = PackedScene::new(&scene).unwrap();
    let photons = trace(&packed, 0, 500, &|_| true).unwrap().photons;
    store_photons(packed, photons, 20).unwrap()
}

fn frame() -> FrameParameters {
    let settings = RenderSettings {
        picture: Picture { width: 8, height: 8, ..Picture::default() },
        photons: PhotonMaps { neighbors: 20, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 8, ..Integrator::default() },
        ..RenderSettings::default()
    };
    settings.frame(&camera(Vec3::new(0.0, 0.0, 0.5), Vec3::NEG_Z), &GatherParameters::within(0.5))
}

const TILE: Tile = Tile { id: 7, x: 0, y: 0, width: 8, height: 8 };

/// Answers of the micro chip to a tile of 64 pixels without layers, 16 pixels a reply.
fn tile_of_64_pixels(id: u32) -> [Answer; 5] {
    let pixels = || Answer::Pixels(16);
    [pixels(), pixels(), pixels(), pixels(), Answer::TileDone(id)]
}

fn renders_a_tile(wire: &mut Wire, image: &CardImage) {
    wire.hello();
    assert_eq!(wire.load(image.lines()), [Answer::ImageAccepted]);
    assert_eq!(wire.say(&Command::BeginFrame(frame())), [Answer::FrameAccepted]);
    let answers = wire.say(&Command::RenderTile(TILE));
    assert_eq!(answers, tile_of_64_pixels(7));
}

#[test]
fn commands_out_of_order_are_faults_and_the_card_continues() {
    with_room_for_a_card(|| {
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let mut wire = Wire::new(&mut memory);
        let fault = |code| vec![Answer::Fault(code)];
        wire.hello();
        assert_eq!(wire.say(&Command::RenderTile(TILE)), fault(FaultCode::Order));
        assert_eq!(wire.say(&Command::BeginFrame(frame())), fault(FaultCode::Order));
        assert_eq!(wire.say(&Command::EndImage), fault(FaultCode::Order));
        assert_eq!(wire.say(&Command::WriteLines { first: 0, data: &[0; 128] }), fault(FaultCode::Order));
        let too_large = Command::BeginImage { lines: DRAM_LINES as u32 + 1, checksum: 0 };
        assert_eq!(wire.say(&too_large), fault(FaultCode::ImageTooLarge));
        assert_eq!(wire.say(&Command::ReadChecksums { first: 0, count: 1 }), fault(FaultCode::Chunks));
        assert_eq!(wire.say(&Command::BeginImage { lines: 2, checksum: 0 }), []);
        assert_eq!(wire.say(&Command::WriteLines { first: 1, data: &[0; 256] }), fault(FaultCode::Lines));
        assert_eq!(
            wire.say(&Command::WriteLines { first: u32::MAX, data: &[0; 128] }),
            fault(FaultCode::Lines)
        );
        assert_eq!(wire.say(&Command::WriteLines { first: 0, data: &[0; 100] }), fault(FaultCode::Lines));
        assert_eq!(wire.say(&Command::WriteLines { first: 0, data: &[0; 256] }), []);
        assert_eq!(wire.say(&Command::EndImage), fault(FaultCode::ImageChecksum));
        assert_eq!(wire.say_bytes(&[0xff; 9]), fault(FaultCode::Message));
        renders_a_tile(&mut wire, &image());
    });
}

/// A tile's gathers wait in the queue until another tile or a flush arrives.
#[test]
fn a_card_with_room_for_another_tile_in_flight_waits_for_it_or_for_a_flush() {
    with_room_for_a_card(|| {
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let mut wire = Wire::<Large>::of_kind(&mut memory);
        wire.hello();
        wire.load(image().lines());
        let done = tile_of_64_pixels;
        let begin = |in_flight| Command::BeginFrame(FrameParameters { in_flight, ..frame() });
        let tile = |id| Command::RenderTile(Tile { id, ..TILE });
        assert_eq!(wire.say(&begin(0)), [Answer::Fault(FaultCode::Parameter)]);
        assert_eq!(wire.say(&begin(1)), [Answer::FrameAccepted]);
        assert_eq!(wire.say(&tile(1)), done(1), "there is no room for another");
        assert_eq!(wire.say(&begin(2)), [Answer::FrameAccepted]);
        assert_eq!(wire.say(&tile(2)), []);
        assert!(!wire.card.is_busy());
        assert_eq!(wire.say(&Command::Flush), done(2));
        assert_eq!(wire.say(&Command::Flush), []);
        // Another frame drops the tile in flight.
        assert_eq!(wire.say(&tile(2)), []);
        assert_eq!(wire.say(&begin(2)), [Answer::FrameAccepted]);
        assert_eq!(wire.say(&Command::Flush), []);
        assert!(!wire.card.is_busy());
        // With the second tile, the maximum number of tiles is in flight: both are completed without a third.
        assert_eq!(wire.say(&tile(3)), []);
        assert_eq!(wire.say(&tile(4)), [done(3), done(4)].concat());
        assert_eq!(wire.say(&tile(5)), []);
        // A hello drops the tile in flight: the next command need not wait for it.
        wire.hello();
        assert!(!wire.card.is_busy());
        let checksums = wire.say(&Command::ReadChecksums { first: 0, count: 1 });
        assert!(matches!(checksums[..], [Answer::Checksums(_)]), "{checksums:?}");
        assert_eq!(wire.say(&Command::Flush), []);
        assert!(!wire.card.is_busy());
        wire.load(image().lines());
        wire.say(&begin(2));
        assert_eq!(wire.say_all(&[tile(6), Command::Flush]), done(6));
    });
}

/// A pixel with layers takes four sums of the chip's buffer. The micro chip has room for 64 such pixels; a
/// reply has room for 8.
#[test]
fn a_tile_with_layers_has_a_fourth_of_the_pixels() {
    with_room_for_a_card(|| {
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let mut wire = Wire::new(&mut memory);
        wire.hello();
        wire.load(image().lines());
        let plain = FrameParameters { width: 16, ..frame() };
        let wide = Tile { width: 9, ..TILE };
        for (layers, fits) in [(true, false), (false, true), (true, false)] {
            let frame = FrameParameters { layers, ..plain };
            assert_eq!(wire.say(&Command::BeginFrame(frame)), [Answer::FrameAccepted]);
            let answers = wire.say(&Command::RenderTile(wide));
            if fits {
                assert_eq!(answers.last(), Some(&Answer::TileDone(7)));
            } else {
                assert_eq!(answers, [Answer::Fault(FaultCode::Tile)]);
            }
        }
        let mut expected = vec![Answer::Pixels(8); 8];
        expected.push(Answer::TileDone(7));
        assert_eq!(wire.say(&Command::RenderTile(TILE)), expected);
    });
}

#[test]
fn frames_and_tiles_outside_the_budget_are_faults() {
    with_room_for_a_card(|| {
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let mut wire = Wire::new(&mut memory);
        wire.hello();
        wire.load(image().lines());
        let bad_frames = [
            FrameParameters { width: 0, ..frame() },
            FrameParameters { samples: 0, ..frame() },
            FrameParameters { gather_rays: MICRO.gather_rays + 1, ..frame() },
            FrameParameters { neighbors: MICRO.neighbors + 1, ..frame() },
            FrameParameters { max_distance: f32::NAN, ..frame() },
            // The card image has photons, but no irradiance points.
            FrameParameters { radiance: Radiance::Precomputed, ..frame() },
            FrameParameters { identities: true, ..frame() },
        ];
        for bad in bad_frames {
            assert_eq!(wire.say(&Command::BeginFrame(bad)), [Answer::Fault(FaultCode::Parameter)], "{bad:?}");
        }
        assert_eq!(wire.say(&Command::BeginFrame(frame())), [Answer::FrameAccepted]);
        // An `EndImage` without a `BeginImage` leaves the loaded image in use.
        assert_eq!(wire.say(&Command::EndImage), [Answer::Fault(FaultCode::Order)]);
        assert_eq!(wire.say(&Command::RenderTile(TILE)).last(), Some(&Answer::TileDone(7)));
        let bad_tiles = [
            Tile { width: 0, ..TILE },
            Tile { width: 9, ..TILE },
            Tile { x: u32::MAX, ..TILE },
            Tile { y: 1, ..TILE },
        ];
        for bad in bad_tiles {
            assert_eq!(wire.say(&Command::RenderTile(bad)), [Answer::Fault(FaultCode::Tile)], "{bad:?}");
        }
        renders_a_tile(&mut wire, &image());
    });
}

/// Lines of the image with another root node: `children` children, whose boxes contain the scene.
fn with_root(image: &CardImage, children: usize, links: Links) -> Vec<Line> {
    let mut lines = image.lines().to_vec();
    let root =
        Header::read(lines.first_chunk().unwrap()).unwrap().section(SectionKind::Nodes).first_line as usize;
    let everywhere = NodeBox { lower: [-9.0; 3], upper: [9.0; 3] };
    lines[root] = Line(BvhNode::encode(&vec![everywhere; children], links).unwrap());
    lines
}

#[test]
fn unsound_images_end_in_faults_and_not_in_a_hang() {
    with_room_for_a_card(|| {
        let image = image();
        let nodes = |first_node: u32| Links { leaves: 0, first_leaf: 0, first_node };
        let unsound = [
            (with_root(&image, 1, nodes(0)), FaultCode::Depth),
            (with_root(&image, 16, nodes(1_000_000)), FaultCode::Record),
            (with_root(&image, 2, nodes(u32::MAX)), FaultCode::Depth),
            (with_root(&image, 3, Links { leaves: 3, first_leaf: 5_000, first_node: 0 }), FaultCode::Record),
        ];
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let mut wire = Wire::new(&mut memory);
        for (lines, code) in unsound {
            wire.hello();
            assert_eq!(wire.load(&lines), [Answer::ImageAccepted]);
            assert_eq!(wire.say(&Command::BeginFrame(frame())), [Answer::FrameAccepted]);
            assert_eq!(wire.say(&Command::RenderTile(TILE)), [Answer::Fault(code)]);
        }
        renders_a_tile(&mut wire, &image);
    });
}

#[test]
fn a_card_reports_the_lines_of_an_image_and_keeps_them_over_sessions() {
    with_room_for_a_card(|| {
        let image = image();
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let mut wire = Wire::new(&mut memory);
        assert_eq!(wire.hello(), 0);
        wire.load(image.lines());
        let written = wire.hello();
        assert_eq!(written as usize, image.lines().len());
        assert_eq!(wire.say(&Command::BeginFrame(frame())), [Answer::Fault(FaultCode::Order)]);
        let chunks = written.div_ceil(CHUNK_LINES);
        let chunks_of_image = image.lines().chunks(CHUNK_LINES as usize);
        let expected = chunks_of_image.flat_map(|chunk| image_checksum(chunk).to_le_bytes());
        let answers = wire.say(&Command::ReadChecksums { first: 0, count: chunks });
        assert_eq!(answers, [Answer::Checksums(expected.collect())]);
        for (first, count) in [(0, 0), (0, chunks + 1), (chunks, 1), (u32::MAX, 2)] {
            let answers = wire.say(&Command::ReadChecksums { first, count });
            assert_eq!(answers, [Answer::Fault(FaultCode::Chunks)], "{first} {count}");
        }
        // All lines of the image are in the memory already.
        let checksum = image_checksum(image.lines());
        assert_eq!(wire.say(&Command::BeginImage { lines: written, checksum }), []);
        assert_eq!(wire.say(&Command::EndImage), [Answer::ImageAccepted]);
        assert_eq!(wire.say(&Command::BeginFrame(frame())), [Answer::FrameAccepted]);
        assert_eq!(wire.say(&Command::RenderTile(TILE)).last(), Some(&Answer::TileDone(7)));
    });
}

#[test]
fn a_card_reports_the_memory_use_that_its_board_measures() {
    with_room_for_a_card(|| {
        let hello = Command::Hello { protocol: PROTOCOL_VERSION, layout: 1 };
        let mut memory = vec![Line::ZERO; 1];
        let mut wire = Wire::new(&mut memory);
        wire.hello();
        assert_eq!(wire.say(&hello), [Answer::Hello(0, None)]);
        const MEASURED: MemoryUse = MemoryUse { static_bytes: 100, stack_bytes: 20, stack_used: 10 };
        wire.card.measure_memory_by(|| MEASURED);
        assert_eq!(wire.say(&hello), [Answer::Hello(0, Some(MEASURED))]);
    });
}

/// A memory test overwrites the scene, even during a tile; the next image is loaded from its first line.
#[test]
fn a_memory_test_drops_the_scene_and_the_next_load_works() {
    with_room_for_a_card(|| {
        let image = image();
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let mut wire = Wire::new(&mut memory);
        renders_a_tile(&mut wire, &image);
        let answers = wire.say_all(&[Command::RenderTile(TILE), Command::TestMemory]);
        let sound = |answer: &Answer| matches!(answer, Answer::MemoryTested(test) if test.wrong.count == 0);
        assert!(answers.iter().all(sound), "{answers:?}");
        // In so small a memory each of the five patterns has two reports: at the end of writing and of
        // reading.
        assert_eq!(answers.len(), 10);
        assert_eq!(wire.say(&Command::RenderTile(TILE)), [Answer::Fault(FaultCode::Order)]);
        assert_eq!(wire.say(&Command::BeginFrame(frame())), [Answer::Fault(FaultCode::Order)]);
        let read = Command::ReadChecksums { first: 0, count: 1 };
        assert_eq!(wire.say(&read), [Answer::Fault(FaultCode::Chunks)]);
        assert_eq!(wire.hello(), 0, "no line holds what was written");
        renders_a_tile(&mut wire, &image);
        // Another command ends the memory test.
        let begin = Command::BeginImage { lines: 2, checksum: 0 };
        assert_eq!(wire.say_all(&[Command::TestMemory, begin, Command::EndImage]).len(), 1);
        renders_a_tile(&mut wire, &image);
    });
}

#[test]
fn a_card_computes_only_without_other_work() {
    with_room_for_a_card(|| {
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let mut wire = Wire::new(&mut memory);
        renders_a_tile(&mut wire, &image());
        let cases = |count: usize| vec![0x3f; OPERAND_BYTES * count];
        for count in [1, CASES_PER_COMMAND] {
            let answers = wire.say(&Command::Compute { operands: &cases(count) });
            assert_eq!(answers, [Answer::Computed(RESULT_BYTES * count)]);
        }
        for bytes in [vec![], vec![0; 11], vec![0; 13], cases(CASES_PER_COMMAND + 1)] {
            let answers = wire.say(&Command::Compute { operands: &bytes });
            assert_eq!(answers, [Answer::Fault(FaultCode::Operands)], "{} bytes", bytes.len());
        }
        // Results are computed in the buffer of pixels, and are refused while a tile is rendered.
        let answers = wire.say_all(&[Command::RenderTile(TILE), Command::Compute { operands: &cases(1) }]);
        assert_eq!(answers.first(), Some(&Answer::Fault(FaultCode::Order)));
        assert_eq!(answers.last(), Some(&Answer::TileDone(7)), "the scene is still there");
    });
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Messages of arbitrary bytes arrive in valid frames.
    #[test]
    fn no_messages_stop_a_card(
        messages in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..200), 0..40),
    ) {
        with_room_for_a_card(|| {
            let mut memory = vec![Line::ZERO; DRAM_LINES];
            let mut wire = Wire::new(&mut memory);
            wire.hello();
            messages.iter().for_each(|message| drop(wire.say_bytes(message)));
            wire.hello();
        });
    }

    #[test]
    fn no_bytes_stop_a_card(garbage in proptest::collection::vec(any::<u8>(), 0..5000)) {
        with_room_for_a_card(|| {
            let mut memory = vec![Line::ZERO; DRAM_LINES];
            let mut wire = Wire::new(&mut memory);
            wire.card.feed(&garbage);
            wire.card.feed(&[0]);
            wire.work();
            wire.hello();
        });
    }

    /// With a damaged line in its image a card renders or reports a fault, without a panic or an endless
    /// loop.
    #[test]
    fn no_damaged_image_stops_a_card(
        line in any::<prop::sample::Index>(),
        place in 0_usize..128,
        bytes in proptest::collection::vec(any::<u8>(), 1..16),
    ) {
        let mut lines = image().lines().to_vec();
        let line = line.index(lines.len());
        let damaged = &mut lines[line].0;
        for (target, byte) in damaged[place..].iter_mut().zip(bytes) {
            *target = byte;
        }
        with_room_for_a_card(|| {
            let mut memory = vec![Line::ZERO; DRAM_LINES];
            let mut wire = Wire::new(&mut memory);
            wire.hello();
            if wire.load(&lines) == [Answer::ImageAccepted] {
                wire.say(&Command::BeginFrame(frame()));
                let answers = wire.say(&Command::RenderTile(TILE));
                assert!(matches!(answers.last(), Some(Answer::TileDone(7) | Answer::Fault(_))), "{answers:?}");
            }
            wire.hello();
        });
    }
}
