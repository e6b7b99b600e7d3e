//! Image pyramids of emissive textures (Williams, "Pyramidal Parametrics", 1983). The mean over many texels
//! is approximated by the mean over few cells.

use glam::Vec3;
use photoncard_firmware::scene::decode_texel;
use photoncard_scene::{Encoding, Image};

/// Number of cells along each axis that are combined to one cell of the next level.
const STEP: u32 = 4;

/// Means of an image at several resolutions below the image's own.
pub(super) struct Pyramid {
    /// Levels from fine to coarse. The last level is one cell.
    pub(super) levels: Vec<Level>,
}

/// Means of an image over the cells of a grid. The cells have about equal size.
pub(super) struct Level {
    /// Number of columns and of rows.
    pub(super) size: [u32; 2],
    /// Linear RGB of the cells, in rows from the top.
    pub(super) cells: Vec<Vec3>,
}

impl Level {
    /// Maximum distance from a cell's centre at which it contributes, cells. Interpolation carries a texel at
    /// the border half a texel farther. If [`STEP`] does not divide a side, a cell consists of all finer
    /// cells that begin in it. They extend beyond its border by up to 0.67 cells.
    pub(super) const REACH: f64 = 1.5;
    /// Weight of a cell whose centre is not on the triangle. It is small, but not 0, because the cell may be
    /// the only one that emits.
    pub(super) const OUTSIDE: f64 = 1.0 / 16.0;

    /// Creates the level above a finer grid of `finer_size` columns and rows. `finer` returns a cell of that
    /// grid by index.
    fn new(finer_size: [u32; 2], finer: impl Fn(usize) -> Vec3) -> Self {
        let size = finer_size.map(|side| side.div_ceil(STEP));
        let range = |axis: usize, cell: u32| {
            let border =
                |cell: u32| (u64::from(cell) * u64::from(finer_size[axis]) / u64::from(size[axis])) as usize;
            border(cell)..border(cell + 1)
        };
        let mut cells = Vec::with_capacity(size[0] as usize * size[1] as usize);
        for row in 0..size[1] {
            for column in 0..size[0] {
                let [columns, rows] = [range(0, column), range(1, row)];
                let count = columns.len() * rows.len();
                let sum: Vec3 = rows
                    .flat_map(|row| columns.clone().map(move |column| row * finer_size[0] as usize + column))
                    .map(&finer)
                    .sum();
                cells.push(sum / count as f32);
            }
        }
        Self { size, cells }
    }
}

impl Pyramid {
    pub(super) fn new(image: &Image) -> Self {
        let texel = |index: usize| decode(image.encoding, image.texels[index]);
        let mut levels = vec![Level::new([image.width, image.height], texel)];
        while let Some(last) = levels.last()
            && last.size != [1; 2]
        {
            levels.push(Level::new(last.size, |index| last.cells[index]));
        }
        Self { levels }
    }
}

/// Decodes a texel to linear RGB.
pub(super) fn decode(encoding: Encoding, texel: [u8; 4]) -> Vec3 {
    let [red, green, blue, _] = decode_texel(encoding.into(), texel);
    Vec3::new(red, green, blue)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_texel_is_in_one_cell_of_each_level() {
        for (width, height) in [(1, 1), (64, 64), (5, 37), (1, 300)] {
            for lit in [0, width * height / 3, width * height - 1] {
                let mut texels = vec![[0, 0, 0, 255]; (width * height) as usize];
                texels[lit as usize] = [255; 4];
                let image = Image { name: "spark".into(), width, height, texels, encoding: Encoding::Srgb };
                let pyramid = Pyramid::new(&image);
                for level in &pyramid.levels {
                    assert_eq!(level.cells.len() as u32, level.size[0] * level.size[1]);
                    let shown = level.cells.iter().filter(|cell| cell.x > 0.0).count();
                    assert_eq!(shown, 1, "{width} x {height}, {lit}, {:?}", level.size);
                }
                assert_eq!(pyramid.levels.last().map(|level| level.size), Some([1; 2]));
            }
        }
    }
}
