//! Sensors as the pixels of a picture, and their place in the card image.

use std::sync::{Arc, OnceLock};

use photoncard_map::pack::CardImage;
use photoncard_picture::film::Window;
use photoncard_shared::layout::Sensor;
use photoncard_shared::message::{Camera, Projection, SumScale};

use crate::RenderError;

/// Columns of the picture whose pixels are sensors.
pub(super) const COLUMNS: u32 = 256;

/// Consecutive sensors that are measured together.
pub(crate) struct Sensors {
    /// Number of the first sensor among all.
    first: u32,
    sensors: Vec<Sensor>,
    /// Minimum radiance unit, W/(sr m^2), that the light of the sensors needs.
    unit: f32,
    /// Card image with the sensors, once it is made, and the camera that reads them there.
    placed: OnceLock<(Arc<CardImage>, Camera)>,
}

impl Sensors {
    pub(super) fn new(first: u32, sensors: Vec<Sensor>, unit: f32) -> Self {
        Self { first, sensors, unit, placed: OnceLock::new() }
    }

    /// Units of a pixel's sums, from those of the card image without sensors.
    pub(crate) fn scale(&self, of_image: SumScale) -> SumScale {
        SumScale { radiance: of_image.radiance.max(self.unit), ..of_image }
    }

    pub(super) fn count(&self) -> usize {
        self.sensors.len()
    }

    /// Window of the picture that has the sensors, and the index of the first in it.
    pub(super) fn window(&self) -> (Window, usize) {
        let end = self.first + self.sensors.len() as u32;
        let window = Window { x0: 0, x1: COLUMNS, y0: self.first / COLUMNS, y1: end.div_ceil(COLUMNS) };
        (window, (self.first % COLUMNS) as usize)
    }

    /// Card image `image` with the sensors, and the camera of the frame that reads them. Only the image of
    /// the first call counts: sensors are measured in one scene.
    ///
    /// # Errors
    /// If the image is too large.
    pub(crate) fn placed_in(&self, image: &CardImage) -> Result<(&Arc<CardImage>, Camera), RenderError> {
        let (image, camera) = match self.placed.get() {
            Some(placed) => placed,
            None => {
                let unit = self.scale(image.view().0.header.sum_scale()).radiance;
                let (image, line) = image.with_sensors(&self.sensors, unit)?;
                let made = (Arc::new(image), self.camera(line));
                self.placed.get_or_init(|| made)
            }
        };
        Ok((image, *camera))
    }

    /// Camera of a frame whose pixels are these sensors, which lie in card memory from line `line` on.
    fn camera(&self, line: u32) -> Camera {
        let projection = Projection::Sensors { line, first: self.first, count: self.sensors.len() as u32 };
        let [forward, right, up] = [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        Camera { projection, ..Camera::pinhole([0.0; 3], forward, right, up) }
    }
}
