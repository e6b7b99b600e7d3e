//! Option `--prepared`, and the assignment of the options of `photoncard render` to the steps of a render
//! farm's job.

use clap::error::{ContextKind, ContextValue, Error, ErrorKind};
use clap::{Arg, Args, Command, Id};

use super::frames::FrameOptions;
use super::integrator::IntegratorOptions;
use super::photons::PhotonOptions;
use super::samples::SampleOptions;
use super::scene::SceneOptions;

/// Steps of a render farm's job whose commands take a given option of `photoncard render`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// The preparation: the prepared scene depends on the option.
    Prepare,
    /// The preparation and the renders of parts.
    Both,
    /// The preparation and the merge of the parts.
    PrepareAndMerge,
    /// The renders of parts.
    Render,
    /// The merge of the parts.
    Merge,
    /// None: the job itself takes the option.
    Job,
}

impl Step {
    /// Returns the steps that take `option`. Most options are assigned by their heading in the help.
    pub(crate) fn of(option: &Arg) -> Self {
        match option.get_id().as_str() {
            // By their headings, if they have any, these options would be of other steps.
            "quality" => Self::Prepare,
            "threads" | "quiet" | "card_memory" => Self::Both,
            "denoise" => Self::PrepareAndMerge,
            "display_server" => Self::Render,
            "frames" | "parts" => Self::Job,
            _ => match option.get_help_heading() {
                Some("Scene" | "Frames" | "Photon maps" | "Rays and samples") => Self::Prepare,
                Some("Picture and camera") => Self::Both,
                Some("Outputs") => Self::Merge,
                _ => Self::Render,
            },
        }
    }
}

/// Ids of the options of `photoncard prepare`, which `--prepared` excludes.
fn of_preparation() -> impl Iterator<Item = Id> {
    let groups = [
        SceneOptions::augment_args,
        FrameOptions::augment_args,
        PhotonOptions::augment_args,
        IntegratorOptions::augment_args,
        SampleOptions::augment_args,
    ];
    let all = groups.iter().fold(Command::new("prepare"), |command, add| add(command));
    let prepared = all.get_arguments().filter(|option| Step::of(option) == Step::Prepare);
    let prepared: Vec<Id> = prepared.map(|option| option.get_id().clone()).collect();
    prepared.into_iter().chain(["quality".into()])
}

#[derive(Args)]
pub(crate) struct PreparedOption {
    /// SCENE is a file that photoncard prepare has written: no glTF file is read, and no photon is traced
    ///
    /// The scene and the settings of photons, rays and samples are those of photoncard prepare. Options of
    /// the picture and of its camera are stated as for a glTF file. If frames were prepared, --frames selects
    /// those to render, and SCENE has a run of # if several files were written.
    #[arg(long, help_heading = "Scene", conflicts_with_all = of_preparation())]
    pub(crate) prepared: bool,
}

/// Adds a remedy to `error` if it says that `--prepared` excludes an option of `photoncard prepare`.
pub(super) fn with_remedy(mut error: Error) -> Error {
    let names = |option: &str| {
        [ContextKind::InvalidArg, ContextKind::PriorArg].into_iter().any(|kind| match error.get(kind) {
            Some(ContextValue::String(name)) => name.starts_with(option),
            Some(ContextValue::Strings(names)) => names.iter().any(|name| name.starts_with(option)),
            _ => false,
        })
    };
    // `photoncard prepare` has no `--photons-for`: prepared photons are for all cameras.
    if error.kind() == ErrorKind::ArgumentConflict && names("--prepared") && !names("--photons-for") {
        let remedy = "state it to photoncard prepare: the prepared scene depends on it";
        let remedy = ContextValue::StyledStrs(vec![remedy.into()]);
        let _ = error.insert(ContextKind::Suggested, remedy);
    }
    error
}
