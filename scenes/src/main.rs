//! Writes the shipped scenes into the folder that the first argument names, by default the folder of this
//! crate.

use std::path::PathBuf;
use std::process::ExitCode;
use std::{env, fs};

fn main() -> ExitCode {
    let folder =
        env::args_os().nth(1).map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    for scene in photoncard_scenes::scenes() {
        let path = folder.join(scene.name);
        if let Err(error) = fs::write(&path, &scene.bytes) {
            eprintln!("cannot write {}: {error}", path.display());
            return ExitCode::FAILURE;
        }
        println!("{}  {} bytes", path.display(), scene.bytes.len());
    }
    ExitCode::SUCCESS
}
