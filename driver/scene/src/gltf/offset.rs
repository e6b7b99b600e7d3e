//! Offset of the origin for a scene far from the file's origin, so that single precision suffices.
//!
//! Positions in a file of a building or a map may be thousands of kilometres from its origin, where steps of
//! single precision are half a metre. The scene's origin is then a point near the scene whose coordinates
//! have few digits. If an exporter has added such an offset, the subtraction is exact: the scene equals one
//! that is modelled at the origin.

use glam::{DMat4, DVec3};

use super::limits::MAX_COORDINATE;

/// Distance of a scene's centre from the file's origin beyond which the scene is moved, in units of the
/// scene's size.
const NEAR: f64 = 16.0;

/// Distance of a scene's centre from the file's origin, metres, beyond which the scene is moved although it
/// is within [`NEAR`]. For a scene larger than this distance, the limit is the scene's size. Single precision
/// is coarser than 60 um beyond 1000 m.
const FAR: f64 = 1000.0;

/// Least exponent of a power of two to which the offset is rounded: 2^-10 m.
const FINEST: i32 = -10;

/// Bounding box in double precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Bounds {
    pub(super) const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    /// Extends the box by a point. Points that are not finite are ignored.
    pub(super) fn add(&mut self, place: DVec3) {
        if place.is_finite() {
            (self.low, self.high) = (self.low.min(place), self.high.max(place));
        }
    }

    /// The box around both boxes.
    pub(super) fn joined(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Centre of the box; `None` if it is empty or further from the origin than [`MAX_COORDINATE`].
    pub(super) fn centre(&self) -> Option<DVec3> {
        let is_near = self.low.abs().max(self.high.abs()).max_element() <= f64::from(MAX_COORDINATE);
        is_near.then(|| 0.5 * (self.low + self.high))
    }

    /// Extends the box by the transformed box `local`.
    pub(super) fn add_placed(&mut self, transform: &DMat4, local: &Self) {
        if !local.low.is_finite() {
            return;
        }
        for corner in 0..8 {
            let is_high = [corner & 1, corner & 2, corner & 4].map(|bit| bit != 0);
            let corner = DVec3::select(is_high.into(), local.high, local.low);
            self.add(transform.transform_point3(corner));
        }
    }

    /// Offset of a scene with these bounds, metres. It is 0 along axes on which the scene is near the origin.
    /// Along other axes it lies within one scene size of the scene's centre: the first whole number among the
    /// translations `stated` of top-level nodes, else the number with the fewest digits.
    pub(super) fn offset(&self, stated: &[DVec3]) -> DVec3 {
        let size = (self.high - self.low).max_element();
        let furthest = self.low.abs().max(self.high.abs()).max_element();
        if !(size > 0.0 && furthest <= f64::from(MAX_COORDINATE)) {
            return DVec3::ZERO;
        }
        let centre = 0.5 * (self.low + self.high);
        let along = |axis: usize| {
            let distance = centre[axis].abs();
            let is_far = distance > NEAR * size || distance > FAR.max(size);
            let [low, high] = [centre[axis] - size, centre[axis] + size];
            let whole = stated.iter().map(|place| place[axis]);
            let mut whole = whole.filter(|place| place.fract() == 0.0);
            let whole = whole.find(|place| (low..=high).contains(place));
            if is_far { whole.unwrap_or_else(|| roundest(low, high)) } else { 0.0 }
        };
        DVec3::new(along(0), along(1), along(2))
    }
}

/// Returns the number between `low` and `high`, of equal sign, that has the fewest decimal or binary digits;
/// of several, the nearest to the middle. A decimal digit counts as two binary digits.
fn roundest(low: f64, high: f64) -> f64 {
    let middle = 0.5 * (low + high);
    let magnitude = |base: f64| libm::floor(libm::log2(low.abs().max(high.abs())) / libm::log2(base)) as i32;
    let decimal = multiple(10.0, (0..=magnitude(10.0)).rev(), middle, low..=high);
    let binary = multiple(2.0, (FINEST..=magnitude(2.0)).rev(), middle, low..=high);
    let price = |digits: i32, of_each: i32| digits * of_each;
    let decimal = decimal.map(|(number, power)| (price(magnitude(10.0) - power, 2), number));
    let binary = binary.map(|(number, power)| (price(magnitude(2.0) - power, 1), number));
    let found = [decimal, binary].into_iter().flatten();
    let is_better = |one: &(i32, f64), other: &(i32, f64)| {
        let distance = |(_, number): &(i32, f64)| (number - middle).abs();
        one.0.cmp(&other.0).then(distance(one).total_cmp(&distance(other)))
    };
    found.min_by(is_better).map_or(0.0, |(_, number)| number)
}

/// Returns the multiple of `base^power` that is nearest to `middle`, and `power`: the first of `powers` for
/// which this multiple is in `range`.
fn multiple(
    base: f64,
    mut powers: impl Iterator<Item = i32>,
    middle: f64,
    range: std::ops::RangeInclusive<f64>,
) -> Option<(f64, i32)> {
    powers.find_map(|power| {
        let step = libm::pow(base, power.into());
        let number = libm::round(middle / step) * step;
        range.contains(&number).then_some((number, power))
    })
}

/// Translation of a node relative to the scene's origin. `stated` is the file's translation in double
/// precision; the offset is subtracted if the node is a root. Components below half the offset's greatest
/// component are rounded to single precision, as in a scene without an offset.
pub(super) fn translation(stated: DVec3, offset: DVec3, is_root: bool) -> DVec3 {
    let moved = if is_root { stated - offset } else { stated };
    let limit = 0.5 * offset.abs().max_element();
    let rounded = moved.as_vec3().as_dvec3();
    DVec3::select(moved.abs().cmplt(DVec3::splat(limit)), rounded, moved)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds(centre: DVec3, half: f64) -> Bounds {
        Bounds { low: centre - half, high: centre + half }
    }

    #[test]
    fn scenes_near_the_origin_stay() {
        for (centre, half) in [(DVec3::ZERO, 1.0), (DVec3::splat(30.0), 1.0), (DVec3::X * 990.0, 500.0)] {
            assert_eq!(bounds(centre, half).offset(&[]), DVec3::ZERO);
        }
        assert_eq!(Bounds::EMPTY.offset(&[]), DVec3::ZERO);
        assert_eq!(bounds(DVec3::X * 2e8, 1.0).offset(&[]), DVec3::ZERO, "beyond the greatest coordinate");
    }

    #[test]
    fn round_offsets_are_found_wherever_the_room_stands_about_its_origin() {
        let rounds = [1e4, -1e4, 1e5, 5e6, 12e3, 131_072.0, -4_194_304.0, 1024.0, 2e7];
        for offset in rounds {
            for inside in [-0.9, -0.5, 0.0, 0.3, 0.99] {
                let found = bounds(DVec3::new(offset + 4.0 * inside, 1.2, -offset), 2.0).offset(&[]);
                assert_eq!(found, DVec3::new(offset, 0.0, -offset), "{offset} {inside}");
            }
        }
    }

    #[test]
    fn whole_places_of_nodes_are_preferred() {
        let place = DVec3::new(12_345.0, 7.0, 0.5);
        assert_eq!(bounds(place, 2.0).offset(&[place]), DVec3::X * 12_345.0);
        let other = bounds(DVec3::X * 12_343.5, 2.0).offset(&[DVec3::X * 12_345.25]);
        assert_eq!(other, DVec3::X * 12_340.0);
    }

    #[test]
    fn small_translations_have_single_precision() {
        let offset = DVec3::new(1e4, 0.0, -1e4);
        let stated = DVec3::new(10_000.0, 1.1, -9_995.8);
        assert_eq!(translation(stated, offset, true), glam::Vec3::new(0.0, 1.1, 4.2).as_dvec3());
        let deep = DVec3::new(10_000.1, 0.1, 0.0);
        assert_eq!(translation(deep, offset, false), DVec3::new(10_000.1, f64::from(0.1_f32), 0.0));
    }
}
