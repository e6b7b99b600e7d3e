//! Options of output files and of the display server.

use std::path::{Path, PathBuf};

use clap::Args;
use photoncard_driver::display::{DisplayAddress, DisplaySettings};
use photoncard_driver::exr::SampleFormat;
use photoncard_driver::partial::PartialSettings;
use photoncard_driver::quality::Finish;

use super::choice::choice;
use super::files::{PictureFormat, PictureOutput, TextOutput, picture, text};
use super::frames::numbered;
use super::tone::ToneOptions;

#[derive(Args, Clone)]
#[command(next_help_heading = "Outputs")]
pub(crate) struct OutputOptions {
    /// The picture to write: OUT.exr, linear radiance, or OUT.png, tone-mapped; may be repeated [default:
    /// SCENE's name with .png]
    ///
    /// The EXR has linear RGB radiance and the layers of --aov. One render writes all pictures. With --part
    /// the file is OUT.part, for photoncard merge. With --frames, OUT.mp4, .mov, .mkv or .webm is a video,
    /// which the program ffmpeg encodes. The name - is a PNG on standard output.
    #[arg(short = 'o', long = "output", value_name = "OUT.exr|OUT.png", value_parser = picture())]
    pub(crate) pictures: Vec<PictureOutput>,
    /// Continue a render that was stopped or has failed
    ///
    /// Finished tiles are kept beside the picture, in OUT.exr.partial, until the picture is written. Without
    /// this option such a file is refused: remove it to begin anew. Frames whose files exist, are complete
    /// and have these settings are not rendered again.
    #[arg(long)]
    pub(crate) resume: bool,
    /// Type of the EXR's samples; layers Z, gathers, position and mattes are always float [default: float]
    #[arg(long, value_parser = choice::<SampleFormat>(), hide_short_help = true)]
    sample_type: Option<SampleFormat>,
    #[command(flatten)]
    pub(crate) tone: ToneOptions,
    /// Remove noise by Open Image Denoise, a library that is looked for at run time
    ///
    /// The PNG shows the denoised picture. The EXR keeps the rendered one, and has the denoised one in the
    /// layer denoised. With this option --quality chooses fewer samples and rays, and no irradiance cache.
    #[arg(long)]
    pub(crate) denoise: bool,
    /// Show finished tiles during the render, in tev or another viewer that has tev's protocol; - for
    /// standard output [default port: 14158]
    #[arg(long, value_name = "HOST:PORT", allow_hyphen_values = true, hide_short_help = true)]
    display_server: Option<DisplayAddress>,
    /// Write statistics of the render as JSON; - for standard output
    #[arg(long, value_name = "OUT.json", value_parser = text())]
    pub(crate) stats: Option<TextOutput>,
}

impl OutputOptions {
    /// Returns whether the render continues with finished tiles or frames of an earlier one.
    pub(crate) fn resumes(&self) -> bool {
        self.resume
    }

    /// Returns these options with the default output, a PNG beside the scene file and named like it. If
    /// `has_frames`, the name has a run of `#` for the frame's number. `None` if an output is stated.
    pub(crate) fn beside(&self, scene: &Path, has_frames: bool) -> Option<Self> {
        if !self.pictures.is_empty() {
            return None;
        }
        // With frames, a prepared scene's name may have a run of `#` already.
        let is_numbered = numbered(scene, 0).is_some();
        let path = scene.with_extension(if has_frames && !is_numbered { "####.png" } else { "png" });
        Some(Self { pictures: vec![PictureOutput { path, format: PictureFormat::Png }], ..self.clone() })
    }

    /// Settings of the file that keeps finished tiles until the picture is written; `None` if the picture
    /// goes to standard output.
    pub(super) fn partial(&self) -> Option<PartialSettings> {
        self.main()?.file()?;
        Some(PartialSettings { path: self.partial_path(), resume: self.resume })
    }

    /// Path of the file that holds finished tiles until the picture is written.
    pub(crate) fn partial_path(&self) -> PathBuf {
        let mut name = self.main_path().as_os_str().to_owned();
        name.push(".partial");
        name.into()
    }

    /// Returns these options with the frame's number in place of the `#` in each output path.
    ///
    /// # Errors
    /// Returns the first path that has no `#`.
    pub(crate) fn of_frame(&self, frame: u32) -> Result<Self, &Path> {
        let mut outputs = self.clone();
        for (output, pattern) in outputs.pictures.iter_mut().zip(&self.pictures) {
            output.path = numbered(&pattern.path, frame).ok_or(&*pattern.path)?;
        }
        if let Some(TextOutput::File(pattern)) = &self.stats {
            outputs.stats = Some(TextOutput::File(numbered(pattern, frame).ok_or(&**pattern)?));
        }
        Ok(outputs)
    }

    /// Returns whether a denoiser follows the render.
    pub(crate) fn finish(&self) -> Finish {
        Finish::new(self.denoise)
    }

    /// Type of an EXR's samples.
    pub(crate) fn sample_type(&self) -> SampleFormat {
        self.sample_type.unwrap_or(SampleFormat::Float)
    }

    /// Reports useless options: calls `add(is_useless, name, reason)` for each option that can be useless.
    pub(super) fn without_effect(&self, add: &mut impl FnMut(bool, &str, &str)) {
        let [no_exr, no_png] = [PictureFormat::Exr, PictureFormat::Png].map(|format| !self.has(format));
        add(self.tone.exposure.is_some() && no_png, "--exposure", "without -o OUT.png");
        add(self.tone.curve.is_some() && no_png, "--tonemap", "without -o OUT.png");
        add(self.sample_type.is_some() && no_exr, "--sample-type", "without -o OUT.exr");
    }

    /// Returns whether layers are stored or shown: in an EXR or a part, or on a display server.
    pub(super) fn have_layers(&self) -> bool {
        self.display_server.is_some() || self.has(PictureFormat::Part) || self.has(PictureFormat::Exr)
    }

    /// Returns whether finished tiles go to standard output.
    pub(crate) fn pipes_tiles(&self) -> bool {
        self.display_server == Some(DisplayAddress::StandardOutput)
    }

    /// Returns whether a picture of this format is written.
    fn has(&self, format: PictureFormat) -> bool {
        self.pictures.iter().any(|picture| picture.format == format)
    }

    /// Main picture: the first EXR, else the first picture. Its file name is used for the partial file and
    /// for the picture on a display server.
    pub(crate) fn main(&self) -> Option<&PictureOutput> {
        let exr = self.pictures.iter().find(|picture| picture.format == PictureFormat::Exr);
        exr.or(self.pictures.first())
    }

    fn main_path(&self) -> &Path {
        self.main().map_or(Path::new(""), |picture| &picture.path)
    }

    /// Display server, and the picture's name there: the file name of the main picture.
    pub(super) fn display(&self) -> Option<DisplaySettings> {
        let address = self.display_server.clone()?;
        let path = self.main_path();
        let image = path.file_name().unwrap_or(path.as_os_str());
        Some(DisplaySettings { address, image: image.to_string_lossy().into_owned() })
    }
}
