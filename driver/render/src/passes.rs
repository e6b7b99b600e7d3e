//! Renders pictures by passes: adds samples until the time is over or the noise is low enough.
//!
//! The number of samples doubles from pass to pass. The picture before a pass and the samples of the pass are
//! therefore two estimates with equally many samples. Their difference shows the noise of their mean
//! ([`NoiseEstimate`]).

use std::cell::RefCell;
use std::sync::Arc;
use std::time::{Duration, Instant};

use photoncard_map::pack::PackedScene;
use photoncard_scene::Scene;

use super::noise::NoiseEstimate;
use super::renderer::{Chosen, Renderer, Rendering};
use super::{Integrator, Observer, Picture, RenderError, RenderSettings};

/// Maximum number of samples per pixel, which all kinds of chips support.
const MAX_SAMPLES: u32 = 4096;
/// Minimum number of samples per pixel at which the noise estimate can end the passes.
const MIN_SAMPLES: u32 = 16;
const FIRST_SAMPLES: u32 = 1;
/// Fraction of the remaining time that a pass is planned to take.
const PLANNED_SHARE: f64 = 0.95;

/// Condition that ends the passes of a picture: a time or a noise, whichever is reached first. 4096 samples
/// per pixel end them in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aim {
    /// Time limit of the render. The first pass may exceed the limit, and so may the second if a card has no
    /// room for irradiance records.
    pub time: Option<Duration>,
    /// Noise limit: estimated root mean square standard error of pixels, relative to the mean of the picture.
    pub noise: Option<f64>,
}

/// A picture rendered by passes, and the reason why they ended.
pub struct Passes {
    /// Picture of all complete passes. Its statistics have the times of all, and the work of the last.
    pub rendering: Rendering,
    /// Estimated noise, as in [`Aim::noise`]; `None` after a single pass.
    pub noise: Option<f64>,
    /// Number of complete passes.
    pub count: u32,
    /// Reason why the passes ended.
    pub ending: Ending,
}

/// Reason why the passes of a picture ended.
#[derive(Debug)]
pub enum Ending {
    /// The aim was reached.
    Reached,
    /// The aim was not reached, but the picture has the maximum number of samples.
    MaxSamples,
    /// The picture is black, so that noise relative to its mean is undefined.
    Black,
    /// A pass after the first failed, or the observer stopped it.
    Failed(RenderError),
}

impl Renderer {
    /// Renders a picture by passes until an aim is reached. Photons and integrator are chosen as in
    /// [`Self::render_chosen`], but the chosen number of samples only becomes
    /// [`Integrator::planned_samples`]. The picture equals, bit for bit, that of a single render with the
    /// same number of samples and the same planned number.
    ///
    /// # Errors
    /// As [`Self::render_chosen`], if the first pass fails.
    pub fn render_until(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        choose: &dyn Fn(&PackedScene) -> Chosen,
        aim: Aim,
        observer: &dyn Observer,
    ) -> Result<Passes, RenderError> {
        let start = Instant::now();
        let chosen = RefCell::new((settings.photons.clone(), settings.integrator.clone()));
        let first = |packed: &PackedScene| {
            let (photons, integrator) = choose(packed)?;
            let planned_samples = Some(integrator.planned());
            let integrator = Integrator { samples: FIRST_SAMPLES, planned_samples, ..integrator };
            *chosen.borrow_mut() = (photons.clone(), integrator.clone());
            Ok((photons, integrator))
        };
        let layers = settings.picture.layers.clone();
        let settings = settings.clone().with(|settings| {
            settings.schedule.keep_records = true;
            // Each pass is one frame, and illuminance another, after all passes.
            settings.picture.layers = layers.of_one_frame();
        });
        let rendering = self.render_chosen(scene, &settings, &first, observer)?;
        let (photons, integrator) = chosen.into_inner();
        let mut settings = RenderSettings { photons, integrator, ..settings };
        let mut passes = Passes { rendering, noise: None, count: 1, ending: Ending::Reached };
        let mut estimate = NoiseEstimate::default();
        let mut pace = Pace::default();
        if settings.integrator.irradiance_error.is_none() {
            pace.add(settings.integrator.samples, passes.rendering.statistics.time_s.render);
        }
        loop {
            let more = match next_pass(&passes, &estimate, &pace, aim, start.elapsed()) {
                Ok(more) => more,
                Err(ending) => {
                    passes.ending = ending;
                    break;
                }
            };
            let before = Arc::new(passes.rendering.film.clone());
            settings.integrator.samples += more;
            let begun = Instant::now();
            match self.refine(scene, &settings, before.clone(), observer) {
                Ok(mut rendering) => {
                    rendering.statistics.time_s += passes.rendering.statistics.time_s;
                    passes.rendering = rendering;
                }
                Err(error) => {
                    passes.ending = Ending::Failed(error);
                    break;
                }
            }
            pace.add(more, begun.elapsed().as_secs_f64());
            passes.count += 1;
            estimate.add(&before, &passes.rendering.film);
            passes.noise = estimate.noise();
        }
        if layers.have_illuminance() {
            settings.integrator.samples = passes.rendering.statistics.samples;
            self.add_illuminance(scene, &settings, &mut passes.rendering, observer)?;
            let picture = Picture { layers, ..settings.picture.clone() };
            passes.rendering.statistics.provenance.pixels.extend(picture.of_layers());
        }
        passes.rendering.statistics.time_s.total = start.elapsed().as_secs_f64();
        Ok(passes)
    }
}

/// Number of samples of the next pass.
///
/// # Errors
/// The reason to end the passes.
fn next_pass(
    passes: &Passes,
    estimate: &NoiseEstimate,
    pace: &Pace,
    aim: Aim,
    elapsed: Duration,
) -> Result<u32, Ending> {
    let samples = passes.rendering.film.format().samples;
    let mut more = samples;
    if let Some(aim) = aim.noise
        && samples >= MIN_SAMPLES
    {
        if estimate.is_of_black() {
            return Err(Ending::Black);
        }
        more = more.min(estimate.samples_to(aim).unwrap_or(more));
    }
    if let Some(time) = aim.time {
        let left = time.saturating_sub(elapsed).as_secs_f64();
        more = more.min(pace.samples_in(PLANNED_SHARE * left));
    }
    match more.min(MAX_SAMPLES.saturating_sub(samples)) {
        0 if more > 0 => Err(Ending::MaxSamples),
        0 => Err(Ending::Reached),
        more => Ok(more),
    }
}

/// Model of the time of a pass: a constant, plus a time in proportion to the number of samples.
#[derive(Default)]
struct Pace {
    /// Numbers of samples and times, seconds, of the last two passes; the later pass has index 1. A first
    /// pass that gathers irradiance records for all passes is left out.
    last: [Option<(f64, f64)>; 2],
}

impl Pace {
    fn add(&mut self, samples: u32, seconds: f64) {
        self.last = [self.last[1], Some((f64::from(samples), seconds))];
    }

    /// Number of samples that can be rendered in a pass of `seconds` seconds.
    fn samples_in(&self, seconds: f64) -> u32 {
        let Some((samples, time)) = self.last[1] else { return u32::from(seconds > 0.0) };
        let slope = self.last[0].filter(|(before, _)| *before != samples);
        let slope = slope.map(|(before, other)| (time - other) / (samples - before));
        // The time per sample is at most the time of the last pass divided by its samples, and at least a
        // fourth of that maximum.
        let most = time / samples;
        let each = slope.unwrap_or(most).clamp(0.25 * most, most).max(f64::MIN_POSITIVE);
        let fixed = time - each * samples;
        ((seconds - fixed) / each).clamp(0.0, f64::from(MAX_SAMPLES)) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pass_fits_the_time_that_is_left() {
        let mut pace = Pace::default();
        pace.add(1, 3.0);
        assert_eq!(pace.samples_in(9.5), 3);
        // A pass takes two seconds, and one more for each sample.
        pace.add(2, 4.0);
        assert_eq!((pace.samples_in(10.0), pace.samples_in(2.9), pace.samples_in(-1.0)), (8, 0, 0));
        pace.add(2, 0.0);
        assert_eq!(pace.samples_in(1e9), MAX_SAMPLES);
    }
}
