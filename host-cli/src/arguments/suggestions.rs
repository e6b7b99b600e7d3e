//! Hints in error messages on this program's equivalents of other renderers' options.

use clap::Command;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

use crate::shell;

/// Commands that render a scene on cards.
const RENDER: &[&str] = &["render", "view", "farm"];
/// Commands with settings of a picture.
const PICTURE: &[&str] = &["render", "prepare", "view", "study sweep", "farm"];
/// Commands that write pictures in several formats.
const WRITE: &[&str] = &["render", "merge", "farm"];

/// Options of other renderers with a remedy, a text that names this program's equivalent options. `commands`
/// lists the commands that have these equivalents; an empty list means all commands.
pub(super) struct Word {
    options: &'static [&'static str],
    pub(super) remedy: &'static str,
    pub(super) commands: &'static [&'static str],
}

/// Options of other renderers. Of several entries for an option, the first one for the given command applies.
pub(super) const OF_OTHERS: [Word; 17] = [
    Word {
        options: &["--samples", "--sample", "--num-samples", "-s"],
        remedy: "the samples of a pixel are stated by --spp N; by default --quality finds them",
        commands: PICTURE,
    },
    Word {
        options: &["--width", "--height", "--resolution", "--res", "-w", "--resx", "--resy"],
        remedy: "the size is stated by --size WIDTHxHEIGHT, or --size 1080p",
        commands: PICTURE,
    },
    Word {
        options: &["--denoiser", "--oidn"],
        remedy: "noise is removed by --denoise, with Open Image Denoise (docs/denoising.md)",
        commands: &["render", "merge", "prepare", "view", "farm"],
    },
    Word {
        options: &["--gpu", "--device", "--cuda", "--optix", "--metal", "--vulkan", "--cycles-device"],
        remedy: "there is no graphics processor to choose: emulated cards run on the processor's cores, others are stated by --card",
        commands: RENDER,
    },
    Word {
        options: THREADS,
        remedy: "the number of chips, each on a core, is stated by --card emulated:N",
        commands: RENDER,
    },
    Word {
        options: THREADS,
        remedy: "the number of threads is stated by --threads N",
        commands: &["prepare", "study"],
    },
    Word {
        options: &["--output", "--out"],
        remedy: "outputs of this command are in its --help",
        commands: &[],
    },
    Word { options: OUTPUT, remedy: "the picture is stated by -o OUT.png or -o OUT.exr", commands: WRITE },
    Word { options: OUTPUT, remedy: "the picture is stated by -o OUT.png", commands: &["tonemap"] },
    Word {
        options: &["--alpha", "--film-transparent"],
        remedy: "a background without the environment, and alpha, are written by photoncard render --transparent",
        commands: &[],
    },
    Word {
        options: &["--bounces", "--max-bounces", "--depth", "--max-depth"],
        remedy: "paths have no number of bounces to state: the photon map has light of all",
        commands: &[],
    },
    Word {
        options: &["--env", "--envmap", "--hdri", "--world", "--background"],
        remedy: "light from infinitely far is stated by --environment FILE or R,G,B, or by --sky LAT,LON,TIME",
        commands: PICTURE,
    },
    Word {
        options: &["--frame", "--start", "--end", "--frame-start", "--frame-end"],
        remedy: "frames are stated by --frames A-B, or --frames N for one",
        commands: &["render", "prepare", "farm"],
    },
    Word {
        options: &["--format", "--render-format"],
        remedy: "the format is that of the ending of -o: OUT.exr or OUT.png",
        commands: WRITE,
    },
    Word {
        options: &["--ev", "--gamma", "--exp"],
        remedy: "the exposure of a PNG is stated by --exposure STOPS, its curve by --tonemap",
        commands: &["render", "merge", "tonemap", "farm"],
    },
    Word {
        options: VERBOSE,
        remedy: "progress is printed by default; --quiet leaves warnings alone, --stats OUT.json has all numbers",
        commands: &["render", "farm"],
    },
    Word {
        options: VERBOSE,
        remedy: "progress is printed by default, and silenced by --quiet",
        commands: &["prepare", "study", "card selftest"],
    },
];

const THREADS: &[&str] = &["--threads", "--cores", "--jobs", "-j", "-t", "--nthreads"];
const OUTPUT: &[&str] = &["--outfile", "--render-output", "--image"];
const VERBOSE: &[&str] = &["--verbose", "-v", "--log-level"];

/// Suffixes of picture files.
const PICTURES: [&str; 5] = [".png", ".exr", ".jpg", ".jpeg", ".part"];

/// Replaces clap's suggestion for an unknown argument by a remedy, if the argument is an option of another
/// renderer or the name of a picture. `given` are all arguments of the process, with the program's name.
pub(super) fn with_suggestion(mut error: Error, program: Command, given: &[String]) -> Error {
    if error.kind() != ErrorKind::UnknownArgument {
        return error;
    }
    let Some(ContextValue::String(argument)) = error.get(ContextKind::InvalidArg) else { return error };
    let Some(remedy) = remedy(argument, &command_of(program, given)) else { return error };
    error.remove(ContextKind::SuggestedArg);
    // Clap's usage line would show the option that it suggested.
    error.remove(ContextKind::Usage);
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![remedy.into()]));
    error
}

/// Returns those of `commands` that this build contains.
pub(super) fn built(commands: &'static [&'static str]) -> impl Iterator<Item = &'static str> {
    commands.iter().copied().filter(|command| cfg!(feature = "study") || !command.starts_with("study"))
}

/// Returns the names of the command and subcommand in `given`, joined by blanks: `render`, `study sweep`.
pub(super) fn command_of(program: Command, given: &[String]) -> String {
    let mut command = program;
    let mut names = Vec::new();
    for word in given.iter().skip(1) {
        let Some(next) = command.find_subcommand(word).cloned() else { continue };
        names.push(next.get_name().to_owned());
        command = next;
    }
    names.join(" ")
}

impl Word {
    /// Returns whether the remedy applies to `command` or to a parent command of `command`.
    fn is_of(&self, command: &str) -> bool {
        let is_within = |of: &&str| {
            command.strip_prefix(*of).is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
        };
        self.commands.is_empty() || self.commands.iter().any(is_within)
    }

    /// Text of the remedy, preceded by the names of its commands if `command` is not among them.
    fn remedy_for(&self, command: &str) -> String {
        if self.is_of(command) {
            return self.remedy.to_owned();
        }
        let commands: Vec<_> = built(self.commands).map(|of| format!("photoncard {of}")).collect();
        format!("of {}: {}", commands.join(", "), self.remedy)
    }
}

fn remedy(argument: &str, command: &str) -> Option<String> {
    let name = argument.split('=').next().unwrap_or(argument);
    let mut words: Vec<_> = OF_OTHERS.iter().filter(|word| word.options.contains(&name)).collect();
    // The sort is stable: entries keep the table's order.
    words.sort_by_key(|word| !word.is_of(command));
    if let Some(word) = words.first() {
        return Some(word.remedy_for(command));
    }
    let endings = match command {
        "tonemap" => &PICTURES[..1],
        command if command == "render" || command.starts_with("farm ") => &PICTURES[..],
        _ => &[],
    };
    let is_picture =
        !name.starts_with('-') && endings.iter().any(|ending| name.to_lowercase().ends_with(ending));
    is_picture.then(|| format!("a picture to write is stated by -o {}", shell::quoted(name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remedies_of_other_commands_name_them() {
        for (argument, command, expected) in [
            ("--samples", "render", Some("the samples")),
            ("--samples", "study sweep", Some("the samples")),
            ("--samples", "emulate", Some("of photoncard render, photoncard prepare")),
            ("--cores", "view", Some("the number of chips")),
            ("--cores", "prepare", Some("the number of threads")),
            ("--cores", "farm slurm", Some("the number of chips")),
            (
                "--threads",
                "tonemap",
                Some("of photoncard render, photoncard view, photoncard farm: the number of chips"),
            ),
            ("--outfile", "tonemap", Some("the picture is stated by -o OUT.png")),
            ("--alpha", "diff", Some("a background")),
            ("a.png", "tonemap", Some("a picture to write is stated by -o a.png")),
            ("a.exr", "tonemap", None),
            ("a.png", "diff", None),
            ("--unheard-of", "render", None),
        ] {
            let said = remedy(argument, command);
            let is_right = match (&said, expected) {
                (Some(said), Some(expected)) => said.starts_with(expected),
                (said, expected) => said.is_none() && expected.is_none(),
            };
            assert!(is_right, "{command} {argument}: {said:?}");
        }
    }
}
