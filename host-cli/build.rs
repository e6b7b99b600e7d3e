//! Embeds the WebAssembly module of a page, if `PHOTONCARD_MODULE` names its file: packages have it.

use std::path::Path;

fn main() {
    println!("cargo::rustc-check-cfg=cfg(has_module)");
    println!("cargo::rerun-if-env-changed=PHOTONCARD_MODULE");
    let Some(path) = std::env::var_os("PHOTONCARD_MODULE").filter(|path| !path.is_empty()) else { return };
    // The compiler looks for a relative path beside the source file.
    let path = std::fs::canonicalize(Path::new(&path)).expect("PHOTONCARD_MODULE names a file");
    println!("cargo::rustc-cfg=has_module");
    println!("cargo::rustc-env=PHOTONCARD_MODULE={}", path.display());
    println!("cargo::rerun-if-changed={}", path.display());
}
