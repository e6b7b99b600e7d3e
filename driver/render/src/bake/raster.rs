//! Rasters of charts: which texels a triangle covers or touches.

use glam::DVec2;

use super::overlap::{bounds, doubled_area, overlap};

/// Depth, texels, up to which a triangle does not touch a texel.
const TOUCH: f64 = 1e-5;

/// Range of texels, lower inclusive and upper exclusive.
pub(super) type Rectangle = [[u32; 2]; 2];

/// Texels of `within` that a triangle touches. `places` are the corners, texels.
pub(super) fn touched(places: &[DVec2; 3], within: Rectangle) -> Vec<[u32; 2]> {
    let [low, high] = bounds(places);
    let [[x0, y0], [x1, y1]] = within;
    let first = |low: f64, start: u32| (low.floor().max(0.0) as u32).max(start);
    let end = |high: f64, end: u32| (high.floor().max(0.0) as u32).saturating_add(1).min(end);
    let columns = || first(low.x, x0)..end(high.x, x1);
    let mut texels = Vec::new();
    for y in first(low.y, y0)..end(high.y, y1) {
        texels.extend(columns().map(|x| [x, y]).filter(|texel| touches(places, *texel)));
    }
    texels
}

/// Returns whether a triangle touches a texel: the triangle overlaps one half of the square at least.
fn touches(places: &[DVec2; 3], texel: [u32; 2]) -> bool {
    let low = DVec2::new(f64::from(texel[0]), f64::from(texel[1]));
    let [b, c, d] = [DVec2::X, DVec2::ONE, DVec2::Y].map(|side| low + side);
    overlap(places, &[low, b, c], TOUCH) || overlap(places, &[low, c, d], TOUCH)
}

/// Barycentric coordinates of a place in a triangle of non-zero area.
pub(super) fn barycentric(places: &[DVec2; 3], place: DVec2) -> [f64; 3] {
    let [a, b, c] = *places;
    let area = doubled_area(places);
    let of_b = doubled_area(&[a, place, c]) / area;
    let of_c = doubled_area(&[a, b, place]) / area;
    [1.0 - of_b - of_c, of_b, of_c]
}

/// Returns whether barycentric coordinates are those of a place in the triangle or on its border.
pub(super) fn is_within(barycentric: [f64; 3]) -> bool {
    barycentric.iter().all(|weight| *weight >= -1e-9)
}

/// Place in a triangle that is nearest to a place.
pub(super) fn nearest(places: &[DVec2; 3], place: DVec2) -> DVec2 {
    if is_within(barycentric(places, place)) {
        return place;
    }
    let [a, b, c] = *places;
    let on_edge = |[from, to]: [DVec2; 2]| {
        let along = to - from;
        let length = along.length_squared();
        let share = if length > 0.0 { (place - from).dot(along) / length } else { 0.0 };
        from + along * share.clamp(0.0, 1.0)
    };
    let edges = [[a, b], [b, c], [c, a]].map(on_edge);
    let distance = |edge: &DVec2| edge.distance_squared(place);
    edges.into_iter().min_by(|one, other| distance(one).total_cmp(&distance(other))).unwrap_or(a)
}

/// Centres of the `side * side` cells of a texel, row by row.
pub(super) fn cells(texel: [u32; 2], side: u32) -> impl Iterator<Item = DVec2> {
    let low = DVec2::new(f64::from(texel[0]), f64::from(texel[1]));
    let place = move |cell: u32| (f64::from(cell) + 0.5) / f64::from(side);
    (0..side * side).map(move |cell| low + DVec2::new(place(cell % side), place(cell / side)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_touches_each_texel_that_it_crosses_and_no_other() {
        let sliver = [[0.5, 0.5], [3.5, 0.6], [3.5, 0.61]].map(DVec2::from_array);
        let all = [[0, 0], [8, 8]];
        assert_eq!(touched(&sliver, all), [[0, 0], [1, 0], [2, 0], [3, 0]]);
        let square = [[1.0, 1.0], [3.0, 1.0], [3.0, 3.0]].map(DVec2::from_array);
        assert_eq!(touched(&square, all), [[1, 1], [2, 1], [2, 2]], "edges on borders touch nothing beyond");
        assert_eq!(touched(&square, [[2, 0], [8, 2]]), [[2, 1]]);
    }

    #[test]
    fn the_nearest_place_is_on_the_border_or_the_place_itself() {
        let triangle = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]].map(DVec2::from_array);
        let near = |x: f64, y: f64| nearest(&triangle, DVec2::new(x, y)).to_array();
        assert_eq!(near(0.5, 0.5), [0.5, 0.5]);
        assert_eq!(near(-1.0, 1.0), [0.0, 1.0]);
        assert_eq!(near(2.0, 2.0), [1.0, 1.0]);
        assert_eq!(near(5.0, -1.0), [2.0, 0.0]);
    }
}
