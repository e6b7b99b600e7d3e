//! Arguments that state a study, apart from those of its output.

use std::ffi::OsString;
use std::path::Path;

use clap::Parser;
use miette::MietteDiagnostic;

use crate::arguments::{Arguments, Command, StudyArguments};
use crate::failure::Failure;
use crate::shell;

/// Options with a value on which no number depends.
const WITH_VALUE: [&str; 4] = ["--out", "-o", "--part", "--threads"];
/// Option without a value on which no number depends.
const QUIET: &str = "--quiet";

/// Arguments of this process that its numbers depend on, from `study` on.
pub(super) fn stated() -> Vec<String> {
    of_numbers(std::env::args_os().skip(1).map(|argument| argument.to_string_lossy().into_owned()))
}

/// Command line of these arguments, quoted; the program is named `photoncard`, without its folder.
pub(super) fn line(stated: &[String]) -> String {
    shell::command(stated.iter().cloned())
}

/// Parses the arguments that state a study, with its output in `out`. Returns the words and what they mean.
///
/// # Errors
/// If this program does not take the arguments.
pub(super) fn parse(stated: &[String], out: &Path) -> Result<(Vec<OsString>, StudyArguments), Failure> {
    let mut words: Vec<OsString> =
        std::iter::once("photoncard").chain(stated.iter().map(String::as_str)).map(Into::into).collect();
    let mut output = OsString::from("--out=");
    output.push(out);
    words.insert(end_of_options(&words), output);
    let refused = |reason: &str| {
        let text =
            format!("the parts are of `{}`, which is no study of this program: {reason}", line(stated));
        let help = "measure the parts by photoncard study NAME --part K/N --out DIR";
        Failure::input(MietteDiagnostic::new(text).with_help(help))
    };
    match Arguments::try_parse_from(&words).map(|arguments| arguments.command) {
        Ok(Command::Study(arguments)) => Ok((words, arguments)),
        Ok(_) => Err(refused("another command")),
        Err(error) => {
            let text = error.to_string();
            let reason = text.lines().next().unwrap_or_default();
            Err(refused(reason.strip_prefix("error: ").unwrap_or(reason)))
        }
    }
}

/// Index of the first word that is no option: words after `--` are none.
pub(super) fn end_of_options(words: &[OsString]) -> usize {
    words.iter().position(|word| word == "--").unwrap_or(words.len())
}

/// Leaves out the options on which no number depends.
fn of_numbers(words: impl Iterator<Item = String>) -> Vec<String> {
    let mut kept = Vec::new();
    let mut words = words.peekable();
    while let Some(word) = words.next() {
        if word == "--" {
            kept.push(word);
            kept.extend(words);
            break;
        }
        if WITH_VALUE.contains(&word.as_str()) {
            words.next();
        } else if word != QUIET && !is_with_value(&word) {
            kept.push(word);
        }
    }
    kept
}

/// Returns whether a word is one of [`WITH_VALUE`] with its value, such as `--out=a` or `-oa`.
fn is_with_value(word: &str) -> bool {
    WITH_VALUE.iter().any(|option| {
        word.strip_prefix(option).is_some_and(|rest| rest.starts_with('=') || !option.starts_with("--"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_number_depends_on_is_left_out() {
        for (given, kept) in [
            ("study scaling --out a", "study scaling"),
            ("study -o a scaling --quick --part 1/2", "study scaling --quick"),
            ("study -oa --threads=3 scaling --out=b --part=1/2 --quiet", "study scaling"),
            ("study sweep --vary order=naive,sort a.glb -o=x", "study sweep --vary order=naive,sort a.glb"),
            ("study sweep --out a -- --out", "study sweep -- --out"),
            ("study sweep a.glb --order sort --outer", "study sweep a.glb --order sort --outer"),
        ] {
            let words = of_numbers(given.split(' ').map(str::to_owned));
            assert_eq!(words.join(" "), kept);
        }
    }

    #[test]
    fn recorded_arguments_are_read_with_another_folder() {
        let stated = ["study", "sweep", "a.glb", "--vary", "tile=4,8"].map(str::to_owned);
        let Ok((words, arguments)) = parse(&stated, "my out".as_ref()) else {
            panic!("no sweep: {stated:?}")
        };
        assert!(words.contains(&"--out=my out".into()) && arguments.own.is_some());
        assert!(parse(&["render".to_owned()], "out".as_ref()).is_err());
        assert!(parse(&["study".to_owned(), "figure-0".to_owned()], "out".as_ref()).is_err());
    }
}
