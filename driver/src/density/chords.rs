//! Parallel chords of a ball: their crossings with surfaces, and which of these lie outside all solids.
//!
//! The area of a surface is the area of its projection over the cosine between their normals, `A = A_p / cos`. Evenly
//! spread chords therefore measure it: each stands for an equal share of the disc across them, and each crossing for that
//! share over its cosine. All crossings of a chord count, not only the first, except those inside a solid. The *depth* of a
//! point is the number of solids that contain it. It follows from the front and back faces that are crossed on a path from
//! a reference point outside all solids, a little above the photon.

use glam::Vec3;
use photoncard_firmware::photon::SameSurface;
use photoncard_firmware::simd::{Isa, Kernel, LANES};

use super::lanes::Lane;
use super::sides::Sides;

/// Number of batches of sixteen chords.
pub(super) const BATCHES: usize = 8;
/// Number of chords through a ball.
pub(super) const CHORDS: usize = BATCHES * LANES;

/// Sixteen neighbouring chords: their points in the disc across them, and the bounds of these points.
#[derive(Clone, Copy)]
pub(super) struct Batch {
    pub(super) x: Lane,
    pub(super) y: Lane,
    pub(super) lower: [f32; 2],
    pub(super) upper: [f32; 2],
}

impl Batch {
    fn new(points: &[[f32; 2]]) -> Self {
        let axis = |axis: usize| std::array::from_fn(|lane| points[lane][axis]);
        let bound = |choose: fn(f32, f32) -> f32| {
            [0, 1].map(|axis| points.iter().map(|point| point[axis]).reduce(choose).unwrap_or(0.0))
        };
        Self { x: axis(0), y: axis(1), lower: bound(f32::min), upper: bound(f32::max) }
    }

    /// The batch on a disc `factor` times as large.
    fn scaled(&self, factor: f32) -> Self {
        Self {
            x: self.x.map(|x| x * factor),
            y: self.y.map(|y| y * factor),
            lower: self.lower.map(|bound| bound * factor),
            upper: self.upper.map(|bound| bound * factor),
        }
    }
}

/// Chords that are spread evenly over a disc.
pub(super) struct Chords {
    pub(super) batches: [Batch; BATCHES],
}

impl Chords {
    /// Chords over a disc of radius 1 by the sunflower spiral (Vogel 1979): each stands for an equal area.
    pub(super) fn new() -> Self {
        let mut points: Vec<[f32; 2]> = (0..CHORDS)
            .map(|index| {
                let distance = ((index as f32 + 0.5) / CHORDS as f32).sqrt();
                let angle = index as f32 * 2.399_963_2;
                [distance * libm::cosf(angle), distance * libm::sinf(angle)]
            })
            .collect();
        gather_neighbors(&mut points, 0);
        let (batches, _) = points.as_chunks::<LANES>();
        Self { batches: std::array::from_fn(|batch| Batch::new(&batches[batch])) }
    }

    /// Chords over a disc of radius `radius`.
    pub(super) fn scaled(&self, radius: f32) -> Self {
        Self { batches: self.batches.each_ref().map(|batch| batch.scaled(radius)) }
    }

    /// Point of chord `index` in the disc.
    pub(super) fn point(&self, index: usize) -> [f32; 2] {
        let Batch { x, y, .. } = &self.batches[index / LANES];
        [x[index % LANES], y[index % LANES]]
    }
}

/// Frame along a surface normal, with a reference point outside all solids, in a ball's coordinates.
pub(super) struct ChordFrame {
    /// Two axes across the chords, and the normal along them.
    pub(super) axes: [Vec3; 3],
    /// Reference point outside all solids, along the axes.
    pub(super) open: Vec3,
}

impl ChordFrame {
    /// Components along the axes of a vector from the ball's centre.
    pub(super) fn along(&self, place: Vec3) -> Vec3 {
        let [x, y, z] = self.axes.map(|axis| axis.dot(place));
        Vec3::new(x, y, z)
    }
}

/// Sorts points so that every sixteen consecutive ones are neighbours.
fn gather_neighbors(points: &mut [[f32; 2]], axis: usize) {
    if points.len() > LANES {
        points.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        let (below, above) = points.split_at_mut(points.len() / 2);
        gather_neighbors(below, 1 - axis);
        gather_neighbors(above, 1 - axis);
    }
}

/// Crossing of a chord and a triangle.
#[derive(Clone, Copy)]
pub(super) struct Crossing {
    /// Sort key: by chord, then from the top down, fronts before backs.
    key: u64,
    /// Height above the disc.
    pub(super) height: f32,
    /// Index of the triangle in the image.
    pub(super) triangle: u32,
    /// Area of surface per area of the disc, `1 / cos`.
    pub(super) slope: f32,
}

impl Crossing {
    #[inline(always)]
    pub(super) fn new(chord: usize, height: f32, is_front: bool, triangle: u32, slope: f32) -> Self {
        let bits = height.to_bits();
        // As integers, the bits of positive floats ascend with the value, those of negative floats descend.
        let ascending = if bits >> 31 == 0 { bits | 1 << 31 } else { !bits };
        let key = (chord as u64) << 33 | u64::from(!ascending) << 1 | u64::from(!is_front);
        Self { key, height, triangle, slope }
    }

    pub(super) fn chord(&self) -> usize {
        (self.key >> 33) as usize
    }

    /// True if the chord, on its way down, meets the triangle's front.
    fn is_front(&self) -> bool {
        self.key & 1 == 0
    }
}

/// Crossings of all chords.
pub(super) struct Crossings {
    pub(super) list: Vec<Crossing>,
    /// [`Self::list`], sorted by chord.
    sorted: Vec<Crossing>,
    /// Depth of each chord at [`Self::height`], minus the depth of the reference point.
    pub(super) depths: [[i32; LANES]; BATCHES],
    /// Height of the reference point.
    pub(super) height: f32,
}

impl Crossings {
    pub(super) fn new() -> Self {
        Self { list: Vec::new(), sorted: Vec::new(), depths: [[0; LANES]; BATCHES], height: 0.0 }
    }

    pub(super) fn clear(&mut self, height: f32) {
        self.list.clear();
        self.depths = [[0; LANES]; BATCHES];
        self.height = height;
    }

    /// Sets the depth of a chord at the height of the reference point, relative to that point.
    pub(super) fn set_depth(&mut self, chord: usize, depth: i32) {
        self.depths[chord / LANES][chord % LANES] = depth;
    }

    /// Collects the crossings outside all solids. `sides` maps a triangle's index to its sides.
    pub(super) fn open_surfaces(
        &mut self,
        chords: &Chords,
        sides: impl Fn(u32) -> Sides,
        surfaces: &mut OpenSurfaces,
    ) {
        surfaces.clear();
        self.sort_by_chord();
        for of_chord in self.sorted.chunk_by_mut(|one, other| one.chord() == other.chord()) {
            of_chord.sort_unstable_by_key(|crossing| crossing.key);
            let of_chord = &*of_chord;
            let chord = of_chord.first().map_or(0, Crossing::chord);
            let [x, y] = chords.point(chord);
            let change = |crossing: &Crossing| match sides(crossing.triangle).is_solid {
                true if crossing.is_front() => 1,
                true => -1,
                false => 0,
            };
            let above = of_chord.iter().take_while(|crossing| crossing.height > self.height);
            let mut depth = self.depths[chord / LANES][chord % LANES] - above.map(change).sum::<i32>();
            for crossing in of_chord {
                // Negative depth: the chord crossed the back of an open (non-manifold) surface.
                if depth <= 0
                    && let Some(normal) = sides(crossing.triangle).normal(crossing.is_front())
                {
                    surfaces.push([x, y, crossing.height], crossing.slope, normal);
                }
                depth += change(crossing);
            }
        }
    }
}

impl Crossings {
    /// Counting sort by chord.
    fn sort_by_chord(&mut self) {
        let mut places = [0_u32; CHORDS + 1];
        for crossing in &self.list {
            places[crossing.chord() + 1] += 1;
        }
        for chord in 0..CHORDS {
            places[chord + 1] += places[chord];
        }
        self.sorted.clear();
        self.sorted.extend_from_slice(&self.list);
        for crossing in &self.list {
            let place = &mut places[crossing.chord()];
            self.sorted[*place as usize] = *crossing;
            *place += 1;
        }
    }
}

/// Points on surfaces outside all solids, each of which stands for the share of a chord.
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
    /// The slope if the point belongs to the chosen surface, else 0.
    areas: Lane,
}

impl OpenSurfaces {
    fn clear(&mut self) {
        self.places.clear();
        self.count = 0;
    }

    fn push(&mut self, place: [f32; 3], slope: f32, normal: u8) {
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

    /// Chooses the points that a gather counts to the surface of a photon whose normal has the code `normal`.
    pub(super) fn choose(&mut self, normal: u8) {
        let mut same = SameSurface::new(normal);
        for lanes in &mut self.places {
            for lane in 0..LANES {
                lanes.areas[lane] = if same.holds(lanes.normals[lane]) { lanes.slopes[lane] } else { 0.0 };
            }
        }
    }
}

/// Kernel that computes a disc fraction: area of the chosen surface within the sphere around a photon over the area of its
/// disc.
pub(super) struct FractionWithin<'a> {
    pub(super) chords: &'a Chords,
    pub(super) surfaces: &'a OpenSurfaces,
    pub(super) centre: Vec3,
    pub(super) radius: f32,
    /// Maximum error of heights.
    pub(super) lift: f32,
}

impl Kernel for FractionWithin<'_> {
    type Output = f32;

    #[inline(always)]
    fn run(self, _: impl Isa) -> f32 {
        let Self { chords, surfaces, centre, radius, lift } = self;
        let [p, q, r] = centre.to_array();
        let limit = radius * radius;
        let mut within = [0.0; LANES];
        for batch in &chords.batches {
            for (lane, within) in within.iter_mut().enumerate() {
                let (x, y) = (batch.x[lane] - p, batch.y[lane] - q);
                *within += if x * x + y * y <= limit { 1.0 } else { 0.0 };
            }
        }
        let mut areas = [0.0; LANES];
        for lanes in &surfaces.places {
            for (lane, area) in areas.iter_mut().enumerate() {
                let [x, y, z] = [0, 1, 2].map(|axis: usize| lanes.places[axis][lane]);
                let (x, y, z) = (x - p, y - q, z - r);
                // The grid may move a photon off its plane; heights within that error count as 0, so that a plane has
                // fraction 1.
                let z = if z.abs() <= lift { 0.0 } else { z };
                let is_near = x * x + y * y + z * z <= limit;
                *area += if is_near { lanes.areas[lane] } else { 0.0 };
            }
        }
        let (within, area) = (within.iter().sum::<f32>(), areas.iter().sum::<f32>());
        if within > 0.0 { area / within } else { 1.0 }
    }
}
