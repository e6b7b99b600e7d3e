//! Remedies for what is typed as for other renderers.

use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

/// Options of other renderers, and what states the same here.
const OF_OTHERS: [(&[&str], &str); 14] = [
    (
        &["--samples", "--sample", "--num-samples", "-s"],
        "the samples of a pixel are stated by --spp N; by default --quality finds them",
    ),
    (
        &["--width", "--height", "--resolution", "--res", "-w", "--resx", "--resy"],
        "the size is stated by --size WIDTHxHEIGHT, or --size 1080p",
    ),
    (
        &["--denoise", "--denoiser", "--oidn"],
        "no denoiser is part of photoncard: -o OUT.exr has the layers albedo and N for one (docs/denoising.md); --quality final has less noise",
    ),
    (
        &["--gpu", "--device", "--cuda", "--optix", "--metal", "--vulkan", "--cycles-device"],
        "there is no graphics processor to choose: emulated cards run on the processor's cores, others are stated by --card",
    ),
    (
        &["--threads", "--cores", "--jobs", "-j", "-t", "--nthreads"],
        "the number of chips, each on a core, is stated by --card emulated:N",
    ),
    (&["--output", "--out"], "outputs of this command are in its --help"),
    (&["--outfile", "--render-output", "--image"], "the picture is stated by -o OUT.png or -o OUT.exr"),
    (
        &["--transparent", "--alpha", "--film-transparent"],
        "no transparent background is written: where nothing is seen, the layer Z of an EXR is infinite",
    ),
    (
        &["--bounces", "--max-bounces", "--depth", "--max-depth"],
        "paths have no number of bounces to state: the photon map has light of all",
    ),
    (
        &["--env", "--envmap", "--hdri", "--world", "--sky", "--background"],
        "light from infinitely far is stated by --environment FILE or R,G,B",
    ),
    (
        &["--frame", "--start", "--end", "--frame-start", "--frame-end"],
        "frames are stated by --frames A-B, or --frames N for one",
    ),
    (&["--format", "--render-format"], "the format is that of the ending of -o: OUT.exr or OUT.png"),
    (
        &["--ev", "--gamma", "--exp"],
        "the exposure of a PNG is stated by --exposure STOPS, its curve by --tonemap",
    ),
    (
        &["--verbose", "-v", "--log-level"],
        "progress is printed by default; --quiet leaves warnings alone, --stats OUT.json has all numbers",
    ),
];

/// Endings of pictures' names.
const PICTURES: [&str; 5] = [".png", ".exr", ".jpg", ".jpeg", ".part"];

/// The error of an unknown argument with what states the same here, if that is known.
pub(super) fn with_suggestion(mut error: Error) -> Error {
    if error.kind() != ErrorKind::UnknownArgument {
        return error;
    }
    let Some(ContextValue::String(argument)) = error.get(ContextKind::InvalidArg) else { return error };
    let Some(remedy) = remedy(argument) else { return error };
    error.remove(ContextKind::SuggestedArg);
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![remedy.into()]));
    error
}

fn remedy(argument: &str) -> Option<String> {
    let name = argument.split('=').next().unwrap_or(argument);
    if let Some((_, remedy)) = OF_OTHERS.iter().find(|(names, _)| names.contains(&name)) {
        return Some((*remedy).to_owned());
    }
    let is_picture =
        !name.starts_with('-') && PICTURES.iter().any(|ending| name.to_lowercase().ends_with(ending));
    is_picture.then(|| format!("a picture to write is stated by -o {name}"))
}
