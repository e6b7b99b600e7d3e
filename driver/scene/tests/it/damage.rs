//! Damaged scenes are loaded or rejected, without a panic.

use crate::support::{glb, load_bytes, load_with, triangle_bytes, triangle_json};
use proptest::prelude::{ProptestConfig, any, proptest};
use serde_json::{Value, json};

/// GLB with a node hierarchy, sparse positions, normals and Phong extras.
fn rich() -> (Value, Vec<u8>) {
    let mut json = triangle_json();
    json["nodes"][0]["children"] = json!([2]);
    json["nodes"].as_array_mut().unwrap().push(json!({"mesh": 0, "rotation": [0, 0.6, 0, 0.8]}));
    json["accessors"][0]["sparse"] = json!({
        "count": 1, "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 0}
    });
    json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(0);
    json["materials"][0]["extras"] =
        json!({"photoncard": {"phong": {"specular": [0.1, 0.1, 0.1], "exponent": 8}}});
    (json, triangle_bytes())
}

/// Replaces one number in the JSON: of `n` numbers, the one at index `nth % n`.
fn replace_number(json: &mut Value, nth: usize, value: &Value) {
    fn numbers(value: &mut Value) -> Vec<&mut Value> {
        match value {
            Value::Number(_) => vec![value],
            Value::Array(items) => items.iter_mut().flat_map(numbers).collect(),
            Value::Object(map) => map.values_mut().flat_map(numbers).collect(),
            _ => Vec::new(),
        }
    }
    let mut found = numbers(json);
    let count = found.len();
    *found[nth % count] = value.clone();
}

#[test]
fn the_undamaged_scene_loads() {
    let (json, bin) = rich();
    assert_eq!(load_bytes("scene.glb", &glb(json, &bin)).unwrap().triangles.len(), 2);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn changed_bytes_and_cuts_are_loaded_or_refused(
        flips in proptest::collection::vec((any::<usize>(), any::<u8>()), 1..6),
        cut in any::<usize>(),
        is_cut in any::<bool>(),
    ) {
        let (json, bin) = rich();
        let mut bytes = glb(json, &bin);
        for (at, value) in flips {
            let at = at % bytes.len();
            bytes[at] ^= value;
        }
        if is_cut {
            bytes.truncate(cut % bytes.len());
        }
        drop(load_bytes("scene.glb", &bytes));
    }

    #[test]
    fn odd_numbers_in_the_json_are_loaded_or_refused(first in any::<usize>(), second in any::<usize>(), a in 0usize..10, b in 0usize..10) {
        let odd = [
            json!(0), json!(-1), json!(1), json!(3), json!(1e300), json!(0.5), json!(u64::MAX), json!(u32::MAX),
            json!(1u64 << 40), json!(3u64 << 20),
        ];
        let (mut json, bin) = rich();
        replace_number(&mut json, first, &odd[a]);
        replace_number(&mut json, second, &odd[b]);
        drop(load_with(&json, &bin));
    }
}
