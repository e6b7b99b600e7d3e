//! Checks that the reference of commands in `docs/cli.md` equals the one generated from the arguments.
//! `UPDATE_DOCS=1 cargo test -p photoncard --features study reference` writes it.

use std::collections::BTreeMap;
use std::fs;
use std::iter::once;
use std::path::Path;

use clap::error::ErrorKind;
use clap::{Arg, Command, CommandFactory as _, Parser as _};

use crate::arguments::Arguments;

/// Line that ends the hand-written part of the document.
const HEADING: &str = "\n## Commands\n";

/// Root command, built so that the names of all commands below it are known.
fn program() -> Command {
    let mut command = Arguments::command().disable_help_subcommand(true);
    command.build();
    command
}

/// Returns a command and all commands below it.
fn with_commands_below(command: &Command) -> Vec<&Command> {
    once(command).chain(command.get_subcommands().flat_map(with_commands_below)).collect()
}

/// Full name of a command, such as `photoncard card info`.
fn name(command: &Command) -> &str {
    command.get_bin_name().unwrap_or(command.get_name())
}

/// Returns the arguments that appear in the help, without `--help` and `--version`.
fn shown(command: &Command) -> impl Iterator<Item = &Arg> {
    let hidden = ["help", "version"];
    command
        .get_arguments()
        .filter(move |argument| !argument.is_hide_set() && !hidden.contains(&argument.get_id().as_str()))
}

/// Converts help text to Markdown: options become code, and special characters are escaped.
fn prose(help: &impl ToString) -> String {
    let word = |word: &str| {
        let option = word.trim_end_matches(['.', ',', ':', ';', ')', ']']);
        let is_option = option.len() > 2 && option.starts_with("--");
        let (code, rest) = if is_option { word.split_at(option.len()) } else { ("", word) };
        let code = if is_option { format!("`{code}`") } else { String::new() };
        let escape = |c: char| if "<*_|`".contains(c) { format!("\\{c}") } else { c.to_string() };
        code + &rest.chars().map(escape).collect::<String>()
    };
    help.to_string().split_whitespace().map(word).collect::<Vec<_>>().join(" ")
}

/// Appends the full stop that help texts leave out.
fn sentence(text: String) -> String {
    if text.ends_with(['.', ':']) { text } else { text + "." }
}

/// Names and value of an argument, as help texts show them: `-o, --output OUT.exr`.
fn forms(argument: &Arg) -> String {
    let values = argument.get_value_names().unwrap_or_default().join(" ");
    let short = argument.get_short().map(|short| format!("-{short}"));
    let long = argument.get_long().map(|long| format!("--{long}"));
    let names = short.into_iter().chain(long).collect::<Vec<_>>().join(", ");
    let takes_values = argument.is_positional() || argument.get_action().takes_values();
    if takes_values { format!("{names} {values}").trim().to_owned() } else { names }
}

/// Markdown list item of an argument: names, help, default and possible values.
fn item(argument: &Arg) -> String {
    let help = argument.get_long_help().or(argument.get_help()).expect("the argument has help").to_string();
    let mut parts: Vec<_> = help.split("\n\n").map(|paragraph| sentence(prose(&paragraph))).collect();
    let defaults: Vec<_> =
        argument.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
    let takes_values = argument.is_positional() || argument.get_action().takes_values();
    if takes_values && !defaults.is_empty() {
        parts.push(format!("Default: `{}`.", defaults.join(" ")));
    }
    let values = argument.get_possible_values().into_iter();
    let values = values.filter(|value| takes_values && !value.is_hide_set()).map(|value| {
        let help = value.get_help().map(|help| format!(": {}", prose(help)));
        format!("  - `{}`{}\n", value.get_name(), help.unwrap_or_default())
    });
    format!("- `{}`: {}\n{}", forms(argument), parts.join(" "), values.collect::<String>())
}

/// Arguments grouped by heading, in the order of the help.
fn groups(command: &Command) -> Vec<(&str, Vec<&Arg>)> {
    let mut groups: Vec<(&str, Vec<&Arg>)> = Vec::new();
    for argument in shown(command) {
        let own = if argument.is_positional() { "Arguments" } else { "Options" };
        let heading = argument.get_help_heading().unwrap_or(own);
        match groups.iter_mut().find(|(name, _)| *name == heading) {
            Some((_, arguments)) => arguments.push(argument),
            None => groups.push((heading, vec![argument])),
        }
    }
    groups
}

/// Returns the Markdown section of a command. `described` maps each list item of an earlier section to the
/// command of that section: an equal item is only named, with a link to that section.
fn section(command: &Command, described: &mut BTreeMap<String, String>) -> String {
    let about = sentence(prose(command.get_about().expect("the command has help")));
    let usage = command.clone().render_usage().to_string();
    let usage: Vec<_> = usage.trim_start_matches("Usage:").lines().map(str::trim).collect();
    let mut text =
        format!("\n### {}\n\n{about}\n\n```text synopsis\n{}\n```\n", name(command), usage.join("\n"));
    let mut known: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (heading, arguments) in groups(command) {
        let mut items = String::new();
        for (argument, item) in arguments.into_iter().map(|argument| (argument, item(argument))) {
            if let Some(of) = described.get(&item) {
                known.entry(of.clone()).or_default().push(format!("`{}`", forms(argument)));
            } else {
                items += &item;
                described.insert(item, name(command).to_owned());
            }
        }
        if !items.is_empty() {
            text += &format!("\n#### {heading}\n\n{items}");
        }
    }
    for (of, forms) in known {
        text += &format!("\nAs for [`{of}`](#{}): {}.\n", of.replace(' ', "-"), forms.join(", "));
    }
    text
}

/// Returns the generated part of the document: a list of commands, and a section for each.
fn reference(program: &Command) -> String {
    let commands = &with_commands_below(program)[1..];
    let line = |command: &&Command| {
        let about = sentence(prose(command.get_about().expect("the command has help")));
        format!("- [`{0}`](#{1}): {about}\n", name(command), name(command).replace(' ', "-"))
    };
    let mut described = BTreeMap::new();
    let sections = commands.iter().map(|command| section(command, &mut described)).collect::<String>();
    format!("\n{}{sections}", commands.iter().map(line).collect::<String>())
}

#[test]
fn the_reference_in_the_document_equals_the_generated_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/cli.md");
    let document = fs::read_to_string(&path).expect("the document can be read");
    let (written, is) = document.split_once(HEADING).expect("the document has the heading");
    let expected = reference(&program());
    if is == expected {
        return;
    }
    let differing = is.lines().zip(expected.lines()).find(|(is, expected)| is != expected);
    assert!(std::env::var_os("UPDATE_DOCS").is_some(), "UPDATE_DOCS=1 writes docs/cli.md: {differing:?}");
    fs::write(&path, [written, HEADING, &expected].concat()).expect("written");
}

#[test]
fn the_reference_has_every_option_of_every_command() {
    #[derive(clap::Parser)]
    #[command(name = "tool")]
    enum Tool {
        /// Paint with <paint>
        Paint {
            /// The colour, see --wash [default: by --wash]
            ///
            /// Any of them.
            #[arg(short, long, default_value = "red", value_parser = ["red", "blue"])]
            colour: String,
            /// Wash the brush
            #[arg(long, help_heading = "Brush")]
            wash: bool,
        },
        /// Draw
        Draw {
            /// The page
            page: String,
            /// Wash the brush
            #[arg(long)]
            wash: bool,
            #[arg(long, hide = true)]
            secret: bool,
        },
    }
    let mut tool = Tool::command().disable_help_subcommand(true);
    tool.build();
    let expected = "
- [`tool paint`](#tool-paint): Paint with \\<paint>.
- [`tool draw`](#tool-draw): Draw.

### tool paint

Paint with \\<paint>.

```text synopsis
tool paint [OPTIONS]
```

#### Options

- `-c, --colour COLOUR`: The colour, see `--wash` [default: by `--wash`]. Any of them. Default: `red`.
  - `red`
  - `blue`

#### Brush

- `--wash`: Wash the brush.

### tool draw

Draw.

```text synopsis
tool draw [OPTIONS] <PAGE>
```

#### Arguments

- `PAGE`: The page.

As for [`tool paint`](#tool-paint): `--wash`.
";
    assert_eq!(reference(&tool), expected);
}

#[test]
fn every_command_and_every_argument_has_help() {
    let program = program();
    let commands = with_commands_below(&program);
    assert!(commands.len() > 15, "{} commands are not all", commands.len());
    for command in commands {
        assert!(command.get_about().is_some(), "{}", name(command));
        for argument in shown(command) {
            assert!(argument.get_help().is_some(), "{}: {}", name(command), forms(argument));
        }
        let help = Arguments::try_parse_from(name(command).split(' ').chain(once("--help")));
        let help = help.err().unwrap_or_else(|| panic!("{} has no --help", name(command)));
        assert_eq!(help.kind(), ErrorKind::DisplayHelp, "{help}");
        let usage = format!("Usage: {}", name(command));
        assert!(help.to_string().contains(&usage), "{help}");
    }
}
