//! Arguments of `photoncard study`.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use photoncard_driver::choice::Choice;
use photoncard_driver::study::Study;

use super::choice::possible_value;
use super::machine::MachineOptions;
use super::study_output::StudyOutput;
use super::sweep::SweepArguments;

/// Arguments of `photoncard study`: the name of a built-in study, or the command `sweep`.
#[derive(Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct StudyArguments {
    #[command(subcommand)]
    pub(crate) own: Option<StudyCommand>,
    /// Study to run
    // The name is required unless a command is stated.
    #[arg(value_name = "NAME", value_parser = Selection::parser(), required = true)]
    pub(crate) name: Option<Selection>,
    /// Measure small pictures and few values: about a minute per study
    #[arg(long)]
    pub(crate) quick: bool,
    /// The folder of photoncard's own scenes
    #[arg(long, value_name = "DIR", default_value = "scenes")]
    pub(crate) scenes: PathBuf,
    #[command(flatten)]
    pub(crate) output: Option<StudyOutput>,
    // The machine is not a part of `StudyOutput`: an optional group of options cannot contain another group.
    #[command(flatten)]
    pub(crate) machine: MachineOptions,
}

#[derive(Subcommand)]
pub(crate) enum StudyCommand {
    /// Measure a scene of your own over any values of settings, caches and chips
    Sweep(Box<SweepArguments>),
}

/// Studies that a name selects.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Selection {
    One(Study),
    All,
}

impl Selection {
    /// Name that selects all studies.
    const ALL: &str = "all";

    /// Parser of the names of studies and of `all`.
    fn parser() -> impl TypedValueParser<Value = Self> {
        let all = PossibleValue::new(Self::ALL).help("All of them, each in a folder of its own");
        let studies = Study::ALL.iter().copied().map(possible_value);
        PossibleValuesParser::new(studies.chain([all])).try_map(|name: String| {
            if name == Self::ALL { Ok(Self::All) } else { Study::of_name(&name).map(Self::One) }
        })
    }

    pub(crate) fn studies(self) -> Vec<Study> {
        match self {
            Self::One(study) => vec![study],
            Self::All => Study::ALL.to_vec(),
        }
    }

    /// Returns whether each study has a folder of its own.
    pub(crate) fn is_collection(self) -> bool {
        matches!(self, Self::All)
    }
}
