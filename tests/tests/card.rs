//! A card answers whatever a host says with a fault or with pixels, and renders the next good tile.

use glam::Vec3;
use photoncard_driver::emitter::Emitters;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon::{PhotonMap, trace};
use photoncard_driver::render::RenderSettings;
use photoncard_firmware::card::ReferenceCard;
use photoncard_firmware::memory::Dram;
use photoncard_shared::address::Line;
use photoncard_shared::budget::REFERENCE;
use photoncard_shared::frame::{FrameReader, FrameWriter, checksum};
use photoncard_shared::image::{Header, SectionKind};
use photoncard_shared::layout::{BvhNode, ChildReference};
use photoncard_shared::message::{self, Command, Fault, FaultCode, FrameParameters, Reply, Tile};
use photoncard_tests::{camera, lambertian, room, scene, with_room_for_a_card};
use proptest::prelude::*;

const DRAM_LINES: usize = 4096;

/// A card on a wire that loses nothing.
struct Wire<'a> {
    card: Box<ReferenceCard<Dram<'a>>>,
    writer: FrameWriter,
    reader: FrameReader,
}

/// A reply, without what it borrows.
#[derive(Clone, Debug, PartialEq)]
enum Answer {
    Hello,
    ImageAccepted,
    FrameAccepted,
    Pixels(usize),
    TileDone(u32),
    Counters,
    Fault(FaultCode),
}

impl<'a> Wire<'a> {
    fn new(memory: &'a mut [Line]) -> Self {
        let card = Box::new(ReferenceCard::new(REFERENCE, Dram::new(memory)));
        Self { card, writer: FrameWriter::new(), reader: FrameReader::new() }
    }

    /// Sends a command and works until the card rests. Returns its answers.
    fn say(&mut self, command: &Command) -> Vec<Answer> {
        let frame = self.writer.write(|bytes| message::encode(command, bytes)).expect("fits").to_vec();
        self.send(&frame)
    }

    fn send(&mut self, mut bytes: &[u8]) -> Vec<Answer> {
        let mut answers = Vec::new();
        loop {
            bytes = &bytes[self.card.feed(bytes)..];
            self.card.work();
            let outgoing = self.card.outgoing().to_vec();
            self.card.sent(outgoing.len());
            let mut rest = &outgoing[..];
            while !rest.is_empty() {
                let (taken, frame) = self.reader.read(rest);
                rest = &rest[taken..];
                let Some(frame) = frame else { continue };
                answers.push(answer(message::decode(frame.expect("whole").payload).expect("a reply")));
            }
            if bytes.is_empty() && !self.card.is_busy() && self.card.outgoing().is_empty() {
                return answers;
            }
        }
    }

    fn hello(&mut self) {
        assert_eq!(self.say(&Command::Hello { protocol: 1, layout: 1 }), [Answer::Hello]);
    }

    fn load(&mut self, lines: &[Line]) -> Vec<Answer> {
        let bytes: Vec<u8> = lines.iter().flat_map(|line| line.0).collect();
        let begin = Command::BeginImage { lines: lines.len() as u32, checksum: checksum(&bytes) };
        let mut answers = self.say(&begin);
        for (index, data) in bytes.chunks(16 * 128).enumerate() {
            answers.extend(self.say(&Command::WriteLines { first: 16 * index as u32, data }));
        }
        answers.extend(self.say(&Command::EndImage));
        answers
    }
}

fn answer(reply: Reply) -> Answer {
    match reply {
        Reply::Hello { .. } => Answer::Hello,
        Reply::ImageAccepted => Answer::ImageAccepted,
        Reply::FrameAccepted => Answer::FrameAccepted,
        Reply::Pixels { data, .. } => Answer::Pixels(data.len() / message::PIXEL_BYTES),
        Reply::TileDone { tile } => Answer::TileDone(tile),
        Reply::Counters(_) => Answer::Counters,
        Reply::Fault(Fault { code, .. }) => Answer::Fault(code),
    }
}

/// A lit room with a few photons.
fn image() -> CardImage {
    let mut lamp = lambertian("lamp", 0.5);
    lamp.emission = Vec3::ONE;
    let scene =
        scene(room([0, 0, 0, 1, 0, 0]), vec![lambertian("wall", 0.5), lamp], camera(Vec3::ZERO, Vec3::NEG_Z));
    let packed = PackedScene::new(&scene, &Emitters::new(&scene)).unwrap();
    let map = PhotonMap::new(&trace(&packed, 0, 500, &|_| true).unwrap().arrivals, packed.photon_grid());
    packed.with_photons(&map).unwrap()
}

fn frame() -> FrameParameters {
    let settings =
        RenderSettings { width: 8, height: 8, neighbors: 20, gather_rays: 4, ..RenderSettings::default() };
    settings.frame(&camera(Vec3::new(0.0, 0.0, 0.5), Vec3::NEG_Z), 0.5)
}

const TILE: Tile = Tile { id: 7, x: 0, y: 0, width: 8, height: 8 };

fn renders_a_tile(wire: &mut Wire, image: &CardImage) {
    wire.hello();
    assert_eq!(wire.load(image.lines()), [Answer::ImageAccepted]);
    assert_eq!(wire.say(&Command::BeginFrame(frame())), [Answer::FrameAccepted]);
    let answers = wire.say(&Command::RenderTile(TILE));
    assert_eq!(answers, [Answer::Pixels(48), Answer::Pixels(16), Answer::TileDone(7)]);
    assert_eq!(wire.say(&Command::ReadCounters), [Answer::Counters]);
}

#[test]
fn commands_out_of_order_are_faults_and_the_card_goes_on() {
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
        assert_eq!(wire.say(&Command::BeginImage { lines: 2, checksum: 0 }), []);
        assert_eq!(wire.say(&Command::WriteLines { first: 1, data: &[0; 128] }), fault(FaultCode::LineOrder));
        assert_eq!(wire.say(&Command::WriteLines { first: 0, data: &[0; 100] }), fault(FaultCode::LineOrder));
        assert_eq!(wire.say(&Command::WriteLines { first: 0, data: &[0; 256] }), []);
        assert_eq!(wire.say(&Command::EndImage), fault(FaultCode::ImageChecksum));
        renders_a_tile(&mut wire, &image());
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
            FrameParameters { gather_rays: REFERENCE.gather_rays + 1, ..frame() },
            FrameParameters { neighbors: REFERENCE.neighbors + 1, ..frame() },
            FrameParameters { max_distance: f32::NAN, ..frame() },
        ];
        for bad in bad_frames {
            assert_eq!(wire.say(&Command::BeginFrame(bad)), [Answer::Fault(FaultCode::Parameter)], "{bad:?}");
        }
        assert_eq!(wire.say(&Command::BeginFrame(frame())), [Answer::FrameAccepted]);
        // An image that is in use is not disturbed by the end of none.
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

/// A copy of the image with another root node.
fn with_root(image: &CardImage, change: impl FnOnce(&mut BvhNode)) -> Vec<Line> {
    let mut lines = image.lines().to_vec();
    let root = Header::read(&lines[0]).unwrap().section(SectionKind::Nodes).first_line as usize;
    let mut node = BvhNode::read(&lines[root].0);
    change(&mut node);
    lines[root] = Line(node.to_bytes());
    lines
}

#[test]
fn unsound_images_end_in_faults_and_not_in_a_hang() {
    with_room_for_a_card(|| {
        let image = image();
        let everywhere = |node: &mut BvhNode, child: ChildReference| {
            node.lower = [[-9.0; 4]; 3];
            node.upper = [[9.0; 4]; 3];
            node.children = [child; 4];
        };
        let unsound = [
            (with_root(&image, |node| everywhere(node, ChildReference(0))), FaultCode::Depth),
            (
                with_root(&image, |node| {
                    everywhere(node, ChildReference::EMPTY);
                    node.children[0] = ChildReference(0);
                }),
                FaultCode::Depth,
            ),
            (with_root(&image, |node| everywhere(node, ChildReference(1_000_000))), FaultCode::Record),
            (
                with_root(&image, |node| everywhere(node, ChildReference::leaf(5_000, 3).unwrap())),
                FaultCode::Record,
            ),
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
fn a_damaged_and_a_missing_frame_are_told() {
    with_room_for_a_card(|| {
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let mut wire = Wire::new(&mut memory);
        wire.hello();
        let frame =
            wire.writer.write(|bytes| message::encode(&Command::ReadCounters, bytes)).unwrap().to_vec();
        let mut damaged = frame.clone();
        damaged[3] ^= 0x10;
        assert_eq!(wire.send(&damaged), [Answer::Fault(FaultCode::Frame)]);
        // That frame's number is missing now.
        assert_eq!(wire.say(&Command::ReadCounters), [Answer::Fault(FaultCode::Sequence)]);
        assert_eq!(wire.say(&Command::ReadCounters), [Answer::Counters]);
    });
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn no_bytes_stop_a_card(garbage in proptest::collection::vec(any::<u8>(), 0..5000)) {
        with_room_for_a_card(|| {
            let mut memory = vec![Line::ZERO; DRAM_LINES];
            let mut wire = Wire::new(&mut memory);
            wire.send(&garbage);
            wire.send(&[0]);
            wire.hello();
        });
    }

    /// An image with any line damaged renders, or ends in a fault: never in a panic or a hang.
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
