//! Options of the picture and of the camera that sees it.

use clap::Args;
use photoncard_driver::film::Window;
use photoncard_driver::layer::Layers;
use photoncard_driver::render::{Filter, Picture};
use photoncard_driver::scene::Camera;

use super::choice::choice;

/// Longer side of a picture without a given size, pixels.
const SIDE: u32 = 512;

#[derive(Args)]
#[command(next_help_heading = "Picture and camera")]
pub(crate) struct PictureOptions {
    /// Width and height of the picture, pixels [default: 512 on the longer side]
    ///
    /// By default the picture has the aspect ratio that the file states for the camera, or is square if it states none.
    #[arg(long, value_name = "WxH", value_parser = size, allow_hyphen_values = true)]
    size: Option<(u32, u32)>,
    /// Render only the columns X0 up to X1 and the rows Y0 up to Y1
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = crop, allow_hyphen_values = true, hide_short_help = true)]
    crop: Option<Window>,
    /// Name of the camera [default: the first of the file]
    #[arg(long)]
    camera: Option<String>,
    /// Place of the camera in the scene file's coordinates, metres [default: the camera's own]
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true)]
    camera_at: Option<[f64; 3]>,
    /// Place in the middle of the picture, metres [default: in the camera's own direction]
    ///
    /// The top of the picture is towards +y. Straight up and straight down the right is +x, so that the top is +z and -z.
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true)]
    look_at: Option<[f64; 3]>,
    /// Vertical field of view [default: the camera's own]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    fov: Option<f32>,
    #[arg(
        long,
        value_name = "LIST",
        hide_short_help = true,
        help = format!(
            "Layers of the EXR besides radiance, with commas between them: direct, indirect, caustic, albedo, N, Z, gathers; or all, \
             or none [default: {}]",
            Layers::default()
        )
    )]
    pub(super) aov: Option<Layers>,
    /// Pixel filter [default: blackman-harris; box with --quality paper]
    #[arg(long, value_parser = choice::<Filter>(), hide_short_help = true)]
    filter: Option<Filter>,
}

impl PictureOptions {
    /// Settings of these options; `base` gives those that are not stated.
    pub(super) fn settings(&self, base: &Picture) -> Picture {
        let Self { size, crop, camera, camera_at, look_at, fov, aov: _, filter } = self;
        let (width, height) = size.unwrap_or((SIDE, SIDE));
        Picture {
            width,
            height,
            crop: *crop,
            camera: camera.clone(),
            camera_at: *camera_at,
            look_at: *look_at,
            fov: *fov,
            layers: self.layers(),
            filter: filter.unwrap_or(base.filter),
        }
    }

    /// Returns whether the size of the picture is stated.
    pub(crate) fn states_size(&self) -> bool {
        self.size.is_some()
    }

    /// Layers of the picture.
    pub(crate) fn layers(&self) -> Layers {
        self.aov.clone().unwrap_or_default()
    }

    /// Gives the picture the camera's aspect ratio, if no size is given. Returns a notice if the one that is given is of another.
    pub(crate) fn fit(&self, camera: &Camera, picture: &mut Picture) -> Option<String> {
        match (self.size, camera.size(SIDE)) {
            (None, Some((width, height))) => {
                (picture.width, picture.height) = (width, height);
                None
            }
            (Some((width, height)), Some(_)) if camera.is_cropped(width, height) => {
                let (width, height) = camera.size(width.max(height))?;
                let Camera { name, aspect, .. } = camera;
                Some(format!(
                    "the camera '{name}' has an aspect ratio of {}, and the picture another; the vertical field of view is kept: \
                     --size {width}x{height} shows what the file means",
                    aspect.unwrap_or(1.0)
                ))
            }
            _ => None,
        }
    }
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let sides =
        text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    match sides {
        Some((width, height)) if width > 0 && height > 0 => Ok((width, height)),
        _ => Err("a size is WIDTHxHEIGHT, both at least 1, such as 512x512".into()),
    }
}

fn crop(text: &str) -> Result<Window, String> {
    let ends: Result<Vec<u32>, _> = text.split(',').map(str::parse).collect();
    match ends.as_deref() {
        Ok(&[x0, x1, y0, y1]) => Ok(Window { x0, x1, y0, y1 }),
        _ => Err("a crop is X0,X1,Y0,Y1: four whole numbers, such as 0,64,0,64".into()),
    }
}

fn place(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let place = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    let place = place.filter(|place| place.iter().all(|number| number.is_finite()));
    place.ok_or_else(|| "a place is X,Y,Z: three numbers of metres, such as 0,1.5,4".into())
}
