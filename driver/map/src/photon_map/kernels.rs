//! Kernel radii of caustic photons. Each radius follows from the density of the photons that come from the
//! same light.
//!
//! Photons of one light have similar directions. The few photons that a glass ball scatters over a room can
//! lie among the many photons of a patch of sunlight. The radius of a photon is the distance within which a
//! given number of photons lie on its surface with about its direction. Single photons of a sparse light are
//! then not visible, and a dense light is not blurred.

use glam::Vec3;
use photoncard_shared::layout::{Photon, decode_direction, decode_normal, encode_kernel, kernel_share};

use super::neighbors::{Place, Places, arrange};
use crate::photon::{Photons, StoredPhoton};

/// Maximum number of neighbours from which the density is estimated. A radius for more neighbours is
/// extrapolated from this density.
const MAX_PROBED: u32 = 64;
/// Area of a kernel's disc, divided by the area of a uniform disc that gives equal variance. The kernel falls
/// towards its edge and thus uses fewer photons effectively.
const AREA: f32 = 4.0 / 3.0;
/// Maximum radius of a photon's kernel, as a fraction of the diagonal of the scene. Where light is so sparse
/// that a larger radius would be needed, single photons show as faint spots of this size.
const MAX_SHARE_OF_DIAGONAL: f32 = 0.1;
/// Minimum radius, cells of the photon grid.
const MIN_CELLS: f32 = 4.0;
/// Factor that is applied to a disc's area before its encoding rounds it up to a power of two. The result is
/// the power of two that is nearest by ratio.
const ROUNDING: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Number of cells added to the radius of a photon's disc, for rounding of positions.
const MARGIN_CELLS: u32 = 2;

/// Sets the radius code of each photon, such that about `neighbors` photons of its light lie within the
/// radius, and changes the photons' order. Returns the radius of the greatest code, metres.
pub(super) fn spread(photons: &mut Photons, neighbors: u32, diagonal: f32) -> f32 {
    let grid = photons.grid();
    arrange(photons.stored_mut());
    let places = Places::new(photons.stored().iter().map(place).collect());
    let limit = (MAX_SHARE_OF_DIAGONAL * diagonal / grid.cell).max(MIN_CELLS);
    let probed = neighbors.clamp(1, MAX_PROBED);
    let by_probed = (AREA * neighbors as f32 / probed as f32).sqrt();
    let distances = places.distances(probed as usize, limit);
    let radii: Vec<f32> =
        distances.into_iter().map(|distance| (distance * by_probed).clamp(MIN_CELLS, limit)).collect();
    let greatest = radii.iter().copied().fold(MIN_CELLS, f32::max);
    for (photon, radius) in photons.stored_mut().iter_mut().zip(radii) {
        let code = encode_kernel((radius / greatest).powi(2) * ROUNDING);
        *photon = StoredPhoton::at(photon.point(), Photon::content_with_disc(photon.content(), code));
    }
    greatest * grid.cell
}

/// Number of cells that a photon's disc extends from its position. `greatest` is the radius of the greatest
/// code, cells.
pub(super) fn reach(photon: &StoredPhoton, greatest: f32) -> u32 {
    (greatest * kernel_share(photon.disc()).sqrt()).ceil() as u32 + MARGIN_CELLS
}

fn place(photon: &StoredPhoton) -> Place {
    let [_, _, _, _, u, v, low, high] = photon.content();
    let normal = decode_normal(Photon::normal_of_flags(u16::from_le_bytes([low, high])));
    Place {
        position: Vec3::from_array(photon.point().map(|coordinate| coordinate as f32)),
        normal: Vec3::from(normal).normalize_or_zero(),
        direction: Vec3::from(decode_direction([u, v])).normalize_or_zero(),
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use photoncard_firmware::sampler::hash;
    use photoncard_shared::layout::{FULL_DISC, PhotonGrid, Rgbe, encode_direction, encode_normal};

    use super::*;

    fn photon(position: Vec3, direction: Vec3) -> Photon {
        Photon {
            position: position.to_array(),
            power: Rgbe::encode([1.0; 3], 0),
            direction: encode_direction(direction.to_array()),
            axis_or_group: 0,
            normal: encode_normal([0.0, 1.0, 0.0]),
            disc: FULL_DISC,
            direct: false,
        }
    }

    /// Positions in a square of side `side`, at height 0.
    fn square(side: f32, count: u32) -> impl Iterator<Item = Vec3> {
        let number = |index: u32| (hash(index) >> 8) as f32 / 16_777_216.0;
        (0..count).map(move |index| Vec3::new(number(2 * index), 0.0, number(2 * index + 1)) * side)
    }

    /// A thousand photons on a square metre are mixed with a hundred thousand photons of another light. Each
    /// must get the radius of its own light.
    #[test]
    fn a_radius_follows_the_density_of_the_photons_own_light() {
        let sun = square(1.0, 100_000).map(|place| photon(place, Vec3::Y));
        let sparse = square(1.0, 1000).map(|place| photon(place, Vec3::new(0.8, 0.6, 0.0)));
        let grid = PhotonGrid::around([0.0; 3], [1.0; 3]);
        let mut photons = Photons::new(grid, 1.0, sun.chain(sparse));
        let greatest = spread(&mut photons, 50, 10.0);
        let of_sun = encode_direction(Vec3::Y.to_array());
        for (is_of_sun, density) in [(true, 1e5), (false, 1e3)] {
            let of_light = photons.iter().filter(|photon| (photon.direction == of_sun) == is_of_sun);
            let radii: Vec<f32> =
                of_light.map(|photon| greatest * kernel_share(photon.disc).sqrt()).collect();
            let mean = radii.iter().sum::<f32>() / radii.len() as f32;
            let ratio = mean / (AREA * 50.0 / (std::f32::consts::PI * density)).sqrt();
            assert!(
                (0.8..1.45).contains(&ratio),
                "{ratio} of the radius at {density} photons a square metre"
            );
        }
    }

    #[test]
    fn radii_of_few_photons_are_limited_by_the_diagonal() {
        let grid = PhotonGrid::around([0.0; 3], [1.0; 3]);
        let mut photons = Photons::new(grid, 1.0, [photon(Vec3::ZERO, Vec3::Y), photon(Vec3::X, Vec3::Y)]);
        assert_eq!(spread(&mut photons, 50, 2.0), 0.2);
        assert!(photons.iter().all(|photon| kernel_share(photon.disc) == 1.0));
    }
}
