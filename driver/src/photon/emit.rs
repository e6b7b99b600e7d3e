//! Emission: where a photon path starts, and with what power.
//!
//! The first four random numbers of a path, the place and the direction, are a low-discrepancy sequence in the number
//! of the path (the additive recurrence of Roberts 2018, *The unreasonable effectiveness of quasirandom sequences*),
//! shifted by the seed. Those of the bounces are hashes of (seed, path, bounce).

use std::f32::consts::PI;

use glam::Vec3;
use photoncard_firmware::importance::sample_reflection;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::{Ray, SceneImage, Surface, sample_emitter};
use photoncard_shared::message::Fault;

/// A photon on its way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emission {
    /// The way.
    pub(super) ray: Ray,
    /// Watts per channel, for one path in all.
    pub(super) power: Vec3,
}

/// 2^64 over the powers 1 to 4 of the root of `x^5 = x + 1`.
const RECURRENCE: [u64; 4] =
    [0xdb4f_0b91_75ae_2165, 0xbbe0_5633_03a4_615f, 0xa0f2_ec75_a1fe_1575, 0x89e1_8285_7d9e_d688];

/// The random numbers of one path.
#[derive(Clone, Copy)]
pub(super) struct PathRandom {
    seed: u32,
    path: u64,
}

impl PathRandom {
    pub(super) fn new(seed: u32, path: u64) -> Self {
        Self { seed, path }
    }

    /// The low-discrepancy point of the emission.
    fn emission(self) -> [f32; 4] {
        std::array::from_fn(|dimension| {
            let shift = (hash(self.seed ^ hash(dimension as u32 + 1)) as u64) << 32;
            let bits = RECURRENCE[dimension].wrapping_mul(self.path + 1).wrapping_add(shift);
            unit_interval((bits >> 32) as u32)
        })
    }

    /// The random numbers of a bounce.
    pub(super) fn bounce(self, bounce: u32) -> BounceRandom {
        let path = hash(hash(self.seed ^ 0x2c1b_3c6d).wrapping_add(self.path as u32));
        BounceRandom { key: hash(hash(path.wrapping_add((self.path >> 32) as u32)).wrapping_add(bounce)) }
    }
}

/// The random numbers of one bounce.
#[derive(Clone, Copy)]
pub(super) struct BounceRandom {
    key: u32,
}

impl BounceRandom {
    fn bits(self, index: u32) -> u32 {
        hash(self.key.wrapping_add(index.wrapping_mul(0x9e37_79b9)))
    }

    /// A point of the unit square, for the direction.
    pub(super) fn point(self) -> [f32; 2] {
        [1, 2].map(|index| unit_interval(self.bits(index)))
    }

    /// A number in [0, 1), for the survival.
    pub(super) fn survival(self) -> f32 {
        unit_interval(self.bits(3))
    }

    /// A number in [0, 1), for the way on at a perfectly specular surface.
    pub(super) fn choice(self) -> f32 {
        unit_interval(self.bits(5))
    }

    /// Bits for the rounding of the power.
    pub(super) fn dither(self) -> u32 {
        self.bits(4)
    }
}

fn unit_interval(bits: u32) -> f32 {
    (bits >> 8) as f32 / 16_777_216.0
}

/// The start of a path: an emitter by its power, a point by area, a direction by the cosine; both sides of a
/// double-sided emitter. `None` without emitters.
pub(super) fn emit(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    random: PathRandom,
) -> Result<Option<Emission>, Fault> {
    let [a, b, c, d] = random.emission();
    let Some(sample) = sample_emitter(scene, memory, [a, b])? else { return Ok(None) };
    let (sides, is_back, c) = if sample.double_sided {
        (2.0, c >= 0.5, if c >= 0.5 { 2.0 * c - 1.0 } else { 2.0 * c })
    } else {
        (1.0, false, c)
    };
    let normal = if is_back { -sample.normal } else { sample.normal };
    // A white Lambertian surface reflects by the cosine, as the emitter emits.
    let white = Surface::white(sample.position, normal, sample.magnitude);
    Ok(sample_reflection(&white, [c, d]).map(|sampled| Emission {
        ray: Ray::new(white.offset_origin(), sampled.direction),
        power: sample.emission * (PI * sides / sample.density),
    }))
}
