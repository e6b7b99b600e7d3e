//! Card images: a card that loads one renders a tile of it, or answers a fault.

use glam::Vec3;
use photoncard_driver::emitter::Emitters;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon::{PhotonMap, trace};
use photoncard_driver::render::RenderSettings;
use photoncard_firmware::card::MicroCard;
use photoncard_firmware::memory::Dram;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::budget::MICRO;
use photoncard_shared::checksum::checksum;
use photoncard_shared::message::{
    self, Command, Drain, FrameParameters, LINES_PER_WRITE, PIXEL_BYTES, PROTOCOL_VERSION, Reply, Sampling,
    Tile,
};
use photoncard_shared::transport::Transport;

use super::{Random, Target, bound, mutation};
use crate::{camera, lambertian, room, scene};

/// Lines of the card's memory.
const DRAM_LINES: usize = 1024;
/// A tile in the middle of the picture, which sees the lamp's and other walls.
const TILE: Tile = Tile { id: 7, x: 2, y: 2, width: 4, height: 4 };

/// The target. An input is a byte that chooses the techniques, and an image.
pub(super) struct Image {
    seeds: Vec<Vec<u8>>,
}

/// How a card's answers end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    Nothing,
    Accepted,
    Pixels(usize),
    Done(u32),
    Fault,
}

/// A card on a wire that loses nothing.
struct Wire<'a> {
    card: Box<MicroCard<Dram<'a>>>,
    host: Transport,
    pixels: usize,
}

impl Wire<'_> {
    /// Sends a command and works until the card rests. Returns its last answer.
    fn say(&mut self, command: &Command) -> Answer {
        assert!(self.host.send(|bytes| message::encode(command, bytes)), "there is room for a command");
        let mut answer = Answer::Nothing;
        loop {
            let to_card = self.host.outgoing().to_vec();
            self.host.sent(to_card.len());
            self.card.feed(&to_card);
            self.card.work();
            let to_host = self.card.outgoing().to_vec();
            self.card.sent(to_host.len());
            let mut rest = &to_host[..];
            while !rest.is_empty() {
                rest = &rest[self.host.receive(rest).0..];
                while let Some(payload) = self.host.take() {
                    answer = read_answer(message::decode(payload).expect("a card sends replies"));
                    if let Answer::Pixels(count) = answer {
                        self.pixels += count;
                    }
                }
            }
            if to_card.is_empty() && to_host.is_empty() && !self.card.is_busy() {
                self.card.acknowledge();
                self.host.acknowledge();
                if self.card.outgoing().is_empty() && self.host.outgoing().is_empty() {
                    return answer;
                }
            }
        }
    }

    fn load(&mut self, bytes: &[u8]) -> Answer {
        let lines = (bytes.len() / LINE_BYTES) as u32;
        self.say(&Command::BeginImage { lines, checksum: checksum(bytes) });
        for (index, data) in bytes.chunks(LINES_PER_WRITE * LINE_BYTES).enumerate() {
            self.say(&Command::WriteLines { first: (LINES_PER_WRITE * index) as u32, data });
        }
        self.say(&Command::EndImage)
    }
}

fn read_answer(reply: Reply) -> Answer {
    match reply {
        Reply::ImageAccepted | Reply::FrameAccepted => Answer::Accepted,
        Reply::Pixels { data, .. } => Answer::Pixels(data.len() / PIXEL_BYTES),
        Reply::TileDone { tile, .. } => Answer::Done(tile),
        Reply::Fault(_) => Answer::Fault,
        Reply::Hello { .. } | Reply::Checksums { .. } => Answer::Nothing,
    }
}

/// A lit room with a few photons, in both layouts of the photon map.
fn images() -> [CardImage; 2] {
    let mut lamp = lambertian("lamp", 0.5);
    lamp.emission = Vec3::ONE;
    let mut glossy = lambertian("glossy", 0.5);
    (glossy.specular, glossy.exponent) = (Vec3::splat(0.25), 12.0);
    let walls = room([0, 2, 0, 1, 0, 2]);
    let scene = scene(walls, vec![lambertian("wall", 0.5), lamp, glossy], camera(Vec3::ZERO, Vec3::NEG_Z));
    let image = || {
        let packed = PackedScene::new(&scene, &Emitters::new(&scene)).expect("the room is packed");
        let pass = trace(&packed, 0, 300, &|_| true).expect("the room is lit");
        let map = PhotonMap::new(&pass.arrivals, packed.photon_grid());
        packed.with_photons(&map).expect("the map is packed")
    };
    [image(), image().with_photons_in_leaves(0.5).expect("the map is packed in leaves")]
}

/// The frame that a byte chooses: every technique.
fn frame(choice: u8) -> FrameParameters {
    let settings = RenderSettings { width: 8, height: 8, ..RenderSettings::default() };
    let is_set = |bit: u8| choice >> bit & 1 != 0;
    FrameParameters {
        neighbors: 20,
        gather_rays: 4,
        shadow_rays: 2,
        samples: 1 + u32::from(is_set(0)),
        sampling: [Sampling::Reflection, Sampling::Photon, Sampling::Product, Sampling::Mixture]
            [usize::from(choice >> 1 & 3)],
        irradiance_error: is_set(3).then_some(0.2),
        bins: if is_set(4) { 8 } else { 1 },
        drain: [Drain::Immediate, Drain::Hash, Drain::Sort, Drain::Sort][usize::from(choice >> 5 & 3)],
        queue: if is_set(7) { 3 } else { 64 },
        ..settings.frame(&camera(Vec3::new(0.0, 0.0, 0.5), Vec3::NEG_Z), 0.5)
    }
}

impl Image {
    pub(super) fn new() -> Self {
        let bytes = |image: &CardImage| image.lines().iter().flat_map(|line| line.0).collect();
        Self { seeds: images().iter().map(bytes).collect() }
    }
}

/// Makes one edit of an image that mostly leaves lines where they are.
fn edit(image: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut Random) {
    let lines = image.len() / LINE_BYTES;
    if lines == 0 {
        return;
    }
    // The words of a line, of the header some of the time: the sections are in its first half.
    let place = match random.below(4) {
        0 => 12 + 4 * random.below(25),
        1 => LINE_BYTES * random.below(lines) + random.below(LINE_BYTES),
        _ => LINE_BYTES * random.below(lines) + 4 * random.below(LINE_BYTES / 4),
    };
    match random.below(8) {
        0..=3 => mutation::put_word(image, place, random),
        4 => image[place] ^= 1 << random.below(8),
        5 => image[place] = random.next() as u8,
        6 => {
            let from = LINE_BYTES * random.below(lines);
            image.copy_within(from..from + LINE_BYTES, LINE_BYTES * random.below(lines));
        }
        _ if random.once_in(4) => mutation::edit_bytes(image, seeds, random),
        _ => {
            let other = random.pick(seeds);
            let line = LINE_BYTES * random.below(lines.min(other.len() / LINE_BYTES));
            image[line..line + LINE_BYTES].copy_from_slice(&other[line..line + LINE_BYTES]);
        }
    }
}

impl Target for Image {
    fn name(&self) -> &'static str {
        "image"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        bound(input, 16)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut image = random.pick(&self.seeds).clone();
        for _ in 0..random.edits() {
            edit(&mut image, &self.seeds, random);
        }
        // An image whose lines are fewer or more than its header says is refused: seldom worth a try.
        if !random.once_in(16) && image.len() >= LINE_BYTES {
            let lines = (image.len() / LINE_BYTES) as u32;
            image[12..16].copy_from_slice(&lines.to_le_bytes());
        }
        image.insert(0, random.next() as u8);
        image
    }

    fn read(&self, input: &[u8]) -> bool {
        let Some((&choice, image)) = input.split_first() else { return false };
        let whole = image.len() / LINE_BYTES * LINE_BYTES;
        let mut memory = vec![Line::ZERO; DRAM_LINES];
        let card = Box::new(MicroCard::new(MICRO, Dram::new(&mut memory)));
        let mut wire = Wire { card, host: Transport::host(), pixels: 0 };
        wire.host.open(1);
        wire.say(&Command::Hello { protocol: PROTOCOL_VERSION, layout: 0 });
        match wire.load(&image[..whole]) {
            Answer::Accepted => {}
            Answer::Fault => return false,
            other => panic!("loading ends in {other:?}"),
        }
        assert_eq!(wire.say(&Command::BeginFrame(frame(choice))), Answer::Accepted);
        match wire.say(&Command::RenderTile(TILE)) {
            Answer::Done(id) => {
                assert_eq!((id, wire.pixels as u64), (TILE.id, TILE.pixels()));
                true
            }
            Answer::Fault => false,
            other => panic!("rendering ends in {other:?}"),
        }
    }
}
