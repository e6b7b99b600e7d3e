//! Perspective cameras.

use glam::Vec3;

/// A perspective camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, or `camera N`.
    pub name: String,
    /// Position of the pinhole, metres.
    pub origin: Vec3,
    /// Unit vector to the right of the picture.
    pub right: Vec3,
    /// Unit vector to the top of the picture.
    pub up: Vec3,
    /// Unit vector of the view direction.
    pub forward: Vec3,
    /// Vertical field of view in radians; the horizontal one follows from the picture's aspect.
    pub vertical_fov: f32,
    /// Width over height, if the file states it.
    pub aspect: Option<f32>,
}

impl Camera {
    /// Width and height, pixels, of a picture with the aspect ratio that the file states; `None` if the file
    /// states none. The longer side has `side` pixels, the shorter one at least 1.
    pub fn size(&self, side: u32) -> Option<(u32, u32)> {
        let aspect = self.aspect?;
        let shorter = |ratio: f32| ((side as f32 * ratio + 0.5) as u32).clamp(1, side);
        Some(if aspect >= 1.0 { (side, shorter(1.0 / aspect)) } else { (shorter(aspect), side) })
    }

    /// Returns whether the aspect ratio of a picture of this size differs from the file's by more than one
    /// pixel of the shorter side.
    pub fn is_cropped(&self, width: u32, height: u32) -> bool {
        let meant = self.aspect.map(|aspect| (width as f32 - height as f32 * aspect).abs());
        meant.is_some_and(|pixels| pixels > self.aspect.unwrap_or(1.0).max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(aspect: Option<f32>) -> Camera {
        let [right, up, forward] = [Vec3::X, Vec3::Y, Vec3::NEG_Z];
        let origin = Vec3::ZERO;
        Camera { name: "eye".to_owned(), origin, right, up, forward, vertical_fov: 1.0, aspect }
    }

    #[test]
    fn sizes_have_the_aspect_ratio_of_the_file() {
        for (aspect, size) in [
            (1.0, (512, 512)),
            (2.0, (512, 256)),
            (0.5, (256, 512)),
            (16.0 / 9.0, (512, 288)),
            (1e-6, (1, 512)),
            (1e30, (512, 1)),
        ] {
            let camera = camera(Some(aspect));
            assert_eq!(camera.size(512), Some(size), "{aspect}");
        }
        assert_eq!(camera(None).size(512), None);
    }

    #[test]
    fn a_size_of_another_aspect_ratio_is_cropped() {
        let wide = camera(Some(1.5));
        assert!(wide.is_cropped(512, 512) && wide.is_cropped(512, 384));
        assert!(!wide.is_cropped(512, 341) && !wide.is_cropped(3, 2));
        assert!(!camera(Some(64.0)).is_cropped(512, 8) && camera(Some(64.0)).is_cropped(512, 10));
        assert!(!camera(None).is_cropped(1, 1000));
    }
}
