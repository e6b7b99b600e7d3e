//! Arguments of `photoncard study`.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use photoncard_driver::choice::Choice;
use photoncard_driver::render::ChipModel;
use photoncard_driver::study::{Axis, SampleRate, Scale, Study, SymbolAxes};

use super::choice::possible_value;
use super::machine::MachineOptions;
use super::study_output::StudyOutput;
use super::sweep::SweepArguments;

/// Arguments of `photoncard study`: the name of a built-in study, or the command `sweep` or `merge`.
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
    #[arg(
        long,
        value_name = "CHIP",
        help = format!(
            "Chips that render, for the studies {}: {} [default: reference chips]",
            names(ON_CHIPS),
            ChipModel::forms()
        )
    )]
    pub(crate) card: Option<ChipModel>,
    #[arg(
        long,
        value_name = "SYMBOL=VALUE,VALUE",
        value_parser = symbol,
        help = "Evaluate the formulas of table-7.1 also for other values of its symbols, such as R_IC=0.2,0.4; may be repeated: \
                every combination is a row of varied.csv"
    )]
    vary: Vec<Axis>,
    // The machine is not a part of `StudyOutput`: an optional group of options cannot contain another group.
    #[command(flatten)]
    machine: MachineOptions,
}

/// Studies whose points are rendered on any chips.
const ON_CHIPS: &[Study] = &[Study::Reordering, Study::Table71, Study::Scaling, Study::Interactive];

fn names(studies: &[Study]) -> String {
    studies.iter().map(|study| study.name()).collect::<Vec<_>>().join(", ")
}

impl StudyArguments {
    /// Scale of the studies that `name` selects.
    ///
    /// # Errors
    /// If an option is not for these studies, or a symbol or one of its values is not possible.
    pub(crate) fn scale(&self, name: Selection, sample: SampleRate) -> Result<Scale, String> {
        let studies = name.studies();
        let other = studies.iter().find(|study| !ON_CHIPS.contains(study));
        if let (Some(model), Some(other)) = (&self.card, other) {
            return Err(format!(
                "--card {model} is not for {}, whose chips are fixed; use it with one of {}",
                other.name(),
                names(ON_CHIPS)
            ));
        }
        if !self.vary.is_empty() && studies != [Study::Table71] {
            return Err(format!(
                "--vary is of symbols of {0}; use it with {0}, or photoncard study sweep",
                Study::Table71.name()
            ));
        }
        let of_file = self.card.as_ref().map(ChipModel::rates).unwrap_or_default();
        let scale = if self.quick { Scale::QUICK } else { Scale::FULL };
        let scale = scale.with_sample(sample).on(self.machine.rates().or(of_file).machine());
        let symbols = (!self.vary.is_empty()).then(|| SymbolAxes::new(self.vary.clone())).transpose();
        let symbols = symbols.map_err(|error| error.to_string())?;
        Ok(Scale { model: self.card.clone(), symbols, ..scale })
    }
}

/// Parses `SYMBOL=VALUE,VALUE`.
fn symbol(text: &str) -> Result<Axis, String> {
    let (name, values) = text.split_once('=').ok_or("write SYMBOL=VALUE,VALUE, such as R_IC=0.2,0.4")?;
    let values = values.split(',').map(|value| value.trim().to_owned()).collect();
    Ok(Axis { name: name.to_owned(), values })
}

#[derive(Subcommand)]
pub(crate) enum StudyCommand {
    /// Measure a scene of your own over any values of settings, caches and chips
    Sweep(Box<SweepArguments>),
    /// Write the report of a study whose parts were measured by --part, from their folders; the scene must be
    /// where the parts had it
    Merge(StudyMergeArguments),
}

#[derive(Args)]
pub(crate) struct StudyMergeArguments {
    /// Folders of all parts
    #[arg(required = true, value_name = "DIR")]
    pub(crate) parts: Vec<PathBuf>,
    /// The folder for reports and the points of all parts; it is made if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Show no notices
    #[arg(long)]
    pub(crate) quiet: bool,
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
