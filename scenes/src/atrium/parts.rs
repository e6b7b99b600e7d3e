//! Meshes that occur several times in the atrium.

use glam::Vec3;

use super::dimensions::{
    BAY, CORRIDOR, EMBED, GALLERY_FLOOR, GROUND_ARCH, GROUND_SPRINGING, OUTER_WALL, ROOF, UPPER_ARCH,
    UPPER_SPRINGING,
};
use super::masonry::{ArchedPanel, arch_moulding, groin_vault};
use super::palette::Palette;
use super::{column, furnishing};
use crate::builder::SceneBuilder;
use crate::mesh::Mesh;

/// Indices of the meshes in the glTF file.
pub(super) struct Parts {
    pub(super) ground_arch: usize,
    pub(super) ground_column: usize,
    pub(super) ground_pier: usize,
    pub(super) ground_niche: usize,
    pub(super) ground_door: usize,
    pub(super) pilaster: usize,
    pub(super) vault: usize,
    pub(super) corner_vault: usize,
    pub(super) rib: usize,
    pub(super) upper_arch: usize,
    pub(super) upper_column: usize,
    pub(super) upper_pier: usize,
    pub(super) upper_niche: usize,
    pub(super) upper_door: usize,
    pub(super) balusters: usize,
    pub(super) beam: usize,
    pub(super) corner_wall: usize,
    pub(super) vase: usize,
    pub(super) planter: usize,
    /// Curtains in red, green, blue and gold.
    pub(super) curtains: [usize; 4],
    /// Banners in red, green, blue and gold.
    pub(super) banners: [usize; 4],
}

/// Radius and springing height of the openings in the corridors' back walls, metres.
const GROUND_NICHE: [f32; 2] = [0.75, 2.05];
const UPPER_NICHE: [f32; 2] = [0.6, 6.95];

impl Parts {
    pub(super) fn new(scene: &mut SceneBuilder, colours: &Palette) -> Self {
        let mut make = |name: &str, parts: &[(Mesh, usize)]| {
            let parts: Vec<_> =
                parts.iter().map(|(mesh, material)| (scene.geometry(mesh), *material)).collect();
            scene.mesh(name, &parts)
        };
        let radius = BAY / 2.0;
        let door = |[radius, springing]: [f32; 2], floor: f32| {
            furnishing::door(radius, floor, springing, OUTER_WALL[0] - 0.1)
        };
        let mut parts = Self {
            ground_arch: make(
                "ground-arch",
                &[(ground_arch(), colours.stone), (ground_moulding(), colours.trim)],
            ),
            ground_column: make("ground-column", &[(column::ground_column(), colours.trim)]),
            ground_pier: make("ground-pier", &[(column::ground_pier(), colours.stone)]),
            ground_niche: make("ground-niche", &[(ground_niche(), colours.ochre)]),
            ground_door: make("ground-door", &[(door(GROUND_NICHE, 0.0), colours.wood)]),
            pilaster: make("pilaster", &[(pilaster(), colours.stone)]),
            vault: make("vault", &[(groin_vault(GROUND_SPRINGING, radius, false), colours.plaster)]),
            corner_vault: make(
                "corner-vault",
                &[(groin_vault(GROUND_SPRINGING, radius, true), colours.plaster)],
            ),
            rib: make("rib", &[(rib(), colours.stone)]),
            upper_arch: make(
                "upper-arch",
                &[(upper_arch(), colours.stone), (upper_moulding(), colours.trim)],
            ),
            upper_column: make("upper-column", &[(column::upper_column(), colours.trim)]),
            upper_pier: make("upper-pier", &[(column::upper_pier(), colours.stone)]),
            upper_niche: make("upper-niche", &[(upper_niche(), colours.ochre)]),
            upper_door: make("upper-door", &[(door(UPPER_NICHE, GALLERY_FLOOR[1]), colours.wood)]),
            balusters: make("balusters", &[(column::balusters(), colours.trim)]),
            beam: make("beam", &[(beam(), colours.wood)]),
            corner_wall: make("corner-wall", &[(corner_wall(), colours.ochre)]),
            vase: make(
                "vase",
                &[(furnishing::vase(), colours.glaze), (furnishing::vase_stand(), colours.trim)],
            ),
            planter: make(
                "planter",
                &[
                    (furnishing::pot(), colours.terracotta),
                    (furnishing::soil(), colours.soil),
                    (furnishing::bush(), colours.leaves),
                ],
            ),
            curtains: [0; 4],
            banners: [0; 4],
        };
        parts.hang_cloths(scene, colours);
        parts
    }

    /// Adds the meshes of curtains and banners. Meshes of different colours share their vertices.
    fn hang_cloths(&mut self, scene: &mut SceneBuilder, colours: &Palette) {
        let curtain = scene.geometry(&furnishing::curtain());
        let rod = scene.geometry(&furnishing::curtain_rod());
        let banner = scene.geometry(&furnishing::banner());
        self.curtains =
            colours.cloths.map(|cloth| scene.mesh("curtain", &[(curtain, cloth), (rod, colours.wood)]));
        self.banners = colours.cloths.map(|cloth| scene.mesh("banner", &[(banner, cloth)]));
    }
}

fn ground_arch() -> Mesh {
    let [radius, half] = GROUND_ARCH;
    let panel = ArchedPanel {
        width: BAY,
        bottom: GROUND_SPRINGING,
        springing: GROUND_SPRINGING,
        top: GALLERY_FLOOR[0] + 0.08,
        radius,
        faces: [-half, half],
        segments: 10,
        strips: 2,
    };
    panel.mesh()
}

fn upper_arch() -> Mesh {
    let [radius, half] = UPPER_ARCH;
    let panel = ArchedPanel {
        width: BAY / 2.0,
        bottom: UPPER_SPRINGING,
        springing: UPPER_SPRINGING,
        top: ROOF[0] + 0.08,
        radius,
        faces: [-half, half],
        segments: 8,
        strips: 2,
    };
    panel.mesh()
}

fn ground_moulding() -> Mesh {
    let [radius, half] = GROUND_ARCH;
    let offsets = [-half - 0.07, EMBED - half];
    arch_moulding(GROUND_SPRINGING, [radius + 0.02, radius + 0.20], offsets, 20)
}

fn upper_moulding() -> Mesh {
    let [radius, half] = UPPER_ARCH;
    let offsets = [-half - 0.04, EMBED - half];
    arch_moulding(UPPER_SPRINGING, [radius + 0.015, radius + 0.12], offsets, 12)
}

/// Arch across the corridor between two vaults, slightly lower than the vaults.
fn rib() -> Mesh {
    let radius = BAY / 2.0;
    let arch = arch_moulding(GROUND_SPRINGING, [radius - 0.11, radius + 0.05], [-0.18, 0.18], 16);
    arch.quarter_turn()
}

fn ground_niche() -> Mesh {
    let [radius, springing] = GROUND_NICHE;
    let panel = ArchedPanel {
        width: BAY,
        bottom: -EMBED,
        springing,
        top: GALLERY_FLOOR[0] + 0.08,
        radius,
        faces: [CORRIDOR[1], OUTER_WALL[0] + EMBED],
        segments: 6,
        strips: 1,
    };
    panel.mesh()
}

fn upper_niche() -> Mesh {
    let [radius, springing] = UPPER_NICHE;
    let panel = ArchedPanel {
        width: BAY,
        bottom: GALLERY_FLOOR[1] - EMBED,
        springing,
        top: ROOF[0] + 0.05,
        radius,
        faces: [CORRIDOR[1], OUTER_WALL[0] + EMBED],
        segments: 6,
        strips: 1,
    };
    panel.mesh()
}

/// Pilaster on the back wall of the ground-floor corridor, below a rib.
fn pilaster() -> Mesh {
    let wall = CORRIDOR[1];
    let mut mesh = Mesh::default();
    let mut block = |half: f32, proud: f32, bottom: f32, top: f32| {
        let (min, max) = (Vec3::new(-half, bottom, wall - proud), Vec3::new(half, top, wall + 0.1));
        mesh.cuboid(min, max);
    };
    block(0.26, 0.22, -EMBED, 0.3);
    block(0.22, 0.18, 0.29, 2.8);
    block(0.26, 0.22, 2.79, GROUND_SPRINGING + 0.01);
    mesh
}

/// Beam under the gallery's ceiling, and the pilaster that supports the beam.
fn beam() -> Mesh {
    let wall = CORRIDOR[1];
    let mut mesh = Mesh::default();
    mesh.cuboid(Vec3::new(-0.12, 8.42, 0.1), Vec3::new(0.12, ROOF[0] + EMBED, wall + 0.1));
    mesh.cuboid(Vec3::new(-0.16, GALLERY_FLOOR[1] - EMBED, wall - 0.1), Vec3::new(0.16, 8.45, wall + 0.1));
    mesh
}

/// Back wall beyond the last bay, as high as both storeys. Its end next to the bay is at x = 0.
fn corner_wall() -> Mesh {
    let [inner, outer] = [CORRIDOR[1], OUTER_WALL[0]];
    let mut mesh = Mesh::default();
    let near = Vec3::new(0.0, -0.05, inner);
    mesh.cuboid(near, Vec3::new(outer + 0.05, ROOF[0] + 0.05, outer + 0.03));
    mesh
}
