//! Errors of scenes and settings: the fault, its location and the remedy.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{Diagnostic, MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};
use photoncard_picture::allocation::{self, OutOfMemory};
use thiserror::Error;

/// Part of a line of a file with its position in the file.
#[derive(Debug)]
pub struct Excerpt {
    /// Name of the file.
    pub name: String,
    /// Text of this part of the line.
    pub part: String,
    /// Index of the line in the file, and offset of the part in that line, bytes; both from 0.
    pub place: [usize; 2],
}

impl SourceCode for Excerpt {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        lines_before: usize,
        lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let read = self.part.read_span(span, lines_before, lines_after)?;
        let [line, column] = self.place;
        Ok(Box::new(MietteSpanContents::new_named(
            self.name.clone(),
            read.data(),
            *read.span(),
            line + read.line(),
            column + read.column(),
            read.line_count(),
        )))
    }
}

/// Location in a scene: file and JSON path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The scene file.
    pub file: PathBuf,
    /// The JSON path in the file, such as `meshes[2].primitives[0].attributes.POSITION`; empty for the whole
    /// file.
    pub item: String,
}

impl Location {
    /// Creates the location of `item` in `file`.
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

/// Error of a scene that cannot be loaded, or of a setting that cannot be applied to it.
///
/// Every variant names the location and, as its help, the remedy.
#[derive(Debug, Error, Diagnostic)]
#[non_exhaustive]
pub enum SceneError {
    /// Error of a file that cannot be read: the scene file, a file that it refers to, or an environment map.
    #[error("cannot read {}", file.display())]
    #[diagnostic(code(scene::unreadable), help("check that the path names a file and that it may be read"))]
    Unreadable {
        /// Path of the file.
        file: PathBuf,
        /// The operating system's error.
        #[source]
        source: io::Error,
    },

    /// Error of a file that is neither glTF JSON nor GLB.
    #[error("{} is not a glTF 2.0 scene: {reason}", file.display())]
    #[diagnostic(code(scene::not_gltf), help("export the scene as glTF 2.0 (.gltf or .glb)"))]
    NotGltf {
        /// Path of the file.
        file: PathBuf,
        /// Evidence, such as a wrong magic number.
        reason: String,
    },

    /// Error of a path that is a folder, an address, or a file of another format.
    #[error("{} is {what}, not a glTF 2.0 scene", file.display())]
    #[diagnostic(code(scene::other_format), help("{remedy}"))]
    OtherFormat {
        /// Path of the file.
        file: PathBuf,
        /// Kind of file at the path, such as `a folder` or `an FBX file`.
        what: &'static str,
        /// Remedy, with the command of a program that converts the format to glTF, if there is one.
        remedy: String,
    },

    /// Error of a GLB file that is shorter than the lengths in its headers.
    #[error("{} is truncated: {what} needs {needed} bytes and {available} are there", file.display())]
    #[diagnostic(code(scene::truncated), help("copy or export the file again; it was cut off on the way"))]
    Truncated {
        /// Path of the file.
        file: PathBuf,
        /// Part of the file that is truncated, such as `a chunk`.
        what: &'static str,
        /// Stated size of the part, bytes.
        needed: u64,
        /// Available size, bytes.
        available: u64,
    },

    /// Error of a text that is not JSON.
    #[error("{file} is not glTF JSON: {message}")]
    #[diagnostic(
        code(scene::json),
        help("correct the JSON at the position shown, or export the scene again")
    )]
    Json {
        /// Name of the file.
        file: String,
        /// The parser's message.
        message: String,
        /// Excerpt of the text around the fault.
        #[source_code]
        text: Arc<Excerpt>,
        /// Position of the fault in the excerpt.
        #[label("here")]
        at: SourceSpan,
    },

    /// Error of a scene whose `extensionsRequired` has an unsupported extension.
    #[error("{location} requires the extension {name}, which is not supported")]
    #[diagnostic(
        code(scene::required_extension),
        help("export or convert the scene without {name}; supported are {supported}")
    )]
    RequiredExtension {
        /// Location in `extensionsRequired`.
        location: Location,
        /// Name of the extension.
        name: String,
        /// Names of the supported extensions.
        supported: String,
    },

    /// Error of a file that violates the glTF specification.
    #[error("{location}: {reason}")]
    #[diagnostic(code(scene::invalid), help("{remedy}"))]
    Invalid {
        /// Location of the violation.
        location: Location,
        /// Description of the violation.
        reason: String,
        /// Remedy, which is shown as the help of the error.
        remedy: &'static str,
    },

    /// Error of a buffer whose bytes cannot be obtained.
    #[error("{location}: {reason}")]
    #[diagnostic(code(scene::buffer), help("{remedy}"))]
    Buffer {
        /// Location of the buffer.
        location: Location,
        /// Description of the fault.
        reason: String,
        /// Remedy, which is shown as the help of the error.
        remedy: &'static str,
    },

    /// Error of an image whose texels cannot be obtained.
    #[error("{location}: {reason}")]
    #[diagnostic(code(scene::image), help("{remedy}"))]
    Image {
        /// Location of the image.
        location: Location,
        /// Description of the fault.
        reason: String,
        /// Remedy, which is shown as the help of the error.
        remedy: &'static str,
    },

    /// Error of an environment that cannot be read.
    #[error("{}: {reason}", file.display())]
    #[diagnostic(code(scene::environment), help("{remedy}"))]
    Environment {
        /// Path of the file.
        file: PathBuf,
        /// Description of the fault.
        reason: String,
        /// Remedy, which is shown as the help of the error.
        remedy: &'static str,
    },

    /// Error of a photometric file.
    #[error("{}, line {line}: {reason}", file.display())]
    #[diagnostic(
        code(scene::profile),
        help(
            "photometric files are ANSI/IES LM-63 (.ies) and EULUMDAT (.ldt); download the luminaire's file again"
        )
    )]
    Profile {
        /// Path of the file.
        file: PathBuf,
        /// Line of the fault, from 1 on.
        line: usize,
        /// Description of the fault.
        reason: String,
    },

    /// Error of a vertex attribute that is out of range or not finite.
    #[error("{location}: vertex {vertex} of mesh '{mesh}', primitive {primitive}, {reason}")]
    #[diagnostic(code(scene::vertex), help("repair the mesh in the modelling tool and export it again"))]
    Vertex {
        /// Location of the attribute.
        location: Location,
        /// Name of the mesh.
        mesh: String,
        /// Index of the primitive in the mesh.
        primitive: usize,
        /// Index of the vertex in the primitive.
        vertex: u64,
        /// Description of the fault.
        reason: String,
    },

    /// Error of an index that refers to no vertex.
    #[error(
        "{location}: index {position} is {index}, but mesh '{mesh}', primitive {primitive}, has {vertices} vertices"
    )]
    #[diagnostic(code(scene::index), help("repair the mesh in the modelling tool and export it again"))]
    IndexOutOfRange {
        /// Location of the primitive's `indices`.
        location: Location,
        /// Name of the mesh.
        mesh: String,
        /// Index of the primitive in the mesh.
        primitive: usize,
        /// Position of the faulty index in the list of indices.
        position: u64,
        /// Faulty index, which should be less than `vertices`.
        index: u64,
        /// Number of vertices of the primitive.
        vertices: u64,
    },

    /// Error of a scene with more triangles than a card can address.
    #[error("{}: more than {limit} triangles once every instance is placed", file.display())]
    #[diagnostic(code(scene::too_many_triangles), help("simplify the meshes or place fewer instances"))]
    TooManyTriangles {
        /// Path of the scene file.
        file: PathBuf,
        /// Maximum number of triangles.
        limit: usize,
    },

    /// Error of a scene that exceeds a card's memory even without a photon map.
    #[error("{}: {what} take {needed} bytes of a card's memory or more, and the card has {available}", file.display())]
    #[diagnostic(
        code(scene::too_large),
        help(
            "simplify the meshes, place fewer instances, use fewer materials or smaller textures (`LoadSettings::texture_limit`), or use a card with more memory (an emulated one by `CardAddress::with_memory`)"
        )
    )]
    TooLarge {
        /// Path of the scene file.
        file: PathBuf,
        /// Contents of the scene that exceed the card's memory, such as `8 materials`.
        what: String,
        /// Lower bound of the memory that the scene takes on the card, bytes.
        needed: u64,
        /// Size of the card's memory, bytes.
        available: u64,
    },

    /// Error of a step of loading for which the system refuses the memory.
    #[error("{}: {step} takes {bytes} bytes of memory, which the system does not give", file.display())]
    #[diagnostic(code(scene::memory), help("simplify the scene, or {}", allocation::REMEDY))]
    Memory {
        /// Path of the scene file.
        file: PathBuf,
        /// Step of loading that takes the memory.
        step: &'static str,
        /// Memory that the step needs, bytes.
        bytes: u64,
    },

    /// Error of a material's value that is out of range.
    #[error("{location}: material '{material}': {reason}")]
    #[diagnostic(code(scene::material), help("{remedy}"))]
    Material {
        /// Location of the value.
        location: Location,
        /// Name of the material.
        material: String,
        /// Description of the fault.
        reason: String,
        /// Remedy, which is shown as the help of the error.
        remedy: &'static str,
    },

    /// Error of a file without a scene.
    #[error("{} holds no scene", file.display())]
    #[diagnostic(
        code(scene::no_scene),
        help("export the objects as part of a scene (the glTF array `scenes`)")
    )]
    NoScene {
        /// Path of the file.
        file: PathBuf,
    },

    /// Error of a scene without triangles.
    #[error("{}: the scene has no triangles", file.display())]
    #[diagnostic(
        code(scene::no_geometry),
        help(
            "put at least one triangle mesh into the file's default scene (primitives of mode 4, TRIANGLES)"
        )
    )]
    NoGeometry {
        /// Path of the file.
        file: PathBuf,
    },

    /// Error of a scene whose triangles all have zero area.
    #[error("{}: all {skipped} triangles have zero area", file.display())]
    #[diagnostic(
        code(scene::zero_area),
        help("check the scale of the nodes and the mesh: every triangle collapses to a line or a point")
    )]
    OnlyZeroArea {
        /// Path of the file.
        file: PathBuf,
        /// Number of triangles, all of zero area.
        skipped: usize,
    },

    /// Error of a scene without light.
    #[error("the scene has no light")]
    #[diagnostic(code(scene::no_light), help("{remedy}"))]
    NoLight {
        /// Remedy, which is shown as the help of the error.
        remedy: &'static str,
    },

    /// Error of a camera name that the scene lacks.
    #[error("the scene has no camera '{name}'")]
    #[diagnostic(code(scene::camera), help("{remedy}"))]
    UnknownCamera {
        /// Requested name.
        name: String,
        /// Remedy, with the names of the scene's cameras.
        remedy: String,
    },

    /// Error of an animation name that the scene's file lacks.
    #[error("the scene has no animation '{name}'")]
    #[diagnostic(code(scene::animation), help("choose one of: {animations}"))]
    UnknownAnimation {
        /// Requested name.
        name: String,
        /// Names of the file's animations.
        animations: String,
    },

    /// Error of a variant name that the scene's file lacks.
    #[error("the scene has no variant '{name}'")]
    #[diagnostic(code(scene::variant), help("choose one of: {variants}"))]
    UnknownVariant {
        /// Requested name.
        name: String,
        /// Names of the file's variants.
        variants: String,
    },

    /// Error of a material name that the scene lacks.
    #[error("`{assignment}`: the scene has no material '{material}'")]
    #[diagnostic(code(setting::material), help("choose one of: {nearest}"))]
    UnknownMaterial {
        /// Assignment as given.
        assignment: String,
        /// Requested name.
        material: String,
        /// Material names of the scene that are most similar to the requested one.
        nearest: String,
    },

    /// Error of an assignment that is not of the form `NAME.PROPERTY=VALUE`, or whose value is not possible.
    #[error("`{assignment}`: {reason}")]
    #[diagnostic(code(setting::invalid), help("{remedy}"))]
    Setting {
        /// Assignment as given.
        assignment: String,
        /// Description of the fault.
        reason: String,
        /// Remedy, which is shown as the help of the error.
        remedy: &'static str,
    },
}

impl SceneError {
    /// Creates the error of a step of loading for which the system refuses the memory.
    pub(crate) fn memory(file: &Path, step: &'static str, OutOfMemory { bytes }: OutOfMemory) -> Self {
        Self::Memory { file: file.to_owned(), step, bytes }
    }
}
