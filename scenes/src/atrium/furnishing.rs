//! Cloths, doors, planters and the fountain.

use glam::Vec3;

use super::dimensions::EMBED;
use crate::mesh::{Mesh, on_circle};

/// Curtain that hangs from a rod behind an upper arch, in folds that widen downwards.
pub(super) fn curtain() -> Mesh {
    const FOLDS: usize = 5;
    const PER_FOLD: usize = 6;
    const ROWS: usize = 13;
    let (top, bottom) = (7.62, 5.12);
    let columns = FOLDS * PER_FOLD + 1;
    let mut mesh = Mesh::default();
    mesh.grid([columns, ROWS], [false, false], |column, row| {
        let (s, t) = (column as f32 / (columns - 1) as f32, row as f32 / (ROWS - 1) as f32);
        let wave = on_circle(column % PER_FOLD, PER_FOLD);
        // A second, slower wave makes the folds differ.
        let sway = on_circle(column + 3 * row, 2 * columns);
        let depth = 0.03 + 0.05 * t;
        let x = 0.98 * (s - 0.5) * (1.0 - 0.12 * (t * (1.0 - t))) + 0.012 * wave.x * t;
        Vec3::new(x, bottom + (top - bottom) * (1.0 - t), 0.32 + depth * wave.y + 0.03 * t * sway.y)
    });
    mesh
}

pub(super) fn curtain_rod() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.grid([8, 4], [true, false], |segment, row| {
        let p = on_circle(segment, 8) * if row == 0 || row == 3 { 0.0 } else { 0.018 };
        let x = if row < 2 { -0.62 } else { 0.62 };
        Vec3::new(x, 7.63 + p.y, 0.32 - p.x)
    });
    mesh
}

/// Banner that lies over the handrail and hangs down in front of the gallery's edge.
pub(super) fn banner() -> Mesh {
    const PER_SPAN: usize = 2;
    const COLUMNS: usize = 25;
    // Offset and height of the cloth's centre line, from its end behind the rail to its hem.
    let path = [
        [0.19, 5.55],
        [0.18, 5.90],
        [0.11, 5.97],
        [-0.11, 5.97],
        [-0.19, 5.88],
        [-0.34, 5.55],
        [-0.53, 5.15],
        [-0.57, 4.95],
        [-0.57, 4.50],
        [-0.56, 4.00],
        [-0.56, 3.55],
    ];
    let rows = (path.len() - 1) * PER_SPAN + 1;
    let mut mesh = Mesh::default();
    mesh.grid([COLUMNS, rows], [false, false], |column, row| {
        let span = (row / PER_SPAN).min(path.len() - 2);
        let within = (row - span * PER_SPAN) as f32 / PER_SPAN as f32;
        let [z, y] = [0, 1].map(|axis| path[span][axis] + (path[span + 1][axis] - path[span][axis]) * within);
        // Folds begin where the cloth leaves the rail on the side of the court. The end behind the rail is
        // flat.
        let fall = (5.6 - y).clamp(0.0, 2.0) / 2.0 * if row > 4 * PER_SPAN { 1.0 } else { 0.0 };
        let wave = on_circle(column, 8);
        let s = column as f32 / (COLUMNS - 1) as f32 - 0.5;
        let hem = 0.10 * fall * (1.0 - 4.0 * s * s);
        Vec3::new(-s * (1.0 - 0.06 * fall), y - hem, z - 0.07 * fall * (1.0 + wave.y))
    });
    mesh
}

/// Door with four recessed panels, which fills an arched recess up to its springing.
pub(super) fn door(half_width: f32, bottom: f32, top: f32, offset: f32) -> Mesh {
    let mut mesh = Mesh::default();
    let reach = half_width + EMBED;
    mesh.cuboid(Vec3::new(-reach, bottom - EMBED, offset), Vec3::new(reach, top, offset + 0.12));
    // Rails stand back a little from stiles, so that the two are not coplanar.
    let mut plank = |x: [f32; 2], y: [f32; 2], proud: f32| {
        mesh.cuboid(Vec3::new(x[0], y[0], offset - proud), Vec3::new(x[1], y[1], offset + 0.03));
    };
    let half = half_width - 0.02;
    let stile = 0.1;
    for x in [-half, -stile / 2.0, half - stile] {
        plank([x, x + stile], [bottom - 0.01, top - 0.02], 0.04);
    }
    for y in [bottom + 0.02, bottom + 0.4 * (top - bottom), top - 0.16] {
        for x in [[-half + stile - 0.01, -stile / 2.0 + 0.01], [stile / 2.0 - 0.01, half - stile + 0.01]] {
            plank(x, [y, y + 0.12], 0.032);
        }
    }
    mesh
}

/// Large earthenware pot, hollow down to its soil.
pub(super) fn pot() -> Mesh {
    let profile = [
        [0.26, -EMBED],
        [0.27, 0.06],
        [0.23, 0.10],
        [0.34, 0.26],
        [0.41, 0.44],
        [0.41, 0.54],
        [0.36, 0.62],
        [0.40, 0.66],
        [0.41, 0.71],
        [0.36, 0.72],
        [0.33, 0.66],
        [0.33, 0.58],
    ];
    let mut mesh = Mesh::default();
    mesh.lathe(20, &profile);
    mesh
}

/// Soil of a pot, a low mound.
pub(super) fn soil() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.lathe(20, &[[0.35, 0.61], [0.2, 0.635], [0.0, 0.64]]);
    mesh
}

/// Trimmed bush: a cone of bulging rows, closed at the bottom.
pub(super) fn bush() -> Mesh {
    let profile = [
        [0.0, 0.72],
        [0.16, 0.74],
        [0.33, 0.88],
        [0.38, 1.06],
        [0.35, 1.24],
        [0.28, 1.46],
        [0.20, 1.70],
        [0.12, 1.92],
        [0.05, 2.06],
        [0.0, 2.10],
    ];
    let mut mesh = Mesh::default();
    mesh.fluted_lathe(24, &profile, |segment, row| match (segment + row) % 3 {
        0 => 1.06,
        1 => 0.93,
        _ => 1.0,
    });
    // The stem, from soil to leaves.
    mesh.lathe(8, &[[0.03, 0.6], [0.03, 0.76]]);
    mesh
}

/// Slender vase for a niche.
pub(super) fn vase() -> Mesh {
    let profile = [
        [0.10, 0.83],
        [0.12, 0.86],
        [0.08, 0.90],
        [0.16, 1.02],
        [0.21, 1.16],
        [0.20, 1.28],
        [0.12, 1.42],
        [0.085, 1.50],
        [0.12, 1.58],
        [0.105, 1.585],
        [0.07, 1.50],
        [0.0, 1.46],
    ];
    let mut mesh = Mesh::default();
    mesh.lathe(16, &profile);
    mesh
}

pub(super) fn vase_stand() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.block(0.24, -EMBED, 0.12);
    mesh.block(0.18, 0.11, 0.76);
    mesh.block(0.22, 0.75, 0.85);
    mesh
}

/// Stone of the fountain: a round basin, a stem and a bowl.
pub(super) fn fountain() -> Mesh {
    let basin = [
        [1.55, -EMBED],
        [1.55, 0.10],
        [1.42, 0.14],
        [1.38, 0.42],
        [1.46, 0.48],
        [1.48, 0.56],
        [1.44, 0.60],
        [1.24, 0.60],
        [1.20, 0.56],
        [1.20, 0.20],
    ];
    let stem = [
        [0.30, 0.20],
        [0.30, 0.44],
        [0.18, 0.52],
        [0.13, 0.72],
        [0.17, 0.90],
        [0.12, 0.98],
        [0.20, 1.06],
        [0.45, 1.16],
        [0.58, 1.28],
        [0.59, 1.33],
        [0.54, 1.33],
        [0.50, 1.26],
    ];
    let mut mesh = Mesh::default();
    mesh.lathe(40, &basin);
    mesh.lathe(24, &stem);
    mesh
}

/// Water surfaces in the basin and in the bowl.
pub(super) fn water() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.lathe(40, &[[1.22, 0.46], [0.7, 0.46], [0.2, 0.46]]);
    mesh.lathe(24, &[[0.53, 1.29], [0.25, 1.29], [0.0, 1.29]]);
    mesh
}
