//! Errors of packing a scene.

use photoncard_picture::allocation;
use photoncard_shared::layout::NO_TEXTURE;

use crate::bvh::HierarchyError;

/// Error of a scene that does not fit a card.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum PackError {
    /// The bounding volume hierarchy cannot be built.
    #[error(transparent)]
    #[diagnostic(help("simplify the scene's geometry"))]
    Hierarchy(#[from] HierarchyError),
    /// The system refuses the memory that packing needs.
    #[error("packing {triangles} triangles takes {bytes} bytes of memory, which the system does not give")]
    #[diagnostic(help("simplify the scene's geometry, or {}", allocation::REMEDY))]
    Memory {
        /// Number of triangles of the scene.
        triangles: usize,
        /// Size of the refused memory, bytes.
        bytes: u64,
    },
    /// The card image has more lines than a line address can number.
    #[error("the card image takes {bytes} bytes, more than a card's addresses reach")]
    #[diagnostic(help("lower `photons.count`, use smaller textures, or simplify the scene"))]
    TooLarge {
        /// Size of the card image, bytes.
        bytes: u64,
    },
    /// There are more textures than a material's record can index.
    #[error("the scene has {textures} textures; a card image can index at most {}", NO_TEXTURE)]
    #[diagnostic(help("use one texture wherever image and sampler are equal, or split the scene"))]
    TooManyTextures {
        /// Number of textures of the scene.
        textures: usize,
    },
    /// The card image is larger than the card's memory.
    #[error(
        "the card image takes {needed} bytes ({photons} of them photons), the card's DRAM budget is {available} bytes"
    )]
    #[diagnostic(help("{remedy}"))]
    Dram {
        /// Size of the card image, bytes.
        needed: u64,
        /// Size of the photon map, bytes.
        photons: u64,
        /// Size of the card's DRAM, bytes.
        available: u64,
        /// Setting that can be lowered, with its maximum.
        remedy: String,
    },
}
