//! Measures the flicker of frames: the difference between consecutive frames at equal positions of surfaces
//! that do not move.
//!
//! ```text
//! flicker [--within X0,Y0,Z0,X1,Y1,Z1] FRAME.exr[=OTHER.exr] ...
//! ```
//!
//! The camera and the layer `Z` of a frame give the position that a pixel sees. It is projected into the
//! previous frame, whose radiance is interpolated between four pixels; their depths must be those of the same
//! surface. The program prints the root mean square of the relative difference `(b - a) / ((a + b) / 2)` of
//! luminance. Noise that stays on the surfaces does not count. `--within` selects the positions in a box,
//! such as a strip of a wall. `OTHER.exr`, another renderer's picture of the same view, supplies the radiance
//! in place of `FRAME.exr`.

use std::error::Error;

use exr::prelude::{ReadChannels as _, ReadLayers as _, read};
use glam::{DVec2, DVec3};
use photoncard_driver::exr::{Shown, read as read_picture};
use serde_json::Value;

/// Maximum relative difference of depth at which two pixels see one surface.
const SAME_DEPTH: f64 = 0.01;

/// Lower and upper corner of the box of `--within`, metres.
type Within = [DVec3; 2];

/// Camera of a frame, with the luminance and the depth of each pixel.
struct Frame {
    name: String,
    size: [usize; 2],
    luminance: Vec<f64>,
    depths: Vec<f64>,
    at: DVec3,
    /// Right, up and forward. The lengths of the first two are half the width and half the height of the
    /// picture at distance 1.
    axes: [DVec3; 3],
}

impl Frame {
    fn read(name: &str) -> Result<Self, Box<dyn Error>> {
        let (path, other) = name.split_once('=').unwrap_or((name, name));
        let picture = read_picture(path.as_ref(), Shown::Rendered)?;
        let provenance = picture.provenance.clone().ok_or("the picture has no provenance")?;
        let [width, height] = picture.size().map(|side| side as usize);
        let radiance = if path == other { picture } else { read_picture(other.as_ref(), Shown::Rendered)? };
        if radiance.size() != [width as u32, height as u32] {
            return Err(format!("{other} is of another size than {path}").into());
        }
        let provenance: Value = serde_json::from_str(&provenance)?;
        let view = &provenance["view"];
        let vector = |key: &str| {
            let number = |axis: usize| view[key][axis].as_f64().ok_or("the provenance has no view");
            Ok::<_, &str>(DVec3::new(number(0)?, number(1)?, number(2)?))
        };
        let (forward, up) = (vector("forward")?, vector("up")?);
        let half = (0.5 * view["fov"].as_f64().ok_or("the provenance has no view")?.to_radians()).tan();
        let aspect = width as f64 / height as f64;
        Ok(Self {
            name: other.to_owned(),
            size: [width, height],
            luminance: radiance.pixels.iter().map(luminance).collect(),
            depths: depths(path)?,
            at: vector("at")?,
            axes: [forward.cross(up) * (half * aspect), up * half, forward],
        })
    }

    /// Position that pixel `(x, y)` sees; `None` if the pixel sees no surface.
    fn place(&self, x: usize, y: usize) -> Option<DVec3> {
        let [width, height] = self.size;
        let depth = self.depths[y * width + x];
        let across = 2.0 * (x as f64 + 0.5) / width as f64 - 1.0;
        let upwards = 1.0 - 2.0 * (y as f64 + 0.5) / height as f64;
        let [right, up, forward] = self.axes;
        depth.is_finite().then(|| self.at + (forward + right * across + up * upwards) * depth)
    }

    /// Luminance at a position, interpolated between four pixels; `None` unless all four see the position's
    /// surface.
    fn luminance_at(&self, place: DVec3) -> Option<f64> {
        let [width, height] = self.size;
        let [right, up, forward] = self.axes;
        let offset = place - self.at;
        let depth = offset.dot(forward);
        let across = offset.dot(right) / right.length_squared() / depth;
        let upwards = offset.dot(up) / up.length_squared() / depth;
        let at = DVec2::new((across + 1.0) * width as f64, (1.0 - upwards) * height as f64) * 0.5 - 0.5;
        let corner = at.floor();
        let is_inside = |value: f64, side: usize| value >= 0.0 && value + 1.0 < side as f64;
        if depth <= 0.0 || !is_inside(corner.x, width) || !is_inside(corner.y, height) {
            return None;
        }
        let share = at - corner;
        let first = corner.y as usize * width + corner.x as usize;
        let mut sum = 0.0;
        for (index, weight) in [
            (first, (1.0 - share.x) * (1.0 - share.y)),
            (first + 1, share.x * (1.0 - share.y)),
            (first + width, (1.0 - share.x) * share.y),
            (first + width + 1, share.x * share.y),
        ] {
            if (self.depths[index] / depth - 1.0).abs() > SAME_DEPTH {
                return None;
            }
            sum += weight * self.luminance[index];
        }
        Some(sum)
    }
}

fn luminance([red, green, blue]: &[f32; 3]) -> f64 {
    0.2126 * f64::from(*red) + 0.7152 * f64::from(*green) + 0.0722 * f64::from(*blue)
}

/// Reads the layer `Z` of a picture.
fn depths(path: &str) -> Result<Vec<f64>, Box<dyn Error>> {
    let image = read().no_deep_data().largest_resolution_level().all_channels();
    let image = image.first_valid_layer().all_attributes().from_file(path)?;
    let channels = image.layer_data.channel_data.list;
    let depth =
        channels.into_iter().find(|channel| channel.name.eq("Z")).ok_or("the picture has no layer Z")?;
    Ok(depth.sample_data.values_as_f32().map(f64::from).collect())
}

/// Number of pixels whose positions the frame before sees too, and the mean square of the relative
/// differences of their luminance.
fn difference(before: &Frame, frame: &Frame, within: Option<Within>) -> (usize, f64) {
    let [width, height] = frame.size;
    let is_within =
        |place: &DVec3| within.is_none_or(|[low, high]| place.cmpge(low).all() && place.cmple(high).all());
    let (mut count, mut sum) = (0, 0.0);
    for y in 0..height {
        for x in 0..width {
            let place = frame.place(x, y).filter(is_within);
            let Some(earlier) = place.and_then(|place| before.luminance_at(place)) else { continue };
            let mean = 0.5 * (earlier + frame.luminance[y * width + x]);
            if mean > 0.0 {
                sum += ((frame.luminance[y * width + x] - earlier) / mean).powi(2);
                count += 1;
            }
        }
    }
    (count, sum / count.max(1) as f64)
}

fn corners(text: &str) -> Result<Within, Box<dyn Error>> {
    let numbers: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let numbers: [f64; 6] = numbers.try_into().map_err(|_| "a box is X0,Y0,Z0,X1,Y1,Z1")?;
    let [a, b] = [DVec3::from_slice(&numbers[..3]), DVec3::from_slice(&numbers[3..])];
    Ok([a.min(b), a.max(b)])
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut names: Vec<String> = std::env::args().skip(1).collect();
    let mut within = None;
    if names.first().is_some_and(|first| first == "--within") && names.len() > 1 {
        within = Some(corners(&names[1])?);
        names.drain(..2);
    }
    let (mut sum, mut pairs) = (0.0, 0);
    let mut before: Option<Frame> = None;
    for name in &names {
        let frame = Frame::read(name).map_err(|error| format!("{name}: {error}"))?;
        if let Some(before) = &before {
            let (count, mean_square) = difference(before, &frame, within);
            println!("{}: {count} pixels, {:.3} %", frame.name, 100.0 * mean_square.sqrt());
            (sum, pairs) = (sum + mean_square, pairs + 1);
        }
        before = Some(frame);
    }
    println!("{pairs} pairs: {:.3} %", 100.0 * (sum / f64::from(pairs.max(1))).sqrt());
    Ok(())
}
