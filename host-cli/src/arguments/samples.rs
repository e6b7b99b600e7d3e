//! Options of renders that add passes of samples up to an aim (`--time`, `--noise`), and of kept samples.

use std::time::Duration;

use clap::Args;
use photoncard_driver::render::Aim;

#[derive(Args)]
#[command(next_help_heading = "Rays and samples")]
pub(crate) struct SampleOptions {
    /// Add samples until this time has passed since the start: 90 or 90s (seconds), 5m or 2h
    ///
    /// Each pass doubles the number of samples; the last pass is as long as the time allows. If the time is
    /// short, the numbers of photons and gather rays that are not stated are reduced too. With --noise, the
    /// aim that is reached first ends the render.
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with_all = NOT_BY_PASSES)]
    time: Option<Duration>,
    /// Add samples until the estimated standard error of the pixels is below this share of the picture's mean
    ///
    /// The estimate is the root mean square over all pixels, from the differences between passes. It measures
    /// only the noise of the samples: the numbers of photons and of rays of irradiance records that are not
    /// stated are chosen so high that their errors are small in comparison.
    #[arg(long, value_name = "ERROR", value_parser = noise, allow_negative_numbers = true, conflicts_with_all = NOT_BY_PASSES)]
    noise: Option<f64>,
    /// Keep the samples beside the finished picture, in OUT.exr.partial: --resume with a greater --spp adds
    /// to them
    #[arg(long, hide_short_help = true, conflicts_with_all = ["time", "noise"])]
    pub(crate) keep_samples: bool,
}

/// Ids of the options that cannot be combined with `--time` or `--noise`.
const NOT_BY_PASSES: [&str; 6] = ["spp", "resume", "cache", "trace", "verify", "frames"];

impl SampleOptions {
    /// Time or noise at which the passes end; `None` without `--time` and `--noise`.
    pub(crate) fn aim(&self) -> Option<Aim> {
        let Self { time, noise, keep_samples: _ } = *self;
        (time.is_some() || noise.is_some()).then_some(Aim { time, noise })
    }
}

fn time(text: &str) -> Result<Duration, String> {
    let (number, unit) = text.split_at(text.trim_end_matches(['s', 'm', 'h']).len());
    let seconds = match unit {
        "" | "s" => 1.0,
        "m" => 60.0,
        "h" => 3600.0,
        _ => 0.0,
    };
    let time = number.parse::<f64>().ok().map(|number| number * seconds);
    let time = time.filter(|&time| time > 0.0 && time <= 1e9).map(Duration::from_secs_f64);
    time.ok_or_else(|| {
        "a time is a number of seconds, or of minutes or hours with m or h, such as 60s or 5m".into()
    })
}

fn noise(text: &str) -> Result<f64, String> {
    let noise = text.parse().ok().filter(|noise| (1e-6..=1.0).contains(noise));
    noise.ok_or_else(|| "noise is a share of the picture's mean, 0.000001 to 1, such as 0.01".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units_and_noise_is_a_fraction() {
        for (text, seconds) in [("90", 90.0), ("0.5s", 0.5), ("5m", 300.0), ("2h", 7200.0)] {
            assert_eq!(time(text), Ok(Duration::from_secs_f64(seconds)));
        }
        for text in ["", "s", "-1", "0", "1ms", "5 m", "nan", "inf", "1e99", "1d"] {
            assert!(time(text).is_err(), "{text}");
        }
        assert_eq!(noise("0.01"), Ok(0.01));
        assert!(["0", "-1", "1.5", "nan", ""].iter().all(|text| noise(text).is_err()));
    }
}
