//! Names of output files: the name's ending states the format, and `-` is standard output where text goes there.

use std::path::{Path, PathBuf};

use clap::builder::{PathBufValueParser, TypedValueParser};

/// Output for text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TextOutput {
    StandardOutput,
    File(PathBuf),
}

impl TextOutput {
    /// Path of the file; `None` for standard output.
    pub(crate) fn path(&self) -> Option<&Path> {
        match self {
            Self::StandardOutput => None,
            Self::File(path) => Some(path),
        }
    }
}

/// Format of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PictureFormat {
    /// `OpenEXR`: linear radiance and layers.
    Exr,
    /// PNG: tone-mapped for a screen.
    Png,
    /// Part of a picture, for `photoncard merge`.
    Part,
}

/// Output for a picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PictureOutput {
    pub(crate) path: PathBuf,
    pub(crate) format: PictureFormat,
}

/// Parser of outputs for pictures, by the ending of their names.
pub(super) fn picture() -> impl TypedValueParser<Value = PictureOutput> {
    PathBufValueParser::new().try_map(|path| {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        let format = match ending.as_deref() {
            Some("exr") => PictureFormat::Exr,
            Some("png") => PictureFormat::Png,
            Some("part") => PictureFormat::Part,
            _ => return Err("a picture is a file OUT.exr, linear radiance with layers, or OUT.png, tone-mapped, and a part of one OUT.part; give its name one of these endings"),
        };
        Ok(PictureOutput { path, format })
    })
}

/// Parser of outputs that are a PNG picture.
pub(super) fn png() -> impl TypedValueParser<Value = PathBuf> {
    picture().try_map(|PictureOutput { path, format }| match format {
        PictureFormat::Png => Ok(path),
        PictureFormat::Exr | PictureFormat::Part => {
            Err("a tone-mapped picture is a PNG; give its name the ending .png")
        }
    })
}

/// Parser of outputs for text.
pub(super) fn text() -> impl TypedValueParser<Value = TextOutput> {
    PathBufValueParser::new().map(|path| match path.to_str() {
        Some("-") => TextOutput::StandardOutput,
        _ => TextOutput::File(path),
    })
}

/// Parser of outputs that cannot be standard output.
pub(super) fn file() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| match path.to_str() {
        Some("-") => {
            Err("this is not written to standard output; give a name, which is ./- for one that is a dash")
        }
        _ => Ok(path),
    })
}

#[cfg(test)]
mod tests {
    use clap::{Arg, Command};

    use super::*;

    fn parsed<T: Clone + Send + Sync + 'static>(
        parser: impl TypedValueParser<Value = T>,
        text: &str,
    ) -> Option<T> {
        let command =
            Command::new("test").arg(Arg::new("path").allow_hyphen_values(true).value_parser(parser));
        command.try_get_matches_from(["test", text]).ok()?.get_one::<T>("path").cloned()
    }

    #[test]
    fn the_ending_states_the_format() {
        for (name, format) in [
            ("a.exr", Some(PictureFormat::Exr)),
            ("b.c/A.EXR", Some(PictureFormat::Exr)),
            ("./-.png", Some(PictureFormat::Png)),
            ("a.exr.Png", Some(PictureFormat::Png)),
            ("a.exr.part", Some(PictureFormat::Part)),
            ("-", None),
            ("a", None),
            (".exr", None),
            ("a.exr/", Some(PictureFormat::Exr)),
            ("a.exr/..", None),
            ("a.jpg", None),
            ("a.png.", None),
        ] {
            assert_eq!(parsed(picture(), name).map(|output| output.format), format, "{name}");
            assert_eq!(parsed(png(), name).is_some(), format == Some(PictureFormat::Png), "{name}");
        }
    }

    #[test]
    fn a_dash_is_standard_output_for_text_alone() {
        assert_eq!(parsed(text(), "-"), Some(TextOutput::StandardOutput));
        assert_eq!(parsed(text(), "./-"), Some(TextOutput::File("./-".into())));
        assert_eq!((parsed(file(), "-"), parsed(file(), "./-")), (None, Some("./-".into())));
    }
}
