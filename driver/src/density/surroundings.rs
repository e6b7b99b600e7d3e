//! The triangles around a place, found once for all chords and short rays there.
//!
//! A descent in the hierarchy for every ray would visit the same few leaves again and again. Here one descent finds all
//! triangles in a ball; then sixteen of them are tested for one ray, or sixteen chords for one of them. Coordinates are
//! relative to the ball's centre and in units of its radius.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_firmware::simd::{LANES, run};
use photoncard_shared::layout::Child;
use photoncard_shared::message::Fault;

use super::ball::{Ball, for_each_near};
use super::block::{Block, FirstOnWay};
use super::chords::{ChordFrame, Chords, Crossings};
use super::lanes::set;
use super::shadows::CrossAll;
use super::sides::SideTable;

/// Triangles that are tested one by one; of more, a descent for each ray finds the few that matter.
const MAX_TRIANGLES: usize = 4096;
/// Beyond this many triangles those in the place of another are left out: thousands in one place are as one.
const MAX_WITH_TWINS: usize = 512;
/// Coordinates of corners beyond this, in radii, would round away what is near.
const MAX_EXTENT: f32 = 1e4;
/// Triangles of a plain wall within a ball, at the most.
const MAX_PLAIN: usize = 24;
/// Triangles of a plane have normals that differ by less: to a thousandth of the radius at its end.
const MIN_PLAIN_COSINE: f32 = 1.0 - 5e-7;

/// The triangles in a ball.
#[derive(Default)]
pub(super) struct Surroundings {
    blocks: Vec<Block>,
    triangles: usize,
    centre: Vec3,
    radius: f32,
    stack: Vec<Child>,
}

impl Surroundings {
    /// Finds the triangles in a ball. Returns whether all of them could be taken: if not, nothing may be asked.
    ///
    /// # Errors
    /// If the image is not sound.
    pub(super) fn find(
        &mut self,
        scene: &SceneImage,
        memory: Lines,
        sides: &SideTable,
        ball: Ball,
    ) -> Result<bool, Fault> {
        self.blocks.clear();
        self.triangles = 0;
        (self.centre, self.radius) = (ball.centre, ball.radius);
        let mut stack = std::mem::take(&mut self.stack);
        let all = for_each_near(scene, memory, ball, &mut stack, &mut |index, corners| {
            self.add(index, corners, sides)
        });
        self.stack = stack;
        all
    }

    /// True if all triangles in a ball are one plain wall around its centre, on the side of a normal's code. The triangles found
    /// before are kept.
    ///
    /// # Errors
    /// If the image is not sound.
    pub(super) fn is_plain(
        &mut self,
        scene: &SceneImage,
        memory: Lines,
        sides: &SideTable,
        ball: Ball,
        wall: PlainWall,
    ) -> Result<bool, Fault> {
        let lift = wall.lift / ball.radius;
        let mut triangles = heapless::Vec::<[Vec3; 3], MAX_PLAIN>::new();
        let mut plane: Option<Vec3> = None;
        let mut stack = std::mem::take(&mut self.stack);
        let is_plane = for_each_near(scene, memory, ball, &mut stack, &mut |index, corners| {
            let [a, b, c] = *corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let is_along = normal.dot(*plane.get_or_insert(normal)) >= MIN_PLAIN_COSINE;
            let is_at = normal.dot(a).abs() <= lift;
            let is_side = sides.of(index).normal(true) == Some(wall.normal);
            is_along && is_at && is_side && triangles.push(*corners).is_ok()
        });
        self.stack = stack;
        let Some(normal) = plane.filter(|_| is_plane == Ok(true)) else { return is_plane.map(|_| false) };
        Ok(wall.holds(ball, normal) && covers(&triangles, normal))
    }

    /// Adds a triangle. Returns whether there is room, and it is not too large.
    #[inline(always)]
    fn add(&mut self, index: u32, corners: &[Vec3; 3], sides: &SideTable) -> bool {
        let extent = corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f32::max);
        if self.triangles == MAX_TRIANGLES || extent > MAX_EXTENT {
            return false;
        }
        let lane = self.triangles % LANES;
        if self.triangles >= MAX_WITH_TWINS && self.blocks.last().is_some_and(|block| block.holds(corners)) {
            return true;
        }
        if lane == 0 {
            self.blocks.push(Block { corners: Default::default(), indices: [0; LANES], are_solid: 0 });
        }
        self.triangles += 1;
        if let Some(block) = self.blocks.last_mut() {
            for (lanes, corner) in block.corners.iter_mut().zip(corners) {
                set(lanes, lane, *corner);
            }
            block.indices[lane] = index;
            block.are_solid |= u32::from(sides.of(index).is_solid) << lane;
        }
        true
    }

    /// The first triangle on the way from a place along a unit vector: its distance, if it is not beyond `max_distance`, and
    /// its unit normal on the side that the ray comes from; metres.
    pub(super) fn first_on_way(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_distance: f32,
    ) -> Option<(f32, Vec3)> {
        let origin = (origin - self.centre) / self.radius;
        let (distance, [a, b, c]) = run(FirstOnWay { blocks: &self.blocks, origin, direction })?;
        let distance = distance * self.radius;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        (distance <= max_distance)
            .then_some((distance, if normal.dot(direction) > 0.0 { -normal } else { normal }))
    }

    /// Collects the crossings of chords within the ball.
    pub(super) fn cross(&self, frame: &ChordFrame, chords: &Chords, crossings: &mut Crossings) {
        crossings.clear(frame.open.z);
        run(CrossAll { blocks: &self.blocks, frame, chords, crossings });
    }
}

/// A place on a wall that may be plain.
#[derive(Clone, Copy)]
pub(super) struct PlainWall<'a> {
    /// The code of its normal.
    pub(super) normal: u8,
    /// Greatest distance of photons from the wall, metres.
    pub(super) lift: f32,
    /// Other places on it.
    pub(super) places: &'a [Vec3],
}

impl PlainWall<'_> {
    /// True if all places are in the plane.
    fn holds(&self, ball: Ball, normal: Vec3) -> bool {
        self.places.iter().all(|place| (*place - ball.centre).dot(normal).abs() <= self.lift)
    }
}

/// True if triangles of one plane cover the disc of radius 1 around the origin once: one of them covers the origin, and no
/// edge in the disc is without another triangle beyond it.
fn covers(triangles: &[[Vec3; 3]], normal: Vec3) -> bool {
    let edges = |[a, b, c]: [Vec3; 3]| [(a, b), (b, c), (c, a)];
    let is_left = |(a, b): (Vec3, Vec3)| (b - a).cross(-a).dot(normal) >= 0.0;
    let at_origin = triangles.iter().filter(|triangle| edges(**triangle).into_iter().all(is_left));
    let all_edges = || triangles.iter().flat_map(|triangle| edges(*triangle));
    let is_far = |(a, b): (Vec3, Vec3)| {
        let way = b - a;
        let part = (-a.dot(way) / way.length_squared()).clamp(0.0, 1.0);
        (a + way * part).length_squared() > 1.0
    };
    at_origin.count() == 1
        && all_edges().all(|(a, b)| is_far((a, b)) || all_edges().filter(|edge| *edge == (b, a)).count() == 1)
}
