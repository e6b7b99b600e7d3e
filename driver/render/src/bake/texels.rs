//! Texels of the pages, and the points of the surfaces at which their light is measured.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, Vec3};

use super::atlas::{Atlas, PlacedChart};
use super::raster::{barycentric, cells, is_within, nearest, touched};
use super::surfaces::Surfaces;

/// Point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position in the scene's coordinates, metres.
    pub position: Vec3,
    /// Interpolated unit normal.
    pub normal: Vec3,
    /// Unit normal of the triangle's front.
    pub face: Vec3,
    /// Squared distance from the texel's centre, texels.
    pub off_centre: f32,
}

/// A texel that a chart touches.
#[derive(Clone, Debug, PartialEq)]
pub struct Texel {
    /// Number of the page.
    pub page: u32,
    /// Column and row on the page.
    pub place: [u32; 2],
    /// Index of the chart in the atlas.
    pub chart: u32,
    /// Primitive of the triangle nearest to the texel's centre.
    pub primitive: u32,
    /// Triangle nearest to the texel's centre, and the barycentric coordinates of the nearest place.
    pub nearest: (u32, [f64; 3]),
    /// Points of the texel that lie on its triangles; the nearest point if none does.
    pub samples: Vec<Sample>,
}

/// Texels of all charts, by chart, row and column. Each has at most `side * side` samples.
pub(super) fn texels(surfaces: &Surfaces, atlas: &Atlas, side: u32) -> Vec<Texel> {
    let of_chart = |(index, chart)| of_chart(surfaces, (index, chart), side);
    (0..).zip(&atlas.charts).flat_map(of_chart).collect()
}

/// Texel that is being collected.
struct Found {
    /// Squared distance of the nearest triangle from the centre.
    distance: f64,
    nearest: (u32, u32, [f64; 3]),
    /// Sample of each cell.
    cells: Vec<Option<Sample>>,
}

fn of_chart(surfaces: &Surfaces, (index, chart): (u32, &PlacedChart), side: u32) -> Vec<Texel> {
    let mut found: BTreeMap<[u32; 2], Found> = BTreeMap::new();
    for ((&triangle, places), &primitive) in chart.triangles.iter().zip(&chart.places).zip(&chart.primitives)
    {
        for texel in touched(places, chart.rectangle) {
            let [x, y] = texel;
            let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            let near = nearest(places, centre);
            let distance = near.distance_squared(centre);
            let entry = found.entry([y, x]).or_insert_with(|| Found {
                distance: f64::INFINITY,
                nearest: (0, 0, [0.0; 3]),
                cells: vec![None; (side * side) as usize],
            });
            if distance < entry.distance {
                entry.distance = distance;
                entry.nearest = (triangle, primitive, barycentric(places, near));
            }
            for (place, cell) in cells(texel, side).zip(&mut entry.cells) {
                let weights = barycentric(places, place);
                if cell.is_none() && is_within(weights) {
                    *cell = Some(sample(surfaces, triangle, weights, place.distance_squared(centre)));
                }
            }
        }
    }
    let texel = |([y, x], found): ([u32; 2], Found)| {
        let Found { distance, nearest: (triangle, primitive, weights), cells } = found;
        let mut samples: Vec<Sample> = cells.into_iter().flatten().collect();
        if samples.is_empty() {
            samples.push(sample(surfaces, triangle, weights, distance));
        }
        Texel {
            page: chart.page,
            place: [x, y],
            chart: index,
            primitive,
            nearest: (triangle, weights),
            samples,
        }
    };
    found.into_iter().map(texel).collect()
}

fn sample(surfaces: &Surfaces, index: u32, weights: [f64; 3], off_centre: f64) -> Sample {
    let triangle = surfaces.triangle(index);
    let sum = |corners: [Vec3; 3]| {
        let terms = corners.iter().zip(weights).map(|(corner, weight)| corner.as_dvec3() * weight);
        terms.fold(DVec3::ZERO, |sum, term| sum + term)
    };
    let face = triangle.scaled_normal().normalize_or(Vec3::Y);
    let normal = sum(surfaces.normals(&triangle)).normalize_or(face.as_dvec3()).as_vec3();
    let position = sum(triangle.vertices).as_vec3();
    Sample { position, normal, face, off_centre: off_centre as f32 }
}
