//! The texels that show on a triangle.

use crate::scene::{Attributes, Image, Texture, Wrap};

/// A triangle on a texture.
pub(super) struct Footprint<'s> {
    image: &'s Image,
    wrap: [Wrap; 2],
    /// Its corners, in texels from the upper left corner of the image.
    corners: [[f64; 2]; 3],
}

/// How much farther than the texel's own middle interpolation spreads it, texels.
const REACH: f64 = 1.0;
/// More texels than so many times those of the image are not looked at one by one.
const MOST_REPEATS: f64 = 4.0;

impl<'s> Footprint<'s> {
    pub(super) fn new(texture: &Texture, image: &'s Image, attributes: &Attributes) -> Self {
        let coordinates = attributes.coordinates[texture.set as usize & 1];
        let corners = coordinates.map(|coordinate| {
            let [u, v] = coordinate.to_array().map(f64::from);
            let [x, y] = [0, 1].map(|axis| {
                let [a, b] = texture.matrix[axis].map(f64::from);
                a * u + b * v + f64::from(texture.offset[axis])
            });
            [x * f64::from(image.width), y * f64::from(image.height)]
        });
        Self { image, wrap: texture.wrap, corners }
    }

    /// Shows every texel that has a part in what shows on the triangle, those of a repeated image repeatedly. `false`, and none, if
    /// they are too many, as where the image is repeated often.
    pub(super) fn for_each_texel(&self, mut visit: impl FnMut([u8; 4])) -> bool {
        let side = |axis: usize| {
            let places = self.corners.map(|corner| corner[axis]);
            let [lower, upper] = [
                places.into_iter().fold(f64::INFINITY, f64::min),
                places.into_iter().fold(f64::MIN, f64::max),
            ];
            [lower, upper]
        };
        let [[left, right], [top, bottom]] = [side(0), side(1)];
        let all = (right - left + 2.0) * (bottom - top + 2.0);
        let most = MOST_REPEATS * (self.image.texels.len() as f64 + 64.0);
        // Not `all > most`: it may be no number. Beyond 2^40 a texel is not told from the next.
        if !(all <= most && [left, right, top, bottom].into_iter().all(|place| place.abs() < 1e12)) {
            return false;
        }
        let texels = |lower: f64, upper: f64| {
            (lower - 0.5 - REACH).ceil() as i64..=(upper - 0.5 + REACH).floor() as i64
        };
        for row in texels(top, bottom) {
            let middle = row as f64 + 0.5;
            let Some([left, right]) = self.across(middle - REACH, middle + REACH) else { continue };
            for column in texels(left, right) {
                let x = wrapped(column, self.image.width, self.wrap[0]);
                let y = wrapped(row, self.image.height, self.wrap[1]);
                visit(self.image.texels[y as usize * self.image.width as usize + x as usize]);
            }
        }
        true
    }

    /// How far the triangle goes to the sides between two heights.
    fn across(&self, top: f64, bottom: f64) -> Option<[f64; 2]> {
        let [a, b, c] = self.corners;
        let mut sides: Option<[f64; 2]> = None;
        let mut include = |x: f64| {
            let [left, right] = sides.unwrap_or([x, x]);
            sides = Some([left.min(x), right.max(x)]);
        };
        for [[x0, y0], [x1, y1]] in [[a, b], [b, c], [c, a]] {
            if (top..=bottom).contains(&y0) {
                include(x0);
            }
            for border in [top, bottom] {
                if (y0 < border) != (y1 < border) {
                    include(x0 + (x1 - x0) * ((border - y0) / (y1 - y0)));
                }
            }
        }
        sides
    }
}

/// The texel of the image that lies at a place beyond its borders too.
fn wrapped(place: i64, size: u32, wrap: Wrap) -> u32 {
    let size = i64::from(size);
    let texel = match wrap {
        Wrap::Repeat => place.rem_euclid(size),
        Wrap::Mirror => {
            let place = place.rem_euclid(2 * size);
            place.min(2 * size - 1 - place)
        }
        Wrap::Clamp => place.clamp(0, size - 1),
    };
    texel as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_go_on_beyond_their_borders() {
        let all = |wrap: Wrap| [-5, -1, 0, 3, 4, 8].map(|place| wrapped(place, 4, wrap));
        assert_eq!(all(Wrap::Repeat), [3, 3, 0, 3, 0, 0]);
        assert_eq!(all(Wrap::Mirror), [3, 0, 0, 3, 3, 0]);
        assert_eq!(all(Wrap::Clamp), [0, 0, 0, 3, 3, 3]);
    }
}
