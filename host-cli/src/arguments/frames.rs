//! Options of frames: pictures of a scene at several times of its animations.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use photoncard_driver::render::NamedSettings;
use photoncard_driver::scene::gltf::Moment;
use serde_json::json;

/// Default frames per second, that of Blender.
const FPS: f64 = 24.0;
const MAX_FPS: f64 = 100_000.0;
const MAX_FRAME: u32 = 999_999;

#[derive(Args)]
#[command(next_help_heading = "Frames")]
pub(crate) struct FrameOptions {
    /// Frames of the scene's animations: a range such as 1-240, several such as 1-10,20, or every tenth
    /// frame: 1-240x10
    ///
    /// Frame N is the scene N / --fps seconds after the start of its animations. Names of outputs have a run
    /// of #, which the frame's number replaces: out.####.exr. All frames have the settings that --quality
    /// chooses for the scene at rest.
    #[arg(long, value_name = "RANGES", value_parser = frames)]
    frames: Option<Frames>,
    /// Name of an animation that plays; may be repeated [default: all animations of the file]
    #[arg(long = "animation", value_name = "NAME", requires = "frames", hide_short_help = true)]
    animations: Vec<String>,
    /// Frames per second [default: 24]
    #[arg(long, value_name = "NUMBER", requires = "frames", value_parser = fps, allow_negative_numbers = true)]
    fps: Option<f64>,
}

#[derive(Clone, Debug, PartialEq)]
struct Frames(BTreeSet<u32>);

impl FrameOptions {
    /// Frame numbers of `--frames`, increasing. `None` without `--frames`: one picture without animation.
    pub(crate) fn numbers(&self) -> Option<impl Iterator<Item = u32>> {
        self.frames.as_ref().map(|Frames(numbers)| numbers.iter().copied())
    }

    /// Names of the animations that play. If the list is empty, all animations of the file play.
    pub(crate) fn animations(&self) -> &[String] {
        &self.animations
    }

    /// Options that the pixels of all frames depend on: frames per second and animations.
    pub(crate) fn shared_provenance(&self) -> NamedSettings {
        let named = [("fps", json!(self.fps())), ("animation", json!(self.animations))];
        named.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
    }

    pub(crate) fn fps(&self) -> f64 {
        self.fps.unwrap_or(FPS)
    }

    /// Time and animations of a frame.
    pub(crate) fn moment(&self, frame: u32) -> Moment {
        Moment { animations: self.animations.clone(), seconds: f64::from(frame) / self.fps() }
    }

    /// Options that the pixels of a frame depend on: its number, frames per second and animations.
    pub(crate) fn provenance(&self, frame: u32) -> NamedSettings {
        let own = ("frame".to_owned(), json!(frame));
        self.shared_provenance().into_iter().chain([own]).collect()
    }
}

/// Finds the file with the greatest frame number up to `frame`. File names are `pattern` with a number in
/// place of its last run of `#`. Returns `None` if there is no such file, and `pattern` itself if it has no
/// `#`.
pub(crate) fn last_numbered(pattern: &Path, frame: u32) -> Option<PathBuf> {
    if numbered(pattern, frame).is_none() {
        return Some(pattern.to_owned());
    }
    let folder = pattern.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let of_pattern = |name: &std::ffi::OsStr| {
        let digits = |number: &str| number.parse().ok().filter(|&number: &u32| number <= frame);
        let (begin, end) = pattern.file_name()?.to_str()?.rsplit_once('#')?;
        let number = name.to_str()?.strip_prefix(begin.trim_end_matches('#'))?.strip_suffix(end)?;
        digits(number).filter(|&number| numbered(pattern, number).is_some_and(|path| path.ends_with(name)))
    };
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let last = entries.filter_map(|entry| of_pattern(&entry.file_name())).max()?;
    numbered(pattern, last)
}

/// Replaces the last run of `#` in the file name of `pattern` by the frame's number, padded with zeros to the
/// length of the run. `None` without a `#`.
pub(crate) fn numbered(pattern: &Path, frame: u32) -> Option<PathBuf> {
    let name = pattern.file_name()?.to_str()?;
    let end = name.rfind('#')? + 1;
    let begin = name[..end].trim_end_matches('#').len();
    let (width, rest) = (end - begin, &name[end..]);
    Some(pattern.with_file_name(format!("{}{frame:0width$}{rest}", &name[..begin])))
}

fn frames(text: &str) -> Result<Frames, String> {
    let ranges: Option<Vec<_>> = text.split(',').map(range).collect();
    let ranges = ranges.ok_or_else(|| {
        format!("frames are ranges of numbers up to {MAX_FRAME}, such as 1-240, 1-10,20 or 1-240x10")
    })?;
    Ok(Frames(ranges.into_iter().flatten().collect()))
}

/// Parses a range of frames: `7`, `1-240` or `1-240x10`.
fn range(text: &str) -> Option<impl Iterator<Item = u32>> {
    let (ends, step) = text.split_once('x').unwrap_or((text, "1"));
    let (first, last) = ends.split_once('-').unwrap_or((ends, ends));
    let [first, last, step] = [number(first)?, number(last)?, number(step)?];
    (first <= last && step > 0).then(|| (first..=last).step_by(step as usize))
}

fn number(text: &str) -> Option<u32> {
    let is_number = text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|&number| is_number && number <= MAX_FRAME)
}

fn fps(text: &str) -> Result<f64, String> {
    let fps = text.parse().ok().filter(|&fps| fps > 0.0 && fps <= MAX_FPS);
    fps.ok_or_else(|| format!("frames in a second are a number above 0 and up to {MAX_FPS}, such as 24"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_numbers_in_order_without_repetition() {
        for (text, expected) in [
            ("7", &[7][..]),
            ("0-2", &[0, 1, 2]),
            ("5,1-3,2", &[1, 2, 3, 5]),
            ("1-10x4", &[1, 5, 9]),
            ("999999", &[999_999]),
        ] {
            assert_eq!(frames(text).map(|Frames(found)| found.into_iter().collect()), Ok(expected.to_vec()));
        }
        for text in ["", "-", "1-", "-1", "3-1", "1-5x0", "1,", "1.5", "+1", "1000000", "1-2-3", "#", "1- 2"]
        {
            assert!(frames(text).is_err(), "{text}");
        }
    }

    #[test]
    fn the_number_replaces_the_last_run_of_signs() {
        for (pattern, frame, expected) in [
            ("out.####.exr", 7, Some("out.0007.exr")),
            ("out.#.exr", 12, Some("out.12.exr")),
            ("a#/b##c##.png", 123, Some("a#/b##c123.png")),
            ("a#/b.png", 1, None),
            ("", 1, None),
        ] {
            assert_eq!(numbered(Path::new(pattern), frame), expected.map(PathBuf::from), "{pattern}");
        }
    }

    #[test]
    fn the_last_file_up_to_a_frame_is_found() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.0003.card", "a.0010.card", "a.12.card", "a.10000.card", "b.0004.card", "a.+005.card"]
        {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let pattern = folder.path().join("a.####.card");
        for (frame, expected) in [
            (2, None),
            (3, Some("a.0003.card")),
            (9, Some("a.0003.card")),
            (9_999, Some("a.0010.card")),
            (10_001, Some("a.10000.card")),
        ] {
            let expected = expected.map(|name| folder.path().join(name));
            assert_eq!(last_numbered(&pattern, frame), expected, "{frame}");
        }
        let one = Path::new("absent/one.card");
        assert_eq!(last_numbered(one, 7).as_deref(), Some(one));
        assert_eq!(last_numbered(Path::new("absent/#.card"), 7), None);
    }

    #[test]
    fn frame_rates_are_above_zero() {
        assert_eq!((fps("24"), fps("29.97")), (Ok(24.0), Ok(29.97)));
        assert!(["0", "-1", "nan", "inf", "1e9", ""].iter().all(|text| fps(text).is_err()));
    }
}
