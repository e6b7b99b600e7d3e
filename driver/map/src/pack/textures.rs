//! Encodes textures as records and texel lines of the card image.

use photoncard_scene::{Image, Scene, Wrap};
use photoncard_shared::address::Line;
use photoncard_shared::layout::{self, NO_TEXTURE, TEXELS_PER_LINE, TILE_HEIGHT, TILE_WIDTH};

use rayon::prelude::*;

use super::error::PackError;
use crate::light::EnvironmentMap;

/// Minimum number of lines that a thread writes at a time.
const SEQUENTIAL: usize = 1024;

/// Records of a scene's textures, followed by the environment's. Textures with the same image share its
/// texels.
///
/// # Errors
/// If there are more textures than a material's record can index.
pub(super) fn records(
    scene: &Scene,
    environment: Option<&EnvironmentMap>,
) -> Result<Vec<layout::Texture>, PackError> {
    if scene.textures.len() >= usize::from(NO_TEXTURE) {
        return Err(PackError::TooManyTextures { textures: scene.textures.len() });
    }
    let mut first_line = 0;
    let bare: Vec<layout::Texture> = scene
        .images
        .iter()
        .map(|image| {
            let texture = layout::Texture { first_line, ..bare(image) };
            // If the sum overflows, the card image is rejected when its texel lines are appended, because
            // there are more of them than 32 bits can count.
            first_line = first_line.wrapping_add(texture.lines());
            texture
        })
        .collect();
    let textures = scene.textures.iter().map(|texture| layout::Texture {
        wrap: texture.wrap.map(wrap),
        nearest: texture.nearest,
        set: texture.set,
        matrix: texture.matrix,
        offset: texture.offset,
        ..bare[texture.image as usize]
    });
    Ok(textures.chain(environment.map(|map| map.texture(first_line))).collect())
}

/// Number of lines of the texels of all images and of the environment.
pub(super) fn lines(scene: &Scene, environment: Option<&EnvironmentMap>) -> usize {
    let of_images = scene.images.iter().map(|image| bare(image).lines() as usize);
    of_images.chain(environment.map(|map| map.texture(0).lines() as usize)).sum()
}

/// Writes the lines of the texels of all images, one image after another, and then the environment's.
pub(super) fn write(scene: &Scene, environment: Option<&EnvironmentMap>, mut lines: &mut [Line]) {
    for image in &scene.images {
        let width = image.width as usize;
        lines = write_tiles(bare(image), lines, |x, y| image.texels[y as usize * width + x as usize]);
    }
    if let Some(map) = environment {
        write_tiles(map.texture(0), lines, |x, y| map.texel(x, y));
    }
}

/// Writes the lines of a texture at the start of `lines`, and returns the others. `texel` returns the texel
/// at a column and a row.
fn write_tiles(
    texture: layout::Texture,
    lines: &mut [Line],
    texel: impl Fn(u32, u32) -> [u8; 4] + Sync,
) -> &mut [Line] {
    let [width, height] = texture.size.map(u32::from);
    let across = width.div_ceil(TILE_WIDTH);
    let (own, others) = lines.split_at_mut(texture.lines() as usize);
    own.par_iter_mut().zip(0..texture.lines()).with_min_len(SEQUENTIAL).for_each(|(line, tile)| {
        let [column, row] = [tile % across * TILE_WIDTH, tile / across * TILE_HEIGHT];
        for (place, bytes) in (0..TEXELS_PER_LINE).zip(line.0.as_chunks_mut().0) {
            // A line that extends beyond the borders repeats the last texels.
            let x = (column + place % TILE_WIDTH).min(width - 1);
            let y = (row + place / TILE_WIDTH).min(height - 1);
            *bytes = texel(x, y);
        }
    });
    others
}

/// Texture of an image whose texels begin at line 0.
fn bare(image: &Image) -> layout::Texture {
    layout::Texture {
        first_line: 0,
        // The sides fit `u16`, because the loader rejects larger images.
        size: [image.width, image.height].map(|side| side as u16),
        wrap: [layout::Wrap::Repeat; 2],
        nearest: false,
        set: 0,
        format: image.encoding.into(),
        matrix: [[1.0, 0.0], [0.0, 1.0]],
        offset: [0.0; 2],
    }
}

fn wrap(wrap: Wrap) -> layout::Wrap {
    match wrap {
        Wrap::Repeat => layout::Wrap::Repeat,
        Wrap::Mirror => layout::Wrap::Mirror,
        Wrap::Clamp => layout::Wrap::Clamp,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use photoncard_scene::{Encoding, SceneContents, Texture};

    fn image(width: u32, height: u32) -> Image {
        let texels = (0..width * height).map(u32::to_le_bytes).collect();
        Image { name: "counted".into(), width, height, texels, encoding: Encoding::Linear }
    }

    #[test]
    fn every_texel_is_at_the_position_that_its_texture_computes() {
        let images = vec![image(13, 6), image(1, 1), image(8, 4), image(3, 70)];
        let textures = [0, 3, 1, 2, 3].map(Texture::new).to_vec();
        let scene = Scene::from(SceneContents { images, textures, ..SceneContents::default() });
        let mut lines = vec![Line::ZERO; lines(&scene, None)];
        write(&scene, None, &mut lines);
        for (texture, record) in scene.textures.iter().zip(records(&scene, None).expect("few")) {
            let Image { width, height, texels, .. } = &scene.images[texture.image as usize];
            for (number, texel) in (0..).zip(texels) {
                let (line, place) = record.locate(number % width, number / width);
                assert_eq!(lines[line as usize].record::<4>(place), Some(texel));
            }
            assert_eq!(record.size.map(u32::from), [*width, *height]);
        }
    }
}
