//! Arguments of `photoncard study`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use photoncard_driver::choice::Choice;
use photoncard_driver::study::{SampleRate, Study};

use super::choice::possible_value;
use super::threads::threads;

#[derive(Args)]
pub(crate) struct StudyArguments {
    /// Study to run
    #[arg(value_name = "NAME", value_parser = Selection::parser())]
    pub(crate) name: Selection,
    /// The folder for reports and finished points; it is made if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// A small picture and few values: about a minute a study
    #[arg(long)]
    pub(crate) quick: bool,
    /// The share of the tiles that is rendered where not all are needed
    #[arg(long, value_name = "SHARE", default_value = "1/17", allow_hyphen_values = true)]
    pub(crate) sample: SampleRate,
    /// The folder of photoncard's own scenes
    #[arg(long, value_name = "DIR", default_value = "scenes")]
    pub(crate) scenes: PathBuf,
    /// Threads, an emulated chip on each [default: a thread a core]
    #[arg(long, value_parser = threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<usize>,
    /// Show no progress
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Studies by a name.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Selection {
    One(Study),
    All,
}

impl Selection {
    /// The name of all studies together.
    const ALL: &str = "all";

    /// Parser of the studies' names and of the one for all.
    fn parser() -> impl TypedValueParser<Value = Self> {
        let all = PossibleValue::new(Self::ALL).help("All of them, each in a folder of its own");
        let studies = Study::ALL.iter().copied().map(possible_value);
        PossibleValuesParser::new(studies.chain([all])).try_map(|name: String| {
            if name == Self::ALL { Ok(Self::All) } else { Study::of_name(&name).map(Self::One) }
        })
    }

    /// The studies.
    pub(crate) fn studies(self) -> Vec<Study> {
        match self {
            Self::One(study) => vec![study],
            Self::All => Study::ALL.to_vec(),
        }
    }

    /// Returns whether the reports are a collection, each in a folder of its own.
    pub(crate) fn is_collection(self) -> bool {
        matches!(self, Self::All)
    }
}
