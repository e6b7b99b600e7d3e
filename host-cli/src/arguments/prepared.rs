//! Option of a render whose input is a prepared scene.

use clap::Args;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

/// Ids of the options that belong to `photoncard prepare`.
pub(crate) const OF_PREPARATION: [&str; 29] = [
    "assignments",
    "energy_compensation",
    "variant",
    "light_units",
    "environment",
    "environment_rotation",
    "strict",
    "quality",
    "photons",
    "photon_map",
    "neighbors",
    "caustic_photons",
    "caustic_neighbors",
    "max_distance",
    "radiance",
    "seed",
    "gather_rays",
    "shadow_rays",
    "spp",
    "planned_spp",
    "sampling",
    "irradiance_cache",
    "ic_error",
    "adaptive",
    "time",
    "noise",
    "keep_samples",
    "animations",
    "fps",
];

#[derive(Args)]
pub(crate) struct PreparedOption {
    /// SCENE is a file that photoncard prepare has written: no glTF file is read, and no photon is traced
    ///
    /// The scene, its photons, rays and samples are those that were stated to photoncard prepare. Options of
    /// the picture and of its camera are stated as for a glTF file. Of frames that were prepared --frames
    /// states those to render, and SCENE has a run of # where there is a file for each.
    #[arg(long, help_heading = "Scene", conflicts_with_all = OF_PREPARATION)]
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
