//! Importons: positions at which the picture of a camera uses photons. A pilot pass of eye paths finds them.
//!
//! Photons are used where gather rays end and, for caustics, where eye paths end.

use std::collections::HashMap;

use glam::Vec3;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::render::specular_path::{Arrival, Carried, Passes, SpecularPath};
use photoncard_firmware::scene::camera::ray_at;
use photoncard_firmware::scene::{Ray, RayKind, SceneImage, Surface, closest_hit, read_surface};
use photoncard_shared::layout::{Photon, decode_normal, encode_normal};
use photoncard_shared::message::{Camera, Fault};
use rayon::prelude::*;

use super::emit::PathRandom;
use crate::light::Targets;
use crate::pack::PackedScene;

/// Number of eye paths along each axis of the picture.
const EYE_PATHS: u32 = 128;
/// Number of eye paths along each axis of the picture, for [`Importons::few`].
const FEW_EYE_PATHS: u32 = 32;
/// Number of gather rays per eye path.
const GATHER_RAYS: u32 = 4;
/// Seed of the eye paths. It differs from usual seeds of photon paths, so that the random numbers differ too.
const SEED: u32 = 0x1b56_c4e9;

/// Importon: a position, and the weight of its light in the picture.
#[derive(Clone, Copy, Debug)]
struct Importon {
    position: Vec3,
    /// Code of the surface's normal.
    normal: u8,
    weight: f32,
}

/// Importons of the photon map and of the caustic map.
pub(crate) struct Importons {
    /// Importons at the ends of gather rays and of eye paths. The end of an eye path counts as much as the
    /// end of one gather ray.
    pub(crate) indirect: ImportonGrid,
    /// Importons at the ends of eye paths.
    pub(crate) caustic: ImportonGrid,
}

impl Importons {
    /// Finds the importons of a camera. `areas` are the areas within which photons of the photon map and of
    /// the caustic map are gathered, as fractions of the surface that the picture uses.
    ///
    /// # Errors
    /// If the card image is invalid.
    pub(crate) fn new(packed: &PackedScene, camera: &Camera, areas: [f32; 2]) -> Result<Self, Fault> {
        Self::of(packed, camera, EYE_PATHS, areas)
    }

    /// Finds the importons of a camera with fewer eye paths than [`Self::new`]. The cells of the grids are as
    /// small as the number of importons allows.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn few(packed: &PackedScene, camera: &Camera) -> Result<Self, Fault> {
        Self::of(packed, camera, FEW_EYE_PATHS, [0.0; 2])
    }

    /// Finds the importons of `paths` times `paths` eye paths.
    fn of(
        packed: &PackedScene,
        camera: &Camera,
        paths: u32,
        [indirect, caustic]: [f32; 2],
    ) -> Result<Self, Fault> {
        let rows: Result<Vec<_>, Fault> = (0..paths)
            .into_par_iter()
            .map(|row| {
                let (scene, mut memory) = packed.view();
                let mut seen = Vec::new();
                let mut used = Vec::new();
                for column in 0..paths {
                    let mut walk = Walk {
                        scene: &scene,
                        memory: &mut memory,
                        random: PathRandom::new(SEED, u64::from(row * paths + column)),
                        bounce: 0,
                        side: 1.0 / paths as f32,
                    };
                    walk.look(
                        camera,
                        [column, row].map(|place| place as f32 / paths as f32),
                        &mut seen,
                        &mut used,
                    )?;
                }
                Ok((seen, used))
            })
            .collect();
        let (seen, used): (Vec<_>, Vec<_>) = rows?.into_iter().unzip();
        let [seen, mut used] = [seen, used].map(|importons| {
            let mut all = importons.concat();
            all.retain(|importon| packed.stores_photons_at(importon.position));
            all
        });
        used.extend(&seen);
        Ok(Self { indirect: ImportonGrid::new(&used, indirect), caustic: ImportonGrid::new(&seen, caustic) })
    }
}

/// Eye path of the pilot, with its random numbers.
struct Walk<'a, M> {
    scene: &'a SceneImage,
    memory: &'a mut M,
    random: PathRandom,
    /// Index of the next random numbers ([`PathRandom::bounce`]).
    bounce: u32,
    /// Side of an eye path's cell of the picture, as a fraction of the picture's side.
    side: f32,
}

impl<M: MemoryPort> Walk<'_, M> {
    /// Adds the importons of an eye path and of its gather rays. `[left, above]` is the upper left corner of
    /// the eye path's cell of the picture, as fractions of the picture's sides.
    fn look(
        &mut self,
        camera: &Camera,
        [left, above]: [f32; 2],
        seen: &mut Vec<Importon>,
        used: &mut Vec<Importon>,
    ) -> Result<(), Fault> {
        let [u, v] = self.random.bounce(u32::MAX).point();
        let ray = ray_at(camera, [left + u * self.side, above + v * self.side], [0.0; 2]);
        let Some((eye, throughput)) = self.follow(ray, Passes::Specular)? else { return Ok(()) };
        seen.extend(importon(&eye, throughput));
        for _ in 0..GATHER_RAYS {
            let point = self.random.bounce(self.bounce).point();
            self.bounce += 1;
            let Some(sampled) = eye.reflector().sample(point) else { continue };
            if !eye.is_above(sampled.direction) {
                continue;
            }
            let ray = Ray::new(RayKind::Radiance, eye.offset_origin(), sampled.direction);
            let Some((end, passed)) = self.follow(ray, Passes::NarrowLobes)? else { continue };
            used.extend(importon(&end, throughput * sampled.weight * passed));
        }
        Ok(())
    }

    /// Follows a path to its end. Returns the surface there and the path's throughput; `None` if the path
    /// leaves the scene, is lost or is absorbed.
    fn follow(&mut self, ray: Ray, passes: Passes) -> Result<Option<(Surface, Vec3)>, Fault> {
        let mut path = SpecularPath::new(ray, Carried::Radiance, passes);
        let mut surface = Surface::NOWHERE;
        loop {
            let random = self.random.bounce(self.bounce);
            self.bounce += 1;
            let Some(hit) = closest_hit(self.scene, self.memory, &path.ray)? else { return Ok(None) };
            let layer = |choice| random.layer(choice);
            read_surface(self.scene, self.memory, &path.ray, &hit, &layer, &mut surface)?;
            let [u, v] = random.point();
            match path.arrive(&mut surface, [random.choice(), u, v]) {
                Arrival::Ends => return Ok(Some((surface, path.throughput))),
                Arrival::Lost | Arrival::Absorbed => return Ok(None),
                Arrival::GoesOn => {}
            }
        }
    }
}

/// Importon at the end of a path; `None` if the surface reflects nothing there.
fn importon(surface: &Surface, throughput: Vec3) -> Option<Importon> {
    let surface = surface.flat();
    let weight = (throughput * surface.reflector().albedo()).element_sum() / 3.0;
    (weight > 0.0 && weight.is_finite()).then(|| Importon {
        position: surface.position,
        normal: encode_normal(surface.normal.to_array()),
        weight,
    })
}

/// Cell of a grid: its coordinates, and the signed axis nearest to the surface normal.
type Cell = ([i32; 3], u8);

/// Grid of importon weights. A cell covers a cube of positions and the normals nearest to one signed axis,
/// because photons on the other side of a wall are useless.
pub(crate) struct ImportonGrid {
    /// Side of a cell, metres.
    side: f32,
    cells: HashMap<Cell, f64>,
}

/// Minimum mean number of importons per cell that contains surface.
const MIN_IMPORTONS: f32 = 8.0;
/// Fraction of the importons that `area` ignores at each end of each axis.
const OUTLIERS: f32 = 0.02;

impl ImportonGrid {
    /// Builds a grid of importons. The face of a cell is as large as the area from which photons are
    /// gathered: the fraction `share` of the surface.
    fn new(importons: &[Importon], share: f32) -> Self {
        let share = share.max(MIN_IMPORTONS / importons.len().max(1) as f32);
        let side = (area(importons) * share).sqrt().max(f32::MIN_POSITIVE);
        let mut grid = Self { side, cells: HashMap::new() };
        for importon in importons {
            let cell = grid.cell(importon.position, importon.normal);
            *grid.cells.entry(cell).or_default() += f64::from(importon.weight);
        }
        grid
    }

    /// Use of a photon of power 1: the square root of the variance that it adds to the picture's pixels. This
    /// variance is the squared power times the density of importons around the photon.
    pub(super) fn use_of(&self, photon: &Photon) -> f64 {
        let cell = self.cell(photon.position.into(), photon.normal);
        self.cells.get(&cell).copied().unwrap_or(0.0).sqrt()
    }

    /// Targets for photons: the cells with their weights.
    pub(super) fn targets(&self) -> Targets {
        let mut cells: Vec<(&Cell, &f64)> = self.cells.iter().collect();
        cells.sort_by_key(|(cell, _)| *cell);
        Targets::boxes(cells.into_iter().map(|((place, _), &weight)| {
            let lower = Vec3::from_array(place.map(|coordinate| coordinate as f32)) * self.side;
            ([lower, lower + self.side], weight)
        }))
    }

    /// Returns whether there are importons near a position on a surface whose normal has the code `normal`.
    pub(crate) fn is_used(&self, position: Vec3, normal: u8) -> bool {
        self.cells.contains_key(&self.cell(position, normal))
    }

    fn cell(&self, position: Vec3, normal: u8) -> Cell {
        let normal = Vec3::from(decode_normal(normal));
        let axis = normal.abs().max_position();
        let side = 2 * axis as u8 + u8::from(normal[axis] < 0.0);
        // Positions beyond the range of `i32` are in the outermost cells.
        ((position / self.side).floor().to_array().map(|coordinate| coordinate as i32), side)
    }
}

/// Area of the faces of the box that contains most importons, m^2.
fn area(importons: &[Importon]) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|axis: usize| {
        let mut places: Vec<f32> = importons.iter().map(|importon| importon.position[axis]).collect();
        places.sort_by(f32::total_cmp);
        let last = places.len().saturating_sub(1);
        let outlying = (last as f32 * OUTLIERS) as usize;
        let at = |index: usize| places.get(index).copied().unwrap_or(0.0);
        at(last - outlying) - at(outlying)
    });
    2.0 * (x * y + y * z + z * x)
}
