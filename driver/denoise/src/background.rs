//! Pixels that show the environment alone.

use std::ops::RangeInclusive;

/// Indices of the pixels in which no eye ray hits a surface, nor in their neighbours. `hits_surface` has the
/// pixels of a picture of this width and height, row by row. In a pixel beside a surface, all rays may miss a
/// part of it by chance.
pub(crate) fn pixels(hits_surface: &[bool], [width, height]: [usize; 2]) -> impl Iterator<Item = usize> {
    let around = |place: usize, length: usize| -> RangeInclusive<usize> {
        place.saturating_sub(1)..=(place + 1).min(length - 1)
    };
    (0..hits_surface.len()).filter(move |pixel| {
        let mut rows = around(pixel / width, height);
        rows.all(|row| !hits_surface[row * width..][around(pixel % width, width)].contains(&true))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_beside_a_surface_are_left_out() {
        let picture = ["......", ".#....", "......", ".....#"];
        let hits_surface: Vec<bool> = picture.concat().bytes().map(|byte| byte == b'#').collect();
        let found: Vec<usize> = pixels(&hits_surface, [6, 4]).collect();
        assert_eq!(found, [3, 4, 5, 9, 10, 11, 15, 18, 19, 20, 21]);
        assert_eq!(pixels(&[], [0, 0]).count(), 0);
        assert_eq!(pixels(&[false], [1, 1]).count(), 1);
    }
}
