//! Pixels: the sums over samples that chips send, and the mean values that follow from them.
//!
//! Sums are integers. The sums of different samples of a pixel, from several renders, therefore add up
//! exactly.

use super::identity::{IDENTITIES_BYTES, IdentityCoverage};
use crate::budget::{MAX_LIGHT_GROUPS, SUMS_WITH_LAYERS};

/// Fixed-point scale of sums of light: one radiance unit is stored as 2^40.
const LIGHT_STEPS: f64 = (1_u64 << 40) as f64;
/// Fixed-point scale of sums of albedos: an albedo of 1 is stored as 2^19.
pub const ALBEDO_STEPS: u32 = 1 << 19;
/// Fixed-point scale of sums of normals: a component 1 is stored as 2^18.
pub const NORMAL_STEPS: u32 = 1 << 18;
/// Fixed-point scale of sums of depths: one depth unit ([`SumScale::depth`]) is stored as 2^16.
pub const DEPTH_STEPS: u32 = 1 << 16;
/// Fixed-point scale of sums of coverage: a sample that is all covered is stored as 2^19.
pub const COVERAGE_STEPS: u32 = 1 << 19;
/// Number of probes: a pixel's first samples in a frame with adaptive sampling. Their variance determines the
/// number of paths of each later sample.
pub const PROBES: u32 = 4;
/// Weight of a probe's light in the pixel's mean; a later sample has weight 1. A weight that depended on the
/// number of paths would add bias.
pub const WEIGHT_OF_PROBE: f32 = 0.5;

/// Numbers of samples and of probes in the sums of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SampleCount {
    /// Number of all samples.
    pub samples: u32,
    /// Number of probes among the samples, at most [`PROBES`]; 0 without adaptive sampling.
    pub probes: u32,
}

impl SampleCount {
    /// Returns the count of `samples` samples from number `first` on. A pixel's first [`PROBES`] samples are
    /// probes if `is_adaptive`.
    pub fn of_range(first: u32, samples: u32, is_adaptive: bool) -> Self {
        let probes = PROBES.saturating_sub(first).min(samples);
        Self { samples, probes: if is_adaptive { probes } else { 0 } }
    }

    /// Returns the sum of the weights of the samples' light, at least 1/2. A probe has the weight
    /// [`WEIGHT_OF_PROBE`], another sample 1.
    pub fn weight_of_light(self) -> f64 {
        (f64::from(self.samples) - f64::from(1.0 - WEIGHT_OF_PROBE) * f64::from(self.probes)).max(0.5)
    }
}

/// Values of a pixel, averaged over its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pixel {
    /// Radiance towards the eye, W/(sr m^2).
    pub radiance: [f32; 3],
    /// Mean albedo of the surfaces that the samples see, 0 to 1 per channel. A sample that sees no surface
    /// counts as 0.
    pub albedo: [f32; 3],
    /// Mean unit normal of the surfaces that the samples see, in world space, towards the eye. A sample that
    /// sees no surface counts as 0.
    pub normal: [f32; 3],
    /// Mean depth, metres along the view axis, over the samples whose eye ray hits a surface, of any kind;
    /// infinite if none does.
    pub depth: f32,
}

/// Optional contents of a pixel's record: those that a frame asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PixelForm {
    /// True if the record has [`LayerSums`].
    pub layers: bool,
    /// Number of light groups in the record ([`GroupSums`]), at most [`MAX_LIGHT_GROUPS`].
    pub light_groups: u8,
    /// True if the record has [`PixelSums::position`].
    pub position: bool,
    /// True if the record has [`PixelSums::coverage`].
    pub coverage: bool,
    /// True if the record has [`PixelSums::identities`].
    pub identities: bool,
}

impl PixelForm {
    /// Form without optional contents.
    pub const PLAIN: Self =
        Self { layers: false, light_groups: 0, position: false, coverage: false, identities: false };
    /// Form with layers alone.
    pub const LAYERED: Self = Self { layers: true, ..Self::PLAIN };
    /// Form with all contents.
    pub const FULL: Self = Self {
        layers: true,
        light_groups: MAX_LIGHT_GROUPS as u8,
        position: true,
        coverage: true,
        identities: true,
    };

    /// Form with the contents of either form.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        let groups = [self.light_groups, other.light_groups];
        Self {
            layers: self.layers || other.layers,
            light_groups: if groups[0] > groups[1] { groups[0] } else { groups[1] },
            position: self.position || other.position,
            coverage: self.coverage || other.coverage,
            identities: self.identities || other.identities,
        }
    }

    /// Number of sums of light that a chip keeps per pixel: [`SUMS_WITH_LAYERS`] for layers, and one for each
    /// light group; 1 without layers and groups.
    pub const fn sums_of_light(self) -> u32 {
        let layers = if self.layers { SUMS_WITH_LAYERS } else { 0 };
        let sums = layers + self.light_groups as u32;
        if sums == 0 { 1 } else { sums }
    }

    /// Bytes of a pixel's record.
    pub const fn record_bytes(self) -> usize {
        let light = match (self.layers, self.light_groups) {
            (false, 0) => LIGHT_BYTES,
            (layers, groups) => groups as usize * LIGHT_BYTES + if layers { LAYER_BYTES } else { 0 },
        };
        VIEW_BYTES
            + light
            + if self.position { POSITION_BYTES } else { 0 }
            + if self.coverage { COVERAGE_BYTES } else { 0 }
            + if self.identities { IDENTITIES_BYTES } else { 0 }
    }
}

/// Layers of a pixel: the components of its radiance, and its number of final gathers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PixelLayers {
    /// Direct light, W/(sr m^2): visible emission, and light of emitters that shadow rays and the pixel's own
    /// gather rays reach.
    pub direct: [f32; 3],
    /// Indirect light, W/(sr m^2): radiance estimates at the ends of gather rays, and interpolated
    /// irradiance. Interpolated irradiance includes emission that gather rays of irradiance records hit.
    pub indirect: [f32; 3],
    /// Caustics, W/(sr m^2): radiance estimates in the caustic map.
    pub caustic: [f32; 3],
    /// Number of the pixel's samples with a final gather instead of interpolated irradiance.
    pub gathers: f32,
}

/// Units of a pixel's sums, stored in the card image
/// ([`Header::sum_scale`](crate::image::Header::sum_scale)).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SumScale {
    /// Unit of light: radiance, W/(sr m^2), a power of two, or irradiance, W/m^2.
    pub radiance: f32,
    /// Unit of depth, metres, a power of two.
    pub depth: f32,
}

impl SumScale {
    /// Scale in which the light of an [irradiance frame](super::FrameParameters::irradiance) is the
    /// irradiance, W/m^2: `E = pi L`.
    #[must_use]
    pub const fn of_irradiance(self) -> Self {
        Self { radiance: self.radiance * core::f32::consts::PI, ..self }
    }
}

/// Sums of a pixel over its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PixelSums {
    /// Sum of radiance, in steps of 2^-40 radiance units, at least 0, saturating. With layers it is the sum
    /// of direct, indirect and caustic light; with light groups, the sum over the groups.
    pub light: [i64; 3],
    /// Sum of albedos, in steps of 1 / [`ALBEDO_STEPS`].
    pub albedo: [u32; 3],
    /// Sum of normals, in steps of 1 / [`NORMAL_STEPS`].
    pub normal: [i32; 3],
    /// Sum of depths, in steps of 1 / [`DEPTH_STEPS`] depth units.
    pub depth: i64,
    /// Number of samples that see a surface.
    pub surfaces: u32,
    /// Separate sums of direct, indirect and caustic light; `None` in a frame without layers.
    pub layers: Option<LayerSums>,
    /// Separate sums of the light groups; `None` in a frame without light groups.
    pub light_groups: Option<GroupSums>,
    /// Sum of the positions at which eye rays hit a surface, of the samples that [`Self::surfaces`] counts,
    /// in steps of 1 / [`DEPTH_STEPS`] depth units; `None` in a frame without positions.
    pub position: Option<[i64; 3]>,
    /// Sum of the weights of the paths whose eye ray hits a surface, in steps of 1 / [`COVERAGE_STEPS`]. A
    /// path has the weight that it has in the sum of light. `None` in a frame without coverage.
    pub coverage: Option<u32>,
    /// Coverage by identity; `None` in a frame without identities.
    pub identities: Option<IdentityCoverage>,
}

/// Sums of a pixel's light by light group, in the units of [`PixelSums::light`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GroupSums {
    count: u8,
    sums: [[i64; 3]; MAX_LIGHT_GROUPS],
}

impl GroupSums {
    /// Sums of the first groups, at most [`MAX_LIGHT_GROUPS`].
    pub fn new(groups: impl IntoIterator<Item = [i64; 3]>) -> Self {
        let mut all = Self::default();
        for (sum, of_group) in all.sums.iter_mut().zip(groups) {
            *sum = of_group;
            all.count += 1;
        }
        all
    }

    /// Sums of `count` groups, all 0.
    fn zero(count: u8) -> Self {
        Self { count: count.min(MAX_LIGHT_GROUPS as u8), ..Self::default() }
    }

    /// Number of groups.
    pub fn count(&self) -> u8 {
        self.count
    }

    /// The sums, one for each group.
    pub fn sums(&self) -> &[[i64; 3]] {
        self.sums.get(..self.count as usize).unwrap_or_default()
    }

    fn light(&self) -> [i64; 3] {
        self.sums.into_iter().fold([0; 3], added_light)
    }

    /// Sums over both operands; `None` if their numbers of groups differ.
    fn plus(&self, more: &Self) -> Option<Self> {
        let sums = self.sums.iter().zip(&more.sums).map(|(sum, more)| added_light(*sum, *more));
        (self.count == more.count).then(|| Self { count: self.count, ..Self::new(sums) })
    }
}

/// Sums of the components of a pixel's light, in the units of [`PixelSums::light`], and the number of final
/// gathers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LayerSums {
    /// Sum of [`PixelLayers::direct`].
    pub direct: [i64; 3],
    /// Sum of [`PixelLayers::indirect`].
    pub indirect: [i64; 3],
    /// Sum of [`PixelLayers::caustic`].
    pub caustic: [i64; 3],
    /// Number of samples with a final gather, as in [`PixelLayers::gathers`].
    pub gathers: u32,
}

/// Bytes of a pixel's sums except light: albedo, normal, depth and number of surfaces.
const VIEW_BYTES: usize = 12 + 12 + 8 + 4;
/// Bytes of a sum of light.
const LIGHT_BYTES: usize = 24;
/// Bytes of separate sums of light, and of the number of gathers.
const LAYER_BYTES: usize = 3 * LIGHT_BYTES + 4;
/// Bytes of a sum of positions.
const POSITION_BYTES: usize = 24;
/// Bytes of a sum of coverage.
const COVERAGE_BYTES: usize = 4;
/// Bytes of a pixel without optional contents ([`PixelForm::PLAIN`]).
pub const PIXEL_BYTES: usize = PixelForm::PLAIN.record_bytes();
/// Maximum length of the pixels in one [`super::Reply::Pixels`], bytes.
pub const PIXELS_BYTES: usize = 16 * PIXEL_BYTES;

/// Reader of little-endian numbers. It returns zeros after the end.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn next<const N: usize>(&mut self) -> [u8; N] {
        let (number, rest) = self.0.split_first_chunk().unwrap_or((&[0; N], &[]));
        self.0 = rest;
        *number
    }

    fn vector<const N: usize, T>(&mut self, read: fn([u8; N]) -> T) -> [T; 3] {
        core::array::from_fn(|_| read(self.next()))
    }
}

/// Adds two vectors, component by component, with the addition `add`.
fn added<T>([a, b, c]: [T; 3], [p, q, r]: [T; 3], add: fn(T, T) -> T) -> [T; 3] {
    [add(a, p), add(b, q), add(c, r)]
}

fn added_light(light: [i64; 3], more: [i64; 3]) -> [i64; 3] {
    added(light, more, i64::saturating_add)
}

impl LayerSums {
    fn light(&self) -> [i64; 3] {
        added_light(added_light(self.direct, self.indirect), self.caustic)
    }
}

impl PixelSums {
    /// Sums over no samples.
    pub const NOTHING: Self = Self {
        light: [0; 3],
        albedo: [0; 3],
        normal: [0; 3],
        depth: 0,
        surfaces: 0,
        layers: None,
        light_groups: None,
        position: None,
        coverage: None,
        identities: None,
    };

    /// Replaces the light, and removes layers and light groups.
    pub fn with_light(self, light: [i64; 3]) -> Self {
        Self { light, layers: None, light_groups: None, ..self }
    }

    /// Replaces the layers. The light becomes their sum.
    pub fn with_layers(self, layers: LayerSums) -> Self {
        Self { light: layers.light(), layers: Some(layers), ..self }
    }

    /// Replaces the light groups. The light becomes their sum.
    pub fn with_light_groups(self, groups: GroupSums) -> Self {
        Self { light: groups.light(), light_groups: Some(groups), ..self }
    }

    /// Optional contents of the sums.
    pub fn form(&self) -> PixelForm {
        PixelForm {
            layers: self.layers.is_some(),
            light_groups: self.light_groups.map_or(0, |groups| groups.count),
            position: self.position.is_some(),
            coverage: self.coverage.is_some(),
            identities: self.identities.is_some(),
        }
    }

    /// Returns the sums with the optional contents of `form`: others are removed, and missing ones are 0.
    #[must_use]
    pub fn in_form(self, form: PixelForm) -> Self {
        let mut all = Self {
            layers: None,
            light_groups: None,
            position: form.position.then(|| self.position.unwrap_or_default()),
            coverage: form.coverage.then(|| self.coverage.unwrap_or_default()),
            identities: form.identities.then(|| self.identities.unwrap_or_default()),
            ..self
        };
        if form.layers {
            all = all.with_layers(self.layers.unwrap_or_default());
        }
        if form.light_groups > 0 {
            let of_form = self.light_groups.filter(|groups| groups.count == form.light_groups);
            all = all.with_light_groups(of_form.unwrap_or(GroupSums::zero(form.light_groups)));
        }
        all
    }

    /// Reads the sums of a record with the contents `form`; `None` if the length of `bytes` is not that of
    /// such a record, or the identities are not in the order of [`IdentityCoverage`].
    #[inline]
    pub fn read(form: PixelForm, bytes: &[u8]) -> Option<Self> {
        if bytes.len() != form.record_bytes() {
            return None;
        }
        let mut numbers = Numbers(bytes);
        let mut sums = Self {
            albedo: numbers.vector(u32::from_le_bytes),
            normal: numbers.vector(i32::from_le_bytes),
            depth: i64::from_le_bytes(numbers.next()),
            surfaces: u32::from_le_bytes(numbers.next()),
            ..Self::default()
        };
        if form == PixelForm::PLAIN {
            return Some(sums.with_light(numbers.vector(i64::from_le_bytes)));
        }
        if form.layers {
            let [direct, indirect, caustic] = core::array::from_fn(|_| numbers.vector(i64::from_le_bytes));
            let gathers = u32::from_le_bytes(numbers.next());
            sums = sums.with_layers(LayerSums { direct, indirect, caustic, gathers });
        }
        if form.light_groups > 0 {
            let groups = (0..form.light_groups).map(|_| numbers.vector(i64::from_le_bytes));
            sums = sums.with_light_groups(GroupSums::new(groups));
        } else if !form.layers {
            sums = sums.with_light(numbers.vector(i64::from_le_bytes));
        }
        let position = form.position.then(|| numbers.vector(i64::from_le_bytes));
        let coverage = form.coverage.then(|| u32::from_le_bytes(numbers.next()));
        let identities = match form.identities {
            true => Some(IdentityCoverage::of_numbers(|| u32::from_le_bytes(numbers.next()))?),
            false => None,
        };
        Some(Self { position, coverage, identities, ..sums })
    }

    /// Passes the encoded sums to `append`, [`PixelForm::record_bytes`] bytes in total.
    pub fn write(&self, append: &mut impl FnMut(&[u8])) {
        let Self {
            light,
            albedo,
            normal,
            depth,
            surfaces,
            layers,
            light_groups,
            position,
            coverage,
            identities,
        } = self;
        append(albedo.map(u32::to_le_bytes).as_flattened());
        append(normal.map(i32::to_le_bytes).as_flattened());
        append(&depth.to_le_bytes());
        append(&surfaces.to_le_bytes());
        let mut append_light = |light: &[i64; 3]| append(light.map(i64::to_le_bytes).as_flattened());
        if layers.is_none() && light_groups.is_none() {
            append_light(light);
        }
        if let Some(LayerSums { direct, indirect, caustic, gathers }) = layers {
            [direct, indirect, caustic].into_iter().for_each(&mut append_light);
            append(&gathers.to_le_bytes());
        }
        if let Some(groups) = light_groups {
            let mut append_light = |light: &[i64; 3]| append(light.map(i64::to_le_bytes).as_flattened());
            groups.sums().iter().for_each(&mut append_light);
        }
        if let Some(position) = position {
            append(position.map(i64::to_le_bytes).as_flattened());
        }
        if let Some(coverage) = coverage {
            append(&coverage.to_le_bytes());
        }
        if let Some(identities) = identities {
            identities.numbers(|number| append(&number.to_le_bytes()));
        }
    }

    /// Returns the sums over the samples of both operands. Optional contents are dropped unless both operands
    /// have them.
    #[must_use]
    pub fn plus(&self, more: &Self) -> Self {
        let mut all = Self {
            light: added_light(self.light, more.light),
            albedo: added(self.albedo, more.albedo, u32::saturating_add),
            normal: added(self.normal, more.normal, i32::saturating_add),
            depth: self.depth.saturating_add(more.depth),
            surfaces: self.surfaces.saturating_add(more.surfaces),
            layers: None,
            light_groups: None,
            position: self.position.zip(more.position).map(|(sum, more)| added_light(sum, more)),
            coverage: self.coverage.zip(more.coverage).map(|(sum, more)| sum.saturating_add(more)),
            identities: match (&self.identities, &more.identities) {
                (Some(identities), Some(more)) => Some(identities.plus(more)),
                _ => None,
            },
        };
        if let (Some(layers), Some(more)) = (&self.layers, &more.layers) {
            all = all.with_layers(LayerSums {
                direct: added_light(layers.direct, more.direct),
                indirect: added_light(layers.indirect, more.indirect),
                caustic: added_light(layers.caustic, more.caustic),
                gathers: layers.gathers.saturating_add(more.gathers),
            });
        }
        let groups = self.light_groups.zip(more.light_groups);
        match groups.and_then(|(groups, more)| groups.plus(&more)) {
            Some(groups) => all.with_light_groups(groups),
            None => all,
        }
    }

    /// Returns the sums, without layers, for which [`Self::pixel`] returns the values nearest to `pixel`.
    pub fn nearest(pixel: &Pixel, count: SampleCount, scale: &SumScale) -> Self {
        let Pixel { radiance, albedo, normal, depth } = *pixel;
        let sees = depth.is_finite();
        let samples = count.samples;
        let of_all = |value: f32, steps: u32| f64::from(value) * f64::from(samples) * f64::from(steps);
        let depth = of_all(depth, DEPTH_STEPS) / f64::from(scale.depth);
        Self {
            light: light_of(radiance, count, scale),
            albedo: albedo.map(|value| (of_all(value, ALBEDO_STEPS) + 0.5) as u32),
            normal: normal.map(|value| rounded(of_all(value, NORMAL_STEPS)) as i32),
            depth: if sees { rounded(depth) } else { 0 },
            surfaces: if sees { samples } else { 0 },
            ..Self::NOTHING
        }
    }

    /// Adds the layer sums for which [`Self::pixel_layers`] returns the values nearest to `layers`. The light
    /// becomes the sum of the layers.
    #[must_use]
    pub fn with_nearest_layers(self, layers: &PixelLayers, count: SampleCount, scale: &SumScale) -> Self {
        let [direct, indirect, caustic] =
            [layers.direct, layers.indirect, layers.caustic].map(|light| light_of(light, count, scale));
        self.with_layers(LayerSums { direct, indirect, caustic, gathers: layers.gathers as u32 })
    }

    /// Returns the pixel's values, averaged over the samples.
    #[inline]
    pub fn pixel(&self, count: SampleCount, scale: &SumScale) -> Pixel {
        let per_sample = 1.0 / f64::from(count.samples.max(1));
        let normal = per_sample / f64::from(NORMAL_STEPS);
        let albedo = per_sample / f64::from(ALBEDO_STEPS);
        let depth = f64::from(scale.depth) / f64::from(DEPTH_STEPS) / f64::from(self.surfaces);
        // The groups' means add up to the radiance, bit for bit, in the order of the groups.
        let of_groups = self.light_groups.map(|_| {
            let [first, rest @ ..] = self.group_radiance(count, scale);
            rest.into_iter().fold(first, |sum, group| added(sum, group, |a, b| a + b))
        });
        Pixel {
            radiance: of_groups.unwrap_or_else(|| radiance(self.light, count, scale)),
            albedo: self.albedo.map(|sum| (f64::from(sum) * albedo) as f32),
            normal: self.normal.map(|sum| (f64::from(sum) * normal) as f32),
            depth: if self.surfaces > 0 { (self.depth as f64 * depth) as f32 } else { f32::INFINITY },
        }
    }

    /// Returns the mean position of the surfaces that the samples see, metres from the scene's origin; `None`
    /// in a frame without positions, or if no surface is seen.
    pub fn mean_position(&self, scale: &SumScale) -> Option<[f64; 3]> {
        let unit = f64::from(scale.depth) / f64::from(DEPTH_STEPS);
        let sum = self.position.filter(|_| self.surfaces > 0)?;
        Some(sum.map(|sum| sum as f64 / f64::from(self.surfaces) * unit))
    }

    /// Returns the fraction of the pixel that surfaces cover, 0 to 1. In a frame without
    /// [`Self::coverage`], it is the share of the samples that see a surface.
    pub fn alpha(&self, count: SampleCount) -> f32 {
        match self.coverage {
            Some(coverage) => {
                let share = f64::from(coverage) / f64::from(COVERAGE_STEPS) / count.weight_of_light();
                // Weights such as 1/3 are rounded to steps.
                if share > 1.0 { 1.0 } else { share as f32 }
            }
            None => (f64::from(self.surfaces) / f64::from(count.samples.max(1))) as f32,
        }
    }

    /// Returns the values of the layers, averaged over the samples; `None` in a frame without layers.
    pub fn pixel_layers(&self, count: SampleCount, scale: &SumScale) -> Option<PixelLayers> {
        let LayerSums { direct, indirect, caustic, gathers } = self.layers?;
        let [direct, indirect, caustic] = [direct, indirect, caustic].map(|sum| radiance(sum, count, scale));
        Some(PixelLayers { direct, indirect, caustic, gathers: gathers as f32 })
    }

    /// Returns the light of each group, averaged over the samples, W/(sr m^2); zero for groups that the frame
    /// does not have.
    pub fn group_radiance(&self, count: SampleCount, scale: &SumScale) -> [[f32; 3]; MAX_LIGHT_GROUPS] {
        let groups = self.light_groups.unwrap_or_default();
        groups.sums.map(|sum| radiance(sum, count, scale))
    }
}

/// Converts a mean radiance to the nearest sum of light.
fn light_of(radiance: [f32; 3], count: SampleCount, scale: &SumScale) -> [i64; 3] {
    let steps = LIGHT_STEPS / f64::from(scale.radiance) * count.weight_of_light();
    radiance.map(|value| rounded(f64::from(value) * steps).max(0))
}

/// Rounds to the nearest integer; halves are rounded away from zero.
fn rounded(value: f64) -> i64 {
    (if value < 0.0 { value - 0.5 } else { value + 0.5 }) as i64
}

/// Converts a sum of light to the mean radiance.
fn radiance(light: [i64; 3], count: SampleCount, scale: &SumScale) -> [f32; 3] {
    let unit = f64::from(scale.radiance) / LIGHT_STEPS;
    light.map(|sum| (sum as f64 * unit / count.weight_of_light()) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(number: i64, has_layers: bool) -> PixelSums {
        let vector = |first: i64| [0, 1, 2].map(|axis| number * (first + axis));
        let view = PixelSums {
            albedo: vector(1).map(|value| value as u32),
            normal: vector(4).map(|value| -value as i32),
            depth: number * 7,
            surfaces: number as u32,
            ..PixelSums::default()
        };
        if has_layers {
            let [direct, indirect, caustic] = [vector(10), vector(20), vector(30)];
            view.with_layers(LayerSums { direct, indirect, caustic, gathers: number as u32 })
        } else {
            view.with_light(vector(60))
        }
    }

    #[test]
    fn sums_of_sample_ranges_add_up_to_the_whole_in_any_order() {
        for layers in [false, true] {
            let [one, two, three] = [1, 2, 3].map(|number| sums(number, layers));
            assert_eq!(one.plus(&two), three);
            assert_eq!(three.plus(&one).plus(&two), one.plus(&two.plus(&three)));
        }
        let greatest = PixelSums { light: [i64::MAX; 3], depth: i64::MAX, ..sums(1, false) };
        assert_eq!(greatest.plus(&greatest).light, [i64::MAX; 3]);
        assert_eq!(greatest.plus(&greatest).depth, i64::MAX);
    }

    #[test]
    fn values_are_means_in_the_units_of_the_scale() {
        let scale = SumScale { radiance: 4.0, depth: 0.5 };
        let layers = LayerSums { direct: [1 << 40; 3], indirect: [0; 3], caustic: [2 << 40; 3], gathers: 3 };
        let view = PixelSums {
            albedo: [ALBEDO_STEPS, 0, 2 * ALBEDO_STEPS],
            normal: [0, -(NORMAL_STEPS as i32), 0],
            depth: 3 * i64::from(DEPTH_STEPS),
            surfaces: 2,
            ..PixelSums::default()
        };
        let sums = view.with_layers(layers);
        let count = SampleCount { samples: 4, probes: 0 };
        let pixel = sums.pixel(count, &scale);
        assert_eq!((pixel.radiance, pixel.albedo), ([3.0; 3], [0.25, 0.0, 0.5]));
        assert_eq!((pixel.normal, pixel.depth), ([0.0, -0.25, 0.0], 0.75));
        let layers = sums.pixel_layers(count, &scale).unwrap();
        assert_eq!((layers.direct, layers.caustic, layers.gathers), ([1.0; 3], [2.0; 3], 3.0));
        let nothing = PixelSums::default().pixel(count, &scale);
        assert_eq!(nothing, Pixel { depth: f32::INFINITY, ..Pixel::default() });
        // Two probes count as one sample.
        let with_probes = sums.pixel(SampleCount { samples: 4, probes: 2 }, &scale);
        assert_eq!((with_probes.radiance, with_probes.albedo), ([4.0; 3], pixel.albedo));
    }
}
