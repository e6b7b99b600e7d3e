//! Charts of a surface: connected triangles that are projected on a plane without overlap.
//!
//! A chart grows from the largest free triangle over shared edges, to triangles whose normals are near the
//! mean normal of the chart (Lévy et al., *Least Squares Conformal Maps*, 2002, grow charts so; the map here
//! is the orthogonal projection, which such charts allow). A triangle whose projection overlaps the chart is
//! left to another chart.

use std::collections::{BTreeMap, HashMap, VecDeque};

use glam::{DVec2, DVec3, Vec3};

use super::overlap::{Plane, bounds, doubled_area};
use super::surfaces::Surfaces;

/// Minimum cosine of the angle between a triangle's normal and its chart's mean normal: that of 50 degrees.
const MIN_COSINE: f64 = 0.643;
/// Number of faces beyond an edge to which a chart may grow.
const MAX_AT_EDGE: usize = 16;
/// Number of a chart's edges whose directions are tried as the axes of its rectangle.
const MAX_AXES: usize = 64;

/// Triangles with places in a plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Chart {
    /// Indices of the triangles in the scene without instances.
    pub triangles: Vec<u32>,
    /// Places of the corners of each triangle; metres from the corner of the chart's rectangle.
    pub places: Vec<[DVec2; 3]>,
    /// Sides of the rectangle, metres.
    pub extent: DVec2,
}

impl Chart {
    /// Chart of triangles with places, moved so that its rectangle begins at 0.
    pub(super) fn new(triangles: Vec<u32>, mut places: Vec<[DVec2; 3]>) -> Self {
        let [low, high] = bounds(places.as_flattened());
        places.as_flattened_mut().iter_mut().for_each(|place| *place -= low);
        Self { triangles, places, extent: high - low }
    }
}

/// Triangle of a surface in double precision.
struct Face {
    corners: [DVec3; 3],
    /// Cross product of two edges.
    scaled_normal: DVec3,
    normal: DVec3,
    /// Faces beyond the three edges.
    neighbours: Vec<u32>,
}

/// Divides triangles into charts. Equal triangles in equal order have equal charts.
pub(super) fn charts(surfaces: &Surfaces, triangles: &[u32]) -> Vec<Chart> {
    let faces = faces(surfaces, triangles);
    let mut by_area: Vec<u32> = (0..faces.len() as u32).collect();
    by_area.sort_by(|one, other| {
        let area = |face: &u32| faces.get(*face as usize).map_or(0.0, |face| face.scaled_normal.length());
        area(other).total_cmp(&area(one)).then(one.cmp(other))
    });
    let mut is_taken = vec![false; faces.len()];
    let mut charts = Vec::new();
    for first in by_area {
        if is_taken.get(first as usize) == Some(&false) {
            let members = grown(&faces, first, &mut is_taken);
            let places = members.iter().map(|(_, places)| *places).collect();
            let index = |face: &u32| triangles.get(*face as usize).copied();
            let members = members.iter().filter_map(|(face, _)| index(face)).collect();
            charts.push(upright(&Chart::new(members, places)));
        }
    }
    charts
}

fn faces(surfaces: &Surfaces, triangles: &[u32]) -> Vec<Face> {
    let key = |corner: Vec3| corner.to_array().map(|axis| (axis + 0.0).to_bits());
    let mut edges: HashMap<[[u32; 3]; 2], Vec<u32>> = HashMap::new();
    let mut faces = Vec::with_capacity(triangles.len());
    for (face, &index) in (0..).zip(triangles) {
        let vertices = surfaces.triangle(index).vertices;
        let [a, b, c] = vertices.map(key);
        for [from, to] in [[a, b], [b, c], [c, a]] {
            edges.entry([from.min(to), from.max(to)]).or_default().push(face);
        }
        let corners = vertices.map(Vec3::as_dvec3);
        let [a, b, c] = corners;
        let scaled_normal = (b - a).cross(c - a);
        let normal = scaled_normal.normalize_or_zero();
        faces.push(Face { corners, scaled_normal, normal, neighbours: Vec::new() });
    }
    let edges: BTreeMap<_, _> = edges.into_iter().collect();
    for around in edges.values() {
        for (place, &face) in around.iter().enumerate() {
            // Of many faces at an edge, each adjoins those next to it.
            let nearest = place.saturating_sub(MAX_AT_EDGE / 2)..(place + 1 + MAX_AT_EDGE / 2);
            let others = around.get(nearest.start..nearest.end.min(around.len())).unwrap_or_default();
            if let Some(of_face) = faces.get_mut(face as usize) {
                of_face.neighbours.extend(others.iter().copied().filter(|&other| other != face));
            }
        }
    }
    faces
}

/// Grows a chart from a face. The plane of the projection is that of the faces' mean normal, which is found
/// by a first growth without a test of overlap.
fn grown(faces: &[Face], first: u32, is_taken: &mut [bool]) -> Vec<(u32, [DVec2; 3])> {
    let Some(seed) = faces.get(first as usize) else { return Vec::new() };
    let mut sum = seed.scaled_normal;
    spread(faces, first, is_taken, |face| {
        let fits = face.normal.dot(sum.normalize_or_zero()) >= MIN_COSINE
            && face.normal.dot(seed.normal) >= MIN_COSINE;
        if fits {
            sum += face.scaled_normal;
        }
        fits
    });
    let normal = if seed.normal.dot(sum.normalize_or_zero()) >= MIN_COSINE { sum } else { seed.normal };
    let normal = normal.normalize_or(DVec3::Y);
    let (u, v) = normal.any_orthonormal_pair();
    let project = |face: &Face| face.corners.map(|corner| DVec2::new(corner.dot(u), corner.dot(v)));
    let mut plane = Plane::new(0.5 * seed.scaled_normal.length());
    plane.add(project(seed));
    let members = spread(faces, first, is_taken, |face| {
        face.normal.dot(normal) >= MIN_COSINE && {
            let places = project(face);
            doubled_area(&places) > 0.0 && plane.add(places)
        }
    });
    for &member in &members {
        if let Some(taken) = is_taken.get_mut(member as usize) {
            *taken = true;
        }
    }
    members.iter().filter_map(|&face| Some((face, project(faces.get(face as usize)?)))).collect()
}

/// Visits free faces over shared edges, from `first` on, as long as `takes` takes them. Each is offered once.
fn spread(faces: &[Face], first: u32, is_taken: &[bool], mut takes: impl FnMut(&Face) -> bool) -> Vec<u32> {
    let mut seen = std::collections::HashSet::from([first]);
    let mut waiting = VecDeque::from([first]);
    let mut members = vec![first];
    while let Some(face) = waiting.pop_front().and_then(|face| faces.get(face as usize)) {
        for &next in &face.neighbours {
            let is_free = is_taken.get(next as usize) == Some(&false) && seen.insert(next);
            if is_free && faces.get(next as usize).is_some_and(&mut takes) {
                members.push(next);
                waiting.push_back(next);
            }
        }
    }
    members
}

/// Turns a chart so that its rectangle is small and not higher than wide. The axes tried are those of its
/// longest edges.
fn upright(chart: &Chart) -> Chart {
    let sides = chart.places.iter().flat_map(|&[a, b, c]| [b - a, c - b, a - c]);
    let mut sides: Vec<DVec2> = sides.collect();
    sides.sort_by(|one, other| other.length_squared().total_cmp(&one.length_squared()));
    sides.truncate(MAX_AXES);
    let turned = |axis: DVec2| {
        let turn = |place: &DVec2| DVec2::new(axis.dot(*place), axis.perp_dot(*place));
        let corners: Vec<DVec2> = chart.places.as_flattened().iter().map(turn).collect();
        corners
    };
    let mut best: Option<(f64, DVec2)> = None;
    for axis in sides.iter().filter_map(|side| side.try_normalize()) {
        let [low, high] = bounds(&turned(axis));
        let extent = high - low;
        let area = extent.x * extent.y;
        if best.is_none_or(|(least, _)| area < least * (1.0 - 1e-9)) {
            best = Some((area, if extent.y > extent.x { axis.perp() } else { axis }));
        }
    }
    let places = turned(best.map_or(DVec2::X, |(_, axis)| axis));
    Chart::new(chart.triangles.clone(), places.as_chunks::<3>().0.to_vec())
}
