//! Farm job: the steps that render a picture or frames, or that do another command's work in parts.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::CommandFactory;
use photoncard_shared::checksum::checksum;

use super::parts::{PartSteps, Work};
use super::words::{Words, not_for_a_job, refusal};
use crate::arguments::{Arguments, FarmOptions, PictureFormat};
use crate::failure::Failure;

/// Range of consecutive frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frames {
    pub(super) first: u32,
    pub(super) last: u32,
}

/// Job of a render farm: preparation, tasks and merge of one picture or of frames.
pub(super) struct Job {
    /// File name of the first picture, which is the name of the job.
    pub(super) name: String,
    /// Folder to which the paths of the job are relative.
    pub(super) home: String,
    /// Folder of the prepared scenes and the parts.
    pub(super) folder: String,
    pub(super) steps: Steps,
    /// Number of parts that each picture is divided into.
    pub(super) parts: u32,
    pub(super) frames: Option<Frames>,
}

/// Commands of the steps.
pub(super) enum Steps {
    /// Preparation, render and merge of pictures.
    Pictures(Words),
    /// Parts of a command's work.
    Parts(PartSteps),
}

impl Job {
    /// Creates a job from options. `given` are the arguments from which they were parsed.
    ///
    /// # Errors
    /// If an option or an output is not allowed in a job, a name is not UTF-8, or the frames are not
    /// consecutive.
    pub(super) fn new(options: &FarmOptions, given: impl Iterator<Item = OsString>) -> Result<Self, Failure> {
        let pictures = &options.render.outputs.pictures;
        if pictures.is_empty() || pictures.iter().any(|picture| picture.file().is_none()) {
            return Err(refusal("a job writes its pictures to files", "give -o OUT.exr or -o OUT.png"));
        }
        if pictures.iter().any(|picture| matches!(picture.format, PictureFormat::Part | PictureFormat::Video))
        {
            return Err(refusal(
                "a job makes pictures, of parts of its own",
                "give -o OUT.exr or -o OUT.png",
            ));
        }
        let frames = frames(options)?;
        let given: Vec<String> = given.map(text).collect::<Result<_, _>>()?;
        let print = given.join("\n");
        let command = Arguments::command();
        let engine = command.find_subcommand("farm").and_then(|farm| farm.find_subcommand("slurm"));
        let words = engine.map_or(Ok(Words::default()), |engine| Words::new(given, engine));
        let words = words.map_err(|name| not_for_a_job(&name))?;
        let output = pictures.first().map_or(Path::new("out"), |picture| &picture.path);
        Self::of(output, &print, Steps::Pictures(words), (options.parts, frames))
    }

    /// Creates a job whose first output is `output`; `print` is the text of all its arguments.
    fn of(
        output: &Path,
        print: &str,
        steps: Steps,
        (parts, frames): (u32, Option<Frames>),
    ) -> Result<Self, Failure> {
        let stem =
            output.file_stem().unwrap_or_default().to_string_lossy().replace(".#", "").replace('#', "");
        // The checksum of the arguments gives jobs with different options different folders.
        let folder = output.with_file_name(format!("{stem}.{:08x}.farm", checksum(print.as_bytes())));
        let home = std::env::current_dir().map_err(|error| Failure::work_error(&error))?;
        let name = output.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let path = |path: PathBuf| text(path.into_os_string());
        let (home, folder) = (path(home)?, path(folder)?);
        Ok(Self { name, home, folder, steps, parts, frames })
    }

    /// Number of tasks between preparation and merge.
    pub(super) fn tasks(&self) -> u64 {
        let frames = self.frames.map_or(1, |Frames { first, last }| last - first + 1);
        u64::from(frames) * u64::from(self.parts)
    }
}

/// Job of the work of a command in parts. `given` are the arguments of the command.
///
/// # Errors
/// If an argument is not UTF-8, or an option is not for a job.
pub(super) fn of_arguments(
    work: &Work,
    parts: u32,
    given: impl Iterator<Item = OsString>,
) -> Result<Job, Failure> {
    let given: Vec<String> = given.map(text).collect::<Result<_, _>>()?;
    let print = format!("{}\n{}", work.command, given.join("\n"));
    let steps = PartSteps::new(work, given, |path| text(path.as_os_str().to_owned()))?;
    Job::of(work.output, &print, Steps::Parts(steps), (parts, None))
}

/// Range of `--frames`; `None` for a single picture.
fn frames(options: &FarmOptions) -> Result<Option<Frames>, Failure> {
    let Some(numbers) = options.render.frames.numbers() else { return Ok(None) };
    let numbers: Vec<u32> = numbers.collect();
    let [first, last] = [numbers.first(), numbers.last()].map(|number| number.copied().unwrap_or(0));
    if numbers.len() as u64 != u64::from(last - first) + 1 {
        return Err(refusal(
            "the frames of a job follow each other",
            "give --frames A-B, and a job for each such range",
        ));
    }
    match options.render.outputs.of_frame(first) {
        Ok(_) => Ok(Some(Frames { first, last })),
        Err(_) => Err(refusal("an output has no place for the number of a frame", "give -o OUT.####.exr")),
    }
}

fn text(word: OsString) -> Result<String, Failure> {
    word.into_string().map_err(|word| {
        let text = format!("'{}' is not UTF-8, and a job is text", word.to_string_lossy());
        refusal(&text, "rename it")
    })
}
