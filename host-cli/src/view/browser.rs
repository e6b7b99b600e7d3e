//! Browser of this machine.

use std::process::{Command, Stdio};

/// Opens an address in the browser.
///
/// # Errors
/// If the program that opens addresses cannot be started.
pub(super) fn open(url: &str) -> std::io::Result<()> {
    let [program, arguments @ ..] = match std::env::consts::OS {
        "macos" => ["open", "", "", ""],
        // The empty text is the window's title.
        "windows" => ["cmd", "/c", "start", "\"\""],
        _ => ["xdg-open", "", "", ""],
    };
    let mut command = Command::new(program);
    command.args(arguments.iter().filter(|argument| !argument.is_empty())).arg(url);
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    // The program ends as soon as it has told the browser; nobody waits for it.
    let _ = std::thread::Builder::new().name("browser".into()).spawn(move || child.wait());
    Ok(())
}
