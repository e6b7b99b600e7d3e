//! Construction of the light tree: a hierarchy of emitters with bounds of their positions, directions and
//! power.
//!
//! Emitters are split in two by the surface area orientation heuristic (Conty Estevez, Kulla 2018,
//! *Importance sampling of many lights with adaptive tree splitting*), in bins along each axis. Each half is
//! split again, so that a node has four children. A split that would make the tree deeper than a bit trail
//! can encode is replaced by a median split.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::layout::{LIGHT_CHILDREN, LIGHT_TREE_LEVELS, LightChild, LightLink, LightNode};

/// Bounds and power of one emitter.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    /// Corners of a triangle, or position of a point or spot light, metres.
    pub(super) corners: Vec<DVec3>,
    /// Bounding cone of the emission normals.
    pub(super) cone: Cone,
    /// Power averaged over channels, watts.
    pub(super) power: f64,
}

/// Light tree, encoded as a card's records.
#[derive(Debug, Default)]
pub(super) struct LightTree {
    /// Nodes, from the root; empty without emitters.
    pub(super) nodes: Vec<[u8; LINE_BYTES]>,
    /// Bit trail of each emitter: the index of the child at each level, two bits each, the root's in the
    /// lowest bits.
    pub(super) trails: Vec<u32>,
}

/// Number of bins along each axis in which splits are evaluated.
const BINS: usize = 12;
/// Margin of a cone's angle, radians, for rounding of its axis and cosine.
const CONE_MARGIN: f64 = 5e-4;
/// Margin of a sphere's radius for rounding, relative to the maximum coordinate.
const SPHERE_MARGIN: f64 = 1e-6;

impl LightTree {
    /// Builds the tree of emitters.
    pub(super) fn new(emitters: &[Bounds]) -> Self {
        let mut tree = Self { nodes: Vec::new(), trails: vec![0; emitters.len()] };
        let mut order: Vec<u32> = (0..emitters.len() as u32).collect();
        if !order.is_empty() {
            tree.node(emitters, &mut order, 0, 0);
        }
        tree
    }

    /// Appends the node with the emitters `order`, on the level `level` and with the bit trail `trail`.
    /// Returns the node's index.
    fn node(&mut self, emitters: &[Bounds], order: &mut [u32], level: usize, trail: u32) -> u32 {
        let index = self.nodes.len();
        self.nodes.push([0; LINE_BYTES]);
        let power: f64 = order.iter().map(|&emitter| emitters[emitter as usize].power).sum();
        let below = capacity(LIGHT_TREE_LEVELS - level - 1);
        let mut children = [None; LIGHT_CHILDREN];
        let parts = quarters(emitters, order, below);
        for (number, part) in (0..).zip(parts).filter(|(_, part)| !part.is_empty()) {
            let trail = trail | number << (2 * level);
            let summary = Summary::new(emitters, part);
            let link = match part {
                [emitter] => {
                    self.trails[*emitter as usize] = trail;
                    LightLink::Emitter(*emitter)
                }
                _ => LightLink::Node(self.node(emitters, part, level + 1, trail)),
            };
            children[number as usize] = Some(summary.child(power, link));
        }
        self.nodes[index] = LightNode::encode(children);
        index as u32
    }
}

/// Maximum number of emitters in a tree with `levels` levels.
fn capacity(levels: usize) -> usize {
    LIGHT_CHILDREN.saturating_pow(levels as u32)
}

/// Splits emitters into up to four lists of at most `most` each.
fn quarters<'o>(emitters: &[Bounds], order: &'o mut [u32], most: usize) -> [&'o mut [u32]; LIGHT_CHILDREN] {
    let [left, right] = halves(emitters, order, most.saturating_mul(2));
    let [a, b] = halves(emitters, left, most);
    let [c, d] = halves(emitters, right, most);
    [a, b, c, d]
}

/// Splits emitters into two lists of at most `most` each.
fn halves<'o>(emitters: &[Bounds], order: &'o mut [u32], most: usize) -> [&'o mut [u32]; 2] {
    if order.len() < 2 {
        let middle = order.len();
        return order.split_at_mut(middle).into();
    }
    let split = Split::best(emitters, order);
    let mut middle = 0;
    if let Some(split) = &split {
        // The sort is stable, so that the tree is the same on every machine.
        order.sort_by_cached_key(|&emitter| split.bin(emitters[emitter as usize].middle()) > split.last);
        middle =
            order.partition_point(|&emitter| split.bin(emitters[emitter as usize].middle()) <= split.last);
    }
    if middle == 0 || middle.max(order.len() - middle) > most {
        middle = order.len() / 2;
        let axis = split.map_or(0, |split| split.axis);
        let place = |emitter: u32| emitters[emitter as usize].middle()[axis];
        order.select_nth_unstable_by(middle, |&a, &b| place(a).total_cmp(&place(b)).then(a.cmp(&b)));
    }
    order.split_at_mut(middle).into()
}

impl Bounds {
    /// Centre of the bounding box.
    fn middle(&self) -> DVec3 {
        let [lower, upper] = self.sides();
        (lower + upper) * 0.5
    }

    fn sides(&self) -> [DVec3; 2] {
        let first = self.corners.first().copied().unwrap_or_default();
        self.corners.iter().fold([first; 2], |[lower, upper], &corner| [lower.min(corner), upper.max(corner)])
    }
}

/// Split along an axis. Bins up to and including `last` are on the lower side.
struct Split {
    axis: usize,
    lower: f64,
    bins_per_metre: f64,
    last: usize,
}

impl Split {
    /// Split of minimum cost; `None` if the centres of all emitters coincide.
    fn best(emitters: &[Bounds], order: &[u32]) -> Option<Self> {
        let middles = || order.iter().map(|&emitter| emitters[emitter as usize].middle());
        let lower = middles().reduce(DVec3::min)?;
        let extent = middles().reduce(DVec3::max)? - lower;
        let mut best: Option<(f64, Self)> = None;
        for axis in (0..3).filter(|&axis| extent[axis] > 0.0 && extent[axis].is_finite()) {
            let mut split =
                Self { axis, lower: lower[axis], bins_per_metre: BINS as f64 / extent[axis], last: 0 };
            let mut bins = vec![Summary::NONE; BINS];
            for &emitter in order {
                let bounds = &emitters[emitter as usize];
                let bin = &mut bins[split.bin(bounds.middle())];
                *bin = bin.union(&Summary::of(bounds));
            }
            // The factor k_r of Conty Estevez and Kulla: splits across the shorter sides of a box cost more.
            let slimness = extent.max_element() / extent[axis];
            for last in 0..BINS - 1 {
                let part = |bins: &[Summary]| bins.iter().fold(Summary::NONE, |sum, bin| sum.union(bin));
                let [left, right] = [part(&bins[..=last]), part(&bins[last + 1..])];
                let cost = slimness * (left.cost() + right.cost());
                let is_split = left.count > 0 && right.count > 0;
                if is_split && best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    split.last = last;
                    best = Some((cost, Self { ..split }));
                }
            }
        }
        best.map(|(_, split)| split)
    }

    fn bin(&self, place: DVec3) -> usize {
        (((place[self.axis] - self.lower) * self.bins_per_metre) as usize).min(BINS - 1)
    }
}

/// All directions within an angle of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    axis: DVec3,
    /// Angle, radians, up to pi.
    angle: f64,
}

impl Cone {
    /// Cone of all directions.
    pub(super) const ALL: Self = Self { axis: DVec3::Y, angle: PI };

    /// Cone of the directions within an angle, radians, of a unit vector.
    pub(super) fn new(axis: DVec3, angle: f64) -> Self {
        Self { axis, angle }
    }

    /// Smallest cone that contains both cones, except for rounding.
    fn union(self, other: Self) -> Self {
        let [wide, narrow] = if self.angle >= other.angle { [self, other] } else { [other, self] };
        let between = libm::acos(wide.axis.dot(narrow.axis).clamp(-1.0, 1.0));
        if (between + narrow.angle).min(PI) <= wide.angle {
            return wide;
        }
        let angle = 0.5 * (wide.angle + between + narrow.angle);
        let side = narrow.axis - wide.axis * wide.axis.dot(narrow.axis);
        if angle >= PI || side.length_squared() <= 1e-20 {
            return Self { angle: PI, ..wide };
        }
        let (sin, cos) = libm::sincos(angle - wide.angle);
        let axis = (wide.axis * cos + side.normalize() * sin).normalize();
        Self { axis, angle }
    }

    /// Orientation measure `M_Omega` of Conty Estevez and Kulla for Lambertian emission (`theta_e = pi / 2`):
    /// the solid angle of the emitted directions, weighted by the cosine beyond the cone of normals.
    fn measure(self) -> f64 {
        let reach = (self.angle + FRAC_PI_2).min(PI);
        let (sin, cos) = libm::sincos(self.angle);
        2.0 * PI * (1.0 - cos)
            + FRAC_PI_2
                * (2.0 * reach * sin - libm::cos(self.angle - 2.0 * reach) - 2.0 * self.angle * sin + cos)
    }
}

/// Bounds and power of several emitters.
#[derive(Clone, Copy, Debug)]
struct Summary {
    count: usize,
    lower: DVec3,
    upper: DVec3,
    /// Maximum distance of a corner from the box's centre, metres. Only [`Self::new`] computes it; it is 0 in
    /// partial summaries.
    radius: f64,
    cone: Cone,
    power: f64,
}

impl Summary {
    const NONE: Self = Self {
        count: 0,
        lower: DVec3::INFINITY,
        upper: DVec3::NEG_INFINITY,
        radius: 0.0,
        cone: Cone::ALL,
        power: 0.0,
    };

    fn of(bounds: &Bounds) -> Self {
        let [lower, upper] = bounds.sides();
        Self { count: 1, lower, upper, radius: 0.0, cone: bounds.cone, power: bounds.power }
    }

    /// Summary of emitters, including the radius.
    fn new(emitters: &[Bounds], order: &[u32]) -> Self {
        let each = || order.iter().map(|&emitter| &emitters[emitter as usize]);
        let mut summary = each().fold(Self::NONE, |sum, bounds| sum.union(&Self::of(bounds)));
        let middle = summary.middle();
        let distances = each().flat_map(|bounds| &bounds.corners).map(|corner| corner.distance(middle));
        summary.radius = distances.fold(0.0, f64::max);
        summary
    }

    fn middle(&self) -> DVec3 {
        (self.lower + self.upper) * 0.5
    }

    fn union(&self, other: &Self) -> Self {
        if self.count == 0 || other.count == 0 {
            return if self.count == 0 { *other } else { *self };
        }
        Self {
            count: self.count + other.count,
            lower: self.lower.min(other.lower),
            upper: self.upper.max(other.upper),
            radius: 0.0,
            cone: self.cone.union(other.cone),
            power: self.power + other.power,
        }
    }

    fn cost(&self) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let DVec3 { x, y, z } = self.upper - self.lower;
        // Boxes of a point or of collinear points have no area, but may be long.
        let area = x * y + y * z + z * x + (x * x + y * y + z * z) * 0.01;
        self.power * self.cone.measure() * area
    }

    /// Record of these emitters as a child of a node. `power` is the power of all emitters of the node,
    /// watts.
    fn child(&self, power: f64, link: LightLink) -> LightChild {
        let middle = self.middle();
        let greatest = self.lower.abs().max(self.upper.abs()).max_element();
        let angle = self.cone.angle + CONE_MARGIN;
        LightChild {
            centre: middle.as_vec3().to_array(),
            radius: (self.radius + SPHERE_MARGIN * greatest) as f32,
            share: if power > 0.0 { (self.power / power) as f32 } else { 1.0 },
            axis: self.cone.axis.as_vec3().to_array(),
            cosine: if angle >= PI { -1.0 } else { libm::cos(angle) as f32 },
            link,
        }
    }
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;

    use super::*;

    fn random(index: u32, dimension: u32) -> f64 {
        f64::from(hash(hash(index).wrapping_add(dimension))) / 4_294_967_296.0
    }

    fn triangles(count: u32) -> Vec<Bounds> {
        let triangle = |i: u32| {
            let at = |k: u32| DVec3::new(random(i, k), random(i, k + 1), random(i, k + 2)) - 0.5;
            let middle = at(0) * 10.0;
            let corners = [3, 6, 9].map(|k| middle + 0.1 * at(k));
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            let cone = if i.is_multiple_of(5) { Cone::ALL } else { Cone::new(normal, 0.0) };
            Bounds { corners: corners.to_vec(), cone, power: random(i, 12) }
        };
        (0..count).map(triangle).collect()
    }

    /// Follows the bit trail of an emitter and calls `check` for every child on it. Returns the number of
    /// levels.
    fn follow(tree: &LightTree, emitter: u32, check: &mut dyn FnMut(&LightChild)) -> usize {
        let (mut node, mut trail) = (0, tree.trails[emitter as usize]);
        for level in 1..=LIGHT_TREE_LEVELS {
            let child = LightNode(&tree.nodes[node as usize]).child(trail as usize % LIGHT_CHILDREN);
            let child = child.expect("a child");
            trail /= LIGHT_CHILDREN as u32;
            check(&child);
            match child.link {
                LightLink::Node(next) => node = next,
                LightLink::Emitter(found) => {
                    assert_eq!(found, emitter);
                    return level;
                }
            }
        }
        panic!("the trail has no end")
    }

    #[test]
    fn every_trail_leads_to_its_emitter_through_bounds_that_contain_it() {
        let emitters = triangles(3000);
        let tree = LightTree::new(&emitters);
        for (index, bounds) in (0..).zip(&emitters) {
            let levels = follow(&tree, index, &mut |child| {
                let centre = glam::Vec3::from(child.centre).as_dvec3();
                for corner in &bounds.corners {
                    assert!(corner.distance(centre) <= f64::from(child.radius), "out of the sphere");
                }
                if bounds.cone == Cone::ALL {
                    assert_eq!(child.cosine, -1.0);
                }
                let axis = glam::Vec3::from(child.axis).as_dvec3().normalize();
                assert!(axis.dot(bounds.cone.axis) >= f64::from(child.cosine) || bounds.cone == Cone::ALL);
            });
            // Six levels are the minimum for 3000 emitters.
            assert!(levels <= 12, "{levels}");
        }
    }

    #[test]
    fn shares_of_the_children_of_a_node_sum_to_one() {
        let tree = LightTree::new(&triangles(500));
        for line in &tree.nodes {
            let children = (0..LIGHT_CHILDREN).filter_map(|index| LightNode(line).child(index));
            let sum: f32 = children.map(|child| child.share).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        }
    }

    #[test]
    fn trails_fit_where_splits_would_be_uneven() {
        // Each point is at a tenth of the previous distance, so that the best split separates one point at a
        // time.
        let point = |i: i32| Bounds {
            corners: vec![DVec3::X * 10.0_f64.powi(-i)],
            cone: Cone::ALL,
            power: 10.0_f64.powi(-i),
        };
        let emitters: Vec<Bounds> = (0..200).map(point).chain((0..50).map(|_| point(3))).collect();
        let tree = LightTree::new(&emitters);
        for index in 0..250 {
            follow(&tree, index, &mut |_| {});
        }
    }

    #[test]
    fn a_tree_of_one_emitter_has_a_root_and_one_of_none_is_empty() {
        assert!(LightTree::new(&[]).nodes.is_empty());
        let one = LightTree::new(&triangles(1));
        assert_eq!(one.nodes.len(), 1);
        assert_eq!(follow(&one, 0, &mut |_| {}), 1);
    }
}
