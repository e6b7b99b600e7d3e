//! Surfaces outside all solids, as points on chords, and the disc fraction that they give.

use std::sync::OnceLock;

use glam::Vec3;
use photoncard_firmware::photon::SameSurface;
use photoncard_firmware::simd::{Isa, Kernel, LANES};

use super::chords::Chords;
use super::lanes::Lane;

/// Number of codes of normals.
const CODES: usize = 1 << u8::BITS;

/// Normals that a gather counts to one surface, by their codes.
pub(super) struct SameSurfaces([OnceLock<[bool; CODES]>; CODES]);

impl SameSurfaces {
    pub(super) fn new() -> Self {
        Self([const { OnceLock::new() }; CODES])
    }

    /// For each code of a normal, true if a gather counts it to the surface of a photon whose normal has the code `normal`.
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

    /// Chooses the points that a gather counts to the surface of a photon whose normal has the code `normal`.
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
