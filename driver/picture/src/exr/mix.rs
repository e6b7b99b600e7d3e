//! Mixes the light groups of a picture after the render.
//!
//! The light of a group is in a layer such as `light_key`. The radiance in `R G B` is the sum of the groups'
//! layers, in single precision and in the order of their names. A mix multiplies the layers by gains, and
//! sums them again in the same way: with gains of 1 it has the bits of the picture.

use std::fmt;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use exr::image::read::layers::ReadFirstValidLayer;
use exr::prelude::{
    AnyChannels, AttributeValue, FlatSamples, Image, Layer, ReadLayers, Text, Vec2, WritableImage, f16,
    read as reader,
};
use serde_json::{Map, Value, json};
use thiserror::Error;

use super::{
    COLOUR, DENOISED, ExrError, GROUP_PREFIX, MAX_READ_PIXELS, PROVENANCE, SampleFormat, any_channel, ascii,
    attributes, bytes_of, checked, to_half,
};
use crate::allocation::{self, OutOfMemory};
use crate::film::PixelValue;
use crate::foreign;
use crate::intact::{self, BLANK};
use crate::output;

/// Factors of a light group's light, by channel: `NAME=FACTOR` or `NAME=R,G,B`.
#[derive(Clone, Debug, PartialEq)]
pub struct Gain {
    /// Name of the group.
    pub group: String,
    /// Factors of red, green and blue, finite and not negative.
    pub factors: [f32; 3],
}

impl FromStr for Gain {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || {
            format!(
                "{text:?} is no gain: write NAME=FACTOR or NAME=R,G,B with factors of 0 or more, such as key=1.5,0.9,0.8"
            )
        };
        let (group, factors) = text.rsplit_once('=').ok_or_else(form)?;
        let numbers: Option<Vec<f32>> = factors.split(',').map(|number| number.trim().parse().ok()).collect();
        let factors = match numbers.as_deref() {
            Some(&[factor]) => [factor; 3],
            Some(&[red, green, blue]) => [red, green, blue],
            _ => return Err(form()),
        };
        let is_gain = factors.iter().all(|factor| factor.is_finite() && *factor >= 0.0);
        if is_gain { Ok(Self { group: group.trim().to_owned(), factors }) } else { Err(form()) }
    }
}

impl fmt::Display for Gain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [red, green, blue] = self.factors;
        write!(f, "{}={red},{green},{blue}", self.group)
    }
}

/// Error of a mix.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MixError {
    /// The picture cannot be read or written.
    #[error(transparent)]
    Exr(#[from] ExrError),
    /// The picture has no light groups.
    #[error("{} has no light groups; render it with --light-groups, as an EXR", path.display())]
    NoGroups {
        /// Path of the picture.
        path: PathBuf,
    },
    /// The picture has no group of this name.
    #[error("{} has no light group {group:?}, only {known}; name one of them", path.display())]
    Unknown {
        /// Path of the picture.
        path: PathBuf,
        /// Name of the gain's group.
        group: String,
        /// Names of the picture's groups.
        known: String,
    },
    /// The file has several parts.
    #[error("{} has {parts} parts; mix takes a file of one part, as photoncard render writes it", path.display())]
    Parts {
        /// Path of the picture.
        path: PathBuf,
        /// Number of parts.
        parts: usize,
    },
    /// The picture lacks a layer that the denoiser needs.
    #[error("{} lacks the layer {layer}, which the denoiser needs; render it with --aov albedo,N,Z, or mix it without --denoise", path.display())]
    NoFeature {
        /// Path of the picture.
        path: PathBuf,
        /// Name of the layer.
        layer: &'static str,
    },
}

/// Layers of the light of all groups together.
const OF_WHOLE: [&str; 5] = ["direct", "indirect", "caustic", "denoised", "illuminance"];

/// Light group of a picture: its name, and the indices of its channels R, G and B.
struct Group {
    name: String,
    channels: [usize; 3],
}

/// Picture with light groups.
pub struct Mix {
    path: PathBuf,
    image: Image<Layer<AnyChannels<FlatSamples>>>,
    /// Groups in the order of their names.
    groups: Vec<Group>,
    /// Indices of the channels R, G and B.
    colour: [usize; 3],
}

impl Mix {
    /// Reads a picture.
    ///
    /// # Errors
    /// If the file cannot be read, is malformed or too large, or has no light groups.
    pub fn read(path: &Path) -> Result<Self, MixError> {
        Self::of_bytes(path, &bytes_of(path)?)
    }

    /// Reads a picture from the bytes of a file. `path` is the file's name in errors.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn of_bytes(path: &Path, bytes: &[u8]) -> Result<Self, MixError> {
        foreign::decode(
            || Self::decode(path, bytes),
            || {
                let reason = "its structure contradicts itself".to_owned();
                ExrError::Malformed { path: path.to_owned(), reason }.into()
            },
        )
    }

    fn decode(path: &Path, bytes: &[u8]) -> Result<Self, MixError> {
        let malformed = |reason: String| ExrError::Malformed { path: path.to_owned(), reason };
        let meta = checked(path, bytes, MAX_READ_PIXELS)?;
        if meta.headers.len() > 1 {
            return Err(MixError::Parts { path: path.to_owned(), parts: meta.headers.len() });
        }
        for header in &meta.headers {
            let stated = header.layer_size.area() as u64 * header.channels.bytes_per_pixel as u64;
            allocation::check(2 * stated)
                .map_err(|OutOfMemory { bytes }| ExrError::Memory { path: path.to_owned(), bytes })?;
        }
        let channels = reader().no_deep_data().largest_resolution_level().all_channels();
        let image = ReadFirstValidLayer { read_channels: channels }
            .all_attributes()
            // A panic on a worker thread would end the process.
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .map_err(|error| malformed(error.to_string()))?;
        let list = &image.layer_data.channel_data.list;
        let pixels = image.layer_data.size.area();
        let find = |name: &str| {
            list.iter().position(|channel| channel.name.eq(name) && channel.sample_data.len() == pixels)
        };
        let triple = |prefix: &str| -> Option<[usize; 3]> {
            let [red, green, blue] = COLOUR.map(|channel| find(&format!("{prefix}{channel}")));
            Some([red?, green?, blue?])
        };
        let names = list.iter().filter_map(|channel| {
            let name = channel.name.to_string();
            Some(name.strip_prefix(GROUP_PREFIX)?.strip_suffix(".R")?.to_owned())
        });
        let groups = names.filter_map(|name| {
            let channels = triple(&format!("{GROUP_PREFIX}{name}."))?;
            Some(Group { name, channels })
        });
        let mut groups: Vec<Group> = groups.collect();
        groups.sort_by(|a, b| a.name.cmp(&b.name));
        match triple("") {
            Some(colour) if !groups.is_empty() => Ok(Self { path: path.to_owned(), image, groups, colour }),
            _ => Err(MixError::NoGroups { path: path.to_owned() }),
        }
    }

    /// Names of the light groups, in their order.
    pub fn groups(&self) -> impl Iterator<Item = &str> {
        self.groups.iter().map(|group| group.name.as_str())
    }

    /// Columns and rows of the data window.
    pub fn size(&self) -> [u32; 2] {
        let Vec2(width, height) = self.image.layer_data.size;
        [width, height].map(|side| side as u32)
    }

    /// Multiplies the light of groups by gains, and makes the radiance their sum. Layers of light that are
    /// not those of the mix are removed: direct, indirect and caustic light, denoised radiance and
    /// illuminance. Without gains nothing changes.
    ///
    /// # Errors
    /// [`MixError::Unknown`]. The picture does not change then.
    pub fn apply(&mut self, gains: &[Gain]) -> Result<(), MixError> {
        for gain in gains {
            if !self.groups().any(|name| name == gain.group) {
                let known: Vec<_> = self.groups().map(|name| format!("{name:?}")).collect();
                let (path, group, known) = (self.path.clone(), gain.group.clone(), known.join(", "));
                return Err(MixError::Unknown { path, group, known });
            }
        }
        if gains.is_empty() {
            return Ok(());
        }
        let list = &mut self.image.layer_data.channel_data.list;
        for (channel, colour) in self.colour.into_iter().enumerate() {
            let mut sums: Option<Vec<f32>> = None;
            for group in &self.groups {
                let of_group = gains.iter().filter(|gain| gain.group == group.name);
                let factor = of_group.map(|gain| gain.factors[channel]).product::<f32>();
                let samples = &mut list[group.channels[channel]].sample_data;
                let light: Vec<f32> = samples.values_as_f32().map(|light| light * factor).collect();
                replace(samples, &light);
                match &mut sums {
                    Some(sums) => sums.iter_mut().zip(&light).for_each(|(sum, light)| *sum += light),
                    None => sums = Some(light),
                }
            }
            replace(&mut list[colour].sample_data, &sums.unwrap_or_default());
        }
        list.retain(|channel| {
            let name = channel.name.to_string();
            !OF_WHOLE.iter().any(|layer| name.strip_prefix(layer).is_some_and(|rest| rest.starts_with('.')))
        });
        self.find_again();
        self.note(gains);
        Ok(())
    }

    /// Finds the channels again after some were removed or added.
    fn find_again(&mut self) {
        let list = &self.image.layer_data.channel_data.list;
        let find = |name: String| list.iter().position(|channel| channel.name.eq(&name)).unwrap_or(0);
        self.colour = COLOUR.map(|channel| find(channel.to_owned()));
        for group in &mut self.groups {
            group.channels = COLOUR.map(|channel| find(super::name_of_group(&group.name, channel)));
        }
    }

    /// Enters the gains into the provenance, multiplied by those of earlier mixes.
    fn note(&mut self, gains: &[Gain]) {
        self.change_provenance(|all| {
            let mut mixed = all.get("mix").and_then(Value::as_object).cloned().unwrap_or_default();
            for Gain { group, factors } in gains {
                let earlier = mixed.get(group).and_then(|value| serde_json::from_value(value.clone()).ok());
                let earlier: [f32; 3] = earlier.unwrap_or([1.0; 3]);
                let product: [f32; 3] = std::array::from_fn(|channel| earlier[channel] * factors[channel]);
                mixed.insert(group.clone(), json!(product));
            }
            all.insert("mix".to_owned(), mixed.into());
            all.remove("denoise");
        });
    }

    /// Changes the provenance; has no effect without one.
    fn change_provenance(&mut self, change: impl FnOnce(&mut Map<String, Value>)) {
        let stated = self.provenance().and_then(|text| serde_json::from_str::<Map<_, _>>(&text).ok());
        let Some(mut all) = stated else { return };
        change(&mut all);
        let name = Text::new_or_none(PROVENANCE);
        let value = Text::new_or_none(ascii(&Value::from(all).to_string()));
        if let (Some(name), Some(value)) = (name, value) {
            self.image.layer_data.attributes.other.insert(name, AttributeValue::Text(value));
        }
    }

    /// JSON of the picture's provenance; `None` if it has none.
    pub fn provenance(&self) -> Option<String> {
        super::provenance(&self.image.layer_data.attributes)
    }

    /// Radiance of the pixels, row by row from the top, W/(sr m^2).
    pub fn radiance(&self) -> Vec<[f32; 3]> {
        self.triples(self.colour)
    }

    /// Alpha of the pixels; `None` if the picture has none.
    pub fn alpha(&self) -> Option<Vec<f32>> {
        self.values("A")
    }

    /// Values that the denoiser needs, of each pixel.
    ///
    /// # Errors
    /// [`MixError::NoFeature`].
    pub fn features(&self) -> Result<Vec<PixelValue>, MixError> {
        let missing = |layer| MixError::NoFeature { path: self.path.clone(), layer };
        let layer = |layer: &'static str, names: [&str; 3]| -> Result<Vec<[f32; 3]>, MixError> {
            let [a, b, c] = names.map(|name| self.index(name));
            Ok(self.triples(
                [a, b, c]
                    .map(|index| index.ok_or(missing(layer)))
                    .into_iter()
                    .collect::<Result<Vec<_>, _>>()?
                    .try_into()
                    .unwrap_or_default(),
            ))
        };
        let albedo = layer("albedo", ["albedo.R", "albedo.G", "albedo.B"])?;
        let normal = layer("N", ["N.X", "N.Y", "N.Z"])?;
        let depth = self.values("Z").ok_or_else(|| missing("Z"))?;
        let pixels = self.radiance().into_iter().zip(albedo).zip(normal).zip(depth);
        let pixels = pixels.map(|(((radiance, albedo), normal), depth)| PixelValue {
            radiance,
            albedo,
            normal,
            depth,
        });
        Ok(pixels.collect())
    }

    /// Replaces the layer of denoised radiance, with the type of the samples of the radiance. `entry` is the
    /// denoiser's entry in the provenance.
    pub fn set_denoised(&mut self, denoised: &[[f32; 3]], (name, value): (String, Value)) {
        self.change_provenance(|all| {
            all.insert(name, value);
        });
        let list = &mut self.image.layer_data.channel_data.list;
        list.retain(|channel| !DENOISED.iter().any(|name| channel.name.eq(name)));
        let red = list.iter().find(|channel| channel.name.eq(COLOUR[0]));
        let format = match red.map(|channel| &channel.sample_data) {
            Some(FlatSamples::F16(_)) => SampleFormat::Half,
            _ => SampleFormat::Float,
        };
        let channels = DENOISED.into_iter().enumerate();
        let values = |index: usize| denoised.iter().map(move |pixel| pixel[index]);
        let mut all = list.clone();
        all.extend(channels.map(|(index, name)| any_channel(name, values(index), format)));
        self.image.layer_data.channel_data = AnyChannels::sort(all);
        self.find_again();
    }

    /// Encodes the picture as `OpenEXR`.
    ///
    /// # Errors
    /// If the encoder refuses the picture.
    pub fn bytes(mut self) -> Result<Vec<u8>, MixError> {
        self.image.layer_data.attributes.comments = Text::new_or_none(BLANK);
        // The `exr` crate keeps these in hash maps.
        let others = [&self.image.attributes.other, &self.image.layer_data.attributes.other];
        let unordered: Vec<String> =
            others.into_iter().flat_map(|others| others.keys().map(Text::to_string)).collect();
        let mut bytes = Cursor::new(Vec::new());
        let written = self.image.write().to_buffered(&mut bytes);
        written.map_err(|error| ExrError::Encode { path: self.path, reason: error.to_string() })?;
        let mut bytes = bytes.into_inner();
        attributes::sort(&mut bytes, |name| unordered.iter().any(|other| other == name));
        intact::seal_exr(&mut bytes);
        Ok(bytes)
    }

    /// Writes the picture to `path`, whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(self, path: &Path) -> Result<(), MixError> {
        let bytes = self.bytes()?;
        Ok(output::write(path, &bytes).map_err(ExrError::from)?)
    }

    fn index(&self, name: &str) -> Option<usize> {
        self.image.layer_data.channel_data.list.iter().position(|channel| channel.name.eq(name))
    }

    fn values(&self, name: &str) -> Option<Vec<f32>> {
        let index = self.index(name)?;
        Some(self.image.layer_data.channel_data.list[index].sample_data.values_as_f32().collect())
    }

    fn triples(&self, channels: [usize; 3]) -> Vec<[f32; 3]> {
        let list = &self.image.layer_data.channel_data.list;
        let [mut a, mut b, mut c] = channels.map(|index| list[index].sample_data.values_as_f32());
        std::iter::from_fn(|| Some([a.next()?, b.next()?, c.next()?])).collect()
    }
}

/// Replaces samples, and keeps their type.
fn replace(samples: &mut FlatSamples, values: &[f32]) {
    *samples = match samples {
        FlatSamples::F16(_) => {
            FlatSamples::F16(values.iter().map(|&value| to_half(value)).collect::<Vec<f16>>())
        }
        FlatSamples::F32(_) | FlatSamples::U32(_) => FlatSamples::F32(values.to_vec()),
    };
}
