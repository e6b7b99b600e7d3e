//! Precomputed irradiance (Christensen 1999, *Faster photon map global illumination*). The chip's density
//! estimate for a white diffuser is computed at every photon and stored in the card image. A gather then
//! takes the irradiance of the nearest point on its surface.
//!
//! At a photon the density estimate is too high by one photon, the photon itself. On the other hand, a gather
//! uses the point nearest to its position, so that no photon lies between the two. This lowers the estimate
//! at that point by one photon. For photons in random positions the two errors cancel on average.

use glam::Vec3;
use photoncard_firmware::gather::HilbertCode;
use photoncard_firmware::kind::ReferenceCandidates;
use photoncard_firmware::light_groups::LightGroups;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::photon::{GatherLimits, gathered_radiance};
use photoncard_firmware::scene::{PartialReflection, SceneImage};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{IrradiancePoint, PHOTON_CONTENT_BYTES, Photon, PhotonLeaf, Record};
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::leaves::PhotonTree;
use super::store::store_irradiance;
use crate::pack::CardImage;
use crate::photon::{PhotonError, StoredPhoton};

/// Number of points per task. `go_on` is called before each task.
const POINTS_OF_A_TASK: usize = 256;

/// Grid point, and code of a surface normal.
type SurfacePoint = ([u32; 3], u8);

/// Adds to a card image the irradiance at each photon's position, estimated from the `neighbors` nearest
/// photons within `max_distance` metres. The points depend only on the photons, not on the layout of the
/// photon map. `go_on` is called before each task.
///
/// # Errors
/// If the card image is malformed or grows too large, or `go_on` returns false.
pub fn precompute_irradiance(
    image: CardImage,
    neighbors: u32,
    max_distance: f32,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<CardImage, PhotonError> {
    let places = surface_points(&image)?;
    let points: Result<Vec<Vec<StoredPhoton>>, PhotonError> = places
        .par_chunks(POINTS_OF_A_TASK)
        .map_init(
            || Estimator::new(&image, neighbors, max_distance),
            |estimator, places| {
                if !go_on() {
                    return Err(PhotonError::Stopped);
                }
                let points: Result<Vec<StoredPhoton>, Fault> =
                    places.iter().map(|&place| estimator.point(place)).collect();
                Ok(points?)
            },
        )
        .collect();
    let cell = image.view().0.header.photon_grid.cell;
    // Approximate distance of the nearest photon of a gather.
    let distance = max_distance / (neighbors as f32).sqrt();
    let mut points = points?.concat();
    match PhotonTree::new(&mut points, f64::from(distance / cell)) {
        Some(tree) => Ok(store_irradiance(image, &tree)?),
        None => Ok(image),
    }
}

/// Density estimate of the chip, with its buffer.
struct Estimator<'a> {
    scene: SceneImage,
    memory: Lines<'a>,
    buffer: Box<ReferenceCandidates>,
    limits: GatherLimits,
}

impl<'a> Estimator<'a> {
    fn new(image: &'a CardImage, neighbors: u32, max_distance: f32) -> Self {
        let (scene, memory) = image.view();
        Self {
            scene,
            memory,
            buffer: Box::default(),
            limits: GatherLimits {
                neighbors,
                max_distance,
                free_within: f32::INFINITY,
                groups: LightGroups::ONE,
            },
        }
    }

    fn point(&mut self, (point, normal): SurfacePoint) -> Result<StoredPhoton, Fault> {
        let position: Vec3 = self.scene.header.photon_grid.position(point).into();
        let diffuser = PartialReflection::diffuser(normal);
        let Self { scene, memory, buffer, limits } = self;
        let irradiance = gathered_radiance(
            (&*scene, memory),
            position,
            &diffuser,
            *limits,
            buffer.view(),
            &mut |_, _, _| {},
        )?;
        let irradiance = irradiance.total(LightGroups::ONE).to_array();
        Ok(StoredPhoton::at(point, IrradiancePoint { irradiance, normal }.to_content()))
    }
}

/// Distinct positions and surface normals of photons, sorted by normal and then along a Hilbert curve.
fn surface_points(image: &CardImage) -> Result<Vec<SurfacePoint>, Fault> {
    let (scene, mut memory) = image.view();
    let grid = scene.header.photon_grid;
    let mut points = Vec::new();
    let mut add = |point, content: [u8; PHOTON_CONTENT_BYTES]| {
        let [.., low, high] = content;
        points.push((point, Photon::normal_of_flags(u16::from_le_bytes([low, high]))));
    };
    for index in 0..scene.header.section(SectionKind::Photons).records {
        const PER_LINE: u32 = Photon::PER_LINE as u32;
        let record = scene.record::<{ Photon::BYTES }, PER_LINE>(&mut memory, SectionKind::Photons, index)?;
        add(grid.nearest(Photon::position(record)), Photon::content(record));
    }
    for index in 0..scene.header.section(SectionKind::PhotonLeaves).records {
        let line = scene.line(&mut memory, SectionKind::PhotonLeaves, index, 0..LINE_BYTES as u32)?;
        let leaf = PhotonLeaf::read(line);
        (0..leaf.photons()).for_each(|photon| add(leaf.point(photon), leaf.content(photon)));
    }
    // Points that are neighbours on the curve gather mostly the same photons, so that their searches read the
    // same memory.
    points.par_sort_by_cached_key(|&(point, normal)| (normal, HilbertCode::new(&grid, grid.position(point))));
    points.dedup();
    Ok(points)
}
