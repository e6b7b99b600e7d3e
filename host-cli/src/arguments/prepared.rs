//! Option of a render whose input is a prepared scene.

use clap::error::{ContextKind, ContextValue, Error, ErrorKind};
use clap::{Args, Command, Id};

use super::frames::FrameOptions;
use super::headings::SCENE;
use super::integrator::IntegratorOptions;
use super::photons::PhotonOptions;
use super::samples::SampleOptions;
use super::scene::SceneOptions;
use super::steps::Step;

/// Ids of the options that belong to `photoncard prepare`.
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
    /// The scene, its photons, rays and samples are those that were stated to photoncard prepare. Options of
    /// the picture and of its camera are stated as for a glTF file. Of frames that were prepared --frames
    /// states those to render, and SCENE has a run of # where there is a file for each.
    #[arg(long, help_heading = SCENE, conflicts_with_all = of_preparation())]
    pub(crate) prepared: bool,
}

/// Adds a remedy to an error about an option that belongs to `photoncard prepare`.
pub(super) fn with_remedy(mut error: Error) -> Error {
    let names = |option: &str| {
        [ContextKind::InvalidArg, ContextKind::PriorArg].into_iter().any(|kind| match error.get(kind) {
            Some(ContextValue::String(name)) => name.starts_with(option),
            Some(ContextValue::Strings(names)) => names.iter().any(|name| name.starts_with(option)),
            _ => false,
        })
    };
    // Prepared photons are for all cameras.
    if error.kind() == ErrorKind::ArgumentConflict && names("--prepared") && !names("--photons-for") {
        let remedy = "state it to photoncard prepare: the prepared scene depends on it";
        let remedy = ContextValue::StyledStrs(vec![remedy.into()]);
        let _ = error.insert(ContextKind::Suggested, remedy);
    }
    error
}
