//! Commands of the program with their options, read from its manual pages, and checks of arguments by the
//! program itself.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use super::repository;
use crate::support::Room;

/// Options by command. A key is the command's words after `photoncard`, separated by spaces.
pub(crate) struct CommandTree {
    room: Room,
    options: BTreeMap<String, BTreeSet<String>>,
}

impl CommandTree {
    pub(crate) fn new() -> Self {
        let room = Room::new();
        assert_eq!(room.run(&["man", "pages"]).status, Some(0));
        let mut options = BTreeMap::new();
        for entry in fs::read_dir(room.path("pages")).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let words: Vec<_> = name.strip_suffix(".1").unwrap().split('-').skip(1).collect();
            let page = String::from_utf8(room.read(&format!("pages/{name}"))).unwrap();
            options.insert(words.join(" "), options_of_page(&page));
        }
        assert!(options.len() > 5 && options["render"].contains("--size"), "{options:?}");
        Self { room, options }
    }

    /// Returns the longest command that `words` begin with.
    fn command(&self, words: &[&str]) -> Option<String> {
        let beginnings = (1..=words.len()).rev().map(|length| words[..length].join(" "));
        beginnings.into_iter().find(|command| self.options.contains_key(command))
    }

    /// Returns whether a text begins with a command.
    pub(crate) fn is_command(&self, text: &str) -> bool {
        self.command(&text.split_whitespace().collect::<Vec<_>>()).is_some()
    }

    /// Commands that have all of the wanted options.
    pub(crate) fn commands_with(&self, wanted: &[&str]) -> Vec<&str> {
        let having = self.options.iter().filter(|(_, has)| wanted.iter().all(|&option| has.contains(option)));
        having.map(|(command, _)| command.as_str()).collect()
    }

    /// Returns a message if the program refuses these arguments. An appended `--help` makes the program only
    /// parse them.
    pub(crate) fn defect_of_arguments(&self, arguments: &[&str]) -> Option<String> {
        let outcome = self.room.run(&[arguments, &["--help"]].concat());
        let said = outcome.stderr.trim();
        (outcome.status != Some(0)).then(|| format!("`photoncard {}`: {said}", arguments.join(" ")))
    }

    /// Defects of a line of a synopsis, which is a command with placeholders and, after two spaces, its
    /// description.
    pub(crate) fn defects_of_synopsis(&self, line: &str) -> Vec<String> {
        let (form, description) = line.split_once("  ").unwrap_or((line, ""));
        let words: Vec<_> = form.split_whitespace().collect();
        let mut defects = match words[..] {
            ["photoncard", ref words @ ..] => self.defects_of_form(words),
            [program, ..] if program.contains('/') => {
                repository::defect_of_script(program).into_iter().collect()
            }
            _ => vec![format!("`{line}` is no form of a command")],
        };
        let unknown = options_in(description).filter(|&option| self.commands_with(&[option]).is_empty());
        defects.extend(unknown.map(|option| format!("no command has {option}")));
        defects
    }

    /// Defects of the words after `photoncard`, which may contain placeholders.
    pub(crate) fn defects_of_form(&self, words: &[&str]) -> Vec<String> {
        // Without a command the options are `--help` and `--version`.
        if words.first().is_none_or(|word| word.starts_with('-')) {
            return Vec::new();
        }
        let form = words.join(" ");
        let command = self.command(words).filter(|command| !self.lacks(command, &form));
        let Some(command) = command else { return vec![format!("there is no command `photoncard {form}`")] };
        let unknown = options_in(&form).filter(|&option| !self.options[&command].contains(option));
        unknown.map(|option| format!("`photoncard {command}` has no {option}")).collect()
    }

    /// Returns whether `group` has subcommands, and the next word of `form` is none of them.
    fn lacks(&self, group: &str, form: &str) -> bool {
        let below = form[group.len()..].trim_start();
        let is_group = self.options.keys().any(|command| command.starts_with(&format!("{group} ")));
        let word =
            below.split_whitespace().next().filter(|word| word.starts_with(|c: char| c.is_ascii_lowercase()));
        let is_refused = |word| {
            self.defect_of_arguments(&[&group.split(' ').collect::<Vec<_>>()[..], &[word]].concat()).is_some()
        };
        is_group && word.is_some_and(is_refused)
    }
}

/// Long options that occur in a text.
pub(crate) fn options_in(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-'));
    words.filter(|word| word.len() > 2 && word.starts_with("--"))
}

/// Options that a manual page describes. A line that begins with a bold option names one option, with its
/// short form.
fn options_of_page(page: &str) -> BTreeSet<String> {
    let page = page.replace("\\-", "-").replace("\\fR", " ");
    let described =
        page.lines().filter(|line| line.starts_with("\\fB-")).map(|line| line.replace("\\fB", " "));
    described.flat_map(|line| options_in(&line).map(str::to_owned).collect::<Vec<_>>()).collect()
}
