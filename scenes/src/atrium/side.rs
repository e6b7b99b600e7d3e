//! One of the four sides of the court: its arcades, the corridors behind them, and their furnishing.

use glam::Vec3;

use super::dimensions::{BAY, CORRIDOR};
use super::parts::Parts;
use crate::builder::SceneBuilder;
use crate::document::Node;

/// Cloths (curtains or banners) at the upper arches: for each, the index of the arch and of the colour.
pub(super) type Hangings = &'static [(usize, usize)];

/// Plan of a side of the court: its name, number of bays, local frame and cloths.
pub(super) struct Plan {
    pub(super) name: &'static str,
    pub(super) bays: usize,
    /// Local x axis in world space. It is parallel to a world axis, so that no coordinate is rounded.
    pub(super) x_axis: [f32; 3],
    /// Local z axis in world space.
    pub(super) z_axis: [f32; 3],
    pub(super) origin: [f32; 3],
    pub(super) curtains: Hangings,
    pub(super) banners: Hangings,
}

/// Adds the nodes of a side of the court as children of one root node.
pub(super) fn build(scene: &mut SceneBuilder, parts: &Parts, plan: &Plan) {
    let half = plan.bays as f32 * BAY / 2.0;
    let mut side = Side { scene, parts, half, bays: plan.bays, children: Vec::new() };
    side.ground();
    side.gallery();
    side.corner();
    for &(arch, colour) in plan.curtains {
        side.place("curtain", parts.curtains[colour], side.upper_arch(arch), 0.0);
    }
    for &(arch, colour) in plan.banners {
        side.place("banner", parts.banners[colour], side.upper_arch(arch), 0.0);
    }
    let children = side.children;
    let ([xx, xy, xz], [zx, zy, zz], [ox, oy, oz]) = (plan.x_axis, plan.z_axis, plan.origin);
    let matrix = [xx, xy, xz, 0.0, 0.0, 1.0, 0.0, 0.0, zx, zy, zz, 0.0, ox, oy, oz, 1.0];
    scene.root(Node { name: plan.name.into(), matrix: Some(matrix), children, ..Node::default() });
}

struct Side<'a> {
    scene: &'a mut SceneBuilder,
    parts: &'a Parts,
    /// Half the length of the arcade, metres.
    half: f32,
    bays: usize,
    children: Vec<usize>,
}

impl Side<'_> {
    fn place(&mut self, name: &str, mesh: usize, x: f32, z: f32) {
        let translation = Some([x, 0.0, z]);
        let node = Node { name: name.into(), mesh: Some(mesh), translation, ..Node::default() };
        self.children.push(self.scene.node(node));
    }

    /// Returns the local x, metres, of the centre of upper arch `index`.
    fn upper_arch(&self, index: usize) -> f32 {
        BAY / 2.0 * (index as f32 + 0.5) - self.half
    }

    /// Returns the local x, metres, of the borders between bays, and of the middle of the gap at each end of
    /// the arcade.
    fn joints(&self) -> Vec<f32> {
        let end = self.half + CORRIDOR[0] / 2.0;
        let between = (1..self.bays).map(|index| BAY * index as f32 - self.half);
        [-end].into_iter().chain(between).chain([end]).collect()
    }

    fn ground(&mut self) {
        let parts = self.parts;
        let middle = (CORRIDOR[0] + CORRIDOR[1]) / 2.0;
        for bay in 0..self.bays {
            let x = BAY * (bay as f32 + 0.5) - self.half;
            self.place("ground-arch", parts.ground_arch, x, 0.0);
            self.place("vault", parts.vault, x, middle);
            self.place("ground-niche", parts.ground_niche, x, 0.0);
            if bay % 2 == 0 {
                self.place("vase", parts.vase, x, 3.375);
            } else {
                self.place("ground-door", parts.ground_door, x, 0.0);
            }
        }
        for bay in 1..self.bays {
            self.place("ground-column", parts.ground_column, BAY * bay as f32 - self.half, 0.0);
        }
        for x in self.joints() {
            self.place("rib", parts.rib, x, middle);
            self.place("pilaster", parts.pilaster, x, 0.0);
        }
    }

    fn gallery(&mut self) {
        let parts = self.parts;
        for arch in 0..2 * self.bays {
            let x = self.upper_arch(arch);
            self.place("upper-arch", parts.upper_arch, x, 0.0);
            self.place("balusters", parts.balusters, x, 0.0);
        }
        for column in 1..2 * self.bays {
            self.place("upper-column", parts.upper_column, BAY / 2.0 * column as f32 - self.half, 0.0);
        }
        for bay in 0..self.bays {
            let x = BAY * (bay as f32 + 0.5) - self.half;
            self.place("upper-niche", parts.upper_niche, x, 0.0);
            if bay % 2 == 0 {
                self.place("upper-door", parts.upper_door, x, 0.0);
            }
        }
        for x in self.joints() {
            self.place("beam", parts.beam, x, 0.0);
        }
    }

    /// Adds the piers and the vault of the corner at positive local x, and the walls beyond both ends.
    fn corner(&mut self) {
        let parts = self.parts;
        let half = self.half;
        self.place("ground-pier", parts.ground_pier, half, 0.0);
        self.place("upper-pier", parts.upper_pier, half, 0.0);
        let middle = (CORRIDOR[0] + CORRIDOR[1]) / 2.0;
        self.place("corner-vault", parts.corner_vault, half + middle, middle);
        self.place("corner-wall", parts.corner_wall, half, 0.0);
        let reach = super::dimensions::OUTER_WALL[0] + 0.05;
        self.place("corner-wall", parts.corner_wall, -half - reach, 0.0);
    }
}

/// Adds a root node with mesh `mesh`, scaled by `scale`, at the world position `place`, metres.
pub(super) fn stand(scene: &mut SceneBuilder, name: &str, mesh: usize, place: Vec3, scale: f32) {
    let scale = (scale != 1.0).then_some([scale; 3]);
    let translation = Some(place.to_array());
    scene.root(Node { name: name.into(), mesh: Some(mesh), translation, scale, ..Node::default() });
}
