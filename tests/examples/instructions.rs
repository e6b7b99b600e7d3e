//! Host's part of `tests/instructions.sh`, which counts the instructions of a gather.
//!
//! `instructions write FILE` writes the memory of a board: the card image of the Cornell box with photons
//! and, in the line after it, the parameters of a frame. `instructions render FILE WORK` renders one tile of
//! this frame as a board does, and prints its counters. `WORK` is `Eye`, `Rays` or `Gathers`; the tile is
//! rendered in the function `measured`.

use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon_map::map_photons;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings, Sampling};
use photoncard_driver::scene::gltf;
use photoncard_firmware::chip::MicroChip;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{self, Drain, FrameParameters};

#[path = "../../firmware/boards/common/measure.rs"]
mod measure;

use measure::{Work, render};

fn memory() -> Vec<u8> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf");
    let scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
    let packed = PackedScene::new(&scene).expect("it is packed");
    // Without irradiance cache and direction tables, each gather ray that ends on a surface causes one
    // gather.
    let settings = RenderSettings {
        picture: Picture { width: 64, height: 64, ..Picture::default() },
        photons: PhotonMaps { count: 20_000, neighbors: 100, ..PhotonMaps::default() },
        integrator: Integrator {
            gather_rays: 16,
            sampling: Sampling::Reflection,
            irradiance_error: None,
            near_distance: Some(0.0),
            ..Integrator::default()
        },
        ..RenderSettings::default()
    };
    let mapped = map_photons(packed, &settings.photon_settings(&scene), &|_| true).expect("it is lit");
    let frame = settings.frame(&scene.cameras[0], &mapped.gathers);
    let frame = FrameParameters { drain: Drain::Immediate, ..frame };
    let mut behind = [0; LINE_BYTES];
    let (length, bytes) = behind.split_first_mut().expect("a line has bytes");
    *length = message::encode(&frame, bytes).expect("the parameters fit a line") as u8;
    mapped.image.lines().iter().map(|line| line.0).chain([behind]).flatten().collect()
}

/// Renders the tile. Callgrind counts the instructions of this function alone.
#[inline(never)]
fn measured(chip: &mut MicroChip, lines: &[Line], work: Work) -> Option<Counters> {
    render(chip, lines, work)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["write", path] => std::fs::write(path, memory()).expect("the file is written"),
        ["render", path, work] => {
            let bytes = std::fs::read(path).expect("the file is read");
            let lines: Vec<Line> = bytes.as_chunks().0.iter().map(|&line| Line(line)).collect();
            let work = Work::ALL.into_iter().find(|each| format!("{each:?}") == work).expect("a work");
            let counters = measured(&mut MicroChip::new(), &lines, work).expect("the file is sound");
            println!("{work:?} {} {} {}", counters.eye_rays, counters.gather_rays, counters.gathers);
        }
        _ => panic!("usage: instructions write FILE | render FILE WORK"),
    }
}
