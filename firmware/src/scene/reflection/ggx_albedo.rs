//! Directional albedo of the GGX lobe: `E = F0 A + F90 B`. `A` and `B` are tabulated as functions of
//! roughness and cosine.
//!
//! `A` is the integral of `f cos` for a lobe with `F = 1 - s`, and `B` for one with `F = s`, where
//! `s = (1 - h.o)^5` is Schlick's factor. The entries were computed by quasi-Monte Carlo integration with
//! 2^17 directions sampled by visible normals. The error of interpolated values is at most 0.004 for cosines
//! above 0.2, and 0.02 below.

use crate::vector::sqrt;

/// Number of rows (roughness 0 to 1) and of columns (square root of the cosine, 0 to 1) of a table.
pub(super) const SIDE: usize = 16;

/// Coefficients `[A, B]` for a roughness, 0 to 1, and the cosine between normal and outgoing direction.
#[inline(never)]
pub(super) fn albedo_shares(roughness: f32, cosine: f32) -> [f32; 2] {
    [&F0_SHARES, &F90_SHARES].map(|table| interpolated(table, roughness, cosine))
}

/// Interpolates bilinearly in a table of values in units of 1/255.
#[inline(always)]
pub(super) fn interpolated(table: &[[u8; SIDE]; SIDE], roughness: f32, cosine: f32) -> f32 {
    let (row, down) = cell(roughness);
    let (column, across) = cell(sqrt(if cosine > 0.0 { cosine } else { 0.0 }));
    let entry = |row: usize, column: usize| {
        table.get(row).and_then(|row| row.get(column)).map_or(0.0, |&share| f32::from(share))
    };
    let between = |row: usize| entry(row, column) * (1.0 - across) + entry(row, column + 1) * across;
    (between(row) * (1.0 - down) + between(row + 1) * down) * (1.0 / 255.0)
}

/// Converts a coordinate in [0, 1] to the index of the table entry at or before it, and to the interpolation
/// weight of the next entry, 0 to 1. NaN counts as 0.
#[inline(always)]
fn cell(coordinate: f32) -> (usize, f32) {
    let scaled = if coordinate > 0.0 { coordinate } else { 0.0 } * (SIDE - 1) as f32;
    let index = (scaled as usize).min(SIDE - 2);
    let rest = scaled - index as f32;
    (index, if rest < 1.0 { rest } else { 1.0 })
}

/// Table of `A`, in units of 1/255.
const F0_SHARES: [[u8; SIDE]; SIDE] = [
    [0, 6, 22, 47, 79, 113, 148, 180, 207, 228, 242, 250, 253, 255, 255, 255],
    [22, 16, 25, 49, 79, 114, 149, 180, 207, 228, 241, 250, 253, 255, 255, 255],
    [60, 55, 50, 60, 85, 117, 150, 181, 207, 227, 241, 249, 253, 255, 255, 255],
    [99, 96, 89, 88, 101, 124, 152, 181, 206, 226, 240, 248, 252, 254, 254, 255],
    [133, 131, 126, 122, 125, 138, 158, 181, 204, 223, 237, 246, 250, 253, 253, 254],
    [161, 159, 156, 152, 151, 156, 167, 183, 201, 218, 231, 240, 246, 249, 251, 251],
    [182, 181, 178, 175, 172, 173, 177, 186, 198, 211, 223, 232, 239, 243, 245, 247],
    [199, 198, 195, 191, 188, 186, 187, 190, 197, 205, 213, 222, 228, 233, 236, 239],
    [212, 210, 207, 202, 198, 195, 193, 193, 195, 199, 204, 209, 215, 220, 224, 227],
    [221, 219, 215, 210, 205, 200, 196, 194, 192, 192, 194, 197, 200, 203, 207, 210],
    [228, 225, 220, 214, 208, 202, 196, 192, 188, 185, 184, 183, 184, 185, 187, 189],
    [233, 230, 224, 217, 209, 201, 194, 187, 181, 176, 172, 169, 167, 166, 165, 166],
    [236, 233, 226, 217, 208, 199, 190, 181, 173, 166, 160, 155, 150, 146, 144, 142],
    [239, 235, 227, 217, 206, 195, 184, 174, 164, 155, 147, 140, 133, 127, 122, 118],
    [241, 237, 227, 215, 203, 190, 177, 165, 154, 143, 134, 125, 117, 109, 103, 97],
    [243, 237, 226, 213, 199, 184, 170, 156, 143, 131, 120, 110, 101, 93, 85, 78],
];

/// Table of `B`, in units of 1/255.
const F90_SHARES: [[u8; SIDE]; SIDE] = [
    [255, 249, 233, 208, 176, 142, 107, 75, 48, 27, 13, 5, 2, 0, 0, 0],
    [231, 211, 221, 205, 175, 141, 106, 75, 48, 27, 14, 5, 2, 0, 0, 0],
    [194, 188, 178, 175, 161, 134, 103, 73, 47, 27, 14, 5, 2, 0, 0, 0],
    [156, 153, 146, 139, 130, 115, 93, 69, 45, 27, 14, 6, 2, 0, 0, 0],
    [122, 121, 116, 109, 101, 91, 76, 59, 41, 25, 13, 6, 2, 0, 0, 0],
    [94, 93, 90, 85, 78, 69, 59, 47, 34, 22, 13, 6, 2, 1, 0, 0],
    [73, 72, 69, 65, 59, 52, 45, 36, 27, 18, 11, 5, 2, 1, 0, 0],
    [56, 55, 53, 49, 45, 40, 33, 27, 21, 14, 9, 5, 2, 1, 0, 0],
    [43, 43, 41, 38, 34, 30, 25, 20, 15, 11, 7, 4, 2, 1, 0, 0],
    [34, 33, 32, 29, 26, 23, 19, 15, 12, 8, 5, 3, 2, 1, 0, 0],
    [27, 27, 25, 23, 20, 17, 14, 11, 9, 6, 4, 2, 1, 1, 0, 0],
    [22, 22, 20, 18, 16, 14, 11, 9, 7, 5, 3, 2, 1, 0, 0, 0],
    [19, 18, 17, 15, 13, 11, 9, 7, 5, 4, 2, 1, 1, 0, 0, 0],
    [16, 15, 14, 12, 10, 9, 7, 5, 4, 3, 2, 1, 1, 0, 0, 0],
    [14, 13, 12, 10, 9, 7, 5, 4, 3, 2, 1, 1, 0, 0, 0, 0],
    [12, 11, 10, 9, 7, 6, 4, 3, 2, 2, 1, 1, 0, 0, 0, 0],
];
