//! Sources of the images of textures.

use gltf::json;

use super::extensions::{BASISU, WEBP};

/// Source of a texture's image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Origin {
    /// Index of an image in the file.
    Image(usize),
    /// Index of a texture that has no image in a supported format.
    Absent(usize),
}

impl Origin {
    /// Finds the image of a texture: its own `source` or, if that does not exist, the image of an extension.
    /// An extension's image is a copy of `source` in another format.
    pub(super) fn of(root: &json::Root, texture: usize) -> Self {
        let stated = &root.textures[texture];
        let extensions = stated.extensions.as_ref();
        let of_extension = |name: &str| extensions?.others.get(name)?.get("source")?.as_u64();
        let own = Some(stated.source.value() as u64);
        let mut sources = [own].into_iter().chain([of_extension(WEBP), of_extension(BASISU)]).flatten();
        let images = root.images.len() as u64;
        let image = sources.find(|source| *source < images);
        image.map_or(Self::Absent(texture), |image| Self::Image(image as usize))
    }
}
