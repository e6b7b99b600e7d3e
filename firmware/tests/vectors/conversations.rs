//! Conversations with a card: what it answers in each state, and why it refuses an image or a frame.

use photoncard_firmware::card::Card;
use photoncard_firmware::kind::Micro;
use photoncard_firmware::memory::{CardMemory, Dram, Resident};
use photoncard_shared::address::Line;
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::image::{HEADER_LINES, Header, Lights, Section};
use photoncard_shared::layout::PhotonGrid;
use photoncard_shared::message::*;
use photoncard_shared::transport::Transport;

use crate::json::{hex, lines, list, object, text};
use crate::messages::{FRAME, HELLO, encoded, no_commands};

/// Lines of the card's memory.
const MEMORY: usize = 64;

pub(crate) fn vectors() -> Vec<(&'static str, String)> {
    vec![
        ("images", lines(images().into_iter().map(|image| image.vector()))),
        ("card", lines(states())),
        ("resident_card", lines(resident())),
    ]
}

/// A card image, and the fault with which a card answers to its end.
struct Image {
    what: &'static str,
    lines: Vec<Line>,
    fault: Option<(FaultCode, u32)>,
}

impl Image {
    fn bytes(&self) -> Vec<u8> {
        self.lines.iter().flat_map(|line| line.0).collect()
    }

    fn answer(&self) -> Vec<u8> {
        let fault = |(code, detail)| encoded(&Reply::Fault(Fault { code, detail }));
        self.fault.map_or_else(|| encoded(&Reply::ImageAccepted), fault)
    }

    fn vector(&self) -> String {
        object(&[
            ("what", text(self.what)),
            ("bytes", hex(&self.bytes())),
            ("checksum", text(&format!("{:016x}", image_checksum(&self.lines)))),
            ("answer", hex(&self.answer())),
        ])
    }
}

const HEADER: Header = Header { lines: HEADER_LINES as u32, reach: 1.0, ..Header::EMPTY };

/// An image of an empty scene that a card renders: behind the header, a root of no children.
fn empty_scene() -> Image {
    let mut header = Header { lines: 3, ..HEADER };
    header.sections[0] = Section { first_line: 2, records: 1 };
    let lines = [&header.to_lines()[..], &[Line::ZERO]].concat();
    Image { what: "an empty scene: the header, and a root of no children", lines, fault: None }
}

/// Images of the smallest size: one that a card accepts, and others that it refuses.
fn images() -> Vec<Image> {
    let image = |what, header: Header, fault| Image { what, lines: header.to_lines().to_vec(), fault };
    let unsound = |what, header| image(what, header, Some((FaultCode::ImageHeader, 0)));
    let mut magic = unsound("another first byte", HEADER);
    magic.lines[0].0[0] = b'p';
    let mut version = image("layout version 15", HEADER, Some((FaultCode::ImageHeader, 15)));
    version.lines[0].0[8] = 15;
    let mut section = HEADER;
    section.sections[4] = Section { first_line: 2, records: 1 };
    let mut empty_section = HEADER;
    empty_section.sections[18] = Section { first_line: 3, records: 0 };
    let lights = |lights| Header { lights, ..HEADER };
    vec![
        image("the header alone", HEADER, None),
        empty_scene(),
        magic,
        version,
        unsound("a unit of 0", Header { photon_power_unit: 0.0, ..HEADER }),
        unsound("a denormal unit", Header { caustic_power_unit: 1e-40, ..HEADER }),
        unsound("an infinite radiance unit", Header { radiance_unit: f32::INFINITY, ..HEADER }),
        unsound("a negative reach", Header { reach: -1.0, ..HEADER }),
        unsound("a reach that is no number", Header { reach: f32::NAN, ..HEADER }),
        unsound(
            "a negative side of a cell",
            Header { photon_grid: PhotonGrid { cell: -1.0, ..PhotonGrid::UNIT }, ..HEADER },
        ),
        unsound("a probability above 1", lights(Lights { distant: 1.5, ..Lights::NONE })),
        unsound("a negative radiance", lights(Lights { radiance: [0.0, -1.0, 0.0], ..Lights::NONE })),
        unsound("a section behind the last line", section),
        unsound("an empty section behind the last line", empty_section),
        unsound("another number of lines", Header { lines: 3, ..HEADER }),
    ]
}

/// A conversation of a host with a card.
struct Talk<M> {
    host: Transport,
    card: Box<Card<Micro, M>>,
    steps: Vec<String>,
}

impl<M: CardMemory> Talk<M> {
    fn with(memory: M) -> Self {
        let mut host = Transport::host();
        host.open(1);
        Self { host, card: Box::new(Card::new(memory)), steps: Vec::new() }
    }

    /// Sends payloads, of which all arrive before the card works. Returns its answers.
    fn answers(&mut self, payloads: &[Vec<u8>]) -> Vec<Vec<u8>> {
        let Self { host, card, .. } = self;
        for payload in payloads {
            assert!(host.send(|bytes| {
                bytes.get_mut(..payload.len())?.copy_from_slice(payload);
                Some(payload.len())
            }));
            let outgoing = host.outgoing().to_vec();
            host.sent(outgoing.len());
            card.feed(&outgoing);
        }
        let mut answers = Vec::new();
        loop {
            let replies = card.outgoing().to_vec();
            card.sent(replies.len());
            let mut rest = &replies[..];
            while !rest.is_empty() {
                rest = &rest[host.receive(rest).0..];
                while let Some(reply) = host.take() {
                    answers.push(reply.to_vec());
                }
            }
            host.acknowledge();
            let outgoing = host.outgoing().to_vec();
            host.sent(outgoing.len());
            card.feed(&outgoing);
            card.acknowledge();
            if replies.is_empty() && outgoing.is_empty() && !card.is_busy() {
                return answers;
            }
            card.work();
        }
    }

    /// A step of commands whose answers are `expected`, as [`name`] writes them.
    fn say(&mut self, what: &str, commands: &[Command], expected: &str) {
        let payloads: Vec<_> = commands.iter().map(encoded).collect();
        self.send(what, &payloads, expected);
    }

    fn send(&mut self, what: &str, payloads: &[Vec<u8>], expected: &str) {
        let answers = self.answers(payloads);
        let names: Vec<String> = answers.iter().map(|answer| name(answer)).collect();
        assert_eq!(names.join(", "), expected, "{what}");
        let written = |answer: &Vec<u8>| match decode(answer) {
            // The rest of it is of the card's own.
            Some(Reply::Hello { written_lines, .. }) => written_lines.to_string(),
            _ => hex(answer),
        };
        self.steps.push(object(&[
            ("what", text(what)),
            ("commands", list(payloads.iter().map(|payload| hex(payload)))),
            ("answers", list(answers.iter().map(written))),
        ]));
    }

    /// Sends an image of few lines up to its end.
    fn load(&mut self, image: &Image) {
        let data = image.bytes();
        let begin =
            Command::BeginImage { lines: image.lines.len() as u32, checksum: image_checksum(&image.lines) };
        let commands = [begin, Command::WriteLines { first: 0, data: &data }, Command::EndImage];
        self.say(image.what, &commands, &name(&image.answer()));
    }
}

/// An answer in short.
fn name(answer: &[u8]) -> String {
    match decode(answer).expect("the card answers with messages") {
        Reply::Hello { protocol, layout, written_lines, .. } => {
            assert_eq!(encoded(&Command::Hello { protocol, layout }), encoded(&HELLO));
            format!("Hello {written_lines}")
        }
        Reply::Checksums { first, data } => format!("Checksums {first} {}", data.len() / 8),
        Reply::ImageAccepted => "ImageAccepted".into(),
        Reply::FrameAccepted => "FrameAccepted".into(),
        Reply::Pixels { tile, first, data } => format!("Pixels {tile} {first} {}", data.len()),
        Reply::TileDone { tile, .. } => format!("TileDone {tile}"),
        Reply::Fault(Fault { code, detail }) => format!("{code:?} {detail}"),
        Reply::Computed { results } => format!("Computed {}", results.len()),
        Reply::MemoryTested(MemoryTest { pattern, written, checked, .. }) => {
            format!("MemoryTested {} {written} {checked}", pattern as u8)
        }
    }
}

fn tile(id: u32, width: u32, height: u32) -> Command<'static> {
    Command::RenderTile(Tile { id, x: 0, y: 0, width, height })
}

/// Frames that the card refuses: what is wrong, the frame, and the number of its parameter.
fn refused_frames() -> Vec<(&'static str, FrameParameters, u32)> {
    let sensors = |line, count, frame: FrameParameters| {
        let projection = Projection::Sensors { line, first: 0, count };
        FrameParameters { camera: Camera { projection, ..frame.camera }, ..frame }
    };
    let cached = FrameParameters { irradiance_error: Some(0.1), ..FRAME };
    let mut far = FRAME;
    far.camera.up[1] = f32::NAN;
    let caustics = |neighbors, max_distance| Some(CausticGather { neighbors, max_distance });
    vec![
        ("width 0", FrameParameters { width: 0, ..FRAME }, 0),
        ("width 65537", FrameParameters { width: 65537, ..FRAME }, 0),
        ("height 0", FrameParameters { height: 0, ..FRAME }, 1),
        ("a camera that is no number", far, 2),
        ("sensors behind the image", sensors(0, 1 << 20, FRAME), 2),
        ("sensors behind all lines", sensors(u32::MAX, 6, FRAME), 2),
        ("sensors that interpolate irradiance", sensors(0, 1, cached), 2),
        ("a first sample of the budget's samples", FrameParameters { first_sample: 4096, ..FRAME }, 4),
        ("no samples", FrameParameters { samples: 0, ..FRAME }, 5),
        ("a sample beyond the budget's", FrameParameters { first_sample: 4095, samples: 2, ..FRAME }, 5),
        ("no planned samples", FrameParameters { planned_samples: 0, ..FRAME }, 6),
        ("4097 planned samples", FrameParameters { planned_samples: 4097, ..FRAME }, 6),
        ("16385 gather rays", FrameParameters { gather_rays: 16385, ..FRAME }, 7),
        ("65 shadow rays", FrameParameters { shadow_rays: 65, ..FRAME }, 8),
        ("1 neighbour", FrameParameters { neighbors: 1, ..FRAME }, 9),
        ("129 neighbours", FrameParameters { neighbors: 129, ..FRAME }, 9),
        ("distance 0", FrameParameters { max_distance: 0.0, ..FRAME }, 10),
        ("an infinite distance", FrameParameters { max_distance: f32::INFINITY, ..FRAME }, 10),
        ("error 0", FrameParameters { irradiance_error: Some(0.0), ..FRAME }, 12),
        ("error 1.5", FrameParameters { irradiance_error: Some(1.5), ..FRAME }, 12),
        ("no bins", FrameParameters { bins: 0, ..FRAME }, 13),
        ("257 bins", FrameParameters { bins: 257, ..FRAME }, 13),
        ("drain 3 without room behind the image", FrameParameters { drain: Drain::Buckets, ..FRAME }, 14),
        ("queue 0, without a queue too", FrameParameters { queue: 0, drain: Drain::Immediate, ..FRAME }, 15),
        ("1 neighbour of caustics", FrameParameters { caustics: caustics(1, 1.0), ..FRAME }, 17),
        ("distance 0 of caustics", FrameParameters { caustics: caustics(50, 0.0), ..FRAME }, 17),
        ("no tiles in flight", FrameParameters { in_flight: 0, ..FRAME }, 20),
        ("threshold 0", FrameParameters { adaptive_threshold: Some(0.0), ..FRAME }, 22),
        (
            "two faults: the threshold is checked before the gather rays",
            FrameParameters { gather_rays: 16385, adaptive_threshold: Some(0.0), ..FRAME },
            22,
        ),
    ]
}

fn states() -> Vec<String> {
    let memory = vec![Line::ZERO; MEMORY].leak();
    let mut talk = Talk::with(Dram::new(memory));
    let images = images();
    let [bare, image, unsound @ ..] = &images[..] else { panic!("there are images") };
    let data = image.bytes();
    let checksum = image_checksum(&image.lines);
    let begin = |lines| Command::BeginImage { lines, checksum };
    let read = |first, count| Command::ReadChecksums { first, count };
    let write = |first, data| Command::WriteLines { first, data };
    let operands: Vec<u8> = [1.5_f32, -2.0, 0.25].into_iter().flat_map(f32::to_le_bytes).collect();
    let compute = Command::Compute { operands: &operands };
    let frame = Command::BeginFrame(FRAME);
    let pixels = "Pixels 1 0 240, TileDone 1";

    talk.say("Hello", &[HELLO], "Hello 0");
    talk.say("Hello of another version", &[Command::Hello { protocol: 300, layout: 1 }], "Hello 0");
    talk.say("no image: no chunk is written", &[read(0, 1)], "Chunks 0");
    talk.say("no image: a line", &[write(0, &data)], "Order 0");
    talk.say(
        "no image: EndImage, BeginFrame, RenderTile",
        &[Command::EndImage, frame, tile(1, 2, 2)],
        "Order 0, Order 0, Order 0",
    );
    talk.say("no image: Flush", &[Command::Flush], "");
    talk.say("no image: Compute", &[compute], "Computed 84");
    talk.say("no operands", &[Command::Compute { operands: &[] }], "Operands 0");
    talk.say("half a triple", &[Command::Compute { operands: &operands[..6] }], "Operands 6");
    talk.say("nine triples", &[Command::Compute { operands: &operands.repeat(9) }], "Operands 108");
    talk.say("an image of no lines", &[begin(0)], "ImageTooLarge 64");
    talk.say("an image of one line too many", &[begin(65)], "ImageTooLarge 64");

    talk.say("loading", &[begin(3)], "");
    talk.say("a line and a half", &[write(0, &data[..192])], "Lines 0");
    talk.say("a line behind the image", &[write(1, &data)], "Lines 1");
    talk.say("no lines", &[write(0, &[])], "");
    talk.say("loading: no chunk is written", &[read(0, 1)], "Chunks 0");
    talk.say("loading: BeginFrame, RenderTile", &[frame, tile(1, 2, 2)], "Order 0, Order 0");
    talk.say("loading: Compute, Flush", &[compute, Command::Flush], "Computed 84");
    talk.say("the second line on, then the first", &[write(1, &data[128..]), write(0, &data[..128])], "");
    talk.say("loading: checksums", &[read(0, 1)], "Checksums 0 1");
    talk.say("no chunk", &[read(0, 0)], "Chunks 0");
    talk.say("a chunk that is not written", &[read(0, 2)], "Chunks 0");
    talk.say("65 chunks", &[read(1, 65)], "Chunks 1");
    talk.say(
        "its end, before which checksums are answered",
        &[read(0, 1), Command::EndImage],
        "Checksums 0 1, ImageAccepted",
    );

    talk.say("image: EndImage, WriteLines", &[Command::EndImage, write(0, &data)], "Order 0, Order 0");
    talk.say("image: RenderTile", &[tile(1, 2, 2)], "Order 0");
    talk.say(
        "image: BeginFrame while checksums are computed",
        &[read(0, 1), frame],
        "Order 0, Checksums 0 1",
    );
    talk.say("checksums while checksums are computed", &[read(0, 1), read(0, 1)], "Order 0, Checksums 0 1");
    talk.say("Compute while checksums are computed", &[read(0, 1), compute], "Order 0, Checksums 0 1");
    talk.say("image: BeginFrame", &[frame], "FrameAccepted");
    talk.say("a tile of 2 by 2 pixels", &[tile(1, 2, 2)], pixels);
    talk.say("frame: Compute, checksums", &[compute, read(0, 1)], "Computed 84, Checksums 0 1");
    for (what, frame, parameter) in refused_frames() {
        talk.say(what, &[Command::BeginFrame(frame)], &format!("Parameter {parameter}"));
    }
    let precomputed = FrameParameters { radiance: Radiance::Precomputed, ..FRAME };
    talk.say("radiance 1, of an image without photons", &[Command::BeginFrame(precomputed)], "FrameAccepted");
    talk.say("the frame again", &[frame], "FrameAccepted");
    talk.say(
        "a refused frame drops no tile",
        &[tile(1, 2, 2), Command::BeginFrame(FrameParameters { samples: 0, ..FRAME })],
        &format!("Parameter 5, {pixels}"),
    );
    talk.say("a frame drops tiles", &[tile(1, 2, 2), frame], "FrameAccepted");
    talk.say("empty tiles", &[tile(2, 0, 2), tile(3, 2, 0)], "Tile 2, Tile 3");
    let outside = [(4, 63, 0), (5, 0, 47), (6, u32::MAX, 0)]
        .map(|(id, x, y)| Command::RenderTile(Tile { id, x, y, width: 2, height: 2 }));
    talk.say("tiles outside the picture", &outside, "Tile 4, Tile 5, Tile 6");
    talk.say("a tile of more pixels than the budget", &[tile(7, 17, 16)], "Tile 7");
    talk.say(
        "one tile more than the budget",
        &[tile(1, 2, 2), tile(8, 2, 2), tile(9, 2, 2)],
        &format!("TooManyTiles 9, {pixels}, Pixels 8 0 240, TileDone 8"),
    );
    talk.say(
        "tiles: Compute, checksums",
        &[tile(1, 2, 2), compute, read(0, 1)],
        &format!("Order 0, Order 0, {pixels}"),
    );
    talk.say(
        "tiles: WriteLines, EndImage",
        &[tile(1, 2, 2), write(0, &data), Command::EndImage],
        &format!("Order 0, Order 0, {pixels}"),
    );
    talk.say(
        "a tile while checksums are computed",
        &[read(0, 1), tile(1, 2, 2)],
        &format!("Checksums 0 1, {pixels}"),
    );
    talk.say("a tile after checksums", &[tile(1, 2, 2)], pixels);
    talk.say("a tile after Compute", &[compute, tile(1, 2, 2)], &format!("Computed 84, {pixels}"));
    for (what, payload) in no_commands() {
        let length = payload.len();
        talk.send(what, &[payload], &format!("Message {length}"));
    }
    let layers = FrameParameters { layers: true, ..FRAME };
    talk.say("a frame with layers", &[Command::BeginFrame(layers)], "FrameAccepted");
    talk.say("a tile of a pixel", &[tile(1, 1, 1)], "Pixels 1 0 112, TileDone 1");
    talk.say("a tile of 9 pixels", &[tile(1, 3, 3)], "Pixels 1 0 896, Pixels 1 8 112, TileDone 1");
    talk.say("more than a fourth of the budget's pixels", &[tile(2, 13, 5)], "Tile 2");
    let further = FrameParameters { position: true, coverage: true, transparent: true, ..FRAME };
    talk.say("a frame with positions and coverage", &[Command::BeginFrame(further)], "FrameAccepted");
    talk.say("a tile of a pixel of it", &[tile(1, 1, 1)], "Pixels 1 0 88, TileDone 1");
    let identities = FrameParameters { identities: true, ..FRAME };
    let begin_identities = [Command::BeginFrame(identities)];
    talk.say("identities of an image without triangles", &begin_identities, "FrameAccepted");
    talk.say("a tile of a pixel of it", &[tile(1, 1, 1)], "Pixels 1 0 156, TileDone 1");

    talk.load(bare);
    talk.say("a frame of it", &[frame], "FrameAccepted");
    talk.say("a tile of it: it has no root", &[tile(1, 2, 2)], "Depth 0");
    for image in unsound {
        talk.load(image);
    }
    talk.say("no image is left", &[write(0, &data), frame], "Order 0, Order 0");
    let end = Command::EndImage;
    let load = [begin(3), write(0, &data), end];
    talk.say(
        "the check of an image: WriteLines",
        &[&load[..], &load[1..2]].concat(),
        "Order 0, ImageAccepted",
    );
    talk.say("the check of an image: BeginFrame", &[&load[..], &[frame]].concat(), "Order 0, ImageAccepted");
    talk.say(
        "the check of an image: Compute",
        &[&load[..], &[compute]].concat(),
        "Computed 84, ImageAccepted",
    );
    talk.say(
        "the check of an image: checksums",
        &[&load[..], &[read(0, 1)]].concat(),
        "Checksums 0 1, ImageAccepted",
    );
    talk.say("the check of an image: BeginImage", &[&load[..], &load[..1]].concat(), "");
    let changed = |checksum: u64| Command::BeginImage { lines: 3, checksum: checksum ^ 1 };
    talk.say(
        "another checksum",
        &[changed(checksum), write(0, &data), end],
        &format!("ImageChecksum {}", checksum as u32),
    );
    talk.say("the loading is over", &[write(0, &data), end], "Order 0, Order 0");
    talk.say("an image whose lines are there", &[begin(3), end], "ImageAccepted");
    talk.say("its frame", &[frame], "FrameAccepted");
    talk.say(
        "a refused image forgets image and frame",
        &[begin(65), frame, tile(1, 2, 2)],
        "ImageTooLarge 64, Order 0, Order 0",
    );
    talk.say("BeginImage drops checksums that are computed", &[read(0, 1), begin(3)], "");

    let reports = |patterns: std::ops::Range<u8>| {
        let of_pattern = |pattern| format!("MemoryTested {pattern} 64 0, MemoryTested {pattern} 64 64");
        patterns.map(of_pattern).collect::<Vec<_>>().join(", ")
    };
    talk.say("a memory test", &[Command::TestMemory], &reports(0..5));
    talk.say("nothing is written behind it", &[read(0, 1), begin(3), write(0, &data)], "Chunks 0");
    talk.say(
        "a memory test: Compute, checksums, BeginFrame",
        &[Command::TestMemory, compute, read(0, 1), frame],
        &format!("Computed 84, Chunks 0, Order 0, {}", reports(0..5)),
    );
    talk.say(
        "a memory test: WriteLines, RenderTile, Flush",
        &[Command::TestMemory, write(0, &data), tile(1, 2, 2), Command::Flush],
        &format!("Order 0, Order 0, {}", reports(0..5)),
    );
    talk.say("a memory test ends with BeginImage", &[Command::TestMemory, begin(3)], "");
    talk.say("and with Hello", &[Command::TestMemory, HELLO], "Hello 0");
    talk.say("the image again", &[begin(3), write(0, &data), end], "ImageAccepted");
    talk.say("Hello leaves the lines, and forgets the image", &[HELLO, frame], "Hello 3, Order 0");
    talk.steps
}

/// A card whose memory begins with a read-only image.
fn resident() -> Vec<String> {
    let images = images();
    let [_, image, ..] = &images[..] else { panic!("there is an image") };
    let flash = image.lines.clone().leak();
    let rest = vec![Line::ZERO; MEMORY - flash.len()].leak();
    let mut talk = Talk::with(Resident::new(flash, Dram::new(rest)));
    let data = image.bytes();
    let begin = |lines| Command::BeginImage { lines, checksum: image_checksum(&image.lines) };
    let write = |first, data| Command::WriteLines { first, data };
    talk.say("the image's lines are written", &[HELLO], "Hello 3");
    talk.say("checksums", &[Command::ReadChecksums { first: 0, count: 1 }], "Checksums 0 1");
    talk.say("the image without lines", &[begin(3), Command::EndImage], "ImageAccepted");
    talk.say("equal lines", &[begin(3), write(0, &data), Command::EndImage], "ImageAccepted");
    let other = [&data[..128], &[1; 256]].concat();
    talk.say("another second line", &[begin(4), write(0, &other)], "Memory 1");
    talk.say("a line behind the image", &[write(3, &[1; 128])], "");
    talk.say("a memory test", &[Command::TestMemory], "Memory 0");
    talk.say("the lines are written again", &[HELLO], "Hello 3");
    talk.steps
}
