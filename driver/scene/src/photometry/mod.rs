//! Photometric files: the luminous intensity of luminaires by direction.
//!
//! A card reads a profile as a texture over C and gamma (see [`LightProfile`]), whose texels lie on the
//! file's angles.

mod eulumdat;
mod lm63;
mod numbers;
mod web;

use std::path::Path;

use glam::Vec3;

use self::numbers::Fault;
use self::web::Web;
use crate::error::SceneError;
use crate::limits::EMISSION;
use crate::texture::{Encoding, Image, Texture, Wrap};
use crate::{PunctualKind, Scene};

/// Maximum size of a file, bytes. A web of 0.5 degrees in all directions takes 2 MB.
const MAX_BYTES: u64 = 1 << 24;
/// Steps of C and gamma, degrees. The greatest that has all angles of a file is taken.
const STEPS: [f64; 15] = [45.0, 30.0, 22.5, 15.0, 11.25, 10.0, 7.5, 5.0, 4.0, 3.0, 2.5, 2.0, 1.5, 1.0, 0.5];
/// Further steps of gamma.
const FINE_STEPS: [f64; 3] = [0.25, 0.2, 0.1];
/// Step of angles that have none in common.
const FALLBACK_STEPS: [f64; 2] = [1.0, 0.25];
/// Intensity relative to the peak above which an end of the measured angles is a sharp edge.
const EDGE: f64 = 0.005;
/// Maximum step of gamma next to a sharp edge, degrees.
const EDGE_STEP: f64 = 0.5;
/// Tolerance of multiples of a step, degrees.
const TOLERANCE: f64 = 1e-3;

/// Luminous intensity of a luminaire by direction, from a photometric file: ANSI/IES LM-63 of 1986 to 2019
/// (`.ies`), or EULUMDAT (`.ldt`).
///
/// Directions are in the luminaire's frame: gamma is the angle to -z, and C the angle about it, from +x
/// towards +y. The image has the intensities relative to the peak, 16 bits each; the texture maps
/// `[C / 360 + 0.5, gamma / 180]`, degrees, to it. Outside the file's angles the intensity is 0.
#[derive(Clone, Debug, PartialEq)]
pub struct LightProfile {
    /// Relative intensities over C and gamma.
    pub image: Image,
    /// Mapping of directions to the image, whose index is 0.
    pub texture: Texture,
    /// Greatest intensity, cd.
    pub peak: f64,
    /// Luminous flux, lm.
    pub lumens: f64,
}

impl LightProfile {
    /// Reads a file. Its contents determine its format.
    ///
    /// # Errors
    /// [`SceneError::Unreadable`] if there is no such file, and [`SceneError::Profile`], with the line, if it
    /// is not a photometric file or gives no light.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let unreadable = |source| SceneError::Unreadable { file: path.to_owned(), source };
        let about = std::fs::metadata(path).map_err(unreadable)?;
        if !about.is_file() || about.len() > MAX_BYTES {
            let reason = format!("it is not a regular file of at most {MAX_BYTES} bytes");
            return Err(unreadable(std::io::Error::new(std::io::ErrorKind::InvalidInput, reason)));
        }
        Self::parse(&std::fs::read(path).map_err(unreadable)?, path)
    }

    /// Parses the contents of a file; `path` names them in errors.
    ///
    /// # Errors
    /// [`SceneError::Profile`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, SceneError> {
        // Keywords and names may be in any encoding; numbers are ASCII.
        let text = String::from_utf8_lossy(bytes);
        let text = text.trim_start_matches('\u{feff}').replace("\r\n", "\n").replace('\r', "\n");
        let is_lm63 = text.lines().any(|line| lm63::tilt(line).is_some()) || text.starts_with("IES");
        let web = if [[0xff, 0xfe], [0xfe, 0xff]].iter().any(|mark| bytes.starts_with(mark)) {
            Err(Fault::at(1, "it is UTF-16 text, and photometric files are ASCII"))
        } else if is_lm63 {
            lm63::parse(&text)
        } else {
            eulumdat::parse(&text)
        };
        let name = path.file_name().map_or("profile".to_owned(), |name| name.to_string_lossy().into_owned());
        let profile = web.and_then(|web| Self::of(&web, name).ok_or(Fault::at(1, "it gives no light")));
        profile.map_err(|Fault { line, reason }| SceneError::Profile { file: path.to_owned(), line, reason })
    }

    /// Profile of a web; `None` if it is dark.
    fn of(web: &Web, name: String) -> Option<Self> {
        let peak = web.peak();
        let grid = Grid::of(web);
        if !(peak > 0.0 && peak.is_finite()) {
            return None;
        }
        let values: Vec<f64> = grid.places().map(|[c, gamma]| grid.value(web, c, gamma) / peak).collect();
        let texels = values.iter().map(|value| {
            let [low, high] = ((value * 65_535.0).round() as u16).to_le_bytes();
            [low, high, low, high]
        });
        let [width, height] = [grid.columns as u32, grid.rows as u32];
        let image = Image { name, width, height, texels: texels.collect(), encoding: Encoding::LinearPair };
        let [across, down] = [width, height].map(|side| 1.0 / side as f32);
        let texture = Texture {
            wrap: [Wrap::Repeat, Wrap::Clamp],
            matrix: [[1.0, 0.0], [0.0, 1.0 - down]],
            offset: [0.5 * across - 0.5, 0.5 * down],
            ..Texture::new(0)
        };
        let lumens = peak * grid.integral(&values);
        (lumens > 0.0).then_some(Self { image, texture, peak, lumens })
    }
}

/// Weights of red, green and blue in the luminance (Rec. 709).
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

impl Scene {
    /// Index of a profile's texture in the scene, to which it is added if need be.
    pub(crate) fn profile_texture(&mut self, profile: &LightProfile) -> u32 {
        let is_same = |texture: &Texture| self.images.get(texture.image as usize) == Some(&profile.image);
        if let Some(index) = self.textures.iter().position(is_same) {
            return index as u32;
        }
        let image = self.images.len() as u32;
        self.images.push(profile.image.clone());
        self.textures.push(Texture { image, ..profile.texture });
        self.textures.len() as u32 - 1
    }

    /// Gives a point or spot light the intensities of a profile. The hue of the light stays, and its flux
    /// becomes that of the profile.
    ///
    /// # Errors
    /// Reason and remedy, if the light is a directional one.
    pub(crate) fn set_profile(
        &mut self,
        light: usize,
        profile: &LightProfile,
    ) -> Result<(), (&'static str, &'static str)> {
        let peak = profile.peak / f64::from(self.lumens_per_watt());
        let Some(found) = self.lights.get(light) else { return Ok(()) };
        let position = match found.kind {
            PunctualKind::Point { position }
            | PunctualKind::Spot { position, .. }
            | PunctualKind::Profile { position, .. } => position,
            PunctualKind::Directional { .. } => {
                return Err((
                    "the light is a directional one, which comes from infinitely far",
                    "give a photometric file to a point or spot light",
                ));
            }
        };
        let (hue, _) = found.colour();
        let intensity = hue * (peak / f64::from(hue.dot(LUMINANCE))) as f32;
        if !intensity.to_array().into_iter().all(|value| value == 0.0 || EMISSION.contains(&value)) {
            return Err((
                "no light has the intensity of the file",
                "give a file of 1e-20 to 1e20 candela, its multiplier and ballast factor included",
            ));
        }
        let texture = self.profile_texture(profile);
        if let Some(light) = self.lights.get_mut(light) {
            light.intensity = intensity;
            light.kind = PunctualKind::Profile { position, texture };
        }
        Ok(())
    }
}

/// Equally spaced angles of type C: columns from C = 0, rows from gamma 0 to 180.
struct Grid {
    columns: usize,
    rows: usize,
    /// Angles gamma at which the intensity breaks off.
    edges: Vec<f64>,
}

impl Grid {
    fn of(web: &Web) -> Self {
        let [planes, angles] = web.angles();
        let across = step(planes, STEPS.iter(), FALLBACK_STEPS[0]);
        let mut down = step(angles, STEPS.iter().chain(&FINE_STEPS), FALLBACK_STEPS[1]);
        let edges = web.edges(EDGE);
        while !edges.is_empty() && down > EDGE_STEP {
            down *= 0.5;
        }
        Self {
            columns: if web.is_axial() { 1 } else { (360.0 / across).round() as usize },
            rows: (180.0 / down).round() as usize + 1,
            edges,
        }
    }

    /// Angles C and gamma of the texels, row by row.
    fn places(&self) -> impl Iterator<Item = [f64; 2]> {
        let [columns, rows] = [self.columns, self.rows];
        let across = move |column: usize| 360.0 * column as f64 / columns as f64;
        let down = move |row: usize| 180.0 * row as f64 / (rows - 1) as f64;
        (0..rows).flat_map(move |row| (0..columns).map(move |column| [across(column), down(row)]))
    }

    /// Intensity at a texel. At a sharp edge it is the mean of both sides, which keeps the flux.
    fn value(&self, web: &Web, c: f64, gamma: f64) -> f64 {
        let is_edge = self.edges.iter().any(|edge| (gamma - edge).abs() <= TOLERANCE);
        web.at(c, gamma) * if is_edge { 0.5 } else { 1.0 }
    }

    /// Integral over all directions, sr, of values at the texels that are linear in C and gamma between them.
    fn integral(&self, values: &[f64]) -> f64 {
        let step = std::f64::consts::PI / (self.rows - 1) as f64;
        let means: Vec<f64> =
            values.chunks(self.columns).map(|row| row.iter().sum::<f64>() / self.columns as f64).collect();
        let rings = means.windows(2).enumerate().map(|(row, pair)| {
            let [top, bottom] = [row, row + 1].map(|row| step * row as f64);
            // Integrals of sine, and of sine times the share of the way, from top to bottom.
            let whole = libm::cos(top) - libm::cos(bottom);
            let rising = (libm::sin(bottom) - libm::sin(top)) / step - libm::cos(bottom);
            pair[0] * whole + (pair[1] - pair[0]) * rising
        });
        2.0 * std::f64::consts::PI * rings.sum::<f64>()
    }
}

/// First step of which all angles are multiples; `fallback` if there is none, or no angle.
fn step<'s>(angles: &[f64], mut steps: impl Iterator<Item = &'s f64>, fallback: f64) -> f64 {
    let fits = |step: &&f64| angles.iter().all(|angle| is_multiple(*angle, **step));
    if angles.is_empty() { fallback } else { steps.find(fits).copied().unwrap_or(fallback) }
}

fn is_multiple(angle: f64, step: f64) -> bool {
    (angle - step * (angle / step).round()).abs() <= TOLERANCE
}
