//! Precomputed irradiance (Christensen 1999, *Faster photon map global illumination*): at every photon the chip's own
//! density estimate, of a white diffuser there, is stored in the image. A gather takes that of the nearest point of its surface.
//!
//! At a photon a density estimate is too high by one photon, its own. But to come from any place to the nearest of some points
//! is to know that none is on the way, which is one less: of photons that lie at random the mean is right.

use glam::Vec3;
use photoncard_firmware::gather::HilbertCode;
use photoncard_firmware::kind::ReferenceCandidates;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::photon::{NearestPhotons, PhotonMap, gather, reflected_radiance};
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

/// Points that one task does; `go_on` is asked before each.
const POINTS_OF_A_TASK: usize = 256;

/// A grid point and the code of a surface normal.
type SurfacePoint = ([u32; 3], u8);

/// Adds irradiance points to an image with photons, for gathers of `neighbors` photons within `max_distance`, metres: the same
/// for the same photons, whatever the layout of their map. `go_on` is asked now and then.
///
/// # Errors
/// If the image is not sound or grows too large, or `go_on` says no.
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
    // About as far as the nearest of the photons of a gather lies.
    let distance = max_distance / (neighbors as f32).sqrt();
    let mut points = points?.concat();
    match PhotonTree::new(&mut points, f64::from(distance / cell)) {
        Some(tree) => Ok(store_irradiance(image, &tree)?),
        None => Ok(image),
    }
}

/// The chip's density estimate, with its buffer.
struct Estimator<'a> {
    scene: SceneImage,
    memory: Lines<'a>,
    buffer: Box<ReferenceCandidates>,
    neighbors: u32,
    max_distance: f32,
}

impl<'a> Estimator<'a> {
    fn new(image: &'a CardImage, neighbors: u32, max_distance: f32) -> Self {
        let (scene, memory) = image.view();
        Self { scene, memory, buffer: Box::default(), neighbors, max_distance }
    }

    fn point(&mut self, (point, normal): SurfacePoint) -> Result<StoredPhoton, Fault> {
        let position: Vec3 = self.scene.header.photon_grid.position(point).into();
        let mut nearest = NearestPhotons::new(self.buffer.view(), self.neighbors, self.max_distance);
        gather(&self.scene, &mut self.memory, PhotonMap::Indirect, position, &mut nearest)?;
        let diffuser = PartialReflection::diffuser(normal);
        let irradiance = reflected_radiance(&nearest, position, &diffuser).to_array();
        Ok(StoredPhoton::at(point, IrradiancePoint { irradiance, normal }.to_content()))
    }
}

/// The places of photons with the normals of their surfaces, each once; along a curve through each surface.
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
    // Along a curve: neighbours have most of their photons in common.
    points.par_sort_by_cached_key(|&(point, normal)| (normal, HilbertCode::new(&grid, grid.position(point))));
    points.dedup();
    Ok(points)
}
