//! Real files, damaged: scenes and images that ship are mutated and read in processes of limited memory.
//!
//! The fuzz targets catch panics in their own process and begin with small made-up files. Here a process reads a batch of
//! inputs, and what ends it counts: an exit status, a signal, or the silence of an input that takes too long. Every
//! input is a function of its kind, a seed and a number.

mod inputs;
mod reader;
mod supervisor;

use std::path::PathBuf;
use std::time::Duration;

pub use self::inputs::Inputs;
pub use self::reader::read_batch;
pub use self::supervisor::{Finding, Report, supervise};

/// What is damaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// PNG and JPEG as textures, Radiance and `OpenEXR` pictures as environments, the latter compared as well.
    Images,
    /// glTF as text and as GLB, loaded, packed, and rendered with few photons and rays.
    Scenes,
}

impl Kind {
    /// The kind of a name on the command line.
    pub fn of(name: &str) -> Option<Self> {
        [Self::Images, Self::Scenes].into_iter().find(|kind| kind.name() == name)
    }

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Images => "images",
            Self::Scenes => "scenes",
        }
    }
}

/// What to read.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The kind of files.
    pub kind: Kind,
    /// The seed of all inputs.
    pub seed: u64,
    /// The number of the first input.
    pub first: u64,
    /// How many inputs.
    pub inputs: u64,
    /// Inputs of one process.
    pub batch: u64,
    /// How long one input may take.
    pub patience: Duration,
    /// Address space of a process, kilobytes.
    pub kilobytes: u64,
    /// The command `photoncard`, which reads every [`Settings::every`]th input as well.
    pub command: Option<PathBuf>,
    /// See [`Settings::command`].
    pub every: u64,
    /// The folder that inputs which fail are written to.
    pub folder: PathBuf,
}
