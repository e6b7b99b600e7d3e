//! Errors of packing a scene.

use photoncard_picture::allocation;
use photoncard_shared::layout::NO_TEXTURE;

use crate::bvh::HierarchyError;

/// Error of a scene that does not fit a card.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PackError {
    /// Error of the bounding volume hierarchy.
    #[error(transparent)]
    #[diagnostic(help("simplify the scene's geometry"))]
    Hierarchy(#[from] HierarchyError),
    /// Error of memory that packing needs and the system refuses.
    #[error("packing {triangles} triangles takes {bytes} bytes of memory, which the system does not give")]
    #[diagnostic(help("simplify the scene's geometry, or {}", allocation::REMEDY))]
    Memory {
        /// Triangles of the scene.
        triangles: usize,
        /// Bytes of memory.
        bytes: u64,
    },
    /// Error of more lines than a line address can number.
    #[error("the card image takes {bytes} bytes, more than a card's addresses reach")]
    #[diagnostic(help("lower --photons, use smaller textures, or simplify the scene"))]
    TooLarge {
        /// Bytes of the image.
        bytes: u64,
    },
    /// Error of more textures than the index in a material's record can name.
    #[error("the scene has {textures} textures; a card image can index at most {}", NO_TEXTURE)]
    #[diagnostic(help("use one texture wherever image and sampler are equal, or split the scene"))]
    TooManyTextures {
        /// Textures of the scene.
        textures: usize,
    },
    /// Error of an image that is larger than the card's memory.
    #[error(
        "the card image takes {needed} bytes ({photons} of them photons), the card's DRAM budget is {available} bytes"
    )]
    #[diagnostic(help("{remedy}"))]
    Dram {
        /// Bytes of the image.
        needed: u64,
        /// Bytes of the photon map alone.
        photons: u64,
        /// Bytes of the card's DRAM.
        available: u64,
        /// Setting to lower, and its maximum.
        remedy: String,
    },
}
