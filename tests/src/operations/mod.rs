//! Counts the floating-point operations of rendered tiles. The program in `tests/operations` compiles the
//! firmware so that each operation is a call, which it counts by kind and by position in the code.

pub mod run;
mod steps;

use std::collections::HashSet;
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use photoncard_driver::choice::Choice;
use photoncard_driver::cost_model::arithmetic::{Operations, Step};
use photoncard_driver::pack::CardImage;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{self, FrameParameters, Tile};

use self::steps::{Place, step_of};

/// Compilation target without floating-point instructions, on which operations are calls.
pub const TARGET: &str = "x86_64-unknown-none";
/// Number of the cost model's steps.
pub const STEPS: usize = Step::ALL.len();

/// Operations that were counted in some tiles.
pub struct Counted {
    /// Counters of each tile, which are equal on every processor.
    pub counters: Vec<Counters>,
    /// Operations of all tiles in each step, in the order of [`Step::ALL`].
    pub steps: [Operations; STEPS],
}

impl Counted {
    /// Operations of all steps.
    pub fn total(&self) -> Operations {
        let mut total = Operations::default();
        self.steps.iter().for_each(|operations| total.add(operations));
        total
    }
}

/// Program that counts operations.
pub struct Instrument {
    program: PathBuf,
}

impl Instrument {
    /// Builds the program. It requires Linux on x86-64, and an installed compilation target.
    ///
    /// # Errors
    /// The reason, if this machine cannot build the program.
    ///
    /// # Panics
    /// If the build fails on a machine that meets the requirements.
    pub fn build() -> Result<Self, String> {
        if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
            return Err("the operations are counted on Linux and x86-64 alone".to_owned());
        }
        let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
        let installed = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
        let folder = installed.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
        if !folder.is_ok_and(|folder| Path::new(&folder).is_dir()) {
            return Err(format!("the target {TARGET} is missing; run: rustup target add {TARGET}"));
        }
        let target = tests.join("../target/operations");
        // This build's compiler flags must not apply to the program.
        let status = Command::new("cargo")
            .args(["build", "--release", "--locked", "--quiet"])
            .current_dir(tests.join("operations"))
            .env("CARGO_TARGET_DIR", &target)
            .env_remove("RUSTFLAGS")
            .env_remove("CARGO_ENCODED_RUSTFLAGS")
            .status();
        assert!(status.is_ok_and(|status| status.success()), "tests/operations does not build");
        Ok(Self { program: target.join(TARGET).join("release/photoncard-operations") })
    }

    /// Renders tiles and counts their operations.
    ///
    /// # Panics
    /// If the program fails, or an operation belongs to no step.
    pub fn count(&self, image: &CardImage, frame: &FrameParameters, tiles: &[Tile]) -> Counted {
        let input = input(image, frame, tiles).expect("a temporary file is written");
        let output =
            Command::new(&self.program).stdin(Stdio::from(input)).output().expect("the program runs");
        assert!(output.status.success(), "{}: {}", self.program.display(), output.status);
        let (counters, places) = output.stdout.split_at(tiles.len() * LINE_BYTES);
        let counters = counters.chunks(LINE_BYTES).map(|line| {
            let (&length, bytes) = line.split_first().expect("a line has bytes");
            message::decode(&bytes[..length.into()]).expect("counters")
        });
        Counted { counters: counters.collect(), steps: self.by_step(places) }
    }

    /// Operations of each step, from the counts of each position in the code.
    fn by_step(&self, places: &[u8]) -> [Operations; STEPS] {
        let symbols = addr2line::Loader::new(&self.program).expect("the program has its symbols");
        let mut steps = [Operations::default(); STEPS];
        let records = places.as_chunks::<24>().0;
        let records = records.iter().map(|record| {
            let (words, _) = record.as_chunks::<8>();
            [words[0], words[1], words[2]].map(u64::from_le_bytes)
        });
        let records = records.map(|[kind, address, count]| (kind, Place::new(&symbols, address), count));
        let records: Vec<_> = records.collect();
        let conversions: HashSet<_> =
            records.iter().filter(|(kind, ..)| *kind == CONVERT).map(|(_, place, _)| place).collect();
        for &(kind, ref place, count) in &records {
            // A saturating conversion is one instruction of a processor; on this target it includes
            // comparisons.
            if kind == COMPARE && conversions.contains(place) {
                continue;
            }
            let step = Step::ALL.iter().position(|&step| step == step_of(place)).expect("it is one of all");
            steps[step].add(&operation(kind).times(count as f64));
        }
        steps
    }
}

const COMPARE: u64 = 4;
const CONVERT: u64 = 5;

/// One operation of a kind, by the kind's number in the program's output.
fn operation(kind: u64) -> Operations {
    let none = Operations::default();
    match kind {
        0 => Operations { add: 1.0, ..none },
        1 => Operations { multiply: 1.0, ..none },
        2 => Operations { divide: 1.0, ..none },
        3 => Operations { square_root: 1.0, ..none },
        COMPARE => Operations { compare: 1.0, ..none },
        CONVERT | 6 => Operations { convert: 1.0, ..none },
        // A call of a function of `libm`; the operations in it are counted at the call's position.
        7 => none,
        _ => panic!("there is no operation {kind}"),
    }
}

/// Standard input of the program: card image, frame and tiles, in lines.
fn input(image: &CardImage, frame: &FrameParameters, tiles: &[Tile]) -> std::io::Result<File> {
    let mut bytes: Vec<u8> = image.lines().iter().flat_map(|line| line.0).collect();
    bytes.extend(line(frame));
    tiles.iter().for_each(|tile| bytes.extend(line(tile)));
    let mut file = tempfile::tempfile()?;
    file.write_all(&bytes)?;
    file.seek(SeekFrom::Start(0))?;
    Ok(file)
}

/// Line with the length of an encoded message and the message.
fn line<T: serde::Serialize>(message: &T) -> [u8; LINE_BYTES] {
    let mut line = [0; LINE_BYTES];
    let (length, bytes) = line.split_first_mut().expect("a line has bytes");
    *length = message::encode(message, bytes).expect("it fits into a line") as u8;
    line
}
