//! What can be wrong with a scene, where, and what to do about it.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{Diagnostic, NamedSource, SourceSpan};
use thiserror::Error;

use crate::allocation::{self, OutOfMemory};

/// Location in a scene: file and JSON path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The scene file.
    pub file: PathBuf,
    /// The JSON path in the file, such as `meshes[2].primitives[0].attributes.POSITION`; empty for the whole file.
    pub item: String,
}

impl Location {
    /// Location `item` in `file`.
    pub fn new(file: &Path, item: impl Into<String>) -> Self {
        Self { file: file.to_owned(), item: item.into() }
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if self.item.is_empty() { Ok(()) } else { write!(f, ": {}", self.item) }
    }
}

/// A scene that cannot be loaded, or a setting that cannot be applied to it.
///
/// Every variant names the location and, as its help, the remedy.
#[derive(Debug, Error, Diagnostic)]
#[non_exhaustive]
pub enum SceneError {
    /// The scene file, or a file it refers to, cannot be read.
    #[error("cannot read {}", file.display())]
    #[diagnostic(code(scene::unreadable), help("check that the path names a file and that it may be read"))]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the operating system says.
        #[source]
        source: io::Error,
    },

    /// The file is neither glTF JSON nor GLB.
    #[error("{} is not a glTF 2.0 scene: {reason}", file.display())]
    #[diagnostic(code(scene::not_gltf), help("export the scene as glTF 2.0 (.gltf or .glb)"))]
    NotGltf {
        /// The file.
        file: PathBuf,
        /// What gives it away.
        reason: String,
    },

    /// A GLB file ends before its own lengths say so.
    #[error("{} is truncated: {what} needs {needed} bytes and {available} are there", file.display())]
    #[diagnostic(code(scene::truncated), help("copy or export the file again; it was cut off on the way"))]
    Truncated {
        /// The file.
        file: PathBuf,
        /// The part that is cut off.
        what: &'static str,
        /// Bytes the part states.
        needed: u64,
        /// Bytes there are.
        available: u64,
    },

    /// The text is not JSON, or not JSON of glTF's shape.
    #[error("{file} is not glTF JSON: {message}")]
    #[diagnostic(
        code(scene::json),
        help("correct the JSON at the position shown, or export the scene again")
    )]
    Json {
        /// The file's name.
        file: String,
        /// What is wrong.
        message: String,
        /// The text.
        #[source_code]
        text: Arc<NamedSource<String>>,
        /// Where in the text.
        #[label("here")]
        at: SourceSpan,
    },

    /// The scene says that it cannot be shown without an extension this renderer does not know.
    #[error("{location} requires the extension {name}, which is not supported")]
    #[diagnostic(
        code(scene::required_extension),
        help("export the scene without {name}; supported are {supported}")
    )]
    RequiredExtension {
        /// Where it is required.
        location: Location,
        /// The extension.
        name: String,
        /// The extensions that are supported.
        supported: String,
    },

    /// The file breaks a rule of glTF.
    #[error("{location}: {reason}")]
    #[diagnostic(code(scene::invalid), help("{remedy}"))]
    Invalid {
        /// Where.
        location: Location,
        /// What is wrong.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },

    /// A buffer's bytes cannot be had.
    #[error("{location}: {reason}")]
    #[diagnostic(code(scene::buffer), help("{remedy}"))]
    Buffer {
        /// Which buffer.
        location: Location,
        /// What is wrong.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },

    /// An image's texels cannot be had.
    #[error("{location}: {reason}")]
    #[diagnostic(code(scene::image), help("{remedy}"))]
    Image {
        /// Which image.
        location: Location,
        /// What is wrong.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },

    /// An environment cannot be read.
    #[error("{}: {reason}", file.display())]
    #[diagnostic(code(scene::environment), help("{remedy}"))]
    Environment {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },

    /// A vertex's place, or something else of it, is not a number, infinite, or out of any scale.
    #[error("{location}: vertex {vertex} of mesh '{mesh}', primitive {primitive}, {reason}")]
    #[diagnostic(code(scene::vertex), help("repair the mesh in the modelling tool and export it again"))]
    Vertex {
        /// The attribute.
        location: Location,
        /// The mesh's name.
        mesh: String,
        /// The primitive's index in the mesh.
        primitive: usize,
        /// The vertex's index in the primitive.
        vertex: u64,
        /// What is wrong with it.
        reason: String,
    },

    /// An index refers to a vertex that does not exist.
    #[error(
        "{location}: index {position} is {index}, but mesh '{mesh}', primitive {primitive}, has {vertices} vertices"
    )]
    #[diagnostic(code(scene::index), help("repair the mesh in the modelling tool and export it again"))]
    IndexOutOfRange {
        /// The index accessor's place.
        location: Location,
        /// The mesh's name.
        mesh: String,
        /// The primitive's index in the mesh.
        primitive: usize,
        /// Which index in the list.
        position: u64,
        /// Its value.
        index: u64,
        /// How many vertices there are.
        vertices: u64,
    },

    /// The scene holds more triangles than a card image can address.
    #[error("{}: more than {limit} triangles once every instance is placed", file.display())]
    #[diagnostic(code(scene::too_many_triangles), help("simplify the meshes or place fewer instances"))]
    TooManyTriangles {
        /// The file.
        file: PathBuf,
        /// The limit.
        limit: usize,
    },

    /// The scene cannot be held by a card, whatever else is left out.
    #[error("{}: {what} take {needed} bytes of a card's memory or more, and the card has {available}", file.display())]
    #[diagnostic(
        code(scene::too_large),
        help(
            "simplify the meshes, place fewer instances, use fewer materials or smaller textures, or use a card with more memory"
        )
    )]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// Contents of the card image that exceed the memory, such as `8 materials`.
        what: String,
        /// Bytes of the card image, at least.
        needed: u64,
        /// Bytes of the card's memory.
        available: u64,
    },

    /// The system does not give the memory that a step of loading takes.
    #[error("{}: {step} takes {bytes} bytes of memory, which the system does not give", file.display())]
    #[diagnostic(code(scene::memory), help("simplify the scene, or {}", allocation::REMEDY))]
    Memory {
        /// The file.
        file: PathBuf,
        /// Step of loading that takes the memory.
        step: &'static str,
        /// Number of bytes.
        bytes: u64,
    },

    /// A material's value is out of its range.
    #[error("{location}: material '{material}': {reason}")]
    #[diagnostic(code(scene::material), help("{remedy}"))]
    Material {
        /// Where.
        location: Location,
        /// The material.
        material: String,
        /// What is wrong.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },

    /// The file has no scene.
    #[error("{} holds no scene", file.display())]
    #[diagnostic(
        code(scene::no_scene),
        help("export the objects as part of a scene (the glTF array `scenes`)")
    )]
    NoScene {
        /// The file.
        file: PathBuf,
    },

    /// The scene has no triangle.
    #[error("{}: the scene has no triangles", file.display())]
    #[diagnostic(
        code(scene::no_geometry),
        help(
            "put at least one triangle mesh into the file's default scene (primitives of mode 4, TRIANGLES)"
        )
    )]
    NoGeometry {
        /// The file.
        file: PathBuf,
    },

    /// The scene has triangles, but none with an area.
    #[error("{}: all {skipped} triangles have zero area", file.display())]
    #[diagnostic(
        code(scene::zero_area),
        help("check the scale of the nodes and the mesh: every triangle collapses to a line or a point")
    )]
    OnlyZeroArea {
        /// The file.
        file: PathBuf,
        /// How many there are.
        skipped: usize,
    },

    /// Nothing emits light.
    #[error("the scene has no light")]
    #[diagnostic(
        code(scene::no_light),
        help(
            "give a material of at least one triangle an emissiveFactor above 0 (and KHR_materials_emissive_strength \
             for its radiance), place a light of KHR_lights_punctual, or add an environment"
        )
    )]
    NoLight,

    /// The scene has no camera of this name.
    #[error("the scene has no camera '{name}'")]
    #[diagnostic(code(scene::camera), help("choose one of: {cameras}"))]
    UnknownCamera {
        /// The name asked for.
        name: String,
        /// The names there are.
        cameras: String,
    },

    /// The scene has no material of this name.
    #[error("`{assignment}`: the scene has no material '{material}'")]
    #[diagnostic(code(setting::material), help("choose one of: {nearest}"))]
    UnknownMaterial {
        /// The assignment as given.
        assignment: String,
        /// The name in it.
        material: String,
        /// The names nearest to it.
        nearest: String,
    },

    /// A setting is not of the form `MATERIAL.PROPERTY=VALUE`, or its value is not possible.
    #[error("`{assignment}`: {reason}")]
    #[diagnostic(code(setting::invalid), help("{remedy}"))]
    Setting {
        /// The assignment as given.
        assignment: String,
        /// What is wrong.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },
}

impl SceneError {
    /// A step of loading for which there is no memory.
    pub(crate) fn memory(file: &Path, step: &'static str, OutOfMemory { bytes }: OutOfMemory) -> Self {
        Self::Memory { file: file.to_owned(), step, bytes }
    }
}
