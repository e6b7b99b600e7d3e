//! Firmware of a reference chip, compiled without floating-point instructions. Every operation is a call that
//! is counted by its kind and its position in the code (`counters`). The program is for Linux on x86-64,
//! without libraries.
//!
//! Standard input is a file of lines: a card image, the frame's parameters, and tiles. Parameters and tiles
//! are each a length byte followed by a message. Standard output has such a line with the counters of each
//! tile. Three numbers of eight bytes follow for each position with operations: the kind, the return address
//! of the call, and the count.
#![no_std]
#![no_main]

mod counters;
mod linux;

use photoncard_firmware::chip::{Progress, ReferenceChip};
use photoncard_firmware::memory::Lines;
use photoncard_firmware::render::RenderJob;
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::counters::Counters;
use photoncard_shared::image::Header;
use photoncard_shared::message::{self, FrameParameters, Tile};

use self::counters::{CODE_BYTES, KINDS, OPERATION_COUNTS};

static mut CHIP: ReferenceChip = ReferenceChip::new();

/// Message in a line, after its length.
fn message<'a, T: serde::Deserialize<'a>>(line: &'a Line) -> Option<T> {
    let (&length, bytes) = line.0.split_first()?;
    message::decode(bytes.get(..length.into())?)
}

/// Renders a tile and completes its pixels, as a card does.
fn render(lines: &[Line], scene: &SceneImage, frame: &FrameParameters, tile: Tile) -> Option<Counters> {
    // SAFETY: the program has one thread, and the reference ends with this call.
    let chip = unsafe { &mut *(&raw mut CHIP) };
    let mut job = RenderJob { scene, memory: &mut Lines(lines), frame, outlet: None };
    if !chip.begin(job.memory, job.frame, tile) {
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

fn run() -> Option<()> {
    let lines = linux::standard_input()?;
    let scene = SceneImage { header: Header::read(lines.first_chunk()?).ok()? };
    let [frame, tiles @ ..] = lines.get(scene.header.lines as usize..)? else { return None };
    let frame: FrameParameters = message(frame)?;
    for tile in tiles {
        let counters = render(lines, &scene, &frame, message(tile)?)?;
        let mut line = [0; LINE_BYTES];
        let (length, bytes) = line.split_first_mut()?;
        *length = message::encode(&counters, bytes)? as u8;
        linux::write(&line)?;
    }
    for kind in 0..KINDS {
        for place in 0..CODE_BYTES {
            // SAFETY: nothing writes while this is read.
            let count = unsafe { OPERATION_COUNTS[kind][place] };
            if count > 0 {
                let record = [kind as u64, linux::address(place), count];
                linux::write(record.map(u64::to_le_bytes).as_flattened())?;
            }
        }
    }
    Some(())
}

#[unsafe(no_mangle)]
extern "C" fn program() -> ! {
    linux::exit(if run().is_some() { 0 } else { 1 })
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    linux::exit(2)
}
