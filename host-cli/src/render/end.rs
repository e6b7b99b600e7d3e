//! Message about the end of a render with `--time` or `--noise`, which adds passes of samples up to an aim.

use photoncard_driver::quality::Fit;
use photoncard_driver::render::{Aim, Ending, Statistics};
use serde_json::Value;

use crate::arguments::RenderOptions;
use crate::console::say;

/// Result of a render with `--time` or `--noise`.
pub(super) struct End {
    pub(super) aim: Aim,
    pub(super) noise: Option<f64>,
    pub(super) passes: u32,
    pub(super) samples: u32,
    pub(super) ending: Ending,
}

impl End {
    /// Prints the result, and `at_once`: the options that render an equal picture in one pass.
    pub(super) fn say(&self, at_once: &str) {
        say(format_args!("photoncard: this picture in one render: {at_once}"));
        say(format_args!("photoncard: {}", self.line()));
    }

    fn line(&self) -> String {
        let passes = if self.passes == 1 { "1 pass".to_owned() } else { format!("{} passes", self.passes) };
        let noise = match self.noise {
            Some(noise) => format!("estimated noise {:.2} % of the mean", 100.0 * noise),
            None if self.passes > 1 => "noise of a black picture has no measure".to_owned(),
            None => "noise is known after two passes".to_owned(),
        };
        let most = format!("{} is the maximum number of samples", self.samples);
        let ended = match (&self.ending, self.aim.noise) {
            (Ending::Reached, _) => String::new(),
            (Ending::MaxSamples, Some(noise)) => {
                format!("; the aim of {} is not reached: {most}", percent(noise))
            }
            (Ending::MaxSamples, None) => format!("; ended before the time: {most}"),
            (Ending::Black, _) => "; ended before the aim".to_owned(),
            (Ending::Failed(_), _) => {
                "; ended before the aim: the picture has the samples of complete passes".to_owned()
            }
        };
        format!("{passes}, {noise}{ended}")
    }
}

/// Formats a fraction as a percentage without trailing zeros.
fn percent(share: f64) -> String {
    let digits = format!("{:.6}", 100.0 * share);
    format!("{} %", digits.trim_end_matches('0').trim_end_matches('.'))
}

/// Returns the options that replace `--time` and `--noise` to render the picture of `statistics` in one pass.
/// `fit` has the settings that a pilot render has chosen.
pub(super) fn at_once(options: &RenderOptions, statistics: &Statistics, fit: Option<&Fit>) -> String {
    let is_fitted = fit.is_some();
    let (stated, pixels) = (options.stated(), &statistics.provenance.pixels);
    let is_timed = is_fitted && options.samples.aim().is_some_and(|aim| aim.time.is_some());
    let has_fewer_caustics = is_timed && statistics.caustic_gathers > 0;
    let has_no_caustic_map = fit.is_some_and(|fit| fit.max_caustic_photons == 0)
        && pixels.get("caustic-photons").and_then(Value::as_u64) == Some(0);
    // Each option with whether it is needed, and the words that replace it if its setting has no value.
    let options_of_settings = [
        ("spp", true, ""),
        ("planned-spp", !options.states_planned_samples(), ""),
        ("photons", is_fitted && !stated.photons, ""),
        ("caustic-photons", !stated.caustic_photons && (has_fewer_caustics || has_no_caustic_map), ""),
        ("gather-rays", is_fitted && !stated.gather_rays, ""),
        ("shadow-rays", is_fitted && !stated.shadow_rays, ""),
        ("ic-error", is_fitted && !stated.cache, if is_timed { "--irradiance-cache off" } else { "" }),
        ("adaptive", is_fitted && !stated.adaptive, "--adaptive off"),
    ];
    let needed = options_of_settings.into_iter().filter(|(_, is_needed, _)| *is_needed);
    let words = needed.map(|(name, _, without)| match pixels.get(name) {
        None | Some(Value::Null) => without.to_owned(),
        // The `f32` prints fewer digits than the `f64` of JSON.
        Some(value) if value.is_f64() => format!("--{name} {}", value.as_f64().unwrap_or_default() as f32),
        Some(value) => format!("--{name} {value}"),
    });
    let for_camera = pixels.get("photons-for").and_then(Value::as_str) == Some("camera");
    let cameras =
        (is_fitted && options.leaves_cameras_open() && for_camera).then(|| "--photons-for camera".to_owned());
    words.chain(cameras).filter(|words| !words.is_empty()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use photoncard_driver::render::RenderError;

    use super::*;

    #[test]
    fn a_missed_aim_is_reported() {
        let of = |noise, estimated, ending| {
            let aim = Aim { noise, time: None };
            End { aim, noise: estimated, passes: 13, samples: 4096, ending }.line()
        };
        let line = |noise, ending| of(noise, Some(0.0123), ending);
        let begin = "13 passes, estimated noise 1.23 % of the mean";
        assert_eq!(line(Some(0.02), Ending::Reached), begin);
        for (noise, percent) in [(1e-6, "0.0001 %"), (0.01, "1 %"), (0.005, "0.5 %")] {
            let missed =
                format!("; the aim of {percent} is not reached: 4096 is the maximum number of samples");
            assert_eq!(line(Some(noise), Ending::MaxSamples), format!("{begin}{missed}"));
        }
        assert!(line(None, Ending::MaxSamples).contains("before the time"));
        assert!(line(Some(0.1), Ending::Failed(RenderError::Stopped)).contains("before the aim"));
        assert!(
            of(Some(0.1), None, Ending::Black).contains("black picture has no measure; ended before the aim")
        );
    }
}
