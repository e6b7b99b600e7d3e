//! Cameras: perspective, with a thin lens, orthographic, and panoramas.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use glam::Vec3;
use photoncard_shared::message;

/// A camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, or `camera N`.
    pub name: String,
    /// Position of the pinhole or of the lens' centre, metres; of an orthographic camera, the middle of the
    /// picture.
    pub origin: Vec3,
    /// Unit vector to the right of the picture.
    pub right: Vec3,
    /// Unit vector to the top of the picture.
    pub up: Vec3,
    /// Unit vector of the view direction.
    pub forward: Vec3,
    /// Projection, which states the height of what the picture shows.
    pub projection: Projection,
    /// Lens shift to the right and to the top, in units of the picture's longer side, as in Blender. It moves
    /// the picture in its plane, so that verticals stay vertical.
    pub shift: [f32; 2],
    /// Thin lens of a perspective camera; `None` for a pinhole, whose picture is sharp at all distances.
    pub lens: Option<Lens>,
    /// Width over height, if the file states it.
    pub aspect: Option<f32>,
}

/// Projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Rays from one point, or through a lens.
    Perspective {
        /// Vertical field of view in radians; the horizontal one follows from the picture's aspect.
        vertical_fov: f32,
    },
    /// Parallel rays.
    Orthographic {
        /// Half the height of what the picture shows, metres (glTF's `ymag`); the width follows from the
        /// picture's aspect.
        half_height: f32,
    },
    /// An equirectangular panorama: columns are longitudes and rows latitudes.
    Panorama {
        /// Angles that the picture's width and height show, radians.
        angles: [f32; 2],
    },
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the opening, metres.
    pub radius: f32,
    /// Distance of the plane in focus along the view direction, metres.
    pub focus: f32,
}

/// Opening of a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aperture {
    /// Diameter, metres; 0 is a pinhole.
    Diameter(f32),
    /// Focal length over diameter: 2.8 for f/2.8.
    FNumber(f32),
}

impl FromStr for Aperture {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.parse().ok().filter(|number: &f32| number.is_finite());
        let stated = match text.strip_prefix("f/") {
            Some(text) => number(text).filter(|number| *number > 0.0).map(Self::FNumber),
            None => number(text).filter(|number| *number >= 0.0).map(Self::Diameter),
        };
        stated.ok_or_else(|| {
            "an aperture is an f-number, such as f/2.8, or a diameter in metres, such as 0.01".into()
        })
    }
}

impl fmt::Display for Aperture {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Diameter(diameter) => write!(f, "{diameter}"),
            Self::FNumber(number) => write!(f, "f/{number}"),
        }
    }
}

/// Possible distances of the plane in focus, metres.
const FOCUS: RangeInclusive<f32> = 1e-6..=1e9;
/// Maximum diameter of a lens, metres.
const WIDEST: f32 = 1e6;
/// Maximum lens shift, in units of the picture's longer side.
const FARTHEST_SHIFT: f32 = 1e6;
/// Possible extents of an orthographic picture, metres.
pub(crate) const EXTENTS: RangeInclusive<f32> = 1e-9..=1e12;

/// Longer side of the sensor to which f-numbers refer, metres: 36 mm, as in Blender.
const SENSOR: f32 = 0.036;

impl Lens {
    /// Checks a distance of the plane in focus, metres.
    ///
    /// # Errors
    /// The reason why the distance is not possible.
    pub fn check_focus(focus: f32) -> Result<(), String> {
        if FOCUS.contains(&focus) {
            return Ok(());
        }
        Err(format!("a focus of {focus} m is not possible: it is from 1e-6 to 1e9 m"))
    }
}

impl Projection {
    /// Perspective projection with a vertical field of view in radians.
    pub const fn perspective(vertical_fov: f32) -> Self {
        Self::Perspective { vertical_fov }
    }

    /// Panorama of these angles of longitude and latitude, degrees.
    ///
    /// # Errors
    /// The reason why the angles are not possible.
    pub fn panorama(degrees: [f32; 2]) -> Result<Self, String> {
        let [longitude, latitude] = degrees;
        let is_angle = |degrees: f32, most: f32| degrees.is_normal() && degrees > 0.0 && degrees <= most;
        if is_angle(longitude, 360.0) && is_angle(latitude, 180.0) {
            return Ok(Self::Panorama { angles: degrees.map(f32::to_radians) });
        }
        Err(format!(
            "a panorama of {longitude} by {latitude} degrees is not possible: longitudes are above 0 and up to 360 degrees, latitudes up to 180"
        ))
    }

    /// Orthographic projection that shows `height` metres.
    ///
    /// # Errors
    /// The reason why the height is not possible.
    pub fn orthographic(height: f32) -> Result<Self, String> {
        if EXTENTS.contains(&height) {
            return Ok(Self::Orthographic { half_height: 0.5 * height });
        }
        Err("the height of an orthographic picture is above 0 metres, up to 1e12".into())
    }

    /// Name of the projection in texts and JSON.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Perspective { .. } => "perspective",
            Self::Orthographic { .. } => "orthographic",
            Self::Panorama { .. } => "panorama",
        }
    }
}

impl Camera {
    /// Perspective camera without lens shift, with a pinhole. `right`, `up` and `forward` are unit vectors,
    /// and the vertical field of view is in radians.
    pub fn perspective(
        name: &str,
        origin: Vec3,
        [right, up, forward]: [Vec3; 3],
        vertical_fov: f32,
        aspect: Option<f32>,
    ) -> Self {
        let (name, projection) = (name.to_owned(), Projection::perspective(vertical_fov));
        Self { name, origin, right, up, forward, projection, shift: [0.0; 2], lens: None, aspect }
    }

    /// Vertical field of view of a perspective camera, radians; `None` for another one.
    pub fn vertical_fov(&self) -> Option<f32> {
        match self.projection {
            Projection::Perspective { vertical_fov } => Some(vertical_fov),
            Projection::Orthographic { .. } | Projection::Panorama { .. } => None,
        }
    }

    /// Sets the lens shift.
    ///
    /// # Errors
    /// The reason, if the numbers are not finite, or the camera is a panorama, which has no plane to shift.
    pub fn set_shift(&mut self, shift: [f32; 2]) -> Result<(), String> {
        if !shift.iter().all(|number| number.abs() <= FARTHEST_SHIFT) {
            return Err("a lens shift is two finite numbers, up to 1e6".into());
        }
        if shift != [0.0; 2] && matches!(self.projection, Projection::Panorama { .. }) {
            return Err("a panorama has no lens shift".into());
        }
        self.shift = shift;
        Ok(())
    }

    /// Sets the lens, for a picture with this ratio of width to height. A diameter of 0 is a pinhole.
    ///
    /// # Errors
    /// The reason, if the camera is not perspective, or the numbers are not possible.
    pub fn set_lens(&mut self, aperture: Aperture, focus: f32, aspect: f32) -> Result<(), String> {
        Lens::check_focus(focus)?;
        let diameter = self.diameter(aperture, aspect);
        let diameter = diameter.ok_or("only a perspective camera has an aperture")?;
        if diameter > WIDEST {
            return Err(format!("an aperture of {diameter} m is not possible: it is up to 1e6 m"));
        }
        let radius = 0.5 * diameter;
        // A lens without extent is a pinhole.
        self.lens = radius.is_normal().then_some(Lens { radius, focus });
        Ok(())
    }

    /// Diameter of an opening, metres, for a picture with this ratio of width to height; `None` for a camera
    /// that is not perspective. The focal length, to which f-numbers refer, is that of a sensor whose longer
    /// side has 36 mm.
    fn diameter(&self, aperture: Aperture, aspect: f32) -> Option<f32> {
        let fov = self.vertical_fov()?;
        let focal_length = || 0.5 * SENSOR / (libm::tanf(0.5 * fov) * aspect.max(1.0));
        Some(match aperture {
            Aperture::Diameter(diameter) => diameter,
            Aperture::FNumber(number) => focal_length() / number,
        })
    }

    /// The camera of a frame of `width` by `height` pixels.
    pub fn of_frame(&self, width: u32, height: u32) -> message::Camera {
        let Self { origin, right, up, forward, projection, shift: [shift_x, shift_y], lens, .. } = *self;
        let longer = 2.0 * width.max(height) as f32;
        let shift = [shift_x * longer / width as f32, shift_y * longer / height as f32];
        let sides = |half_height: f32| [half_height * width as f32 / height as f32, half_height];
        let of_lens = |Lens { radius, focus }| message::Projection::ThinLens {
            right: (right * radius).to_array(),
            up: (up * radius).to_array(),
            focus,
        };
        let ([half_width, half_height], projection) = match projection {
            Projection::Perspective { vertical_fov } => {
                let lens = lens.map_or(message::Projection::Pinhole, of_lens);
                (sides(libm::tanf(0.5 * vertical_fov)), lens)
            }
            Projection::Orthographic { half_height } => {
                (sides(half_height), message::Projection::Orthographic)
            }
            Projection::Panorama { angles } => {
                let angles = angles.map(|angle| 0.5 * angle);
                ([1.0; 2], message::Projection::Panorama { angles })
            }
        };
        message::Camera {
            origin: origin.to_array(),
            forward: forward.to_array(),
            right: (right * half_width).to_array(),
            up: (up * half_height).to_array(),
            shift,
            projection,
        }
    }

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
        Camera::perspective("eye", Vec3::ZERO, [Vec3::X, Vec3::Y, Vec3::NEG_Z], 1.0, aspect)
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
