//! Options of the picture and of its camera.

use clap::Args;
use photoncard_driver::film::Window;
use photoncard_driver::layer::Layers;
use photoncard_driver::render::{Filter, Picture};
use photoncard_driver::scene::{Aperture, Camera, Projection};

use super::choice::choice;

/// Default length of the picture's longer side, pixels.
const SIDE: u32 = 512;

/// Aspect ratio of a picture whose height alone is stated, if the camera has none.
const WIDE: f32 = 16.0 / 9.0;

/// Value of `--size`, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Size {
    Exact(u32, u32),
    /// Length of the longer side.
    Longer(u32),
    /// Height of a video format: 1080 for `1080p`.
    Height(u32),
}

impl Size {
    /// Returns the picture's width and height, pixels. If only one side is stated, the other follows from the
    /// camera's aspect ratio.
    fn of(self, camera: Option<&Camera>) -> (u32, u32) {
        let aspect = camera.and_then(|camera| camera.aspect);
        match self {
            Self::Exact(width, height) => (width, height),
            Self::Longer(side) => camera.and_then(|camera| camera.size(side)).unwrap_or((side, side)),
            Self::Height(height) => {
                let width = height as f32 * aspect.unwrap_or(WIDE);
                ((width + 0.5).max(1.0) as u32, height)
            }
        }
    }
}

#[derive(Args)]
#[command(next_help_heading = "Picture and camera")]
pub(crate) struct PictureOptions {
    /// Width and height of the picture, pixels; or the longer side alone, such as 800; or 1080p, 4k or 50%
    /// [default: 512 on the longer side]
    ///
    /// If width and height are not both stated, the picture has the aspect ratio that the file states for the
    /// camera. If the file states none, the picture is square, or 16 to 9 for a video format such as 1080p. A
    /// percentage is of the default longer side.
    #[arg(long, value_name = "WxH", value_parser = size, allow_hyphen_values = true)]
    size: Option<Size>,
    /// Render only the columns from X0 to X1 - 1 and the rows from Y0 to Y1 - 1, counted from 0 at the top
    /// left
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = crop, allow_hyphen_values = true, hide_short_help = true)]
    crop: Option<Window>,
    /// Name of the camera [default: the first of the file]
    #[arg(long)]
    camera: Option<String>,
    /// Position of the camera in the scene file's coordinates, metres [default: the camera's own]
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true)]
    camera_at: Option<[f64; 3]>,
    /// Point in the middle of the picture, in the scene file's coordinates, metres [default: a point in the
    /// camera's own direction]
    ///
    /// The top of the picture is towards +y. If the camera looks straight up or straight down, the right of
    /// the picture is towards +x, so that the top is towards +z or -z, respectively.
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true)]
    look_at: Option<[f64; 3]>,
    /// Direction that is up in the picture [default: +y with --look-at, else the camera's own]
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true, hide_short_help = true)]
    up: Option<[f64; 3]>,
    /// Vertical field of view, degrees [default: the camera's own]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    fov: Option<f32>,
    /// Parallel rays; the picture shows this height, metres [default: the camera's own projection]
    #[arg(long, value_name = "METRES", allow_negative_numbers = true, conflicts_with_all = ["fov", "panorama"], hide_short_help = true)]
    orthographic: Option<f32>,
    /// Equirectangular panorama of these longitudes and latitudes, degrees, such as 360,180 for all around
    /// [default: the camera's own projection]
    ///
    /// 180 alone is 180,180, and 360 alone 360,180. Unless --size states both sides, the picture has their
    /// ratio.
    #[arg(long, value_name = "DEGREES", value_parser = panorama, allow_hyphen_values = true, conflicts_with = "fov", hide_short_help = true)]
    panorama: Option<[f32; 2]>,
    /// Lens shift to the right and to the top, as parts of the picture's longer side, as in Blender [default:
    /// the camera's own]
    ///
    /// It moves the picture in its plane: 0,0.2 shows more of the top, and verticals stay vertical.
    #[arg(long, value_name = "X,Y", value_parser = pair, allow_hyphen_values = true, hide_short_help = true)]
    shift: Option<[f32; 2]>,
    /// Opening of a thin lens: an f-number such as f/2.8, or the diameter in metres; 0 is a pinhole [default:
    /// the camera's own]
    ///
    /// An f-number is of a lens before a sensor whose longer side has 36 mm, as in Blender.
    #[arg(long, value_name = "f/N|METRES", allow_hyphen_values = true)]
    aperture: Option<Aperture>,
    /// Distance of the plane in focus along the view direction, metres [default: the camera's own, or the
    /// distance of --look-at]
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    focus: Option<f32>,
    #[arg(
        long,
        value_name = "LIST",
        hide_short_help = true,
        help = format!(
            "Layers of the EXR besides radiance, with commas between them: {}, illuminance (lx, by a frame of its own); or all of one frame, or none [default: {}]",
            Layers::all().to_string().replace(',', ", "),
            Layers::default()
        )
    )]
    pub(super) aov: Option<Layers>,
    /// Leave the environment out of the background, and write alpha: into the EXR's channel A, beside
    /// premultiplied R, G and B, and into the PNG
    ///
    /// The environment still lights the scene, and is seen in mirrors and through glass, which counts as
    /// covering the background.
    #[arg(long, hide_short_help = true)]
    pub(crate) transparent: bool,
    /// Show irradiance, W/m^2, of the surfaces that the camera sees, in place of radiance
    ///
    /// Surfaces count as white, Lambertian and dark; what glass and mirrors show is not looked for. A picture
    /// beside its radiance has illuminance by --aov illuminance.
    #[arg(long, hide_short_help = true)]
    irradiance: bool,
    /// Lumens per watt of --aov illuminance [default: 683 for a file of Blender, whose lights become watts; 1
    /// for others, whose lights glTF states in candela and lux]
    #[arg(long, value_name = "LUMENS", allow_negative_numbers = true, hide_short_help = true)]
    pub(super) lumens_per_watt: Option<f32>,
    /// Pixel filter [default: blackman-harris; box with --quality paper]
    #[arg(long, value_parser = choice::<Filter>(), hide_short_help = true)]
    filter: Option<Filter>,
}

impl PictureOptions {
    /// Returns the settings that these options state. Settings that are not stated are those of `base`.
    pub(super) fn settings(&self, base: &Picture) -> Picture {
        let Self {
            size,
            crop,
            camera,
            camera_at,
            look_at,
            up,
            fov,
            orthographic,
            panorama,
            shift,
            aperture,
            focus,
            aov: _,
            transparent,
            irradiance,
            lumens_per_watt,
            filter,
        } = self;
        let (width, height) = size.unwrap_or(Size::Longer(SIDE)).of(None);
        Picture {
            width,
            height,
            crop: *crop,
            camera: camera.clone(),
            camera_at: *camera_at,
            look_at: *look_at,
            up: *up,
            fov: *fov,
            orthographic: *orthographic,
            panorama: *panorama,
            shift: *shift,
            aperture: *aperture,
            focus: *focus,
            layers: self.layers(),
            light_groups: Vec::new(),
            filter: filter.unwrap_or(base.filter),
            transparent: *transparent,
            irradiance: *irradiance,
            lumens_per_watt: *lumens_per_watt,
        }
    }

    pub(crate) fn states_size(&self) -> bool {
        self.size.is_some()
    }

    /// Layers that the picture stores besides radiance.
    pub(crate) fn layers(&self) -> Layers {
        self.aov.clone().unwrap_or_default()
    }

    /// Gives the picture the camera's aspect ratio, unless width and height are both stated. Returns a notice
    /// if the stated ratio differs from the camera's.
    pub(crate) fn fit(&self, camera: &Camera, picture: &mut Picture) -> Option<String> {
        let size = self.size.unwrap_or(Size::Longer(SIDE));
        (picture.width, picture.height) = size.of(Some(camera));
        let Size::Exact(width, height) = size else { return None };
        if !camera.is_cropped(width, height) {
            return None;
        }
        let (width, height) = camera.size(width.max(height))?;
        let Camera { name, aspect, projection, .. } = camera;
        let kept = match projection {
            Projection::Perspective { .. } => "the vertical field of view is kept",
            Projection::Orthographic { .. } => "the height that it shows is kept",
            Projection::Panorama { .. } => "the panorama is stretched",
        };
        Some(format!(
            "the camera '{name}' has an aspect ratio of {}, and the picture another; {kept}: \
             --size {width}x{height} shows what the file means",
            aspect.unwrap_or(1.0)
        ))
    }
}

fn size(text: &str) -> Result<Size, String> {
    let number = |text: &str| text.parse().ok().filter(|number: &u32| *number > 0);
    let stated = match text.to_ascii_lowercase() {
        text if text == "4k" => Some(Size::Height(2160)),
        text if text.contains('x') => text
            .split_once('x')
            .and_then(|(width, height)| Some(Size::Exact(number(width)?, number(height)?))),
        text => match (text.strip_suffix('p'), text.strip_suffix('%')) {
            (Some(height), _) => number(height).map(Size::Height),
            (_, Some(percent)) => percent_of_side(percent).map(Size::Longer),
            _ => number(&text).map(Size::Longer),
        },
    };
    stated.ok_or_else(|| {
        "a size is WIDTHxHEIGHT, both at least 1, such as 512x512; 800 for the longer side; 1080p; or 50% of the default".into()
    })
}

/// Parses `percent`, and returns this percentage of [`SIDE`] as pixels, at least 1. `None` unless it is
/// positive.
fn percent_of_side(percent: &str) -> Option<u32> {
    let percent = percent.parse().ok().filter(|percent: &f32| *percent > 0.0 && percent.is_finite())?;
    Some(((SIDE as f32 * percent / 100.0 + 0.5) as u32).max(1))
}

fn crop(text: &str) -> Result<Window, String> {
    let ends: Result<Vec<u32>, _> = text.split(',').map(str::parse).collect();
    match ends.as_deref() {
        Ok(&[x0, x1, y0, y1]) => Ok(Window { x0, x1, y0, y1 }),
        _ => Err("a crop is X0,X1,Y0,Y1: four whole numbers, such as 0,64,0,64".into()),
    }
}

fn numbers<const N: usize>(text: &str) -> Option<[f32; N]> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers.and_then(|numbers| numbers.try_into().ok())
}

fn pair(text: &str) -> Result<[f32; 2], String> {
    numbers(text).ok_or_else(|| "two numbers are X,Y, such as 0,0.2".into())
}

fn panorama(text: &str) -> Result<[f32; 2], String> {
    let alone = |[longitude]: [f32; 1]| [longitude, 180.0];
    let stated = numbers(text).or_else(|| numbers(text).map(alone));
    stated.ok_or_else(|| "a panorama is LONGITUDES,LATITUDES in degrees, such as 360,180".into())
}

pub(super) fn place(text: &str) -> Result<[f64; 3], String> {
    three_numbers(text).ok_or_else(|| "a place is X,Y,Z: three numbers of metres, such as 0,1.5,4".into())
}

fn direction(text: &str) -> Result<[f64; 3], String> {
    three_numbers(text).ok_or_else(|| "a direction is X,Y,Z: three numbers, such as 0,1,0".into())
}

fn three_numbers(text: &str) -> Option<[f64; 3]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_aspect_ratio_of_the_camera_completes_sizes() {
        let camera = |aspect| {
            let [origin, right, up, forward] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
            let [origin, right, up, forward] = [origin, right, up, forward].map(Into::into);
            Camera::perspective("eye", origin, [right, up, forward], 1.0, aspect)
        };
        for (text, plain, wide) in [
            ("640x360", (640, 360), (640, 360)),
            ("1080p", (1920, 1080), (2160, 1080)),
            ("4K", (3840, 2160), (4320, 2160)),
            ("800", (800, 800), (800, 400)),
            ("50%", (256, 256), (256, 128)),
            ("0.01%", (1, 1), (1, 1)),
        ] {
            let size = size(text).unwrap();
            assert_eq!(
                [None, Some(2.0)].map(|aspect| size.of(Some(&camera(aspect)))),
                [plain, wide],
                "{text}"
            );
        }
        for text in
            ["", "0", "x", "0x5", "5x", "-5", "p", "0p", "%", "-5%", "nan%", "1.5", "12x12x12", "4294967296"]
        {
            assert!(size(text).is_err(), "{text}");
        }
    }
}
