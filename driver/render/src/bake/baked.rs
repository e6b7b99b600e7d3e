//! Light of the texels of a plan.

use std::f32::consts::PI;

use glam::{DVec3, Vec3};

use super::colours::colours;
use super::error::BakeError;
use super::pages::{Page, greatest, pages, rgbm_png};
use super::part::Light;
use super::plan::Plan;
use super::texels::Texel;

/// Light of all texels.
pub struct Baked {
    /// Irradiance, W/m^2.
    pub irradiance: Vec<Page>,
    /// Outgoing radiance, W/(sr m^2).
    pub radiance: Vec<Page>,
}

impl Baked {
    /// Pages of the irradiance of all sensors, in the order of [`Plan::points`], W/m^2.
    pub fn irradiance(plan: &Plan, light: &[Light]) -> Vec<Page> {
        let mut light = light.iter();
        let irradiance = |texel: &Texel| {
            let own = light.by_ref().take(texel.samples.len());
            let sum = own.fold(DVec3::ZERO, |sum, light| sum + DVec3::from_array(*light));
            (!texel.samples.is_empty()).then(|| (sum / texel.samples.len() as f64).as_vec3())
        };
        let measured: Vec<Option<Vec3>> = plan.texels().iter().map(irradiance).collect();
        pages(plan.atlas(), plan.texels(), &measured)
    }

    /// Lightmaps from pages of irradiance, which may be denoised.
    pub fn of(plan: &Plan, irradiance: Vec<Page>) -> Self {
        let colours = colours(plan.surfaces(), plan.atlas(), plan.texels());
        let radiance = plan.texels().iter().zip(colours).map(|(texel, colour)| {
            let [x, y] = texel.place;
            let page = irradiance.get(texel.page as usize)?;
            let light = page.values.get(y as usize * page.size as usize + x as usize)?;
            Some(colour.albedo * *light / PI + colour.emission)
        });
        let radiance = pages(plan.atlas(), plan.texels(), &radiance.collect::<Vec<_>>());
        Self { irradiance, radiance }
    }

    /// PNG files of the pages' irradiance in RGBM, whose range is [`Self::range`].
    ///
    /// # Errors
    /// If the encoder fails.
    pub fn rgbm(&self) -> Result<Vec<Vec<u8>>, BakeError> {
        let range = self.range();
        self.irradiance.iter().map(|page| rgbm_png(page, range)).collect()
    }

    /// Greatest irradiance, W/m^2.
    pub fn range(&self) -> f32 {
        greatest(&self.irradiance)
    }
}
