//! Surfaces outside all solids, represented by points on chords, and the disc fraction that follows from
//! them.

use std::sync::OnceLock;

use glam::Vec3;
use photoncard_firmware::photon::{SameSurface, Sectors};
use photoncard_firmware::simd::{Isa, Kernel, LANES};

use super::chords::{Batch, Chords};
use super::lanes::Lane;

/// Number of normal codes.
const CODES: usize = 1 << u8::BITS;

/// For each code of a normal, the codes of the normals that a gather counts as the same surface.
pub(super) struct SameSurfaces([OnceLock<[bool; CODES]>; CODES]);

impl SameSurfaces {
    pub(super) fn new() -> Self {
        Self([const { OnceLock::new() }; CODES])
    }

    /// Returns a flag for each normal code `c`: true if a gather at a photon with the code `normal` counts
    /// photons with the code `c`.
    fn of(&self, normal: u8) -> &[bool; CODES] {
        self.0[usize::from(normal)].get_or_init(|| {
            let (mut same, mut code) = (SameSurface::new(normal), 0_u8);
            [(); CODES].map(|()| {
                let holds = same.holds(code);
                code = code.wrapping_add(1);
                holds
            })
        })
    }
}

/// Points on surfaces outside all solids. Each point represents its chord's part of the surface area.
#[derive(Default)]
pub(super) struct OpenSurfaces {
    places: Vec<SurfaceLanes>,
    count: usize,
}

/// Sixteen surface points. Unused lanes have no area.
#[derive(Clone, Copy)]
struct SurfaceLanes {
    places: [Lane; 3],
    slopes: Lane,
    normals: [u8; LANES],
    /// For each point, its slope if [`OpenSurfaces::choose`] has chosen it, else 0.
    areas: Lane,
}

impl OpenSurfaces {
    pub(super) fn clear(&mut self) {
        self.places.clear();
        self.count = 0;
    }

    #[inline(always)]
    pub(super) fn push(&mut self, place: [f32; 3], slope: f32, normal: u8) {
        let lane = self.count % LANES;
        if lane == 0 {
            let zero = [0.0; LANES];
            self.places.push(SurfaceLanes {
                places: [zero; 3],
                slopes: zero,
                normals: [0; LANES],
                areas: zero,
            });
        }
        self.count += 1;
        if let Some(lanes) = self.places.last_mut() {
            lanes.places.iter_mut().zip(place).for_each(|(lanes, coordinate)| lanes[lane] = coordinate);
            (lanes.slopes[lane], lanes.normals[lane]) = (slope, normal);
        }
    }

    /// Chooses the points that a gather counts as the surface of a photon whose normal has the code `normal`.
    pub(super) fn choose(&mut self, normal: u8, same: &SameSurfaces) {
        let same = same.of(normal);
        for lanes in &mut self.places {
            for lane in 0..LANES {
                let is_same = same[usize::from(lanes.normals[lane])];
                lanes.areas[lane] = if is_same { lanes.slopes[lane] } else { 0.0 };
            }
        }
    }
}

/// Kernel that computes a disc fraction: the area of the chosen surface within the sphere around a photon,
/// divided by the area of its disc.
pub(super) struct FractionWithin<'a> {
    pub(super) chords: &'a Chords,
    pub(super) surfaces: &'a OpenSurfaces,
    pub(super) centre: Vec3,
    pub(super) radius: f32,
    /// Distance above or below the photon's plane up to which a point counts as in the plane, in radii of the
    /// ball around the photon's cluster. It allows for the photon grid, which can move a photon off its
    /// surface.
    pub(super) lift: f32,
}

impl Kernel for FractionWithin<'_> {
    type Output = f32;

    #[inline(always)]
    fn run(self, _: impl Isa) -> f32 {
        let Self { chords, surfaces, centre, radius, lift } = self;
        let limit = radius * radius;
        let (mut disc, mut area) = ([0.0; LANES], [0.0; LANES]);
        for batch in &chords.batches {
            let near = within(&batch_ways(batch, centre), limit);
            for lane in 0..LANES {
                disc[lane] += near[lane];
            }
        }
        for lanes in &surfaces.places {
            let near = within(&lanes.ways(centre, lift), limit);
            for lane in 0..LANES {
                area[lane] += near[lane] * lanes.areas[lane];
            }
        }
        share(area.iter().sum(), disc.iter().sum(), 1.0)
    }
}

/// Areas, around a photon, of the surface that [`OpenSurfaces::choose`] has chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Areas {
    /// Area within the photon's sphere, divided by the area of its disc.
    pub(super) fraction: f32,
    /// Hidden fraction: the area that the photon cannot see, divided by the whole area, both within a larger
    /// sphere.
    pub(super) hidden: f32,
    /// Area within the photon's sphere that lies in its visible region, divided by the region's area in the
    /// plane.
    pub(super) of_region: f32,
    /// Number of points of the chosen surface within the larger sphere.
    pub(super) points: f32,
}

/// Visible region of a photon, in a ball's coordinates. `axes` are its axes in the chords' frame. `inner` are
/// the sectors that are visible as a whole, and `outer` the sectors that contain everything visible.
pub(super) struct SeenRegion {
    pub(super) axes: [[f32; 3]; 3],
    pub(super) inner: Sectors,
    pub(super) outer: Sectors,
}

/// Kernel that measures the areas of the chosen surface around a photon.
#[derive(Clone, Copy)]
pub(super) struct AreasWithin<'a> {
    pub(super) chords: &'a Chords,
    pub(super) surfaces: &'a OpenSurfaces,
    pub(super) region: &'a SeenRegion,
    pub(super) centre: Vec3,
    pub(super) radius: f32,
    /// Radius of the larger sphere, in radii of the ball.
    pub(super) outer_radius: f32,
    /// See `FractionWithin::lift`.
    pub(super) lift: f32,
}

impl Kernel for AreasWithin<'_> {
    type Output = Areas;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Areas {
        let Self { chords, surfaces, region, centre, radius, outer_radius, lift } = self;
        let [limit, outer_limit] = [radius * radius, outer_radius * outer_radius];
        let [mut disc, mut in_plane, mut all, mut seen, mut around, mut hidden] = [[0.0; LANES]; 6];
        let mut points = [0.0; LANES];
        for batch in &chords.batches {
            let ways = batch_ways(batch, centre);
            let near = within(&ways, limit);
            let mut outside = [0; LANES];
            region.inner.test(isa, along(&ways, &region.axes).each_ref(), &mut outside);
            for lane in 0..LANES {
                disc[lane] += near[lane];
                in_plane[lane] += if outside[lane] == 0 { near[lane] } else { 0.0 };
            }
        }
        for lanes in &surfaces.places {
            let ways = lanes.ways(centre, lift);
            let [near, nearby] = [limit, outer_limit].map(|limit| within(&ways, limit));
            let ways = along(&ways, &region.axes);
            let [mut outside, mut beyond] = [[0; LANES]; 2];
            region.inner.test(isa, ways.each_ref(), &mut outside);
            region.outer.test(isa, ways.each_ref(), &mut beyond);
            for lane in 0..LANES {
                let area = lanes.areas[lane];
                all[lane] += area * near[lane];
                seen[lane] += if outside[lane] == 0 { area * near[lane] } else { 0.0 };
                around[lane] += area * nearby[lane];
                points[lane] += if area > 0.0 { nearby[lane] } else { 0.0 };
                hidden[lane] += if beyond[lane] == 0 { 0.0 } else { area * nearby[lane] };
            }
        }
        let sum = |lanes: Lane| lanes.iter().sum::<f32>();
        Areas {
            fraction: share(sum(all), sum(disc), 1.0),
            hidden: share(sum(hidden), sum(around), 0.0),
            of_region: share(sum(seen), sum(in_plane), 1.0),
            points: sum(points),
        }
    }
}

impl SurfaceLanes {
    /// Vectors from a photon's position to the points. Points at most `lift` above or below the photon's
    /// plane count as in the plane. The photon grid can move a photon off its surface, and the disc fraction
    /// of a plane must still be 1.
    #[inline(always)]
    fn ways(&self, from: Vec3, lift: f32) -> [Lane; 3] {
        let [p, q, r] = from.to_array();
        let [x, y, z] = &self.places;
        let mut ways = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let height = z[lane] - r;
            (ways[0][lane], ways[1][lane]) = (x[lane] - p, y[lane] - q);
            ways[2][lane] = if height.abs() <= lift { 0.0 } else { height };
        }
        ways
    }
}

/// Vectors from a position to the chords of a batch, perpendicular to the chords.
#[inline(always)]
fn batch_ways(batch: &Batch, from: Vec3) -> [Lane; 3] {
    let [p, q, _] = from.to_array();
    [batch.x.map(|x| x - p), batch.y.map(|y| y - q), [0.0; LANES]]
}

/// Ratio of a part to the whole; `without` if the whole is 0.
#[inline(always)]
fn share(part: f32, whole: f32, without: f32) -> f32 {
    if whole > 0.0 { part / whole } else { without }
}

/// Returns 1 for vectors whose squared length is at most `limit`, else 0.
#[inline(always)]
fn within([x, y, z]: &[Lane; 3], limit: f32) -> Lane {
    let mut within = [0.0; LANES];
    for lane in 0..LANES {
        let distance = x[lane] * x[lane] + y[lane] * y[lane] + z[lane] * z[lane];
        within[lane] = if distance <= limit { 1.0 } else { 0.0 };
    }
    within
}

/// Components of vectors along three axes.
#[inline(always)]
fn along([x, y, z]: &[Lane; 3], axes: &[[f32; 3]; 3]) -> [Lane; 3] {
    let mut along = [[0.0; LANES]; 3];
    for (along, [a, b, c]) in along.iter_mut().zip(axes) {
        for lane in 0..LANES {
            along[lane] = a * x[lane] + b * y[lane] + c * z[lane];
        }
    }
    along
}
