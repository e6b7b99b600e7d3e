//! Photons as evidence of whether light reaches a surface that another surface covers.
//!
//! A wall behind a picture, a floor under a carpet, or the inside of a box of double-sided sheets is unlit,
//! and no photon hits it. The boards of a shelf and the slats of a blind are lit. Geometry cannot distinguish
//! the two cases: meshes are open, touch each other, or are less than a millimetre apart. The photons of the
//! map can.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::photon::MIN_NORMAL_COSINE;
use photoncard_firmware::scene::SceneImage;
use photoncard_firmware::simd::LANES;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Child, Photon, PhotonLeaf, PhotonNode, Rgbe, WideNode, decode_normal};
use photoncard_shared::message::{Fault, FaultCode};

use super::ball::{Ball, line};
use super::chords::ChordFrame;
use super::lanes::{Lane, LaneVector, set};
use super::surfaces::OpenSurfaces;

/// Position, power and surface normal of a photon.
struct Place {
    position: Vec3,
    /// Sum of the power's channels, in the map's units.
    power: f32,
    /// Code of the surface normal.
    code: u8,
    normal: Vec3,
}

/// Photons in a ball, as evidence that surfaces are lit.
#[derive(Default)]
pub(super) struct Evidence {
    places: Vec<Place>,
    stack: Vec<Child>,
    /// Positions of the photons whose normals are nearly parallel to the chords. Coordinates are along the
    /// frame's axes, relative to the ball's centre, in radii. Unused lanes are infinitely far away.
    along: Vec<LaneVector>,
    /// Squared distances, along the surface, from the measured photon to the photons on its own surface, m^2.
    own: Vec<f32>,
    /// Squared distance perpendicular to the chords within which a photon is evidence, in square radii of the
    /// ball.
    near: f32,
}

/// Expected number of photons near a chord's crossing with a lit surface. If that surface is as bright as the
/// measured photon's, one crossing in 150 has no photon near it.
const SEVERAL: usize = 5;
/// Maximum tangent of the angle between a photon's surface and the direction to another photon on it.
const OWN_SLOPE: f32 = 0.25;

impl Evidence {
    /// Finds the photons in a ball.
    ///
    /// # Errors
    /// If the card image is malformed.
    pub(super) fn find(&mut self, scene: &SceneImage, memory: Lines, ball: Ball) -> Result<(), Fault> {
        self.places.clear();
        self.stack.clear();
        let sections = [SectionKind::PhotonNodes, SectionKind::PhotonLeaves];
        let [nodes, leaves] = sections.map(|kind| scene.header.section(kind).records);
        self.stack.push(if nodes > 0 { Child::Node(0) } else { Child::Leaf(0) });
        // In a sound tree each node and leaf is visited at most once; more visits mean a cycle.
        let mut visits_left = u64::from(nodes) + u64::from(leaves);
        while let Some(part) = self.stack.pop() {
            let cycle = Fault { code: FaultCode::Depth, detail: 0 };
            visits_left = visits_left.checked_sub(1).ok_or(cycle)?;
            match part {
                Child::Node(node) => self.enter(scene, line(scene, memory, sections[0], node)?, ball),
                Child::Leaf(leaf) => self.add(scene, line(scene, memory, sections[1], leaf)?, ball),
            }
        }
        Ok(())
    }

    /// Pushes the children of a node that may intersect a ball onto the stack.
    fn enter(&mut self, scene: &SceneImage, line: &[u8; LINE_BYTES], ball: Ball) {
        let grid = scene.header.photon_grid;
        let (node, wide) = (PhotonNode(line), WideNode(line));
        let (axes, links) = (node.coordinates(), wide.links());
        for child in 0..wide.children() {
            let sides = axes.each_ref().map(|axis| axis.sides(child as usize).unwrap_or_default());
            let corner = |side: usize| Vec3::from(grid.position(sides.map(|sides| sides[side])));
            let nearest = ball.centre.clamp(corner(0), corner(1));
            if nearest.distance_squared(ball.centre) <= ball.radius * ball.radius {
                self.stack.push(links.child(child));
            }
        }
    }

    /// Adds the photons of a leaf that lie in a ball.
    fn add(&mut self, scene: &SceneImage, line: &[u8; LINE_BYTES], ball: Ball) {
        let leaf = PhotonLeaf::read(line);
        for photon in 0..leaf.photons() {
            let position = Vec3::from(scene.header.photon_grid.position(leaf.point(photon)));
            if position.distance_squared(ball.centre) <= ball.radius * ball.radius {
                let [a, b, c, d, .., low, high] = leaf.content(photon);
                let code = Photon::normal_of_flags(u16::from_le_bytes([low, high]));
                let normal = Vec3::from(decode_normal(code)).normalize();
                let power = Rgbe([a, b, c, d]).decode().iter().sum();
                self.places.push(Place { position, power, code, normal });
            }
        }
    }

    /// Chooses the photons whose normals are nearly parallel to a frame's chords, and the distance within
    /// which they are evidence. This is the distance from `photon` to its [`SEVERAL`]-th neighbour on its own
    /// surface, at most `most` metres.
    pub(super) fn choose(&mut self, ball: Ball, frame: &ChordFrame, (photon, most): (Vec3, f32)) {
        self.along.clear();
        self.own.clear();
        let [.., normal] = frame.axes;
        let across = self.places.iter().filter(|place| place.normal.dot(normal) >= MIN_NORMAL_COSINE);
        for (index, place) in across.enumerate() {
            if index % LANES == 0 {
                self.along.push([[f32::INFINITY; LANES]; 3]);
            }
            if let Some(lanes) = self.along.last_mut() {
                set(lanes, index % LANES, frame.along((place.position - ball.centre) / ball.radius));
            }
            let [x, y, z] = frame.along(place.position - photon).to_array();
            let squared = x * x + y * y;
            if z * z <= OWN_SLOPE * OWN_SLOPE * squared {
                self.own.push(squared);
            }
        }
        let several = self.own.len() > SEVERAL;
        let near = match several {
            true => self.own.select_nth_unstable_by(SEVERAL, f32::total_cmp).1.min(most * most),
            false => most * most,
        };
        self.near = near / (ball.radius * ball.radius);
    }

    /// Replaces the points of `lights` by the photons, with their powers as areas.
    pub(super) fn powers(&self, ball: Ball, frame: &ChordFrame, lights: &mut OpenSurfaces) {
        lights.clear();
        for place in &self.places {
            let along = frame.along((place.position - ball.centre) / ball.radius);
            lights.push(along.to_array(), place.power, place.code);
        }
    }

    /// Returns true if there is a photon near a chord within an interval of heights.
    pub(super) fn is_near(&self, [x, y]: [f32; 2], [lower, upper]: [f32; 2]) -> bool {
        self.along.iter().any(|[along_x, along_y, heights]: &[Lane; 3]| {
            let mut any = false;
            for lane in 0..LANES {
                let (x, y) = (along_x[lane] - x, along_y[lane] - y);
                let is_at = (heights[lane] >= lower) & (heights[lane] <= upper);
                any |= is_at & (x * x + y * y <= self.near);
            }
            any
        })
    }
}
