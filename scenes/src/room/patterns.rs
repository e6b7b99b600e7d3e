//! Patterns of the room's textures. No pattern equals its mirror image, so that errors of texture mapping are
//! visible.

use core::f32::consts::TAU;

use super::picture::Picture;

/// Returns a hash, 0 to 255, of two numbers.
fn hash(a: u32, b: u32) -> u32 {
    let mut value = a.wrapping_mul(0x9e37_79b1) ^ b.wrapping_mul(0x85eb_ca77);
    value = (value ^ (value >> 15)).wrapping_mul(0x2c1b_3c6d);
    value = (value ^ (value >> 12)).wrapping_mul(0x297a_2d39);
    (value ^ (value >> 15)) & 0xff
}

fn opaque(colour: [f32; 3]) -> [u8; 4] {
    let [red, green, blue] = colour.map(|channel| channel.clamp(0.0, 255.0) as u8);
    [red, green, blue, u8::MAX]
}

/// Eight rows of wooden planks that tile seamlessly.
pub(super) fn planks() -> Picture {
    const SIDE: u32 = 512;
    Picture::new([SIDE, SIDE], |column, row| {
        let (plank, within) = (row / 64, row % 64);
        let along = (column + plank * 151) % SIDE;
        let (half, from_end) = (along / 256, along % 256);
        if within < 2 || from_end < 2 {
            return opaque([38.0, 24.0, 16.0]);
        }
        let shade = 120.0 + 70.0 * hash(plank, half + 17) as f32 / 255.0;
        // The grain runs along the plank in slow waves.
        let wave = libm::sinf(TAU * (along as f32 / 256.0 + hash(plank, half) as f32 / 255.0));
        let ring = libm::sinf(0.55 * (within as f32 + 5.0 * wave));
        let shade = shade + 12.0 * ring + 8.0 * (hash(row, plank) as f32 / 255.0 - 0.5);
        opaque([shade, 0.68 * shade, 0.42 * shade])
    })
}

/// Five-petalled flower off the centre, beside a stripe, on a background that darkens downwards.
pub(super) fn wallpaper() -> Picture {
    const SIDE: u32 = 256;
    Picture::new([SIDE, SIDE], |column, row| {
        let [x, y] = [column, row].map(|place| (place as f32 + 0.5) / SIDE as f32);
        if (0.06..0.13).contains(&x) {
            return opaque([72.0, 112.0, 96.0]);
        }
        let [from_x, from_y] = [x - 0.62, y - 0.38];
        let radius = libm::sqrtf(from_x * from_x + from_y * from_y);
        let petals = 0.2 + 0.07 * libm::sinf(5.0 * libm::atan2f(from_y, from_x) + 9.0 * radius);
        if radius < 0.06 {
            return opaque([230.0, 180.0, 60.0]);
        }
        if radius < petals {
            return opaque([150.0 + 200.0 * radius, 52.0, 62.0]);
        }
        let ground = 222.0 - 46.0 * y;
        opaque([ground, 0.94 * ground, 0.8 * ground])
    })
}

/// Crossing slats with a leaf in every other gap. Alpha falls smoothly from 1 to 0 across the edges.
pub(super) fn lattice() -> Picture {
    const SIDE: u32 = 128;
    Picture::new([SIDE, SIDE], |column, row| {
        let [x, y] = [column, row].map(|place| (place as f32 + 0.5) / SIDE as f32);
        let from_slat = |place: f32| libm::fabsf(place - libm::floorf(place) - 0.5);
        // Signed distances to the edges, negative within.
        let rising = from_slat(x + y) - 0.11;
        let falling = 0.6 * from_slat(x - y) - 0.03;
        let [leaf_x, leaf_y] = [x - 0.5, y - 0.03 - if y > 0.53 { 1.0 } else { 0.0 }];
        let leaf = libm::sqrtf(leaf_x * leaf_x + 5.0 * leaf_y * leaf_y) - 0.16;
        let nearest = rising.min(falling).min(leaf);
        let alpha = (127.5 - 1400.0 * nearest).clamp(0.0, 255.0) as u8;
        let [red, green, blue, _] = if leaf < rising.min(falling) {
            opaque([70.0, 150.0, 60.0])
        } else if rising < falling {
            opaque([205.0, 170.0, 120.0])
        } else {
            opaque([120.0, 84.0, 52.0])
        };
        [red, green, blue, alpha]
    })
}

/// Panes of coloured glass separated by leads: the Voronoi cells of scattered points.
pub(super) fn stained_glass() -> Picture {
    const SIDE: u32 = 128;
    const CELLS: u32 = 5;
    const GLASS: [[f32; 3]; 6] = [
        [250.0, 60.0, 50.0],
        [40.0, 90.0, 240.0],
        [250.0, 200.0, 60.0],
        [50.0, 190.0, 90.0],
        [240.0, 240.0, 225.0],
        [190.0, 70.0, 210.0],
    ];
    let place = |cell: u32, salt: u32| 0.15 + 0.7 * hash(cell, salt) as f32 / 255.0;
    Picture::new([SIDE, SIDE], |column, row| {
        let [x, y] = [column, row].map(|place| (place as f32 + 0.5) * CELLS as f32 / SIDE as f32);
        let mut nearest = [(f32::INFINITY, 0); 2];
        for cell in 0..CELLS * CELLS {
            let dx = x - (cell % CELLS) as f32 - place(cell, 101);
            let dy = y - (cell / CELLS) as f32 - place(cell, 202);
            let distance = libm::sqrtf(dx * dx + dy * dy);
            if distance < nearest[0].0 {
                nearest = [(distance, cell), nearest[0]];
            } else if distance < nearest[1].0 {
                nearest[1] = (distance, cell);
            }
        }
        if nearest[1].0 - nearest[0].0 < 0.09 {
            return opaque([12.0, 12.0, 14.0]);
        }
        opaque(GLASS[hash(nearest[0].1, 303) as usize % GLASS.len()])
    })
}
