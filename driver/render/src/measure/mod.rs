//! Irradiance at points: measurements instead of pictures.
//!
//! A sensor is a point with a normal. Cards treat it as a white Lambertian surface: its direct light comes
//! from shadow rays, its indirect light from gather rays, as that of a pixel. The light of a sensor depends
//! on its number, its position and its normal, but not on other sensors, nor on the cards. Sensors in the air
//! measure no caustics from the caustic map, whose photons lie on surfaces; a gather ray that reaches a lamp
//! through glass counts it instead, if there is no caustic map.
//!
//! The samples of a sensor are rendered in batches. The standard error of their mean follows from the
//! variance between the batches. It is that of the rays: photons are the same in all batches.

mod probes;
mod reading;
mod sensors;

use std::f64::consts::PI;
use std::sync::Arc;
use std::time::Duration;

use photoncard_firmware::card::MAX_PICTURE_SIDE;
use photoncard_map::photon_map::PhotonsFor;
use photoncard_picture::film::Film;
use photoncard_picture::layer::{Layer, Layers};
use photoncard_picture::sums::FilmPixel;
use photoncard_scene::{PunctualKind, PunctualLight, Scene};
use photoncard_shared::layout::power_of_two_above;

pub use self::probes::{PROBE_COEFFICIENTS, PROBE_DIRECTIONS, PROBE_ORDERS, harmonics, probe, probe_points};
pub use self::reading::{Point, Reading};
use self::sensors::COLUMNS;
pub(crate) use self::sensors::Sensors;
use crate::{
    CardError, Filter, Integrator, Observer, Phase, Picture, RenderError, RenderSettings, Renderer,
    TileOutputs,
};

/// Maximum number of sensors in all.
pub const MAX_SENSORS: u32 = COLUMNS * MAX_PICTURE_SIDE;
/// Maximum number of sensors that are measured together.
pub const SENSORS_TOGETHER: usize = (COLUMNS as usize) << 8;
/// Distance from a punctual light, metres, up to which its light is measured; nearer, it saturates.
const NEAREST: f32 = 1e-2;
/// Number of batches from which a standard error is estimated, at most.
const BATCHES: u32 = 16;

/// Measures irradiance in a scene, on cards that stay open between measurements.
pub struct Meter<'s> {
    scene: &'s Scene,
    settings: RenderSettings,
    /// Weights of red, green and blue in the standard error.
    weights: [f64; 3],
    renderer: Renderer,
}

impl<'s> Meter<'s> {
    /// Creates a meter for a scene. Of the settings it uses photons, integrator, cards and the order of the
    /// work. The integrator's irradiance cache and adaptive sampling are not used, and photons are those of
    /// the whole scene. `weights` are those of red, green and blue in standard errors.
    pub fn new(scene: &'s Scene, settings: &RenderSettings, weights: [f64; 3]) -> Self {
        let layers = Layers::NONE.with([Layer::Direct, Layer::Indirect, Layer::Caustic]);
        let picture = Picture {
            width: COLUMNS,
            height: MAX_PICTURE_SIDE,
            layers,
            light_groups: settings.picture.light_groups.clone(),
            filter: Filter::Box,
            irradiance: true,
            ..Picture::default()
        };
        let settings = settings.clone().with(|settings| {
            settings.picture = picture;
            settings.photons.photons_for = PhotonsFor::Scene;
            settings.integrator.irradiance_error = None;
            settings.integrator.adaptive_threshold = None;
            settings.schedule.part = None;
            settings.schedule.keep_records = false;
            settings.outputs = TileOutputs::default();
        });
        Self { scene, settings, weights, renderer: Renderer::default() }
    }

    /// Measures points with consecutive numbers, the first of which is `first`. More than
    /// [`SENSORS_TOGETHER`] points are measured in groups. Progress counts the tiles of all.
    ///
    /// # Errors
    /// As [`Renderer::render`]; and [`RenderError::Sensors`] if a number is too large, or a position or
    /// normal is not possible.
    pub fn measure(
        &mut self,
        first: u32,
        points: &[Point],
        observer: &dyn Observer,
    ) -> Result<Vec<Reading>, RenderError> {
        let refused = |number: u64, reason| Err(RenderError::Sensors { number, reason });
        let end = u64::from(first) + points.len() as u64;
        if end > u64::from(MAX_SENSORS) {
            return refused(end, format!("there can be {MAX_SENSORS} sensors"));
        }
        let mut sensors = Vec::with_capacity(points.len());
        for (number, point) in (u64::from(first) + 1..).zip(points) {
            match point.sensor(self.scene) {
                Ok(sensor) => sensors.push(sensor),
                Err(fault) => return refused(number, fault.to_owned()),
            }
        }
        let unit = unit_of(self.scene);
        let groups = sensors.chunks(SENSORS_TOGETHER);
        let mut readings = Vec::with_capacity(points.len());
        let count = groups.len() as u64;
        for ((index, group), first) in (0..).zip(groups).zip((first..).step_by(SENSORS_TOGETHER)) {
            let observer = Share { observer, index, count };
            readings.extend(self.measure_together(&Sensors::new(first, group.to_vec(), unit), &observer)?);
        }
        Ok(readings)
    }

    fn measure_together(
        &mut self,
        sensors: &Sensors,
        observer: &dyn Observer,
    ) -> Result<Vec<Reading>, RenderError> {
        let (window, offset) = sensors.window();
        self.settings.picture.crop = Some(window);
        let mut sums = vec![Sums::default(); sensors.count()];
        let samples = self.settings.integrator.samples;
        let batches = batches(samples);
        let mut base: Option<Arc<Film>> = None;
        for batch in 1..=batches {
            let integrator = Integrator {
                samples: samples / batches * batch,
                planned_samples: Some(samples),
                ..self.settings.integrator.clone()
            };
            let settings = RenderSettings { integrator, ..self.settings.clone() };
            let observer = Share { observer, index: u64::from(batch) - 1, count: batches.into() };
            let rendering =
                self.renderer.render_sensors(self.scene, &settings, (sensors, base), &observer)?;
            let pixels = rendering.film.all().skip(offset);
            sums.iter_mut().zip(pixels).for_each(|(sums, pixel)| sums.add(batch, &pixel, self.weights));
            base = Some(Arc::new(rendering.film));
        }
        let pixels = base.iter().flat_map(|film| film.all()).skip(offset);
        Ok(pixels.zip(sums).map(|(pixel, sums)| sums.reading(batches, &pixel)).collect())
    }
}

/// Observer of one of several pictures, number `index` of `count`, whose tiles it counts together.
pub struct Share<'o> {
    /// Observer of all.
    pub observer: &'o dyn Observer,
    /// Number of the picture, from 0 on.
    pub index: u64,
    /// Number of pictures.
    pub count: u64,
}

impl Observer for Share<'_> {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        let Self { observer, index, count } = self;
        match phase {
            Phase::Tiles => observer.progress(phase, index * total + done, count * total),
            // The image is loaded again for each group of sensors, which takes little time.
            Phase::Load if *index > 0 => {}
            _ => observer.progress(phase, done, total),
        }
    }

    fn is_stopped(&self) -> bool {
        self.observer.is_stopped()
    }

    fn lost(&self, card: &str, error: &CardError) {
        self.observer.lost(card, error);
    }

    fn waits_for(&self, card: &str, error: &CardError, longest: Duration) {
        self.observer.waits_for(card, error, longest);
    }
}

/// Minimum radiance unit for the sums of sensors, W/(sr m^2). Sums hold at least 2^11 units a sample, which
/// are the light of all punctual lights together at [`NEAREST`]. It depends on the scene alone: the rounding
/// of a reading is the same in all groups of sensors.
fn unit_of(scene: &Scene) -> f32 {
    let brightest = |light: &PunctualLight| {
        let irradiance = match light.kind {
            PunctualKind::Directional { .. } => light.intensity,
            _ => light.intensity / (NEAREST * NEAREST),
        };
        f64::from(irradiance.max_element())
    };
    power_of_two_above(scene.lights.iter().map(brightest).sum::<f64>() / (PI * f64::from(1 << 11)))
}

/// Number of batches of `samples` samples: the largest divisor that is not above [`BATCHES`].
fn batches(samples: u32) -> u32 {
    (1..=BATCHES).rev().find(|&batches| samples.is_multiple_of(batches)).unwrap_or(1)
}

/// Sums over the batches of a sensor.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// Weighted irradiance of all batches so far, times their number.
    last: f64,
    /// Sum of the squares of the batches' weighted irradiances.
    squares: f64,
}

impl Sums {
    /// Adds batch number `batch`, from 1 on. `pixel` is the mean of all batches up to this one.
    fn add(&mut self, batch: u32, pixel: &FilmPixel, weights: [f64; 3]) {
        let [direct, indirect] = parts(pixel);
        let mean: f64 = (0..3).map(|channel| weights[channel] * (direct[channel] + indirect[channel])).sum();
        let all = mean * f64::from(batch);
        self.squares += (all - self.last).powi(2);
        self.last = all;
    }

    fn reading(&self, batches: u32, pixel: &FilmPixel) -> Reading {
        let [direct, indirect] = parts(pixel);
        let n = f64::from(batches);
        let variance = (self.squares / n - (self.last / n).powi(2)).max(0.0);
        Reading {
            direct,
            indirect,
            error: if batches > 1 { (variance / (n - 1.0)).sqrt() } else { f64::NAN },
        }
    }
}

/// Direct and indirect irradiance of a pixel, W/m^2.
fn parts(pixel: &FilmPixel) -> [[f64; 3]; 2] {
    let layers = &pixel.layers;
    let [direct, indirect, caustic] =
        [layers.direct, layers.indirect, layers.caustic].map(|light| light.map(f64::from));
    [direct, [0, 1, 2].map(|channel| indirect[channel] + caustic[channel])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_fall_into_equal_batches() {
        for (samples, expected) in [(1, 1), (2, 2), (15, 15), (16, 16), (17, 1), (64, 16), (100, 10)] {
            assert_eq!(batches(samples), expected);
        }
    }

    #[test]
    fn the_error_is_that_of_the_mean_of_the_batches() {
        let light = [1.0, 3.0, 2.0, 6.0];
        let mut sums = Sums::default();
        let mut pixel = FilmPixel::default();
        for (batch, _) in (1..).zip(light) {
            let mean = light[..batch as usize].iter().sum::<f32>() / batch as f32;
            pixel.layers.direct = [mean; 3];
            sums.add(batch, &pixel, [0.0, 1.0, 0.0]);
        }
        let expected = ((4.0 + 0.0 + 1.0 + 9.0) / 3.0 / 4.0_f64).sqrt();
        assert!((sums.reading(4, &pixel).error - expected).abs() < 1e-6);
    }
}
