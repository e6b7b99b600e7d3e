//! Sensors: points at which a card measures irradiance.

use super::{Record, read_vector, write_vector};

/// A point at which irradiance is measured
/// ([`Projection::Sensors`](crate::message::Projection::Sensors)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Position, metres.
    pub position: [f32; 3],
    /// Unit normal of the plane whose irradiance is measured, on the side of the light.
    pub normal: [f32; 3],
}

impl Record for Sensor {
    const BYTES: usize = 24;
}

impl Sensor {
    /// Reads a record.
    pub fn read(bytes: &[u8; Self::BYTES]) -> Self {
        Self { position: read_vector(bytes, 0), normal: read_vector(bytes, 12) }
    }

    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        write_vector(&mut bytes, 0, self.position);
        write_vector(&mut bytes, 12, self.normal);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensors_survive_their_bytes() {
        let sensor = Sensor { position: [1.0, -2.0, 3.5], normal: [0.0, 1.0, 0.0] };
        assert_eq!(Sensor::read(&sensor.to_bytes()), sensor);
    }
}
