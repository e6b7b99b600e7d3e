//! Fuzzing of card images. A card that accepts an image must render a tile or report a fault.

use glam::Vec3;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon::trace;
use photoncard_driver::photon_map::{
    GatherParameters, map_photons, precompute_irradiance, store_photons, to_kd_tree,
};
use photoncard_driver::render::{PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::Material;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::image::HEADER_LINES;
use photoncard_shared::message::{
    CausticGather, Command, Drain, FaultCode, Filter, FrameParameters, Radiance, Sampling, Tile,
};

use super::mutation;
use super::random::Random;
use super::target::{Target, bound};
use crate::everything::everything;
use crate::wire::{Answer, Wire};
use crate::{camera, lambertian, room, scene};

/// Number of lines of the card's memory: gathers that wait there have room after most images.
pub const DRAM_LINES: usize = 4096;
/// Tiles in the middle of the picture, in which several walls are seen.
const TILES: [Tile; 2] =
    [Tile { id: 7, x: 2, y: 2, width: 4, height: 2 }, Tile { id: 8, x: 2, y: 4, width: 4, height: 2 }];

/// Target for card images. An input is a byte that selects techniques, and an image.
pub(super) struct Image {
    seeds: Vec<Vec<u8>>,
}

/// Card images of a lit room with a few photons and irradiance points, in both layouts of the photon map, and
/// of the scene with every feature, with a caustic map.
///
/// # Panics
/// If a scene cannot be packed.
pub fn images() -> [CardImage; 3] {
    let mut lamp = lambertian("lamp", 0.5);
    lamp.emission = Vec3::ONE;
    let glossy = Material::phong("glossy", Vec3::splat(0.5), Vec3::splat(0.25), 12.0);
    let walls = room([0, 2, 0, 1, 0, 2]);
    let scene = scene(walls, vec![lambertian("wall", 0.5), lamp, glossy], camera(Vec3::ZERO, Vec3::NEG_Z));
    let image = || {
        let packed = PackedScene::new(&scene).expect("the room is packed");
        let pass = trace(&packed, 0, 300, &|_| true).expect("the room is lit");
        store_photons(packed, pass.photons, 20).expect("the map is packed")
    };
    let [tree, leaves] = [to_kd_tree(image()).expect("the map is packed as a tree"), image()]
        .map(|image| precompute_irradiance(image, 20, 0.5, &|| true).expect("the irradiance is packed"));
    let scene = everything();
    let packed = PackedScene::new(&scene).expect("the scene is packed");
    let settings = RenderSettings {
        photons: PhotonMaps { count: 300, caustic_photons: Some(100), ..PhotonMaps::default() },
        ..RenderSettings::default()
    };
    let mapped = map_photons(packed, &settings.photon_settings(&scene), &|_| true).expect("the scene is lit");
    [tree, leaves, mapped.image]
}

/// Frame with the techniques that the bits of `choice` select.
pub fn frame(choice: u8) -> FrameParameters {
    let settings = RenderSettings {
        picture: Picture { width: 8, height: 8, ..Picture::default() },
        ..RenderSettings::default()
    };
    let is_set = |bit: u8| choice >> bit & 1 != 0;
    let gathers = GatherParameters {
        max_distance: 0.5,
        near_distance: if is_set(2) { 0.4 } else { 0.0 },
        caustics: choice.is_multiple_of(3).then_some(CausticGather { neighbors: 10, max_distance: 0.3 }),
    };
    FrameParameters {
        neighbors: 20,
        gather_rays: 8,
        shadow_rays: 2,
        samples: 1 + u32::from(is_set(0)),
        sampling: [Sampling::Reflection, Sampling::Photon, Sampling::Mixture, Sampling::Focused]
            [usize::from(choice >> 1 & 3)],
        irradiance_error: is_set(3).then_some(0.2),
        bins: if is_set(4) { 8 } else { 1 },
        drain: [Drain::Immediate, Drain::Hash, Drain::Sort, Drain::Buckets][usize::from(choice >> 5 & 3)],
        filter: [Filter::Box, Filter::Gaussian, Filter::BlackmanHarris][usize::from(choice % 3)],
        queue: if is_set(7) { 3 } else { 64 },
        layers: choice.count_ones() % 2 == 1,
        radiance: if choice >> 4 & 3 == 3 { Radiance::Precomputed } else { Radiance::Density },
        ..settings.frame(&camera(Vec3::new(0.0, 0.0, 0.5), Vec3::NEG_Z), &gathers)
    }
}

impl Image {
    pub(super) fn new() -> Self {
        let bytes = |image: &CardImage| image.lines().iter().flat_map(|line| line.0).collect();
        Self { seeds: images().iter().map(bytes).collect() }
    }
}

/// Makes one edit of an image. Most edits do not move lines.
fn edit(image: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut Random) {
    let lines = image.len() / LINE_BYTES;
    if lines == 0 {
        return;
    }
    // A word of the header behind its first three, any byte of a line, or a word of a line.
    let place = match random.below(4) {
        0 => 12 + 4 * random.below(HEADER_LINES * LINE_BYTES / 4 - 3),
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
        // Most inputs state their true number of lines in the header: others are refused at once.
        if !random.once_in(16) && image.len() >= LINE_BYTES {
            let lines = (image.len() / LINE_BYTES) as u32;
            image[12..16].copy_from_slice(&lines.to_le_bytes());
        }
        image.insert(0, random.next() as u8);
        image
    }

    fn read(&self, input: &[u8]) -> bool {
        let Some((&choice, image)) = input.split_first() else { return false };
        let lines: Vec<Line> = image.as_chunks().0.iter().map(|&line| Line(line)).collect();
        is_rendered(choice, &lines, &mut vec![Line::ZERO; DRAM_LINES])
    }
}

/// Loads a card image and renders two tiles of the frame of `choice`. Returns whether the card does it
/// without a fault.
///
/// # Panics
/// If the card answers with neither pixels nor a fault.
pub fn is_rendered(choice: u8, lines: &[Line], memory: &mut [Line]) -> bool {
    let mut wire = Wire::new(memory);
    wire.hello();
    // If the memory is too small for the image, each command of the load is answered by a fault.
    match wire.load(lines).last() {
        Some(Answer::ImageAccepted) => {}
        Some(Answer::Fault(_)) => return false,
        other => panic!("loading ends in {other:?}"),
    }
    let frame = frame(choice);
    match wire.say(&Command::BeginFrame(frame))[..] {
        [Answer::FrameAccepted] => {}
        // An edit may have removed the irradiance points from the header, or left no room for gathers.
        [Answer::Fault(FaultCode::Parameter)]
            if frame.radiance == Radiance::Precomputed
                || frame.drain == Drain::Buckets && lines.len() > DRAM_LINES / 2 =>
        {
            return false;
        }
        ref other => panic!("the frame begins with {other:?}"),
    }
    let [first, second] = TILES.map(Command::RenderTile);
    let answers = wire.say_all(&[first, second, Command::Flush]);
    if answers.iter().any(|answer| matches!(answer, Answer::Fault(_))) {
        return false;
    }
    for tile in TILES {
        assert!(answers.contains(&Answer::TileDone(tile.id)), "{answers:?}");
    }
    assert_eq!(pixels(&answers) as u64, TILES.iter().map(Tile::pixels).sum::<u64>());
    true
}

/// Number of pixels in all answers.
fn pixels(answers: &[Answer]) -> usize {
    let count = |answer: &Answer| if let Answer::Pixels(count) = answer { *count } else { 0 };
    answers.iter().map(count).sum()
}
