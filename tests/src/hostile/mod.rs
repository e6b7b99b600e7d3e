//! Reads damaged copies of shipped scenes and images in processes of limited memory.
//!
//! Files that the command writes and reads again, such as parts of pictures, are also damaged while it runs,
//! and the pictures are compared.
//!
//! Fuzz targets catch panics in their own process, and start from small generated files. Here a process reads
//! a batch of inputs, and the result is how it ends: by an exit status, a signal, or a time-out. An input is
//! a function of kind, seed and number.

mod inputs;
mod kept;
mod reader;
mod supervisor;

use std::path::PathBuf;
use std::time::Duration;

pub use self::inputs::Inputs;
pub use self::kept::supervise as supervise_kept;
pub use self::reader::read_batch;
pub use self::supervisor::{Finding, Report, supervise};

/// Kind of files to damage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// PNG, JPEG, WebP and KTX2 as textures; Radiance and `OpenEXR` as environments. `OpenEXR` pictures are
    /// also compared, as by `photoncard diff`.
    Images,
    /// glTF as text and as GLB: loaded, packed, and rendered with few photons and rays.
    Scenes,
    /// Files that the command writes and reads again. Only the command reads them here.
    Kept(Kept),
}

/// Kind of files that the command writes and reads again, damaged before it starts or while it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    /// Prepared scenes.
    Cards,
    /// Parts of a picture, which are merged.
    Parts,
    /// Partial file with finished tiles, from which a render resumes.
    Partials,
    /// `OpenEXR` and PNG pictures of finished frames, which a render recognises.
    Frames,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 6] = [
        Self::Images,
        Self::Scenes,
        Self::Kept(Kept::Cards),
        Self::Kept(Kept::Parts),
        Self::Kept(Kept::Partials),
        Self::Kept(Kept::Frames),
    ];

    /// Kind with this name on the command line; `None` if there is none.
    pub fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Images => "images",
            Self::Scenes => "scenes",
            Self::Kept(Kept::Cards) => "cards",
            Self::Kept(Kept::Parts) => "parts",
            Self::Kept(Kept::Partials) => "partials",
            Self::Kept(Kept::Frames) => "frames",
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
    /// Size of a process's address space, kilobytes.
    pub kilobytes: u64,
    /// Program `photoncard`, which also reads every [`Settings::every`]th image or scene, and all kept files.
    pub command: Option<PathBuf>,
    /// Interval of the inputs that [`Settings::command`] reads.
    pub every: u64,
    /// Folder for failing inputs.
    pub folder: PathBuf,
}
