//! Options of `photoncard page`.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
pub(crate) struct PageOptions {
    /// Folder of the page; it is made if it is missing
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
    /// A scene to choose on the page: a file .glb, or a .gltf that names no other files; repeated for more
    #[arg(long = "scene", value_name = "SCENE")]
    pub(crate) scenes: Vec<PathBuf>,
    /// The WebAssembly module, by host-cli/module.sh [default: that of the program's package]
    #[arg(long, value_name = "FILE")]
    pub(crate) module: Option<PathBuf>,
}
