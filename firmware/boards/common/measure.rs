//! Instruction counts. One tile is rendered three times, each time with one more kind of work; the
//! differences are the costs of gather rays and of the gathers at their ends. `tests/instructions.sh` runs
//! the measurement.

use photoncard_firmware::chip::{MicroChip, Progress};
use photoncard_firmware::gather::GatherRequest;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::render::{GatherOutlet, RenderJob};
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::address::Line;
use photoncard_shared::counters::Counters;
use photoncard_shared::image::Header;
use photoncard_shared::message::{self, FrameParameters, Tile};

/// Kinds of work that a measurement includes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    /// Eye and shadow rays.
    Eye,
    /// Eye, shadow and gather rays.
    Rays,
    /// All rays, and the gathers at the ends of gather rays.
    Gathers,
}

impl Work {
    pub(crate) const ALL: [Self; 3] = [Self::Eye, Self::Rays, Self::Gathers];
}

/// Side of the rendered tile, pixels. The tile lies in the middle of the picture.
const TILE_SIDE: u32 = 16;

/// Receiver of gathers that drops them.
struct Nowhere;

impl GatherOutlet for Nowhere {
    fn take(&mut self, _: u32, _: GatherRequest) {}
}

/// Renders the tile and returns its counters. The line after the card image holds the length of the encoded
/// frame parameters, one byte, and these parameters. Returns `None` if the lines hold anything else.
pub(crate) fn render(chip: &mut MicroChip, lines: &[Line], work: Work) -> Option<Counters> {
    let scene = SceneImage { header: Header::read(lines.first_chunk()?).ok()? };
    let (&length, bytes) = lines.get(scene.header.lines as usize)?.0.split_first()?;
    let mut frame: FrameParameters = message::decode(bytes.get(..length.into())?)?;
    if work == Work::Eye {
        frame.gather_rays = 0;
    }
    let middle = |side: u32| side.saturating_sub(TILE_SIDE) / 2;
    let [x, y] = [middle(frame.width), middle(frame.height)];
    let mut nowhere = Nowhere;
    let outlet = (work == Work::Rays).then_some(&mut nowhere as &mut dyn GatherOutlet);
    let mut job = RenderJob { scene: &scene, memory: &mut Lines(lines), frame: &frame, outlet };
    if !chip.begin(job.memory, job.frame, Tile { id: 0, x, y, width: TILE_SIDE, height: TILE_SIDE }) {
        return None;
    }
    loop {
        match chip.step(&mut job).ok()? {
            Progress::Tile(_, counters) => return Some(counters),
            Progress::Idle if !chip.flush(job.frame) => return None,
            Progress::Busy | Progress::Pixel(_) | Progress::Idle => {}
        }
    }
}
