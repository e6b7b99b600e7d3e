//! Splitting of a GLB into chunks, parsing of the JSON, and its validation.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gltf::json;
use gltf::json::extensions::scene::khr_lights_punctual::Light;
use gltf::json::mesh::Semantic;
use gltf::json::validation::{Checked, Error as Fault, Validate};
use miette::SourceSpan;
use photoncard_picture::allocation;
use photoncard_picture::foreign;
use photoncard_picture::printable::printable;

use super::extensions::{QUANTIZATION, SUPPORTED_EXTENSIONS};
use super::files::{Files, read_file};
use super::json_scan;
use super::other_kinds;
use super::schema::{self, Shortened, UnknownPath};
use super::specular_glossiness::{self, Conversions};
use crate::blender;
use crate::error::{Excerpt, Location, SceneError};

const GLB_MAGIC: &[u8] = b"glTF";
const GLB_HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;
const CHUNK_JSON: u32 = u32::from_le_bytes(*b"JSON");
const CHUNK_BIN: u32 = u32::from_le_bytes(*b"BIN\0");

const INCONSISTENT: &str = "export the scene again; the file is inconsistent";

/// Parsed glTF file whose indices are all valid.
pub(super) struct Document {
    pub(super) path: PathBuf,
    pub(super) root: json::Root,
    /// Bytes of the file. The JSON and the BIN chunk of a GLB are ranges of them.
    bytes: Vec<u8>,
    text: Range<usize>,
    blob: Option<Range<usize>>,
    /// Materials and images that were converted from specular-glossiness.
    pub(super) conversions: Conversions,
    /// Animations from which channels without a target node were removed.
    pub(super) shortened: Shortened,
    /// Channels that were removed because neither glTF nor an extension defines their path.
    pub(super) unknown_paths: Vec<UnknownPath>,
    /// Files in the scene's folder that were read.
    pub(super) files: Files,
    /// True if `TEXCOORD_1` is read where no texture takes it.
    pub(super) has_lightmaps: bool,
}

impl Document {
    /// Lights of `KHR_lights_punctual`.
    pub(super) fn lights(&self) -> &[Light] {
        let extensions = self.root.extensions.as_ref();
        extensions
            .and_then(|root| root.khr_lights_punctual.as_ref())
            .map_or(&[], |extension| &extension.lights)
    }

    pub(super) fn read(path: &Path) -> Result<Self, SceneError> {
        other_kinds::refused_path(path).map_or(Ok(()), Err)?;
        let bytes =
            read_file(path).map_err(|source| SceneError::Unreadable { file: path.to_owned(), source })?;
        let (text, blob) =
            if bytes.starts_with(GLB_MAGIC) { split_glb(path, &bytes)? } else { (0..bytes.len(), None) };
        let parsed = parse(path, &bytes[text.clone()]);
        // The file's name matters only if its JSON cannot be parsed: glTF of any name is read.
        let (mut root, mut shortened) =
            parsed.map_err(|error| other_kinds::refused_file(path, &bytes).unwrap_or(error))?;
        let removed = schema::remove_unknown_paths(&mut root);
        let unknown_paths = match removed.is_empty() {
            true => Vec::new(),
            false => schema::unknown_paths(json_text(&bytes[text.clone()])),
        };
        let of_extensions = |(&index, &count): (&usize, &usize)| {
            let unknown = unknown_paths.iter().filter(|unknown| unknown.animation == index).count();
            (unknown < count).then_some(index)
        };
        shortened.by_extensions.extend(removed.iter().filter_map(of_extensions));
        let (path, conversions, files) = (path.to_owned(), Conversions::default(), Files::default());
        let mut document = Self {
            path,
            root,
            bytes,
            text,
            blob,
            conversions,
            shortened,
            unknown_paths,
            files,
            has_lightmaps: false,
        };
        document.check()?;
        document.conversions = specular_glossiness::convert(&mut document.root);
        Ok(document)
    }

    /// Text of the JSON; its encoding was checked.
    pub(super) fn text(&self) -> &str {
        self.bytes.get(self.text.clone()).map_or("", json_text)
    }

    /// BIN chunk of a GLB.
    pub(super) fn blob(&self) -> Option<&[u8]> {
        self.bytes.get(self.blob.clone()?)
    }

    /// Returns whether Blender's exporter wrote the file.
    pub(super) fn is_of_blender(&self) -> bool {
        blender::is_exporter(self.root.asset.generator.as_deref())
    }

    /// Returns whether `KHR_mesh_quantization` allows integer vertex attributes.
    pub(super) fn is_quantized(&self) -> bool {
        let Self { root, .. } = self;
        root.extensions_used.iter().chain(&root.extensions_required).any(|name| name == QUANTIZATION)
    }

    pub(super) fn location(&self, item: impl Into<String>) -> Location {
        Location::new(&self.path, item)
    }

    pub(super) fn invalid(
        &self,
        item: impl Into<String>,
        reason: impl Into<String>,
        remedy: &'static str,
    ) -> SceneError {
        SceneError::Invalid { location: self.location(item), reason: reason.into(), remedy }
    }

    fn check(&self) -> Result<(), SceneError> {
        self.check_version()?;
        for (i, name) in self.root.extensions_required.iter().enumerate() {
            if !SUPPORTED_EXTENSIONS.contains(&name.as_str()) {
                let location = self.location(format!("extensionsRequired[{i}]"));
                let supported = SUPPORTED_EXTENSIONS.join(", ");
                return Err(SceneError::RequiredExtension { location, name: name.clone(), supported });
            }
        }
        self.check_positions()?;
        self.check_targets()?;
        self.check_rules()
    }

    fn check_version(&self) -> Result<(), SceneError> {
        let asset = &self.root.asset;
        let too_new = asset.min_version.as_deref().is_some_and(|version| version != "2.0");
        if asset.version.starts_with("2.") && !too_new {
            return Ok(());
        }
        let version = asset.min_version.as_deref().unwrap_or(&asset.version);
        let reason = format!("the file is of glTF version {version:?}");
        Err(self.invalid("asset.version", reason, "export the scene as glTF 2.0"))
    }

    /// Checks that the `POSITION` accessor of every primitive exists. The `gltf` crate's validation uses the
    /// accessor's index unchecked.
    fn check_positions(&self) -> Result<(), SceneError> {
        let accessors = self.root.accessors.len();
        for (m, mesh) in self.root.meshes.iter().enumerate() {
            for (p, primitive) in mesh.primitives.iter().enumerate() {
                let position = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
                if let Some(index) = position.filter(|index| index.value() >= accessors) {
                    let item = format!("meshes[{m}].primitives[{p}].attributes.POSITION");
                    let reason = format!("accessor {index} does not exist, there are {accessors}");
                    return Err(self.invalid(item, reason, INCONSISTENT));
                }
            }
        }
        Ok(())
    }

    /// Checks the target nodes of animations, which the `gltf` crate does not validate.
    fn check_targets(&self) -> Result<(), SceneError> {
        let nodes = self.root.nodes.len();
        for (a, animation) in self.root.animations.iter().enumerate() {
            let mut channels = animation.channels.iter().map(|channel| channel.target.node).enumerate();
            if let Some((c, node)) = channels.find(|(_, node)| node.value() >= nodes) {
                let item = format!("animations[{a}].channels[{c}].target.node");
                let reason = format!("node {node} does not exist, there are {nodes}");
                return Err(self.invalid(item, reason, INCONSISTENT));
            }
        }
        Ok(())
    }

    fn check_rules(&self) -> Result<(), SceneError> {
        let Some((path, fault)) = self.first_fault()? else { return Ok(()) };
        let reason = match fault {
            Fault::IndexOutOfBounds => "the index refers to nothing",
            Fault::Invalid => "the value is not one that glTF knows",
            Fault::Missing => "it is missing, or a member that it needs",
            Fault::Oversize => "the size is beyond this machine's limits",
            Fault::Unsupported => "it is not supported",
        };
        // The `gltf` crate's paths have `khrLightsPunctual` for the name of the extension.
        let item = path.as_str().replace("khrLightsPunctual", "KHR_lights_punctual");
        Err(self.invalid(item, reason, "export the scene again, or correct this item of the file"))
    }

    /// First violation of glTF that the loader cannot accept, with its JSON path.
    fn first_fault(&self) -> Result<Option<(json::Path, Fault)>, SceneError> {
        let mut first = None;
        let mut report = |path: &dyn Fn() -> json::Path, fault| {
            if first.is_some() {
                return;
            }
            let path = path();
            // The loader does not use `min` and `max` of accessors: files without them are accepted.
            let is_bound = path.as_str().ends_with(".min") || path.as_str().ends_with(".max");
            // An accessor without a buffer view is all zeros: exporters write such morph targets.
            let is_zeros = fault == Fault::Missing && is_accessors_view(path.as_str());
            // Primitives without positions are not rendered, and attributes of unknown names are not read.
            let is_attribute = ["POSITION", "<invalid semantic name>"]
                .iter()
                .any(|name| ends_in_attribute(path.as_str(), name));
            // `Fault::Unsupported` is of `extensionsRequired`, which was checked before.
            let is_taken = is_bound || is_zeros || is_attribute && fault != Fault::IndexOutOfBounds;
            if !is_taken && fault != Fault::Unsupported {
                first = Some((path, fault));
            }
        };
        foreign::decode(
            || {
                self.root.validate(&self.root, json::Path::new, &mut report);
                Ok(())
            },
            || SceneError::NotGltf { file: self.path.clone(), reason: CONTRADICTION.to_owned() },
        )?;
        Ok(first)
    }
}

/// Returns whether a JSON path, in the notation of the `gltf` crate, ends in vertex attribute `name`.
fn ends_in_attribute(path: &str, name: &str) -> bool {
    path.strip_suffix("\"]")
        .and_then(|path| path.strip_suffix(name))
        .is_some_and(|path| path.ends_with(".attributes[\""))
}

/// Returns whether a JSON path is that of an accessor's own buffer view, not of its sparse elements.
fn is_accessors_view(path: &str) -> bool {
    path.strip_prefix("accessors[")
        .and_then(|rest| rest.split_once(']'))
        .is_some_and(|(_, field)| field == ".bufferView")
}

fn u32_at(bytes: &[u8], offset: usize) -> Option<u32> {
    let word = bytes.get(offset..)?.first_chunk()?;
    Some(u32::from_le_bytes(*word))
}

/// Splits a GLB into the ranges of its JSON and its BIN chunk. Chunks of other types are skipped, as the
/// format requires.
fn split_glb(path: &Path, bytes: &[u8]) -> Result<(Range<usize>, Option<Range<usize>>), SceneError> {
    let truncated = |what, needed: u64, available: usize| SceneError::Truncated {
        file: path.to_owned(),
        what,
        needed,
        available: available as u64,
    };
    let not_gltf = |reason: &str| SceneError::NotGltf { file: path.to_owned(), reason: reason.to_owned() };
    let header = (u32_at(bytes, 4), u32_at(bytes, 8));
    let (Some(version), Some(length)) = header else {
        return Err(truncated("the GLB header", GLB_HEADER as u64, bytes.len()));
    };
    if version == 1 {
        return Err(other_kinds::version_1(path));
    }
    if version != 2 {
        return Err(not_gltf(&format!("it is a GLB of version {version}")));
    }
    let Some(contents) = bytes.get(..length as usize) else {
        return Err(truncated("the GLB", length.into(), bytes.len()));
    };
    let mut start = GLB_HEADER;
    let (mut text, mut blob) = (None, None);
    while start < contents.len() {
        let chunk = &contents[start..];
        let (Some(size), Some(kind)) = (u32_at(chunk, 0), u32_at(chunk, 4)) else {
            return Err(truncated("a chunk header", CHUNK_HEADER as u64, chunk.len()));
        };
        let available = chunk.len() - CHUNK_HEADER;
        if size as usize > available {
            return Err(truncated("a chunk", size.into(), available));
        }
        let data = start + CHUNK_HEADER..start + CHUNK_HEADER + size as usize;
        start = data.end;
        match kind {
            CHUNK_JSON if text.is_none() => text = Some(data),
            CHUNK_BIN if blob.is_none() => blob = Some(data),
            _ if text.is_none() => return Err(not_gltf("the first chunk of the GLB is not JSON")),
            _ => {}
        }
    }
    text.map(|text| (text, blob)).ok_or_else(|| not_gltf("the GLB has no JSON chunk"))
}

/// Parses the JSON. Returns the document, and the animations from which channels were removed.
fn parse(path: &Path, bytes: &[u8]) -> Result<(json::Root, Shortened), SceneError> {
    let not_gltf = |reason: &str| SceneError::NotGltf { file: path.to_owned(), reason: reason.to_owned() };
    let text = str::from_utf8(bytes).map_err(|_| not_gltf("it is neither a GLB nor UTF-8 text"))?;
    let text = without_padding(text);
    if text.trim().is_empty() {
        return Err(not_gltf("it is empty"));
    }
    let json_scan::Scanned { bytes, repeated_key, extras } =
        json_scan::scan(text).ok_or_else(|| SceneError::Invalid {
            location: Location::new(path, ""),
            reason: format!(
                "its {} bytes of JSON would take more than {} bytes of memory",
                text.len(),
                json_scan::limit(text)
            ),
            remedy: "leave out what is empty: most of its nodes, materials, meshes or extras say nothing",
        })?;
    let check =
        |bytes| allocation::check(bytes).map_err(|error| SceneError::memory(path, "reading its JSON", error));
    check(bytes)?;
    if let Some(item) = repeated_key {
        return Err(SceneError::Invalid {
            location: Location::new(path, item),
            reason: "the key stands twice in its object, and readers take either of its values".to_owned(),
            remedy: "leave one of the two out, or export the scene again: in glTF each key stands once",
        });
    }
    let strict = foreign::decode(|| Ok(json::Root::from_str(text)), || not_gltf(CONTRADICTION))?;
    match strict {
        Ok(root) => Ok((root, Shortened::default())),
        Err(error) if error.is_data() => {
            // `parse_amended` holds the document twice: as JSON values, and as types of the `gltf` crate.
            check(bytes.saturating_mul(2))?;
            foreign::decode(|| Ok(parse_amended(path, text, &extras)), || not_gltf(CONTRADICTION))?
        }
        Err(error) => Err(json_error(path, text, &error)),
    }
}

/// Parses valid JSON that the types of the `gltf` crate reject, after [`schema::amend`] has changed it.
fn parse_amended(
    path: &Path,
    text: &str,
    extras: &[Range<usize>],
) -> Result<(json::Root, Shortened), SceneError> {
    // `extras` may contain what `serde_json::Value` cannot hold, such as 1e999.
    let document = serde_json::from_str(text);
    let document = document.or_else(|error| serde_json::from_str(&without(text, extras)).map_err(|_| error));
    let mut document = document.map_err(|error| json_error(path, text, &error))?;
    if schema::is_of_version_1(&document) {
        return Err(other_kinds::version_1(path));
    }
    let shortened = schema::amend(&mut document);
    let root = json::Root::from_str(&document.to_string()).map_err(|_| {
        let (item, reason) = schema::violation(&document);
        let remedy = "export the scene again, or correct this item of the file: it violates glTF's schema";
        SceneError::Invalid { location: Location::new(path, item), reason, remedy }
    })?;
    Ok((root, shortened))
}

/// Returns `text` with `null` in place of the values at these byte ranges, which are in ascending order.
fn without(text: &str, values: &[Range<usize>]) -> String {
    let mut rest = 0;
    let mut kept = String::with_capacity(text.len());
    for value in values {
        kept += text.get(rest..value.start).unwrap_or_default();
        kept += "null";
        rest = value.end;
    }
    kept + text.get(rest..).unwrap_or_default()
}

const CONTRADICTION: &str = "its structure contradicts itself";

/// Text of UTF-8 bytes without padding; empty if the bytes are not UTF-8.
fn json_text(bytes: &[u8]) -> &str {
    str::from_utf8(bytes).map_or("", without_padding)
}

/// Removes a byte order mark, and the zeros with which some exporters pad a chunk.
fn without_padding(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text).trim_end_matches('\0')
}

/// Creates the error of invalid JSON. It shows an excerpt of the faulty line, because the whole line may
/// contain a buffer in base64.
fn json_error(path: &Path, text: &str, error: &serde_json::Error) -> SceneError {
    const CONTEXT: usize = 100;
    let above = error.line().saturating_sub(1);
    let line = text.lines().nth(above).unwrap_or_default();
    let at = char_boundary(line, error.column().saturating_sub(1));
    let start = char_boundary(line, at.saturating_sub(CONTEXT));
    let end = char_boundary(line, at + CONTEXT);
    let next = at + line[at..].chars().next().map_or(0, char::len_utf8);
    // The excerpt is escaped here, in three parts, since the error points into it by offset.
    let [before, here, after] = [start..at, at..next, next..end.max(next)].map(|part| printable(&line[part]));
    let file = path.display().to_string();
    SceneError::Json {
        message: error.to_string(),
        text: Arc::new(Excerpt {
            name: printable(&file).into(),
            part: format!("{before}{here}{after}"),
            place: [above, start],
        }),
        at: SourceSpan::new(before.len().into(), here.len()),
        file,
    }
}

/// Last character boundary at or before `index`.
fn char_boundary(text: &str, index: usize) -> usize {
    let index = index.min(text.len());
    (0..=index).rev().find(|&index| text.is_char_boundary(index)).unwrap_or(0)
}
