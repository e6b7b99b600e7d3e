//! Errors of a bake.

use std::io;
use std::path::PathBuf;

use photoncard_map::pack::PackError;
use photoncard_picture::output::OutputError;
use photoncard_shared::message::Fault;

use crate::RenderError;
use crate::parts::{Part, named};

/// Error of a bake.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum BakeError {
    /// The scene has no object of a stated name.
    #[error("the scene has no object {name} with a mesh")]
    #[diagnostic(help("{remedy}"))]
    UnknownObject {
        /// The stated name.
        name: String,
        /// Names that the scene has.
        remedy: String,
    },
    /// No surface of the scene, or of the stated objects, takes a lightmap.
    #[error("there is nothing to bake: no surface reflects diffusely or emits")]
    #[diagnostic(help("glass and metals keep their materials; name other objects, or leave out --object"))]
    Nothing,
    /// The density of texels is not possible.
    #[error("{density} texels per metre are not possible")]
    #[diagnostic(help("give --texels-per-metre a number above 0, such as 20, or leave it out"))]
    Density {
        /// Stated density, 1/m.
        density: f64,
    },
    /// The side of the pages is not possible.
    #[error("pages of {size} texels are not possible")]
    #[diagnostic(help("give --size 64 to 8192; 2048 is common"))]
    Size {
        /// Stated side, texels.
        size: u32,
    },
    /// The number of sensors along a texel is not possible.
    #[error("{supersample} sensors along a texel are not possible")]
    #[diagnostic(help("give --supersample 1 to 4"))]
    Supersample {
        /// Stated number.
        supersample: u32,
    },
    /// A chart is wider than a page.
    #[error("object {object} takes {texels} texels along one side, and a page has {size}")]
    #[diagnostic(help("give a lower --texels-per-metre, or a greater --size"))]
    TooWide {
        /// Name of the object.
        object: String,
        /// Side of its chart, texels.
        texels: u64,
        /// Side of a page, texels.
        size: u32,
    },
    /// There are more pages or sensors than a bake can have.
    #[error("the lightmaps take {count} {what}, and a bake has {most} at most")]
    #[diagnostic(help("give a lower --texels-per-metre, or bake some objects by --object"))]
    TooMany {
        /// Name of the counted items.
        what: &'static str,
        /// Number that the bake would take.
        count: u64,
        /// Maximum number.
        most: u64,
    },
    /// The scene cannot be packed for the host's rays.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Pack(#[from] PackError),
    /// The packed scene is malformed although it was just packed.
    #[error("the packed card image is malformed: {0}")]
    #[diagnostic(help("this is a fault of the program: please report it with the scene"))]
    Image(Fault),
    /// The measurement failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Render(#[from] RenderError),
    /// A page, or the file, cannot be encoded.
    #[error("cannot encode the {what}: {reason}")]
    #[diagnostic(help("bake fewer texels: a glb holds 4 GB at most"))]
    Encode {
        /// Name of the file's format.
        what: &'static str,
        /// Error of the encoder.
        reason: String,
    },
    /// A file of a part cannot be used.
    #[error("cannot use {}: {fault}", path.display())]
    #[diagnostic(help("{remedy}"))]
    Part {
        /// Path of the file.
        path: PathBuf,
        /// Reason.
        fault: String,
        /// Suggestion.
        remedy: &'static str,
    },
    /// Parts are missing.
    #[error("{} of {count} parts are missing: {}", missing.len(), named(missing))]
    #[diagnostic(help("bake them by --part K/N, and give all by --merge"))]
    Missing {
        /// Number of parts.
        count: u32,
        /// The missing parts.
        missing: Vec<Part>,
    },
    /// A part cannot be read.
    #[error("cannot read {}", path.display())]
    #[diagnostic(help("check that the path names a file and that it may be read"))]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: io::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl From<Fault> for BakeError {
    fn from(fault: Fault) -> Self {
        Self::Image(fault)
    }
}
