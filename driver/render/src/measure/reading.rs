//! Points of a measurement, and what is measured there.

use glam::DVec3;
use photoncard_scene::Scene;
use photoncard_shared::layout::Sensor;

/// Bound of the coordinates of sensors, metres: their squares are finite.
const MAX_COORDINATE: f64 = 1e18;

/// Point at which irradiance is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Position in the coordinates of the scene's file, metres.
    pub position: [f64; 3],
    /// Normal of the plane whose irradiance is measured, towards the light; of any length but 0.
    pub normal: [f64; 3],
}

impl Point {
    /// Reason why the point cannot be measured in any scene; `None` if it can.
    pub fn fault(&self) -> Option<&'static str> {
        self.unit_normal().err()
    }

    /// Unit normal of a point that can be measured.
    fn unit_normal(&self) -> Result<DVec3, &'static str> {
        if !self.position.into_iter().all(|coordinate| coordinate.abs() < MAX_COORDINATE) {
            return Err("its position is too far away");
        }
        let normal = DVec3::from_array(self.normal);
        (normal / normal.abs().max_element()).try_normalize().ok_or("its normal is 0")
    }

    pub(super) fn sensor(&self, scene: &Scene) -> Result<Sensor, &'static str> {
        let normal = self.unit_normal()?.as_vec3().to_array();
        Ok(Sensor { position: scene.in_scene(self.position.into()).to_array(), normal })
    }
}

/// Irradiance measured by a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Irradiance by direct light, W/m^2.
    pub direct: [f64; 3],
    /// Irradiance by light that surfaces have reflected, W/m^2.
    pub indirect: [f64; 3],
    /// Standard error of the weighted irradiance ([`Meter::new`](super::Meter::new)), W/m^2; NaN if the
    /// samples make one batch.
    pub error: f64,
}

impl Reading {
    /// Irradiance, W/m^2.
    pub fn irradiance(&self) -> [f64; 3] {
        [0, 1, 2].map(|channel| self.direct[channel] + self.indirect[channel])
    }
}
