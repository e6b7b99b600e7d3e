//! Damaged real files: scenes and images that ship are mutated and read in processes of limited memory.
//!
//! The fuzz targets catch panics in their own process and start from small generated files. Here a process reads a batch of
//! inputs, and its end is the result: an exit status, a signal, or a time-out. Every input is a function of its kind, a
//! seed and a number.

mod inputs;
mod reader;
mod supervisor;

use std::path::PathBuf;
use std::time::Duration;

pub use self::inputs::Inputs;
pub use self::reader::read_batch;
pub use self::supervisor::{Finding, Report, supervise};

/// Kind of files to damage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// PNG, JPEG, WebP and KTX2 as textures, Radiance and `OpenEXR` pictures as environments; the latter are compared as well.
    Images,
    /// glTF as text and as GLB, loaded, packed, and rendered with few photons and rays.
    Scenes,
}

impl Kind {
    /// Kind with the name `name` on the command line.
    pub fn of(name: &str) -> Option<Self> {
        [Self::Images, Self::Scenes].into_iter().find(|kind| kind.name() == name)
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Images => "images",
            Self::Scenes => "scenes",
        }
    }
}

/// Settings of a run.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Kind of files.
    pub kind: Kind,
    /// Seed of all inputs.
    pub seed: u64,
    /// Number of the first input.
    pub first: u64,
    /// Number of inputs.
    pub inputs: u64,
    /// Number of inputs per process.
    pub batch: u64,
    /// Time limit of one input.
    pub patience: Duration,
    /// Address space of a process, kilobytes.
    pub kilobytes: u64,
    /// Command `photoncard`, which reads every [`Settings::every`]th input as well.
    pub command: Option<PathBuf>,
    /// Interval of inputs that [`Settings::command`] reads.
    pub every: u64,
    /// Folder for failing inputs.
    pub folder: PathBuf,
}
