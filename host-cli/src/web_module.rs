//! WebAssembly module that browsers run, as a host or as a card.

use std::path::Path;

use miette::{MietteDiagnostic, Report};

use crate::failure::Failure;

/// Place of the module in a package, from the folder of the program.
const PACKED: &str = "../share/photoncard/photoncard.wasm";
/// First bytes of a WebAssembly module.
const MAGIC: &[u8] = b"\0asm";
const BUILD: &str = "build it by host-cli/module.sh FILE";

/// Reads the module: the stated one, or that of this program's package.
///
/// # Errors
/// If no module is found, or the file cannot be read or is no WebAssembly module.
pub(crate) fn read(stated: Option<&Path>) -> Result<Vec<u8>, Failure> {
    let packed = std::env::current_exe().ok().and_then(|program| Some(program.parent()?.join(PACKED)));
    let packed = packed.filter(|path| stated.is_none() && path.is_file());
    let Some(path) = stated.or(packed.as_deref()) else {
        let text = "the WebAssembly module is not beside this program".to_owned();
        return Err(refused(text, &format!("{BUILD}, and state it: --module FILE")));
    };
    let bytes = std::fs::read(path)
        .map_err(|error| refused(format!("cannot read {}: {error}", path.display()), "check the path"))?;
    if !bytes.starts_with(MAGIC) {
        return Err(refused(format!("{} is no WebAssembly module", path.display()), BUILD));
    }
    Ok(bytes)
}

fn refused(text: String, help: &str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}
