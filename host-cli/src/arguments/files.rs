//! Names of output files. The suffix states the format, and `-` is standard output where a command allows it.

use std::path::{Path, PathBuf};

use clap::builder::{PathBufValueParser, TypedValueParser};

/// Destination of text that a command writes.
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

/// Format of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PictureFormat {
    /// `OpenEXR`: linear radiance and layers.
    Exr,
    /// PNG: tone-mapped for a screen.
    Png,
    /// Pixels of one part of a picture, which `photoncard merge` combines with the other parts.
    Part,
    /// Video of frames.
    Video,
}

/// Path that means standard output.
const STANDARD_OUTPUT: &str = "-";

/// Destination of a picture, with its file format.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PictureOutput {
    /// Path of the file; `-` for standard output, which takes a PNG.
    pub(crate) path: PathBuf,
    pub(crate) format: PictureFormat,
}

impl PictureOutput {
    /// Path of the file; `None` for standard output.
    pub(crate) fn file(&self) -> Option<&Path> {
        (self.path.as_os_str() != STANDARD_OUTPUT).then_some(&self.path)
    }

    /// Name of the destination in messages: the path, or `standard output`.
    pub(crate) fn name(&self) -> String {
        self.file().map_or("standard output".to_owned(), |path| path.display().to_string())
    }
}

/// Picture formats that photoncard does not write, each with its suffixes, its name and a remedy: an argument
/// for `-o`, mostly followed by a command that converts the file.
const OTHER_FORMATS: [(&[&str], &str, &str); 8] = [
    (&["jpg", "jpeg", "jpe"], "JPEG", "out.png, then: magick out.png out.jpg"),
    (&["webp"], "WebP", "out.png, then: magick out.png out.webp"),
    (&["tif", "tiff"], "TIFF", "out.exr, then: oiiotool out.exr -o out.tif"),
    (&["hdr", "pic", "rgbe"], "Radiance HDR", "out.exr, then: oiiotool out.exr -o out.hdr"),
    (&["avif", "heic", "jxl"], "this format", "out.png, then: magick out.png out.avif"),
    (
        &["bmp", "gif", "tga", "ppm", "pfm"],
        "this format",
        "out.png, then convert it, such as: magick out.png out.bmp",
    ),
    (&["glb", "gltf"], "a glTF scene", "out.png"),
    (&["card"], "a prepared scene", "SCENE.card to photoncard prepare"),
];

/// Returns the error message for a path whose suffix is not that of a picture format. The message has a
/// remedy.
fn other_format(ending: Option<&str>) -> String {
    let other =
        OTHER_FORMATS.iter().find(|(endings, ..)| ending.is_some_and(|ending| endings.contains(&ending)));
    match other {
        Some((_, name, instead)) => format!("{name} is not written: give -o {instead}"),
        None => "a picture is a file OUT.exr, linear radiance with layers, or OUT.png, tone-mapped, and a part of one OUT.part; give \
                 its name one of these endings, or - for a PNG on standard output"
            .to_owned(),
    }
}

/// Parser of the path of a picture, whose suffix states the format.
pub(super) fn picture() -> impl TypedValueParser<Value = PictureOutput> {
    PathBufValueParser::new().try_map(|path| {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        let format = match ending.as_deref() {
            Some("exr") => PictureFormat::Exr,
            Some("png") => PictureFormat::Png,
            Some("part") => PictureFormat::Part,
            Some("mp4" | "mov" | "mkv" | "webm") => PictureFormat::Video,
            None if path.as_os_str() == STANDARD_OUTPUT => PictureFormat::Png,
            ending => return Err(other_format(ending)),
        };
        Ok(PictureOutput { path, format })
    })
}

/// Parser of the path of a PNG file.
pub(super) fn png() -> impl TypedValueParser<Value = PathBuf> {
    picture().try_map(|output| match output {
        PictureOutput { path, format: PictureFormat::Png } if path.as_os_str() != STANDARD_OUTPUT => Ok(path),
        _ => Err("a tone-mapped picture is a PNG; give its name the ending .png"),
    })
}

/// Parser of the path of a text file; `-` is standard output.
pub(super) fn text() -> impl TypedValueParser<Value = TextOutput> {
    PathBufValueParser::new().map(|path| match path.to_str() {
        Some("-") => TextOutput::StandardOutput,
        _ => TextOutput::File(path),
    })
}

/// Parser of the path of a file that is not standard output.
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
    fn the_suffix_states_the_format() {
        for (name, format) in [
            ("a.exr", Some(PictureFormat::Exr)),
            ("b.c/A.EXR", Some(PictureFormat::Exr)),
            ("./-.png", Some(PictureFormat::Png)),
            ("a.exr.Png", Some(PictureFormat::Png)),
            ("a.exr.part", Some(PictureFormat::Part)),
            ("a.mp4", Some(PictureFormat::Video)),
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
    fn unsupported_formats_are_refused_with_a_command_that_converts() {
        for (ending, parts) in [
            ("jpg", ["JPEG", "magick"]),
            ("tiff", ["TIFF", "oiiotool"]),
            ("bmp", ["format", "magick"]),
            ("card", ["prepared", "photoncard prepare"]),
            ("docx", ["OUT.exr", "OUT.png"]),
        ] {
            let text = other_format(Some(ending));
            assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        }
    }

    #[test]
    fn a_dash_is_standard_output_for_text_and_pictures() {
        let picture = parsed(picture(), "-").unwrap();
        assert_eq!(
            (picture.format, picture.file(), &*picture.name()),
            (PictureFormat::Png, None, "standard output")
        );
        assert_eq!(parsed(png(), "-"), None);
        assert_eq!(parsed(text(), "-"), Some(TextOutput::StandardOutput));
        assert_eq!(parsed(text(), "./-"), Some(TextOutput::File("./-".into())));
        assert_eq!((parsed(file(), "-"), parsed(file(), "./-")), (None, Some("./-".into())));
    }
}
