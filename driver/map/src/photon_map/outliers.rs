//! Spreads the power of photons that are much stronger than their neighbours.
//!
//! The paths of a map for a camera differ in power. The guide rarely samples a path that it estimates to be
//! useless. The photons of such a path can have hundreds of times the power of the photons around them. They
//! cause a bright spot of the size of a gather. The excess is distributed over so many neighbours that none
//! of them becomes much brighter. The sum of all powers does not change.

use glam::{DVec3, Vec3};
use photoncard_firmware::memory::Lines;
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::{Ray, SceneImage, closest_hit};
use photoncard_shared::layout::PhotonGrid;
use photoncard_shared::message::Fault;
use rayon::prelude::*;

use super::neighbors::{LEAF, Place, Places, arrange};
use crate::pack::PackedScene;
use crate::photon::{Photons, StoredPhoton};

/// Maximum power that a photon gives to a neighbour, relative to the neighbour's own power.
const MAX_GAIN: f64 = 0.25;
/// Numbers of neighbours that are tried in turn, until a photon can give its whole excess of power to them.
const NUMBERS: [usize; 5] = [32, 128, 512, 2048, 8192];
/// Distance of a line of sight from the surfaces at its ends, relative to its length.
const LIFT: f32 = 0.02;
/// Minimum distance of a line of sight from the surfaces at its ends, cells of the photon grid.
const MIN_LIFT_CELLS: f32 = 2.0;

/// Power that a photon gives to its neighbours.
struct Gift {
    from: usize,
    power: DVec3,
    /// Neighbours with their fractions of the power.
    to: Vec<(usize, f64)>,
}

/// Spreads the power of photons that are much stronger than their neighbours, and changes the photons' order.
///
/// # Errors
/// A [`Fault`] if the card image is invalid.
pub(super) fn spread(photons: &mut Photons, packed: &PackedScene) -> Result<(), Fault> {
    arrange(photons.stored_mut());
    let mut colours: Vec<DVec3> =
        photons.stored().iter().map(|photon| Vec3::from(photon.colour()).as_dvec3()).collect();
    let gifts: Vec<Option<Gift>> = {
        let map = Map::new(photons, &colours, packed);
        (0..colours.len()).into_par_iter().map(|photon| map.gift(photon)).collect::<Result<_, Fault>>()?
    };
    let mut changed: Vec<usize> = Vec::new();
    for Gift { from, power, to } in gifts.into_iter().flatten() {
        colours[from] -= power;
        changed.push(from);
        for (receiver, fraction) in to {
            colours[receiver] += power * fraction;
            changed.push(receiver);
        }
    }
    changed.sort_unstable();
    changed.dedup();
    for photon in changed {
        let stored = &mut photons.stored_mut()[photon];
        *stored = stored.with_colour(colours[photon].as_vec3(), hash(photon as u32));
    }
    Ok(())
}

/// Photons of a map in the order of [`arrange`].
struct Map<'a> {
    stored: &'a [StoredPhoton],
    colours: &'a [DVec3],
    places: Places,
    grid: PhotonGrid,
    scene: (SceneImage, Lines<'a>),
}

impl<'a> Map<'a> {
    fn new(photons: &'a Photons, colours: &'a [DVec3], packed: &'a PackedScene) -> Self {
        let place = |photon: &StoredPhoton| Place {
            position: Vec3::from_array(photon.point().map(|coordinate| coordinate as f32)),
            normal: photon.normal(),
            // The direction is equal for all photons, so that neighbours are compared by normal alone.
            direction: Vec3::Y,
        };
        let stored = photons.stored();
        let places = Places::new(stored.iter().map(place).collect());
        Self { stored, colours, places, grid: photons.grid(), scene: packed.view() }
    }

    fn power(&self, photon: usize) -> f64 {
        self.colours[photon].element_sum()
    }

    /// Returns whether two photons carry light of one group, so that neither group gains or loses power.
    fn is_of_group(&self, photon: usize, other: usize) -> bool {
        self.stored[photon].light_group() == self.stored[other].light_group()
    }

    /// Power that a photon gives; `None` if it is not much stronger than its neighbours.
    fn gift(&self, photon: usize) -> Result<Option<Gift>, Fault> {
        let own = self.power(photon);
        let is_alike = |around: f64| own <= MAX_GAIN * around;
        let powers = |photons: &[usize]| photons.iter().map(|&photon| self.power(photon)).sum::<f64>();
        if is_alike(powers(&self.others_of_leaf(photon))) {
            return Ok(None);
        }
        let mut gift = None;
        for number in NUMBERS {
            let nearest = self.places.nearest(photon, number, f32::INFINITY);
            if number == NUMBERS[0] && is_alike(nearest.iter().map(|(_, other)| self.power(*other)).sum()) {
                return Ok(None);
            }
            let reach = nearest.last().map_or(0.0, |(squared, _)| *squared);
            let mut to = Vec::with_capacity(nearest.len());
            for (squared, other) in nearest {
                let weight = self.power(other) * f64::from(1.0 - squared / reach);
                if weight > 0.0 && self.is_of_group(photon, other) && self.sees(photon, other)? {
                    to.push((other, weight));
                }
            }
            let sum: f64 = to.iter().map(|(_, weight)| weight).sum();
            let mean = to.iter().map(|(other, _)| self.power(*other)).sum::<f64>() / to.len() as f64;
            let given = (own - mean).min(MAX_GAIN * sum);
            // `given` is 0 if the photon sees none of its neighbours.
            if given > 0.0 {
                to.iter_mut().for_each(|(_, weight)| *weight /= sum);
                gift = Some(Gift { from: photon, power: self.colours[photon] * (given / own), to });
            }
            if own - mean <= MAX_GAIN * sum {
                break;
            }
        }
        Ok(gift)
    }

    /// Returns the photons with a similar normal that share a leaf of [`Places`] with a photon.
    fn others_of_leaf(&self, photon: usize) -> Vec<usize> {
        let leaf = photon / LEAF * LEAF;
        let is_other = |&other: &usize| other != photon && self.places.are_alike(photon, other);
        (leaf..(leaf + LEAF).min(self.stored.len())).filter(is_other).collect()
    }

    /// Returns true if nothing lies between two photons.
    fn sees(&self, photon: usize, other: usize) -> Result<bool, Fault> {
        let ends = [photon, other].map(|index| {
            let stored = self.stored[index];
            (Vec3::from(self.grid.position(stored.point())), stored.normal())
        });
        let [(from, _), (to, _)] = ends;
        let lift = (LIFT * from.distance(to)).max(MIN_LIFT_CELLS * self.grid.cell);
        let [from, to] = ends.map(|(position, normal)| position + lift * normal);
        let length = from.distance(to);
        if length == 0.0 {
            return Ok(true);
        }
        let ray = Ray::of_light(from, (to - from) / length, length);
        let (scene, mut memory) = self.scene;
        Ok(closest_hit(&scene, &mut memory, &ray)?.is_none())
    }
}

#[cfg(test)]
mod tests {
    use photoncard_scene::{Material, Reflection, Scene, Triangle};
    use photoncard_shared::layout::{FULL_DISC, Photon, Rgbe, encode_normal};

    use super::*;

    /// The wall's coordinate x, metres.
    const WALL: f32 = 0.05;

    /// Floor of 2 m, and a vertical sheet on it.
    fn floor_and_wall() -> PackedScene {
        let quad = |[a, b, c, d]: [Vec3; 4]| [[a, b, c], [a, c, d]].map(|corners| Triangle::new(corners, 0));
        let floor = [[-1., -1.], [-1., 1.], [1., 1.], [1., -1.]].map(|[x, z]| Vec3::new(x, 0., z));
        let wall = [[0., -1.], [0., 1.], [1., 1.], [1., -1.]].map(|[y, z]| Vec3::new(WALL, y, z));
        let grey = Reflection::Phong { diffuse: Vec3::splat(0.5), specular: Vec3::ZERO, exponent: 0.0 };
        let scene = Scene::default().with(|scene| {
            scene.triangles = [quad(floor), quad(wall)].concat();
            scene.materials = vec![Material::new("grey", grey)];
        });
        PackedScene::new(&scene).expect("it is small")
    }

    /// Photons on the floor, the first of them at its centre.
    fn photons(packed: &PackedScene, power: impl Fn(u32) -> f32) -> Photons {
        let coordinate = |number: u32| (hash(number) >> 8) as f32 / (1 << 23) as f32 - 1.0;
        let photon = |index: u32| Photon {
            position: if index == 0 {
                [0.0; 3]
            } else {
                [coordinate(2 * index), 0.0, coordinate(2 * index + 1)]
            },
            power: Rgbe::encode([1.0, 0.5, 0.25].map(|channel| channel * power(index)), 0),
            direction: [0; 2],
            axis_or_group: 0,
            normal: encode_normal([0.0, 1.0, 0.0]),
            disc: FULL_DISC,
            direct: false,
        };
        Photons::new(packed.photon_grid(), 1.0, (0..20_000).map(photon))
    }

    fn powers(photons: &Photons) -> Vec<(Vec3, Vec3)> {
        photons.iter().map(|photon| (photon.position.into(), photon.power.decode().into())).collect()
    }

    #[test]
    fn a_strong_photon_brightens_its_visible_neighbours_by_a_quarter_at_most() {
        let packed = floor_and_wall();
        for strength in [40.0_f32, 200.0] {
            let mut photons = photons(&packed, |index| if index == 0 { strength } else { 1.0 });
            let sum =
                |photons: &Photons| powers(photons).iter().map(|(_, power)| power.as_dvec3()).sum::<DVec3>();
            let before = sum(&photons);
            spread(&mut photons, &packed).expect("sound");
            let ratio = sum(&photons) / before;
            assert!((ratio - DVec3::ONE).abs().max_element() < 1e-3, "{strength}: {ratio}");
            let mut changed = 0;
            for (position, power) in powers(&photons) {
                assert!(power.x <= 1.27 && power.x >= 0.99, "{strength}: {power} at {position}");
                changed += u32::from(power.x > 1.0);
                assert!(position.x < WALL || power.x == 1.0, "{strength}: {power} behind the wall");
            }
            assert!(f64::from(changed) > 4.0 * f64::from(strength), "{strength}: {changed}");
        }
    }

    #[test]
    fn photons_as_strong_as_their_neighbours_keep_their_power() {
        let packed = floor_and_wall();
        let mut photons = photons(&packed, |index| 1.0 + (hash(index) % 4) as f32);
        let sorted = |photons: &Photons| {
            let mut stored = photons.stored().to_vec();
            stored.sort_unstable();
            stored
        };
        let before = sorted(&photons);
        spread(&mut photons, &packed).expect("sound");
        assert_eq!(sorted(&photons), before);
    }
}
