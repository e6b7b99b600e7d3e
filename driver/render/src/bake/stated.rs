//! Layouts that the scene's file states: the second set of texture coordinates of an object.

use std::collections::BTreeMap;

use glam::DVec2;

use super::charts::Chart;
use super::overlap::{Plane, bounds, doubled_area};
use super::surfaces::Surfaces;

/// Minimum area of a triangle in the layout, relative to its share of the layout by its area in the scene.
const MIN_SHARE: f64 = 1e-3;

/// Layout of an object by its second set of coordinates, scaled such that its area is that of the object:
/// the connected parts as charts that keep their places. `None` unless the coordinates of all triangles lie
/// in 0 to 1 and no triangle overlaps another.
pub(super) fn stated(surfaces: &Surfaces, triangles: &[u32]) -> Option<Vec<Chart>> {
    let mut places = Vec::with_capacity(triangles.len());
    for &index in triangles {
        let own = surfaces.coordinates(&surfaces.triangle(index), 1)?;
        let is_inside = |place: &DVec2| place.cmpge(DVec2::ZERO).all() && place.cmple(DVec2::ONE).all();
        places.push(own.iter().all(is_inside).then_some(own)?);
    }
    let area = |index: &u32| f64::from(surfaces.triangle(*index).area());
    let of_object: f64 = triangles.iter().map(area).sum();
    let of_layout: f64 = places.iter().map(|places| 0.5 * doubled_area(places).abs()).sum();
    let has_area = |(index, places): (&u32, &[DVec2; 3])| {
        0.5 * doubled_area(places).abs() / of_layout > MIN_SHARE * area(index) / of_object
    };
    if !(of_layout > 0.0 && triangles.iter().zip(&places).all(has_area)) {
        return None;
    }
    let scale = (of_object / of_layout).sqrt();
    places.as_flattened_mut().iter_mut().for_each(|place| *place *= scale);
    let mut plane = Plane::new(of_object / triangles.len() as f64);
    places.iter().all(|&places| plane.add(places)).then(|| parts(triangles, &places))
}

/// Connected parts of a layout. They share the corner of the layout's rectangle.
fn parts(triangles: &[u32], places: &[[DVec2; 3]]) -> Vec<Chart> {
    let [low, high] = bounds(places.as_flattened());
    let key = |place: DVec2| place.to_array().map(f64::to_bits);
    let mut at: BTreeMap<[[u64; 2]; 2], Vec<usize>> = BTreeMap::new();
    for (face, &[a, b, c]) in places.iter().enumerate() {
        for [from, to] in [[a, b], [b, c], [c, a]].map(|ends| ends.map(key)) {
            at.entry([from.min(to), from.max(to)]).or_default().push(face);
        }
    }
    let mut part_of: Vec<usize> = (0..places.len()).collect();
    let root = |part_of: &[usize], mut face: usize| {
        while let Some(&next) = part_of.get(face).filter(|&&next| next != face) {
            face = next;
        }
        face
    };
    for around in at.values() {
        for pair in around.windows(2) {
            let [one, other] = [pair.first(), pair.last()].map(|face| root(&part_of, *face.unwrap_or(&0)));
            if let Some(greater) = part_of.get_mut(one.max(other)) {
                *greater = one.min(other);
            }
        }
    }
    let mut found: BTreeMap<usize, Chart> = BTreeMap::new();
    for (face, (&triangle, places)) in triangles.iter().zip(places).enumerate() {
        let chart = found.entry(root(&part_of, face)).or_default();
        chart.triangles.push(triangle);
        chart.places.push(places.map(|place| place - low));
        chart.extent = high - low;
    }
    found.into_values().collect()
}
