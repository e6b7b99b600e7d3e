//! Textures of materials with their samplers and transforms. Equal ones are stored once.

use std::collections::BTreeMap;

use gltf::json;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::Checked;

use super::accessor::Source;
use super::document::Document;
use super::image::{self, Wanted};
use super::origin::Origin;
use super::room::Room;
use crate::error::SceneError;
use crate::raster::Deep;
use crate::{Encoding, Material, Scene, Texture, Wrap};

/// Maximum absolute value in a texture transform. Beyond it, single precision cannot resolve texels.
const MAX_TRANSFORM: f32 = 1e6;

/// Channels of a texture that a material uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// Colour, alpha or both.
    Colour,
    Emission,
    Normal,
    Red,
    Green,
    /// Metalness in blue, roughness in green.
    MetallicRoughness,
}

impl Use {
    fn encoding(self) -> Encoding {
        match self {
            Self::Colour | Self::Emission => Encoding::Srgb,
            Self::Normal | Self::Red | Self::Green | Self::MetallicRoughness => Encoding::Linear,
        }
    }
}

/// Image in one encoding, and each [`Use`] that materials make of it.
struct Taken {
    origin: Origin,
    encoding: Encoding,
    uses: Vec<Use>,
}

impl Taken {
    fn wanted(&self) -> Wanted {
        let all = |uses: &[Use]| self.uses.iter().all(|found| uses.contains(found));
        let forms = [
            (&[Use::Emission][..], Deep::Emission),
            (&[Use::Normal], Deep::Normal),
            (&[Use::Red, Use::Green], Deep::RedGreen),
            (&[Use::MetallicRoughness, Use::Green], Deep::BlueGreen),
        ];
        let deep = forms.into_iter().find_map(|(uses, deep)| all(uses).then_some(deep));
        Wanted { origin: self.origin, encoding: self.encoding, deep }
    }
}

/// Textures, in the order in which materials refer to them.
pub(super) struct Textures<'a> {
    document: &'a Document,
    textures: Vec<Texture>,
    /// Index of each known texture, by the bits of its fields.
    known: BTreeMap<[u32; 11], u32>,
    images: Vec<Taken>,
    image_indices: BTreeMap<(Origin, Encoding), u32>,
}

impl<'a> Textures<'a> {
    pub(super) fn new(document: &'a Document) -> Self {
        Self {
            document,
            textures: Vec::new(),
            known: BTreeMap::new(),
            images: Vec::new(),
            image_indices: BTreeMap::new(),
        }
    }

    /// Adds the texture that the `textureInfo` at `item` describes, and returns its index.
    pub(super) fn add(
        &mut self,
        item: &str,
        info: &json::texture::Info,
        taken: Use,
    ) -> Result<u32, SceneError> {
        let document = self.document;
        let index = info.index.value();
        // The `gltf` crate has not checked textures of extensions that it does not know.
        let Some(texture) = document.root.textures.get(index) else {
            let reason =
                format!("there is no texture {index}: the file has {}", document.root.textures.len());
            return Err(document.invalid(format!("{item}.index"), reason, "state the index of a texture"));
        };
        let origin = Origin::of(&document.root, index);
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
        let set = transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord);
        if set > 1 {
            let reason = format!("the texture takes TEXCOORD_{set}, and only sets 0 and 1 are supported");
            let remedy = "export the mesh with at most two sets of texture coordinates";
            return Err(document.invalid(format!("{item}.texCoord"), reason, remedy));
        }
        let (matrix, offset) = transform.map_or(Ok(IDENTITY), |transform| {
            let found = affine(transform);
            let remedy = "state offset, rotation and scale as numbers of at most 1000000";
            let place = format!("{item}.extensions.KHR_texture_transform");
            found.ok_or_else(|| document.invalid(place, "the transform is out of range", remedy))
        })?;
        let image = self.image(origin, taken);
        let (wrap, nearest) = sampler(document, texture);
        Ok(self.insert(Texture { image, set, wrap, nearest, matrix, offset }))
    }

    fn image(&mut self, origin: Origin, taken: Use) -> u32 {
        let Self { images, image_indices, .. } = self;
        let encoding = taken.encoding();
        let index = *image_indices.entry((origin, encoding)).or_insert_with(|| {
            images.push(Taken { origin, encoding, uses: Vec::new() });
            images.len() as u32 - 1
        });
        images[index as usize].uses.push(taken);
        index
    }

    fn insert(&mut self, texture: Texture) -> u32 {
        let Texture { image, set, wrap: [across, down], nearest, matrix: [[a, b], [c, d]], offset: [e, f] } =
            texture;
        let [a, b, c, d, e, f] = [a, b, c, d, e, f].map(f32::to_bits);
        let bits = [image, set, across as u32, down as u32, u32::from(nearest), a, b, c, d, e, f];
        let Self { textures, known, .. } = self;
        *known.entry(bits).or_insert_with(|| {
            textures.push(texture);
            textures.len() as u32 - 1
        })
    }

    /// Loads the images. Textures whose image cannot be read are removed, and described in `unreadable`.
    pub(super) fn finish(
        self,
        source: &Source<'_>,
        room: &mut Room,
        scene: &mut Scene,
        unreadable: &mut Vec<String>,
    ) -> Result<(), SceneError> {
        let wanted: Vec<_> = self.images.iter().map(Taken::wanted).collect();
        let images = image::load(source, &wanted, room, unreadable)?;
        let is_read: Vec<_> = images.iter().map(Option::is_some).collect();
        scene.images = images.into_iter().flatten().collect();
        let images = renumbered(&is_read);
        let kept = self.textures.iter().map(|texture| images[texture.image as usize].is_some());
        let textures = renumbered(&kept.collect::<Vec<_>>());
        scene.textures = (self.textures.into_iter())
            .filter_map(|texture| Some(Texture { image: images[texture.image as usize]?, ..texture }))
            .collect();
        scene.materials.iter_mut().for_each(|material| renumber(material, &textures));
        Ok(())
    }
}

/// New index of each element after all elements that are not kept are removed; `None` for a removed one.
fn renumbered(is_kept: &[bool]) -> Vec<Option<u32>> {
    let mut next = 0..;
    is_kept.iter().map(|kept| kept.then(|| next.next()).flatten()).collect()
}

/// Renumbers the textures of a material, or removes them. All fields are destructured, so that the compiler
/// reports a new field that is not handled.
fn renumber(material: &mut Material, indices: &[Option<u32>]) {
    let Material {
        name: _,
        reflection: _,
        emission: _,
        double_sided: _,
        alpha_cutoff: _,
        blends: _,
        alpha: _,
        energy_compensation: _,
        base_texture,
        metallic_roughness_texture,
        emissive_texture,
        layers,
        visibility: _,
    } = material;
    for texture in [base_texture, metallic_roughness_texture, emissive_texture] {
        *texture = texture.and_then(|index| indices[index as usize]);
    }
    if let Some(layers) = layers {
        layers.renumber(|index| indices[index as usize]);
    }
}

/// Matrix and offset of a texture transform.
type Affine = ([[f32; 2]; 2], [f32; 2]);

const IDENTITY: Affine = ([[1.0, 0.0], [0.0, 1.0]], [0.0; 2]);

/// Affine form of `KHR_texture_transform`: scale, then counter-clockwise rotation, then offset. The matrix is
/// that of a clockwise rotation, because v points down. The equations in the extension's text have the
/// opposite sign, against its words, its example and its implementations (KhronosGroup/glTF issue 1563).
fn affine(transform: &TextureTransform) -> Option<Affine> {
    let (offset, [width, height]) = (transform.offset.0, transform.scale.0);
    let angle = transform.rotation.0;
    let numbers = [offset[0], offset[1], width, height, angle];
    if !numbers.iter().all(|number| number.abs() <= MAX_TRANSFORM) {
        return None;
    }
    let (sine, cosine) = (libm::sin(angle.into()), libm::cos(angle.into()));
    let product = |factor: f64, scale: f32| (factor * f64::from(scale)) as f32;
    let matrix =
        [[product(cosine, width), product(sine, height)], [product(-sine, width), product(cosine, height)]];
    Some((matrix, offset))
}

/// Wrap modes of a sampler, and whether its filter is `NEAREST`.
fn sampler(document: &Document, texture: &json::Texture) -> ([Wrap; 2], bool) {
    let Some(sampler) = texture.sampler.and_then(|index| document.root.samplers.get(index.value())) else {
        return ([Wrap::Repeat; 2], false);
    };
    let wrap = |mode: Checked<WrappingMode>| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        // Validation has rejected other values.
        _ => Wrap::Repeat,
    };
    let nearest = sampler.mag_filter == Some(Checked::Valid(MagFilter::Nearest));
    ([wrap(sampler.wrap_s), wrap(sampler.wrap_t)], nearest)
}
