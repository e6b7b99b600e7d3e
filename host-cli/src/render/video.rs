//! Videos of frames, which ffmpeg encodes from PNG pictures.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use miette::{MietteDiagnostic, Report};

use crate::arguments::{PictureFormat, PictureOutput, RenderOptions, numbered};
use crate::console::say;
use crate::failure::Failure;
use crate::shell;

const FFMPEG: &str = "ffmpeg";

/// Path of a video, and the path pattern of the PNG pictures of its frames.
pub(super) struct Video {
    path: PathBuf,
    pictures: PathBuf,
}

/// Replaces each video among the outputs by the PNG pictures that it is encoded from, and returns the videos.
///
/// # Errors
/// If no frames are stated; if the pictures are to have alpha; if a video's name contains `#`, or is that of
/// an input; if a file that photoncard did not write has the name of one of the PNG pictures; or if ffmpeg
/// cannot be started.
pub(super) fn take(options: &mut RenderOptions) -> Result<Vec<Video>, Failure> {
    let mut videos = Vec::new();
    for output in options.outputs.pictures.iter_mut().filter(|output| output.format == PictureFormat::Video) {
        let (path, pictures) = (output.path.clone(), output.path.with_extension("######.png"));
        *output = PictureOutput { path: pictures.clone(), format: PictureFormat::Png };
        videos.push(Video { path, pictures });
    }
    let Some(Video { path, pictures }) = videos.first() else { return Ok(videos) };
    if options.picture.transparent {
        let text = format!("{} is a video, which has no alpha", path.display());
        let frames = path.with_extension("####.png");
        return Err(refusal(
            text,
            &format!("leave --transparent out, or write frames: -o {}", frames.display()),
        ));
    }
    if let Some(video) = videos.iter().find(|video| numbered(&video.path, 0).is_some()) {
        return Err(of_each_frame(&video.path));
    }
    if options.frames.numbers().is_none() {
        let text = format!("{} is a video, and one picture is rendered", path.display());
        return Err(refusal(text, "state the frames of the scene's animations: --frames 1-240"));
    }
    let written: Vec<&Path> = videos.iter().map(|video| &*video.path).collect();
    crate::outputs::check(&crate::input::files(&options.scene), &written, &[])?;
    let numbers = || options.frames.numbers().into_iter().flatten();
    let frames =
        |video: &Video| numbers().filter_map(|number| numbered(&video.pictures, number)).collect::<Vec<_>>();
    crate::outputs::check_foreign(videos.iter().flat_map(frames))?;
    if !is_there() {
        let text =
            format!("{} is a video, which the program ffmpeg makes, and it is not there", path.display());
        let pattern = pictures.display();
        return Err(refusal(text, &format!("install ffmpeg, or render the frames alone: -o {pattern}")));
    }
    Ok(videos)
}

/// Error of a video whose name contains a run of `#`, the placeholder of a frame's number.
fn of_each_frame(path: &Path) -> Failure {
    let text = format!(
        "{} is one video of all frames, and a run of # in its name stands for the number of each",
        path.display()
    );
    let words = [as_one(path), path.with_extension("png")];
    let [one, frames] = words.map(|path| shell::quoted(&path.to_string_lossy()).into_owned());
    refusal(text, &format!("leave the # out: -o {one}; or write the frames alone: -o {frames}"))
}

/// Path for a single video: `pattern` without its runs of `#`, and without the dot before each run.
fn as_one(pattern: &Path) -> PathBuf {
    let name = pattern.file_name().unwrap_or_default().to_string_lossy();
    let kept: Vec<_> = name.split('.').map(|word| word.replace('#', "")).collect();
    let kept = kept.iter().filter(|word| !word.is_empty()).map(String::as_str).collect::<Vec<_>>().join(".");
    let is_named = Path::new(&kept).extension().is_some();
    pattern.with_file_name(if is_named { kept } else { format!("video.{kept}") })
}

fn is_there() -> bool {
    let started = Command::new(FFMPEG).arg("-version").stdin(Stdio::null()).output();
    started.is_ok_and(|output| output.status.success())
}

impl Video {
    /// Encodes the video from rendered frames.
    ///
    /// # Errors
    /// If a file cannot be read or written, or ffmpeg fails. The error of ffmpeg contains the last line that
    /// it printed, and its command.
    pub(super) fn write(&self, options: &RenderOptions) -> Result<(), Failure> {
        let pictures = options.frames.numbers().into_iter().flatten();
        let pictures: Vec<PathBuf> = pictures.filter_map(|number| numbered(&self.pictures, number)).collect();
        let failed = |error: std::io::Error| Failure::work_error(&error);
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = tempfile::tempdir_in(folder.unwrap_or(Path::new("."))).map_err(failed)?;
        let list = folder.path().join("frames.txt");
        let mut file = std::fs::File::create(&list).map_err(failed)?;
        for picture in &pictures {
            let picture = std::fs::canonicalize(picture).map_err(failed)?;
            let name = picture.to_string_lossy().replace('\'', "'\\''");
            writeln!(file, "file '{name}'").map_err(failed)?;
        }
        let name = self.path.file_name().unwrap_or_default();
        let made = folder.path().join(name);
        let words = self.words(options.frames.fps(), &list, &made);
        let output = Command::new(FFMPEG).args(&words).stdin(Stdio::null()).output().map_err(failed)?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            let last = said.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or_default().to_owned();
            let text = format!("ffmpeg made no {}: {last}", self.path.display());
            let words: Vec<_> = words.iter().map(|word| shell::quoted(word)).collect();
            let help = format!(
                "the frames are written; with a list of them it was started as: {FFMPEG} {}",
                words.join(" ")
            );
            return Err(Failure::Work(Report::new(MietteDiagnostic::new(text).with_help(help))));
        }
        std::fs::rename(&made, &self.path).map_err(failed)?;
        if !options.host.quiet {
            let count = pictures.len();
            say(format_args!("photoncard: {}: {count} frames, by ffmpeg", self.path.display()));
        }
        Ok(())
    }

    fn words(&self, fps: f64, list: &Path, made: &Path) -> Vec<String> {
        // Most players need even sides and 4:2:0 chroma subsampling.
        let even = "pad=ceil(iw/2)*2:ceil(ih/2)*2,format=yuv420p";
        let fps = fps.to_string();
        let [list, made] = [list, made].map(|path| path.to_string_lossy().into_owned());
        let words = ["-v", "error", "-y", "-f", "concat", "-safe", "0", "-r", &fps, "-i", &list, "-vf", even];
        words.into_iter().map(str::to_owned).chain([made]).collect()
    }
}

fn refusal(text: String, help: &str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_video_is_the_pattern_without_signs() {
        for (pattern, expected) in [
            ("a#/view.####.mp4", "a#/view.mp4"),
            ("take#2.webm", "take2.webm"),
            ("##.mp4", "video.mp4"),
            ("####.#.mkv", "video.mkv"),
        ] {
            assert_eq!(as_one(Path::new(pattern)), Path::new(expected), "{pattern}");
        }
    }
}
