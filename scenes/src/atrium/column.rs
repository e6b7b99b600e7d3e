//! Columns, piers and balusters, made of surfaces of revolution and square blocks about the y axis.

use super::dimensions::{EMBED, GALLERY_FLOOR, GROUND_SPRINGING, STEP_TOP, UPPER_SPRINGING};
use crate::mesh::Mesh;

/// Fluted column with a base and a capital, on the steps of the court.
pub(super) fn ground_column() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.block(0.40, STEP_TOP - EMBED, 0.28);
    let base = [
        [0.0, 0.27],
        [0.385, 0.27],
        [0.39, 0.31],
        [0.375, 0.35],
        [0.32, 0.37],
        [0.315, 0.40],
        [0.34, 0.43],
        [0.33, 0.47],
        [0.28, 0.50],
        [0.0, 0.50],
    ];
    mesh.lathe(18, &base);
    mesh.append(&fluted_shaft(), glam::Vec3::ZERO);
    let capital = [
        [0.0, 2.50],
        [0.25, 2.50],
        [0.275, 2.53],
        [0.25, 2.56],
        [0.25, 2.60],
        [0.29, 2.66],
        [0.35, 2.74],
        [0.39, 2.82],
        [0.40, 2.87],
        [0.0, 2.87],
    ];
    mesh.lathe(18, &capital);
    mesh.block(0.44, 2.86, GROUND_SPRINGING + EMBED);
    mesh
}

/// Shaft with sixteen flutes that fade out towards both ends. It swells slightly (entasis).
fn fluted_shaft() -> Mesh {
    let profile = [
        [0.265, 0.48],
        [0.26, 0.58],
        [0.262, 0.68],
        [0.257, 1.5],
        [0.237, 2.3],
        [0.232, 2.42],
        [0.232, 2.52],
    ];
    let mut mesh = Mesh::default();
    mesh.fluted_lathe(48, &profile, |segment, row| {
        let fluted = (2..=4).contains(&row) && segment % 3 != 0;
        if fluted { 0.93 } else { 1.0 }
    });
    mesh
}

/// Slender, smooth column on a pedestal, with a wide abacus for the upper arches.
pub(super) fn upper_column() -> Mesh {
    let floor = GALLERY_FLOOR[1];
    let mut mesh = Mesh::default();
    mesh.block(0.17, floor - EMBED, 5.95);
    mesh.block(0.21, 5.93, 6.02);
    let shaft = [
        [0.0, 6.0],
        [0.19, 6.0],
        [0.195, 6.04],
        [0.15, 6.08],
        [0.165, 6.12],
        [0.125, 6.16],
        [0.13, 6.6],
        [0.11, 7.36],
        [0.135, 7.38],
        [0.115, 7.41],
        [0.125, 7.46],
        [0.20, 7.58],
        [0.0, 7.58],
    ];
    mesh.lathe(12, &shaft);
    mesh.block(0.26, 7.57, UPPER_SPRINGING + EMBED);
    mesh
}

/// Balusters between two pedestals.
pub(super) fn balusters() -> Mesh {
    let floor = GALLERY_FLOOR[1];
    let profile =
        [[0.05, 0.11], [0.055, 0.18], [0.035, 0.24], [0.07, 0.36], [0.065, 0.46], [0.03, 0.64], [0.05, 0.83]];
    let mut one = Mesh::default();
    one.lathe(6, &profile.map(|[radius, height]| [radius, floor + height]));
    let mut mesh = Mesh::default();
    for index in 0..4 {
        mesh.append(&one, glam::Vec3::new(0.28 * (index as f32 - 1.5), 0.0, 0.0));
    }
    mesh
}

/// Square pier at each corner of the court, on the ground floor.
pub(super) fn ground_pier() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.block(0.54, STEP_TOP - EMBED, 0.36);
    mesh.block(0.46, 0.35, 2.86);
    mesh.block(0.54, 2.84, GROUND_SPRINGING + 0.04);
    mesh.block(0.46, 3.03, GALLERY_FLOOR[0] + 0.05);
    mesh
}

/// Square pier at each corner of the gallery.
pub(super) fn upper_pier() -> Mesh {
    let mut mesh = Mesh::default();
    mesh.block(0.34, GALLERY_FLOOR[1] - 0.03, 6.03);
    mesh.block(0.30, 6.02, 7.56);
    mesh.block(0.36, 7.55, UPPER_SPRINGING + 0.04);
    mesh.block(0.30, 7.73, 8.8);
    mesh
}
