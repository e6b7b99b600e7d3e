//! Points (measurements) of `photoncard study sweep`. A point has the arguments of the command line, but
//! other values of the varied options.

use std::collections::BTreeSet;
use std::ffi::OsString;

use clap::{CommandFactory, FromArgMatches};
use miette::{MietteDiagnostic, Report};
use photoncard_driver::emulator::memory_model::CacheSettings;
use photoncard_driver::render::ChipModel;
use photoncard_driver::scene::Scene;
use photoncard_driver::study::{
    ALONG_CURVE, AxisError, Extent, Hardware, Point, Provenance, Sweep, SweepOptions, Task,
};

use super::command::end_of_options;
use crate::arguments::{
    Arguments, CACHE, CHIP, Command, StudyArguments, StudyCommand, StudyOutput, SweepArguments,
};
use crate::console::say;
use crate::failure::Failure;
use crate::input;
use crate::notices::{self, Uses};

/// Name of a varied option, without its leading dashes, and one of the option's values.
type Value<'a> = (&'a str, &'a str);

/// Loads the scene of a sweep and creates its points. `words` are the words of the arguments.
pub(super) fn options(
    arguments: &SweepArguments,
    words: &[OsString],
    provenance: Provenance,
) -> Result<SweepOptions, Failure> {
    if !arguments.scene.light_groups.is_empty() {
        let report = MietteDiagnostic::new("a sweep has no --light-groups");
        return Err(Failure::Input(Report::new(
            report.with_help("leave it out: the groups of a picture share their gathers"),
        )));
    }
    let scene = input::load(&arguments.scene, u64::from(u32::MAX))?;
    let name = input::name(&arguments.scene);
    let picture = arguments.point(&name, arguments.model()).settings.picture;
    notices::say_ignored(&arguments.scene, &scene, &Uses::of(&arguments.scene, &picture, None))?;
    let mut notices = BTreeSet::new();
    let sweep = Sweep::new(arguments.axes(), |values| {
        let made = point((arguments, words), &values, &scene, &mut notices);
        made.map_err(PointError)
    });
    let sweep = sweep.map_err(|PointError(failure)| failure)?;
    if !arguments.output.quiet {
        notices.iter().for_each(|notice| say(format_args!("photoncard: {notice}")));
    }
    // Assignments (`--set`) belong to the settings of each point, not to the sweep's inputs.
    let inputs = input::provenance(&arguments.scene).into_iter().filter(|(name, _)| name != "set");
    let mut settings: Vec<_> = inputs.map(|(name, value)| (name, value.to_string())).collect();
    settings.push(("scene-checksum".to_owned(), scene.checksum().to_owned()));
    let provenance = Provenance { settings, ..provenance };
    let StudyOutput { out, threads, .. } = &arguments.output;
    let (out, threads) = (out.clone(), *threads);
    Ok(SweepOptions { sweep, name, scene, out, threads, provenance, extent: Extent::Whole })
}

/// Returns the point of the sweep at which the options have these values, with its hardware, and adds notices
/// about it to `notices`. If no size is stated, the picture has the camera's aspect ratio.
fn point(
    (arguments, words): (&SweepArguments, &[OsString]),
    values: &[Value],
    scene: &Scene,
    notices: &mut BTreeSet<String>,
) -> Result<(Point, Hardware), Failure> {
    let (caches, others): (Vec<_>, Vec<_>) = values.iter().copied().partition(|(name, _)| *name == CACHE);
    let (capacities, others): (Vec<_>, Vec<_>) =
        others.into_iter().partition(|(name, _)| name.starts_with(CHIP));
    let (curve, others): (Vec<_>, Vec<_>) =
        others.into_iter().partition(|value| *value == ("order", ALONG_CURVE));
    let replaced = replaced(words, &others).map_err(|error| refused(&others, &reason(&error)))?;
    let arguments = replaced.as_ref().unwrap_or(arguments);
    let model = with_capacities(arguments.model().clone(), &capacities)?;
    let mut point = arguments.point(&input::name(&arguments.scene), &model);
    point.is_along_curve = !curve.is_empty();
    if let (Some((_, text)), Task::Traffic { caches: behind, .. }) = (caches.first(), &mut point.task) {
        *behind = cache(text).map_err(|reason| refused(&caches, &reason))?;
    }
    if let Task::Traffic { caches, .. } = &point.task {
        notices.extend(beyond_chip(&model, caches));
    }
    let camera = point.settings.camera(scene)?;
    notices.extend(arguments.picture().fit(&camera, &mut point.settings.picture));
    Ok((point, arguments.hardware(&model)))
}

/// Replaces capacities of a chip by values of `--vary chip.NAME=`.
fn with_capacities(model: ChipModel, values: &[Value]) -> Result<ChipModel, Failure> {
    values.iter().try_fold(model, |model, (name, value)| {
        let capacity = name.strip_prefix(CHIP).unwrap_or(name);
        model.with_capacity(capacity, value).map_err(|error| refused(values, &error.to_string()))
    })
}

/// Parses the words of a sweep's arguments with `values` added; `None` if there are no values.
fn replaced(words: &[OsString], values: &[Value]) -> Result<Option<SweepArguments>, clap::Error> {
    if values.is_empty() {
        return Ok(None);
    }
    // With `args_override_self` the last of repeated options counts.
    let command = Arguments::command().mut_subcommand("study", |study| {
        study.mut_subcommand("sweep", |sweep| sweep.args_override_self(true))
    });
    let added = values.iter().map(|(name, value)| format!("--{name}={value}").into());
    let mut given = words.to_vec();
    let end = end_of_options(words);
    given.splice(end..end, added);
    let matches = command.try_get_matches_from(given)?;
    match Arguments::from_arg_matches(&matches)?.command {
        Command::Study(StudyArguments { own: Some(StudyCommand::Sweep(sweep)), .. }) => Ok(Some(*sweep)),
        _ => Ok(None),
    }
}

/// Notice about caches that are larger than the on-chip memory of `chip`.
fn beyond_chip(chip: &ChipModel, caches: &CacheSettings) -> Option<String> {
    let (taken, all) = (caches.bytes(), u64::from(chip.kind().budget().sram_bytes));
    (taken > all).then(|| {
        format!(
            "cache={caches} takes {taken} bytes, and the chip {chip} has {all} in all: its traffic is that of a \
             larger chip"
        )
    })
}

/// Parses a value of `--vary cache=`: caches in the syntax of `--cache`, or the photon cache's SIZE/LINE/WAYS
/// or SIZE.
fn cache(text: &str) -> Result<CacheSettings, String> {
    match (text.contains('='), text.contains('/')) {
        (true, _) => text.parse(),
        (false, true) => format!("photon={text}").parse(),
        (false, false) => format!("photon={text}/128/4").parse(),
    }
}

/// First paragraph of clap's error about an argument, in one line.
fn reason(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    text.split("\n\n").next().unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Error that `--vary` cannot take these values together; `reason` says why.
fn refused(values: &[Value], reason: &str) -> Failure {
    let values: Vec<_> = values.iter().map(|(name, value)| format!("{name}={value}")).collect();
    let text = format!("--vary {} is not possible: {reason}", values.join(" with "));
    let help = "correct the values; photoncard study sweep --help names those of each option";
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

/// Failure to create a point or the axes of a sweep.
struct PointError(Failure);

impl From<AxisError> for PointError {
    fn from(error: AxisError) -> Self {
        Self(Failure::input(error))
    }
}

#[cfg(test)]
mod tests {
    use photoncard_driver::choice::Choice;
    use photoncard_driver::emulator::EmulatedKind;

    use super::*;

    #[test]
    fn caches_beyond_the_memory_of_a_chip_are_reported() {
        for (chip, caches, is_beyond) in [
            (EmulatedKind::Reference, "photon=128K/128/4", false),
            (EmulatedKind::Reference, "unified=1M/128/16", false),
            (EmulatedKind::Reference, "photon=1M/128/16,scene=75K/128/4", true),
            (EmulatedKind::Micro, "unified=512K/128/16", true),
        ] {
            let said = beyond_chip(&chip.into(), &caches.parse().unwrap());
            assert_eq!(said.is_some_and(|said| said.contains(chip.name())), is_beyond, "{caches}");
        }
    }
}
