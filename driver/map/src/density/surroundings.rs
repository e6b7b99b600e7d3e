//! List of the triangles in a ball. It is built once and used for all chords and short rays in the ball.
//!
//! Traversing the hierarchy for every ray would visit the same few leaves many times. Instead, one traversal
//! finds all triangles in a ball. Then sixteen triangles at a time are tested against one ray, or sixteen
//! chords at a time against one triangle. Coordinates are relative to the ball's centre and in units of its
//! radius.

use glam::Vec3;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::scene::SceneImage;
use photoncard_firmware::simd::{LANES, run};
use photoncard_shared::layout::Child;
use photoncard_shared::message::Fault;

use super::ball::{Ball, NearTriangle, for_each_near};
use super::block::{Block, FirstOnWay};
use super::chords::{ChordFrame, Chords};
use super::crossings::Crossings;
use super::shadows::CrossAll;
use super::sides::SideTable;

/// Maximum number of triangles in [`Surroundings`]. With more, tracing each chord through the hierarchy is
/// faster.
const MAX_TRIANGLES: usize = 1536;
/// Number of triangles in a ball above which few chords suffice.
const CROWD: usize = 512;
/// Once the list has this many triangles, it omits further duplicates. Thousands of coincident triangles then
/// act as one.
const MAX_WITH_TWINS: usize = 512;
/// Maximum number of triangles in a ball that `Surroundings::is_plain` tests for coplanarity.
const MAX_PLAIN: usize = 24;
/// Minimum cosine between the normals of triangles of one plane. It allows a deviation of a thousandth of the
/// radius at the ball's border.
const MIN_PLAIN_COSINE: f32 = 1.0 - 5e-7;

/// List of the triangles in a ball.
#[derive(Default)]
pub(super) struct Surroundings {
    blocks: Vec<Block>,
    triangles: usize,
    centre: Vec3,
    radius: f32,
    stack: Vec<Child>,
}

impl Surroundings {
    /// Finds the triangles in a ball. Returns false if there are too many or one is too large. The list is
    /// then incomplete and must not be used.
    ///
    /// # Errors
    /// If the card image is malformed.
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
        let all = for_each_near(scene, memory, ball, &mut stack, &mut |triangle| self.add(triangle, sides));
        self.stack = stack;
        all
    }

    /// Returns whether the triangles in a ball form one plane without holes. The plane must pass through the
    /// ball's centre, have the normal of `wall`, and contain all photons of `wall`. The list of triangles
    /// does not change.
    ///
    /// # Errors
    /// If the card image is malformed.
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
        let is_plane = for_each_near(scene, memory, ball, &mut stack, &mut |triangle| {
            let &NearTriangle { id, corners, .. } = triangle;
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let is_along = normal.dot(*plane.get_or_insert(normal)) >= MIN_PLAIN_COSINE;
            let is_at = normal.dot(a).abs() <= lift;
            let own = sides.of(id, corners);
            let (is_side, is_whole) = (own.normal(true) == Some(wall.normal), !own.has_cut_outs);
            is_along && is_at && is_side && is_whole && triangles.push(corners).is_ok()
        });
        self.stack = stack;
        let Some(normal) = plane.filter(|_| is_plane == Ok(true)) else { return is_plane.map(|_| false) };
        Ok(wall.holds(ball, normal) && covers(&triangles, normal))
    }

    /// Returns whether there are so many triangles that few chords suffice.
    pub(super) fn is_crowded(&self) -> bool {
        self.triangles > CROWD
    }

    /// Adds a triangle. Returns false if the list is full or the triangle is too large.
    #[inline(always)]
    fn add(&mut self, triangle: &NearTriangle, sides: &SideTable) -> bool {
        let &NearTriangle { id, ref corners, is_large } = triangle;
        if self.triangles == MAX_TRIANGLES || is_large {
            return false;
        }
        let lane = self.triangles % LANES;
        if self.triangles >= MAX_WITH_TWINS && self.blocks.last().is_some_and(|block| block.holds(corners)) {
            return true;
        }
        if lane == 0 {
            self.blocks.push(Block::default());
        }
        self.triangles += 1;
        if let Some(block) = self.blocks.last_mut() {
            block.set(lane, (id, sides.stored(id)), corners);
        }
        true
    }

    /// Finds the nearest triangle from `origin` along a unit vector. Returns its distance (metres, at most
    /// `max_distance`) and its unit normal, which faces the origin.
    pub(super) fn first_on_way(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_distance: f32,
    ) -> Option<(f32, Vec3)> {
        let origin = (origin - self.centre) / self.radius;
        let reach = max_distance / self.radius;
        let (distance, [a, b, c]) = run(FirstOnWay { blocks: &self.blocks, origin, direction, reach })?;
        let distance = distance * self.radius;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        (distance <= max_distance)
            .then_some((distance, if normal.dot(direction) > 0.0 { -normal } else { normal }))
    }

    /// Replaces the content of `crossings` by the crossings of `chords` with the listed triangles.
    pub(super) fn cross(&self, frame: &ChordFrame, chords: &Chords, crossings: &mut Crossings) {
        crossings.clear(frame.open.z);
        run(CrossAll { blocks: &self.blocks, frame, chords, crossings });
    }
}

/// Photons that are assumed to lie on one plane. `Surroundings::is_plain` tests the assumption.
#[derive(Clone, Copy)]
pub(super) struct PlainWall<'a> {
    /// Code of the wall's normal.
    pub(super) normal: u8,
    /// Maximum distance of photons from the wall, metres.
    pub(super) lift: f32,
    /// Positions of photons on the wall.
    pub(super) places: &'a [Vec3],
}

impl PlainWall<'_> {
    /// Returns whether all positions are within `lift` of the plane through the ball's centre that is
    /// perpendicular to `normal`.
    fn holds(&self, ball: Ball, normal: Vec3) -> bool {
        self.places.iter().all(|place| (*place - ball.centre).dot(normal).abs() <= self.lift)
    }
}

/// Returns true if coplanar triangles cover the disc of radius 1 around the origin exactly once. This holds
/// if one triangle covers the origin, and each edge within the disc is shared with one other triangle.
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
