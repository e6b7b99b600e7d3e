//! Properties of sorted crossings.

use photoncard_firmware::sampler::hash;
use photoncard_firmware::simd::Level as Instructions;

use super::*;

struct Sort<'a>(&'a [Layer]);

impl Kernel for Sort<'_> {
    type Output = Vec<Level>;

    #[inline(always)]
    fn run(self, isa: impl Isa) -> Self::Output {
        let mut levels = Vec::new();
        sort(isa, self.0, &mut levels);
        levels
    }
}

/// Layers with few distinct keys, so that many are equal. The slope is the number of the layer.
fn layers(count: u32) -> Vec<Layer> {
    let random = |layer: u32, lane: u32| hash(hash(layer).wrapping_add(lane)) % 11;
    let layer = |layer: u32| Layer {
        keys: std::array::from_fn(|lane| random(layer, lane as u32) % 7),
        slope: layer as f32,
        face: random(layer, 16),
        triangle: TriangleId::lone(0),
    };
    (0..count).map(layer).collect()
}

#[test]
fn crossings_of_a_chord_descend_and_equal_ones_keep_their_order() {
    for count in [0, 1, 2, 5, 20, MAX_LAYERS as u32, 200] {
        let layers = layers(count);
        for levels in Instructions::ALL.iter().filter_map(|level| level.run(Sort(&layers))) {
            for lane in 0..LANES {
                let mut expected: Vec<_> = layers.iter().filter(|layer| layer.keys[lane] != 0).collect();
                expected.sort_by_key(|layer| Reverse(layer.keys[lane]));
                let expected = expected.iter().map(|layer| (layer.keys[lane], layer.slope, layer.face));
                let found = levels
                    .iter()
                    .map(|level| (level.keys[lane], f32::from_bits(level.slopes[lane]), level.faces[lane]));
                assert!(found.filter(|(key, ..)| *key != 0).eq(expected), "{count} layers, chord {lane}");
                let is_empty = |level: &Level| level.keys[lane] == 0;
                assert!(levels.is_sorted_by_key(is_empty), "{count} layers, chord {lane}");
            }
        }
    }
}

#[test]
fn keys_ascend_with_heights_and_decode_to_them() {
    let heights = [-1.0, -0.5, -f32::MIN_POSITIVE, -0.0, 0.0, 1e-30, 0.1, 1.0];
    let keys = heights.map(|at| [false, true].map(|is_front| key(at, is_front)));
    assert!(keys.as_flattened().is_sorted_by(|a, b| a < b) && keys[0][0] > 0);
    for (at, keys) in heights.iter().zip(keys) {
        assert!(keys.iter().all(|&key| height(key).to_bits() == at.to_bits()));
    }
}
