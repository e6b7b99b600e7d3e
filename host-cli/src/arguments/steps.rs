//! Steps of a render that are commands of their own, as in a farm's job.

use clap::Arg;

use super::headings::{FRAMES, OUTPUTS, PHOTONS, PICTURE, RAYS, SCENE};

/// Steps that take an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// The preparation: the prepared scene depends on the option.
    Prepare,
    /// The preparation and the renders of parts.
    Both,
    /// The renders of parts.
    Render,
    /// The merge of the parts.
    Merge,
    /// None: the job itself takes the option.
    Job,
}

impl Step {
    /// Step of an option of `photoncard render`, by its heading.
    pub(crate) fn of(option: &Arg) -> Self {
        match option.get_id().as_str() {
            // Their headings, if they have any, are those of other steps.
            "quality" => Self::Prepare,
            "threads" | "quiet" => Self::Both,
            "display_server" => Self::Render,
            "frames" | "parts" => Self::Job,
            _ => match option.get_help_heading() {
                Some(SCENE | FRAMES | PHOTONS | RAYS) => Self::Prepare,
                Some(PICTURE) => Self::Both,
                Some(OUTPUTS) => Self::Merge,
                _ => Self::Render,
            },
        }
    }
}
