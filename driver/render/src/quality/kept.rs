//! Takes over the settings of samples that an earlier render has stored, for a render that adds to them.

use photoncard_map::photon_map::PhotonsFor;
use photoncard_picture::choice::Choice;
use serde_json::Value;

use super::Stated;
use crate::{NamedSettings, RenderSettings};

impl Stated {
    /// Copies the settings of stored samples into `settings`, so that more samples can be added to the
    /// picture. It copies the values that a quality may have chosen and the planned number of samples, but
    /// none that the user stated. `kept` has the values by option names. An invalid value is ignored, because
    /// a render compares all settings with those of the samples anyway.
    pub fn take_over(self, settings: &mut RenderSettings, kept: &NamedSettings) {
        let number = |name: &str| kept.get(name).and_then(Value::as_u64);
        let count = |name: &str| number(name).and_then(|count| u32::try_from(count).ok());
        let RenderSettings { photons, integrator, .. } = settings;
        if !self.photons {
            let kept = number("photons").and_then(|count| usize::try_from(count).ok());
            photons.count = kept.unwrap_or(photons.count);
        }
        if !self.caustic_photons {
            let kept = number("caustic-photons").and_then(|count| usize::try_from(count).ok());
            photons.caustic_photons = kept.or(photons.caustic_photons);
        }
        if !self.neighbors {
            photons.neighbors = count("neighbors").unwrap_or(photons.neighbors);
        }
        if photons.photons_for == PhotonsFor::Auto {
            let kept = kept.get("photons-for").and_then(Value::as_str);
            let is_of_camera = kept == Some(PhotonsFor::Camera.name());
            photons.photons_for = if is_of_camera { PhotonsFor::Camera } else { PhotonsFor::Scene };
        }
        if !self.gather_rays {
            integrator.gather_rays = count("gather-rays").unwrap_or(integrator.gather_rays);
        }
        if !self.shadow_rays {
            integrator.shadow_rays = count("shadow-rays").unwrap_or(integrator.shadow_rays);
        }
        // The stored error bound is the quality's own, or smaller if the user asked for little noise. The
        // scene determines only whether irradiance is interpolated.
        if !self.cache
            && let Some(kept) = kept.get("ic-error")
        {
            let error =
                kept.as_f64().filter(|&error| error > 0.0).map_or(f32::INFINITY, |error| error as f32);
            let smaller = |own: f32| (!kept.is_null()).then_some(own.min(error));
            integrator.irradiance_error = integrator.irradiance_error.and_then(smaller);
        }
        if !self.adaptive {
            let kept = kept.get("adaptive").and_then(Value::as_f64).map(|threshold| threshold as f32);
            integrator.adaptive_threshold =
                kept.filter(|threshold| threshold.is_finite() && *threshold > 0.0);
        }
        integrator.planned_samples = integrator.planned_samples.or(count("planned-spp"));
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn kept(settings: &RenderSettings) -> NamedSettings {
        let mut kept = settings.of_pixels();
        kept.insert("planned-spp".to_owned(), json!(settings.integrator.planned()));
        kept
    }

    #[test]
    fn unstated_settings_become_those_of_the_kept_samples() {
        let earlier = RenderSettings::default().with(|s| {
            s.photons.count = 3000;
            (s.photons.caustic_photons, s.photons.neighbors) = (Some(700), 9);
            s.integrator.samples = 3;
            (s.integrator.gather_rays, s.integrator.shadow_rays) = (40, 6);
            s.integrator.adaptive_threshold = Some(0.25);
        });
        let asked = RenderSettings::default().with(|s| {
            s.integrator.samples = 7;
            s.integrator.irradiance_error = Some(0.1);
        });
        let taken =
            |stated: Stated| asked.clone().with(|settings| stated.take_over(settings, &kept(&earlier)));
        let planned = Some(3);
        let all = earlier.clone().with(|s| {
            (s.integrator.samples, s.integrator.planned_samples) = (7, planned);
        });
        assert_eq!(taken(Stated::default()), all);
        let none = asked.clone().with(|s| s.integrator.planned_samples = planned);
        assert_eq!(taken(Stated::ALL), none);
        let of_other_quality = earlier.with(|s| s.integrator.irradiance_error = Some(0.2));
        let taken = asked.clone().with(|s| Stated::default().take_over(s, &kept(&of_other_quality)));
        assert_eq!(taken.integrator.irradiance_error, Some(0.1));
        let of_little_noise = asked.clone().with(|s| s.integrator.irradiance_error = Some(0.025));
        let taken = asked.clone().with(|s| Stated::default().take_over(s, &kept(&of_little_noise)));
        assert_eq!(taken.integrator.irradiance_error, Some(0.025));
        let planned = asked.with(|s| s.integrator.planned_samples = Some(9));
        assert_eq!(
            planned.with(|s| Stated::ALL.take_over(s, &kept(&all))).integrator.planned_samples,
            Some(9)
        );
    }

    #[test]
    fn invalid_values_are_ignored() {
        for value in [json!(-1), json!("many"), json!(1e9), json!([1]), json!(u64::from(u32::MAX) + 1)] {
            let names = ["gather-rays", "shadow-rays", "planned-spp", "ic-error"];
            let kept = names.map(|name| (name.to_owned(), value.clone())).into_iter().collect();
            let asked = RenderSettings::default();
            assert_eq!(asked.clone().with(|s| Stated::default().take_over(s, &kept)), asked);
        }
    }
}
