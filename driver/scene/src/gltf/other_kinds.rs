//! Recognises files that are not glTF by content or name, and proposes the command that converts them.

use std::path::{Path, PathBuf};

use photoncard_picture::printable::shell_word;

use crate::error::SceneError;

/// Remedy for formats that no program converts completely.
const BY_HAND: &str =
    "open it in the program that wrote it, or import it into Blender, and export glTF 2.0 (.glb)";

/// First bytes of files, and extensions of their names.
type Signs = (&'static [&'static [u8]], &'static [&'static str]);

/// Formats other than glTF, with the signs by which they are recognised.
const KINDS: [(Signs, Kind); 15] = [
    ((&[b"photoncard partial render "], &[]), Kind::Partial),
    ((&[b"photoncard part "], &[]), Kind::Part),
    ((&[b"BLENDER"], &["blend", "blend1"]), Kind::Blender),
    ((&[b"Kaydara FBX Binary", b"; FBX"], &["fbx"]), Kind::Imported("an FBX file", "import_scene.fbx")),
    (
        (&[b"PXR-USDC", b"#usda"], &["usd", "usda", "usdc", "usdz"]),
        Kind::Imported("a USD file", "wm.usd_import"),
    ),
    ((&[b"PK\x03\x04"], &["zip"]), Kind::Zip),
    ((&[b"ply\n", b"ply\r"], &["ply"]), Kind::Imported("a PLY file", "wm.ply_import")),
    ((&[], &["obj"]), Kind::Imported("a Wavefront OBJ file", "wm.obj_import")),
    ((&[], &["stl"]), Kind::Imported("an STL file", "wm.stl_import")),
    ((&[], &["abc"]), Kind::Imported("an Alembic file", "wm.alembic_import")),
    (
        (&[], &["dae", "3ds", "x3d", "lwo", "max", "ma", "mb", "c4d", "skp"]),
        Kind::ByHand("a scene of another format"),
    ),
    ((&[], &["pbrt"]), Kind::ByHand("a pbrt scene")),
    ((&[], &["xml"]), Kind::ByHand("an XML file, such as a scene of Mitsuba")),
    ((&[b"photoncard prepared scene "], &["card"]), Kind::Prepared),
    (
        (
            &[b"\x89PNG", b"\xff\xd8\xff", b"\x76\x2f\x31\x01", b"#?RADIANCE"],
            &["exr", "hdr", "png", "jpg", "jpeg"],
        ),
        Kind::Picture,
    ),
];

#[derive(Clone, Copy)]
enum Kind {
    Blender,
    /// Format that Blender imports: its name, and Blender's import operator.
    Imported(&'static str, &'static str),
    Zip,
    ByHand(&'static str),
    /// File of the finished tiles of an interrupted render.
    Partial,
    /// File of a part of a picture. `photoncard merge` joins the parts.
    Part,
    Prepared,
    Picture,
}

/// Returns the error of a path that is a folder or a URL; `None` for other paths.
pub(super) fn refused_path(path: &Path) -> Option<SceneError> {
    let text = path.to_string_lossy();
    let is_scheme =
        |scheme: &str| scheme.len() > 1 && scheme.bytes().all(|byte| byte.is_ascii_alphanumeric());
    if let Some((_, rest)) = text.split_once("://").filter(|(scheme, _)| is_scheme(scheme)) {
        let name = rest.split(['?', '#']).next().unwrap_or_default().rsplit('/').next().unwrap_or_default();
        let name = if name.is_empty() { "scene.glb" } else { name };
        let remedy = format!("download it: curl -L -o {} {}", shell_word(name), shell_word(&text));
        return Some(other(path, "an address, and scenes are read from files", remedy));
    }
    if !path.is_dir() {
        return None;
    }
    let remedy = match scene_within(path) {
        Some(scene) => format!("give the scene in it: {}", shell_word(&scene.to_string_lossy())),
        None => "give a file .gltf or .glb".to_owned(),
    };
    Some(other(path, "a folder", remedy))
}

/// Returns the error of a file that is recognised as another format; `None` if it is not.
pub(super) fn refused_file(path: &Path, bytes: &[u8]) -> Option<SceneError> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let is_of = |((starts, endings), _): &&(Signs, Kind)| {
        let has_start = starts.iter().any(|start| bytes.starts_with(start));
        has_start || ending.as_deref().is_some_and(|ending| endings.contains(&ending))
    };
    let (_, kind) = KINDS.iter().find(is_of)?;
    let file = path.to_string_lossy();
    let made = path.with_extension("glb").to_string_lossy().into_owned();
    let (what, remedy) = match kind {
        Kind::Blender => ("a file of Blender", export(&file, "", &made)),
        Kind::Imported(what, import) => {
            let empty = "bpy.ops.wm.read_factory_settings(use_empty=True); ";
            let import = format!("{empty}bpy.ops.{import}(filepath={}); ", python(&file));
            (*what, export("", &import, &made))
        }
        Kind::Zip => {
            let folder = path.with_extension("").to_string_lossy().into_owned();
            let remedy = format!(
                "unpack it and give the .gltf or .glb in it: unzip {} -d {}",
                shell_word(&file),
                shell_word(&folder)
            );
            ("a ZIP archive", remedy)
        }
        Kind::ByHand(what) => (*what, BY_HAND.to_owned()),
        Kind::Partial => {
            let is_beside_picture = ending.as_deref() == Some("partial");
            let (renaming, picture) = match is_beside_picture {
                true => (String::new(), path.with_extension("")),
                false => (format!("mv {} OUT.exr.partial && ", shell_word(&file)), PathBuf::from("OUT.exr")),
            };
            let picture = picture.to_string_lossy();
            let remedy = format!(
                "give the scene of that render, which goes on from them: {renaming}photoncard render SCENE.glb -o {} --resume",
                shell_word(&picture)
            );
            ("a file of finished tiles of a render", remedy)
        }
        Kind::Part => {
            let made = path.with_extension("exr").to_string_lossy().into_owned();
            let remedy = format!(
                "merge it with the others: photoncard merge {} OTHERS.part -o {}",
                shell_word(&file),
                shell_word(&made)
            );
            ("a part of a picture", remedy)
        }
        Kind::Prepared => {
            let remedy =
                format!("render it as it is prepared: photoncard render --prepared {}", shell_word(&file));
            ("a prepared scene", remedy)
        }
        Kind::Picture => (
            "a picture",
            "give a glTF scene, .gltf or .glb; an environment map is given by --environment".to_owned(),
        ),
    };
    Some(other(path, what, remedy))
}

/// Error of a file of glTF 1.0.
pub(super) fn version_1(path: &Path) -> SceneError {
    let file = path.to_string_lossy();
    let made = path.with_extension("2.glb").to_string_lossy().into_owned();
    let remedy = format!("convert it: npx gltf-pipeline -i {} -o {}", shell_word(&file), shell_word(&made));
    other(path, "a glTF 1.0 scene", remedy)
}

fn other(path: &Path, what: &'static str, remedy: String) -> SceneError {
    SceneError::OtherFormat { file: path.to_owned(), what, remedy }
}

/// Remedy with a shell command. Blender opens `file`, or runs the Python line `import`, and exports glTF.
fn export(file: &str, import: &str, made: &str) -> String {
    let made = python(made);
    let code = format!(
        "import bpy; {import}bpy.ops.export_scene.gltf(filepath={made}, export_lights=True, export_cameras=True)"
    );
    let file = if file.is_empty() { String::new() } else { format!("{} ", shell_word(file)) };
    format!("convert it by Blender: blender -b {file}--python-expr {}", shell_word(&code))
}

/// Text as a Python string literal.
fn python(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Scene file in a folder: the only one, or the first by name.
fn scene_within(folder: &Path) -> Option<PathBuf> {
    let is_scene = |path: &PathBuf| {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        matches!(ending.as_deref(), Some("gltf" | "glb"))
    };
    let entries = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    entries.filter(is_scene).min()
}
