//! Plan of a bake: charts, texels and sensors.

use photoncard_map::pack::PackedScene;
use photoncard_scene::Scene;
use photoncard_shared::checksum::{Checksum, checksum};
use serde_json::Value;

use super::atlas::Atlas;
use super::error::BakeError;
use super::part::Whole;
use super::solids::Solids;
use super::surfaces::Surfaces;
use super::texels::{Sample, Texel, texels};
use crate::RenderSettings;
use crate::measure::{MAX_SENSORS, Point};

/// Sensors along a texel that are possible.
const SUPERSAMPLES: std::ops::RangeInclusive<u32> = 1..=4;

/// Settings of a bake.
#[derive(Clone, Debug, PartialEq)]
pub struct BakeSettings {
    /// Names of the objects that get lightmaps; all if there are none.
    pub objects: Vec<String>,
    /// Texels per metre; `None` for the density at which one page of 1024 x 1024 texels holds all.
    pub density: Option<f64>,
    /// Side of the pages, texels.
    pub size: u32,
    /// Sensors along a texel.
    pub supersample: u32,
}

impl Default for BakeSettings {
    fn default() -> Self {
        Self { objects: Vec::new(), density: None, size: 2048, supersample: 2 }
    }
}

/// Charts, texels and sensors of a bake.
pub struct Plan {
    surfaces: Surfaces,
    atlas: Atlas,
    texels: Vec<Texel>,
}

impl Plan {
    /// Plans the bake of a scene.
    ///
    /// # Errors
    /// If a setting is not possible, the texels do not fit, or the scene cannot be packed.
    pub fn new(scene: &Scene, settings: &BakeSettings) -> Result<Self, BakeError> {
        let BakeSettings { objects, density, size, supersample } = settings;
        if !SUPERSAMPLES.contains(supersample) {
            return Err(BakeError::Supersample { supersample: *supersample });
        }
        let surfaces = Surfaces::new(scene, objects)?;
        let atlas = Atlas::new(&surfaces, *density, *size)?;
        let area = |[[x0, y0], [x1, y1]]: [[u32; 2]; 2]| u64::from(x1 - x0) * u64::from(y1 - y0);
        let count = atlas.charts.iter().map(|chart| area(chart.rectangle)).sum::<u64>();
        if count > u64::from(MAX_SENSORS) {
            return Err(BakeError::TooMany { what: "texels", count, most: MAX_SENSORS.into() });
        }
        let mut texels = texels(&surfaces, &atlas, *supersample);
        let packed = PackedScene::new(scene)?;
        Solids::new(&surfaces.scene, &packed, (1.0 / atlas.density) as f32).free(&mut texels)?;
        let count: u64 = texels.iter().map(|texel| texel.samples.len() as u64).sum();
        if count > u64::from(MAX_SENSORS) {
            return Err(BakeError::TooMany { what: "sensors", count, most: MAX_SENSORS.into() });
        }
        if count == 0 {
            return Err(BakeError::Density { density: atlas.density });
        }
        Ok(Self { surfaces, atlas, texels })
    }

    /// Places of the charts on the pages.
    pub fn atlas(&self) -> &Atlas {
        &self.atlas
    }

    /// Surfaces of the scene.
    pub fn surfaces(&self) -> &Surfaces {
        &self.surfaces
    }

    /// Texels of all charts.
    pub fn texels(&self) -> &[Texel] {
        &self.texels
    }

    /// Points of all sensors, in the coordinates of the scene's file.
    pub fn points(&self) -> Vec<Point> {
        let offset = self.surfaces.scene.offset;
        let point = |sample: &Sample| Point {
            position: (sample.position.as_dvec3() + offset).to_array(),
            normal: sample.normal.as_dvec3().to_array(),
        };
        self.texels.iter().flat_map(|texel| &texel.samples).map(point).collect()
    }

    /// Number of sensors and identity of a bake of the scene with these settings, equal in all its parts.
    pub fn whole(&self, scene: &Scene, settings: &RenderSettings) -> Whole {
        let text = Value::from(settings.identity(scene)).to_string();
        let mut sum = Checksum::default();
        let points = self.points();
        for number in points.iter().flat_map(|point| [point.position, point.normal]).flatten() {
            sum.update(&number.to_le_bytes());
        }
        let identity = format!("{:08x}{:08x}", checksum(text.as_bytes()), sum.value());
        Whole { sensors: points.len() as u32, identity }
    }
}
