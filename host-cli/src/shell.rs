//! Commands for a POSIX shell.

pub(crate) use photoncard_driver::printable::shell_word as quoted;

/// Command line of this program with the arguments, quoted for a shell.
pub(crate) fn command(arguments: impl IntoIterator<Item = String>) -> String {
    let arguments = arguments.into_iter().map(|argument| quoted(&argument).into_owned());
    std::iter::once("photoncard".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}

#[cfg(all(test, unix))]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn a_shell_reads_quoted_words_as_they_are() {
        for word in
            ["", "a", "a b", "it's", "'", "\"$HOME\"", "`id`;&|<>*?~#!\\", "-x=1,2:3", "a\nb", "\u{e4} {}"]
        {
            let script = format!("printf %s {}", quoted(word));
            let output = Command::new("sh").args(["-c", &script]).output().unwrap();
            assert_eq!(String::from_utf8(output.stdout).unwrap(), word);
        }
    }
}
