//! Sorts the words of a command line by the steps of a job to which they belong.

use clap::{Arg, ArgAction, Command};
use miette::{MietteDiagnostic, Report};

use crate::arguments::Step;
use crate::failure::Failure;

/// Clap's ids of options that a job states itself, or that a job cannot have.
const OF_NO_JOB: [&str; 12] = [
    "photons_for",
    "part",
    "prepared",
    "resume",
    "stats",
    "counters",
    "cache",
    "time",
    "noise",
    "keep_samples",
    "trace",
    "progress",
];

/// Error of an option that is not for a job.
pub(super) fn not_for_a_job(option: &str) -> Failure {
    refusal(
        &format!("{option} is not for a farm's job"),
        "leave it out: tasks state what they need themselves",
    )
}

pub(super) fn refusal(text: &str, help: &str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

/// Words of a command line, sorted by the steps of a farm's job that take them.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Words {
    pub(super) scene: Vec<String>,
    /// Options of the scene, of photons and of the integrator.
    pub(super) prepare: Vec<String>,
    /// Options that preparation and render both need.
    pub(super) both: Vec<String>,
    /// Options of cards and of the order of the work.
    pub(super) render: Vec<String>,
    /// Options of the picture's files.
    pub(super) merge: Vec<String>,
}

impl Words {
    /// Sorts `given`, arguments of `command`, by the steps of the job that take them.
    ///
    /// # Errors
    /// Returns the name of an option that is not allowed in a job.
    pub(super) fn new(given: impl IntoIterator<Item = String>, command: &Command) -> Result<Self, String> {
        let mut words = Self::default();
        for (option, given) in options(given, command) {
            let Some(option) = option else {
                words.scene.extend(given);
                continue;
            };
            let name = given[0].split('=').next().unwrap_or_default();
            for room in words.rooms(option).ok_or_else(|| name.to_owned())? {
                room.extend(given.iter().cloned());
            }
        }
        Ok(words)
    }

    /// Returns the lists to which the words of an option are appended; an empty list for an option of the job
    /// itself, such as `--parts`. `None` for an option that is not allowed in a job.
    fn rooms(&mut self, option: &Arg) -> Option<Vec<&mut Vec<String>>> {
        if OF_NO_JOB.contains(&option.get_id().as_str()) {
            return None;
        }
        Some(match Step::of(option) {
            Step::Prepare => vec![&mut self.prepare],
            Step::Both => vec![&mut self.both],
            Step::PrepareAndMerge => vec![&mut self.prepare, &mut self.merge],
            Step::Render => vec![&mut self.render],
            Step::Merge => vec![&mut self.merge],
            Step::Job => Vec::new(),
        })
    }
}

/// Divides `given`, arguments of `command`, into options with their values, and other words.
pub(super) fn options(
    given: impl IntoIterator<Item = String>,
    command: &Command,
) -> Vec<(Option<&Arg>, Vec<String>)> {
    let mut divided = Vec::new();
    let mut given = given.into_iter();
    while let Some(word) = given.next() {
        let (name, has_value) = match word.split_once('=') {
            Some((name, _)) if name.starts_with("--") => (name, true),
            _ => (&*word, false),
        };
        let is_short = name.starts_with("-o");
        let is_named = |long: Option<&str>| long.is_some_and(|long| name.strip_prefix("--") == Some(long));
        let option = (command.get_arguments())
            .find(|option| is_named(option.get_long()) || is_short && option.get_short() == Some('o'));
        let takes_value =
            option.is_some_and(|option| matches!(option.get_action(), ArgAction::Set | ArgAction::Append));
        let is_whole = has_value || is_short && name.len() > 2;
        if option.is_none() && word == "--" {
            continue;
        }
        let value = if takes_value && !is_whole { given.next() } else { None };
        divided.push((option, [word].into_iter().chain(value).collect()));
    }
    divided
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::arguments::Arguments;

    fn words_of(line: &str) -> Result<Words, String> {
        let command = Arguments::command();
        let farm = command.find_subcommand("farm").and_then(|farm| farm.find_subcommand("slurm")).unwrap();
        Words::new(line.split(' ').map(str::to_owned), farm)
    }

    #[test]
    fn words_are_sorted_by_the_steps_that_take_them() {
        let line = "--size 8x8 --photons=9 a.gltf -o b.exr --quiet --card emulated:1 --irradiance-cache on --parts 3 -oc.png \
                    --sample-type half --tile 8 --set -x.y=1 --frames=1-2 --denoise";
        let words = words_of(line).unwrap();
        assert_eq!(words.scene, ["a.gltf"]);
        assert_eq!(words.both, ["--size", "8x8", "--quiet"]);
        assert_eq!(
            words.prepare,
            ["--photons=9", "--irradiance-cache", "on", "--set", "-x.y=1", "--denoise"]
        );
        assert_eq!(words.render, ["--card", "emulated:1", "--tile", "8"]);
        assert_eq!(words.merge, ["-o", "b.exr", "-oc.png", "--sample-type", "half", "--denoise"]);
    }

    #[test]
    fn options_of_a_single_render_are_refused() {
        for option in [
            "--part=1/2",
            "--prepared",
            "--resume",
            "--stats",
            "--counters",
            "--cache=photon=64K/128/4",
            "--time",
            "--noise=0.1",
            "--keep-samples",
        ] {
            let name = option.split('=').next().unwrap();
            assert_eq!(words_of(&format!("a.gltf {option}")), Err(name.to_owned()));
        }
    }

    /// Each name in [`OF_NO_JOB`] is the id of an option.
    #[test]
    fn every_listed_name_is_an_option() {
        let command = Arguments::command();
        let farm = command.find_subcommand("farm").and_then(|farm| farm.find_subcommand("slurm")).unwrap();
        for name in OF_NO_JOB {
            assert!(farm.get_arguments().any(|argument| argument.get_id() == name), "{name}");
        }
    }

    #[test]
    fn a_prepared_scene_takes_no_option_of_its_preparation() {
        let mut command = Arguments::command();
        command.build();
        let farm = command.find_subcommand("farm").and_then(|farm| farm.find_subcommand("slurm")).unwrap();
        let prepared = farm.get_arguments().find(|option| option.get_id() == "prepared").unwrap();
        let conflicts = farm.get_arg_conflicts_with(prepared);
        let of_jobs = farm.get_arguments().filter(|option| !OF_NO_JOB.contains(&option.get_id().as_str()));
        for option in of_jobs {
            let is_refused = conflicts.iter().any(|other| other.get_id() == option.get_id());
            assert_eq!(is_refused, Step::of(option) == Step::Prepare, "{}", option.get_id());
        }
    }
}
