//! Command `photoncard page`: a page that has its own host, as files for any web server.

use std::fs;
use std::path::{Component, Path, PathBuf};

use miette::{MietteDiagnostic, Report};
use photoncard_driver::output;
use photoncard_shared::checksum::Checksum;
use serde_json::{Value, json};

use crate::arguments::PageOptions;
use crate::console::print;
use crate::failure::Failure;
use crate::view::page_files::pages;
use crate::web_module;

/// Name of the module in the folder.
const MODULE: &str = "photoncard.wasm";
/// List of the files that a page keeps for use without a network.
const LIST: &str = "files.json";
/// Line of `index.html` that says where the host is.
const COMMANDS_HOST: &str = "<meta name=\"host\" content=\"command\">";
/// Content policy, place of the host and manifest, in the line's place. Nothing is loaded from elsewhere, and
/// no script runs but the folder's own.
const OWN_HOST: &str = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; \
    worker-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data: blob:; manifest-src 'self'; base-uri 'none'; form-action 'none'\">\n\
    <meta name=\"host\" content=\"page\">\n<link rel=\"manifest\" href=\"manifest.webmanifest\">";
/// Placeholder of the version in the service worker.
const VERSION: &str = "VERSION";

/// Name of a file in the folder, and its contents.
type File = (String, Vec<u8>);

/// Writes the folder of a page.
pub(crate) fn run(options: &PageOptions) -> Result<(), Failure> {
    let module = web_module::read(options.module.as_deref())?;
    let scenes = scenes(&options.scenes)?;
    let folder = &options.folder;
    check_folder(folder)?;
    let files = files(module, scenes);
    let outdated = outdated(folder, &files);
    for (name, bytes) in &files {
        write(&folder.join(name), bytes)?;
    }
    for path in outdated {
        fs::remove_file(&path).map_err(|error| Failure::work_error(&error))?;
    }
    print(&[format!("{}: {} files, for any web server", folder.display(), files.len())])
}

/// Files of a page with its module and its scenes.
fn files(module: Vec<u8>, scenes: Vec<File>) -> Vec<File> {
    let mut files = vec![(MODULE.to_owned(), module)];
    let list: Vec<Value> =
        scenes.iter().map(|(file, _)| json!({ "file": file, "title": title(file) })).collect();
    files.push(("scenes.json".into(), json!(list).to_string().into_bytes()));
    files.extend(scenes);
    files.extend(
        pages().map(|(name, text)| (name.to_owned(), text.replace(COMMANDS_HOST, OWN_HOST).into_bytes())),
    );
    // A browser takes a changed service worker for a new version of all files.
    let version = version(&files);
    for (_, bytes) in files.iter_mut().filter(|(name, _)| name == "offline.js") {
        *bytes = String::from_utf8_lossy(bytes).replace(VERSION, &version).into_bytes();
    }
    let names = files.iter().map(|(name, _)| name.as_str()).filter(|name| *name != "offline.js");
    let names: Vec<&str> = ["./"].into_iter().chain(names).collect();
    // The list is written first: by it the next run knows the folder again, also if this one is interrupted.
    files.insert(0, (LIST.into(), json!(names).to_string().into_bytes()));
    files
}

/// Checks that a folder is new, empty, or one that this command has written.
fn check_folder(folder: &Path) -> Result<(), Failure> {
    let is_foreign = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some())
        && !folder.join(LIST).is_file();
    if is_foreign {
        return Err(refused(format!("{} has other files", folder.display()), "state a new or empty folder"));
    }
    Ok(())
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    fs::read(path)
        .map_err(|error| refused(format!("cannot read {}: {error}", path.display()), "check the path"))
}

fn refused(text: String, help: &str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

/// Files of an earlier page in the folder that the page no longer has, such as other scenes.
fn outdated(folder: &Path, files: &[File]) -> Vec<PathBuf> {
    let listed = fs::read(folder.join(LIST)).unwrap_or_default();
    let listed: Vec<String> = serde_json::from_slice(&listed).unwrap_or_default();
    // Names that lead out of the folder are none of this command's.
    let is_inside =
        |name: &str| Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    let is_old = |name: &String| is_inside(name) && !files.iter().any(|(file, _)| file == name);
    listed.into_iter().filter(is_old).map(|name| folder.join(name)).filter(|path| path.is_file()).collect()
}

/// Reads scenes for the page's list.
fn scenes(paths: &[PathBuf]) -> Result<Vec<File>, Failure> {
    let mut scenes: Vec<File> = Vec::new();
    for path in paths {
        let scene = scene(path)?;
        if scenes.iter().any(|(name, _)| *name == scene.0) {
            return Err(refused(format!("two scenes have the name {}", scene.0), "rename one of them"));
        }
        scenes.push(scene);
    }
    Ok(scenes)
}

/// Reads a scene for the page's list, under `scenes/` in the folder.
fn scene(path: &Path) -> Result<File, Failure> {
    let bytes = read(path)?;
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let Some(gltf) = json_of(&bytes) else {
        return Err(refused(format!("{} is no glTF file", path.display()), "state a file .glb or .gltf"));
    };
    if names_files(&gltf) {
        return Err(refused(
            format!("{} names other files", path.display()),
            "convert it to one file .glb, such as by: npx gltf-pipeline -i scene.gltf -o scene.glb",
        ));
    }
    Ok((format!("scenes/{name}"), bytes))
}

/// JSON of a glTF file. That of a GLB is its first chunk, behind twenty bytes of heads.
fn json_of(bytes: &[u8]) -> Option<Value> {
    let text = match bytes.strip_prefix(b"glTF") {
        None => bytes,
        Some(rest) => {
            let length = u32::from_le_bytes(rest.get(8..12)?.try_into().ok()?);
            rest.get(16..)?.get(..length as usize)?
        }
    };
    serde_json::from_slice(text).ok()
}

/// Returns whether the JSON of a glTF file names other files: a URI that has no data itself.
fn names_files(gltf: &Value) -> bool {
    let of = |list: &str| gltf[list].as_array().cloned().unwrap_or_default();
    of("buffers")
        .iter()
        .chain(&of("images"))
        .any(|entry| entry["uri"].as_str().is_some_and(|uri| !uri.starts_with("data:")))
}

/// Name of a scene on its button.
fn title(file: &str) -> String {
    let stem = Path::new(file).file_stem().map(|stem| stem.to_string_lossy().replace(['-', '_'], " "));
    stem.unwrap_or_default()
}

/// Number that changes with any byte of the files.
fn version(files: &[File]) -> String {
    let mut checksum = Checksum::default();
    for (name, bytes) in files {
        checksum.update(name.as_bytes());
        checksum.update(bytes);
    }
    format!("{:08x}", checksum.value())
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|error| Failure::folder(folder, &error))?;
    }
    output::write(path, bytes).map_err(|error| Failure::work_error(&error))
}
