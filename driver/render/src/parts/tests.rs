use std::fs;
use std::path::{Path, PathBuf};

use photoncard_firmware::sampler::hash;
use photoncard_picture::film::{Film, SumFormat, Window};
use photoncard_picture::layer::Layers;
use photoncard_shared::message::PixelSums;
use serde_json::json;

use super::*;

const WINDOW: Window = Window { x0: 5, x1: 75, y0: 2, y1: 40 };

type Change = fn(&mut PartHead);

/// Film with distinct sums in all pixels.
fn film(seed: i64) -> Film {
    let mut film = Film::new(80, 50, WINDOW, SumFormat { samples: 4, ..SumFormat::ONE }).unwrap();
    for y in WINDOW.y0..WINDOW.y1 {
        for x in WINDOW.x0..WINDOW.x1 {
            let light = [i64::from(x) + seed, i64::from(y), 7];
            film.write(x, y, &PixelSums { light, ..PixelSums::default() }).unwrap();
        }
    }
    film
}

fn head(part: Part, samples: u32) -> PartHead {
    let settings = json!({
        "size": [80, 50], "crop": [WINDOW.x0, WINDOW.x1, WINDOW.y0, WINDOW.y1], "spp": samples, "seed": 3,
    });
    let settings = settings.as_object().unwrap().clone();
    let command = vec!["render".into(), "a.gltf".into()];
    PartHead::new(part, &film(0), settings, &Layers::default(), None, command)
}

fn part(number: u32, count: u32) -> Part {
    Part::new(number, count).unwrap()
}

/// Writes a part of `film`. Returns the path.
fn written(folder: &Path, name: &str, part: Part, film: &Film) -> PathBuf {
    let path = folder.join(name);
    write(&path, &head(part, 4), film).unwrap();
    path
}

/// Error of a merge that must be refused.
fn refused(paths: &[PathBuf]) -> PartError {
    match Parts::open(paths).and_then(|parts| parts.merge()) {
        Err(error) => error,
        Ok(_) => panic!("{paths:?} are merged"),
    }
}

/// After the head of a part was read, a valid part with other settings replaces the file.
#[test]
fn a_part_that_changes_after_its_head_was_read_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), "1.part", part(1, 1), &film(0));
    let parts = Parts::open(std::slice::from_ref(&path)).unwrap();
    assert!(parts.check_pixels().is_ok() && parts.merge().is_ok());
    let mut other = head(part(1, 1), 4);
    other.settings.insert("seed".into(), json!(4));
    write(&path, &other, &film(9)).unwrap();
    for refused in [parts.check_pixels().err(), parts.merge().err()] {
        assert!(matches!(refused, Some(PartError::Damaged { .. })), "{refused:?}");
    }
    write(&path, &head(part(1, 1), 4), &film(0)).unwrap();
    let mut damaged = fs::read(&path).unwrap();
    let last = damaged.len() - 9;
    damaged[last] ^= 1;
    fs::write(&path, damaged).unwrap();
    assert!(matches!(parts.check_pixels(), Err(PartError::Damaged { .. })));
}

fn equal(a: &Film, b: &Film) -> bool {
    a.is_complete() && b.is_complete() && a.format() == b.format() && a.sums().eq(b.sums())
}

#[test]
fn parts_in_any_order_and_more_than_once_give_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    for count in [1, 3, 40] {
        let mut all: Vec<Part> = Part::all(count).collect();
        all.sort_by_key(|part| hash(part.number()));
        let write = |part: &Part| written(folder.path(), &part.number().to_string(), *part, &film(0));
        let mut paths: Vec<PathBuf> = all.iter().map(write).collect();
        paths.push(paths[0].clone());
        let merged = Parts::open(&paths).unwrap().merge().unwrap();
        assert!(equal(&merged.film, &film(0)), "{count}");
        assert_eq!(merged.provenance, head(part(1, 1), 4).settings);
        assert_eq!(merged.layers, Layers::default());
    }
}

#[test]
fn missing_parts_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let paths = [2, 5].map(|number| written(folder.path(), &number.to_string(), part(number, 20), &film(0)));
    let parts = Parts::open(&paths).unwrap();
    assert_eq!(parts.missing().len(), 18);
    assert_eq!(parts.any().map(|head| head.part), Some(part(2, 20)));
    let error = refused(&paths).to_string();
    assert_eq!(
        error,
        "18 of 20 parts are missing: 1/20, 3/20, 4/20, 6/20, 7/20, 8/20, 9/20, 10/20 and 10 more"
    );
}

#[test]
fn parts_with_other_settings_are_refused_with_the_difference() {
    let folder = tempfile::tempdir().unwrap();
    let first = written(folder.path(), "a", part(1, 2), &film(0));
    let second = folder.path().join("b");
    let changes: [(Change, &str); 4] = [
        (|head| drop(head.settings.insert("spp".into(), json!(16))), "spp: 4 in "),
        (|head| drop(head.settings.remove("seed")), "seed: 3 in "),
        (|head| head.part = part(2, 3), "number of parts: 2 in "),
        (|head| head.layers = "none".into(), "layers: albedo,N,Z in "),
    ];
    for (change, words) in changes {
        let mut changed = head(part(2, 2), 4);
        change(&mut changed);
        write(&second, &changed, &film(0)).unwrap();
        let error = refused(&[first.clone(), second.clone()]).to_string();
        assert!(error.starts_with(&format!("parts differ in {words}")) && error.contains("/b"), "{error}");
    }
}

#[test]
fn two_files_of_a_part_must_have_equal_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let first = written(folder.path(), "a", part(1, 1), &film(0));
    let second = written(folder.path(), "b", part(1, 1), &film(1));
    assert!(matches!(refused(&[first, second]), PartError::Unequal { part, .. } if part.number() == 1));
}

#[test]
fn a_damaged_part_is_refused_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(folder.path(), "a", part(1, 1), &film(0));
    let bytes = fs::read(&path).unwrap();
    let refuses = |bytes: &[u8], case: &str| {
        fs::write(&path, bytes).unwrap();
        let error = refused(std::slice::from_ref(&path));
        assert!(error.to_string().contains(path.to_str().unwrap()), "{case}: {error}");
    };
    for number in 0..200 {
        let place = hash(number) as usize % bytes.len();
        let mut damaged = bytes.clone();
        damaged[place] ^= 1 << (number % 8);
        refuses(&damaged, &format!("bit {} of byte {place}", number % 8));
        refuses(&bytes[..place], &format!("the first {place} bytes"));
        refuses(&[&bytes[..place], &bytes[place..place + 1], &bytes[place..]].concat(), "a repeated byte");
    }
    refuses(&[&bytes[..], b"\n"].concat(), "one byte more");
    refuses(b"photoncard partial render 4\n{}\n", "a partial render");
    fs::write(&path, b"photoncard part 1\n{}\n").unwrap();
    assert!(matches!(refused(std::slice::from_ref(&path)), PartError::Version { found: 1, .. }));
    // Copying another picture's part over this file was interrupted after the head.
    let mut other = head(part(1, 1), 4);
    other.settings.insert("seed".into(), json!(4));
    write(&path, &other, &film(9)).unwrap();
    let changed = fs::read(&path).unwrap();
    let tiles = |bytes: &[u8]| bytes.windows(5).position(|window| window == b"\x89TILE").unwrap();
    let mixed = [&changed[..tiles(&changed)], &bytes[tiles(&bytes)..]].concat();
    assert_eq!(mixed.len(), changed.len());
    refuses(&mixed, "the tiles of another picture");
    let folder = folder.path().to_owned();
    assert!(matches!(refused(&[folder]), PartError::Unreadable { .. }));
}

/// Heads written by hand, with valid checksums.
#[test]
fn a_hostile_head_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let changes: [Change; 8] = [
        |head| drop(head.settings.insert("size".into(), json!([u64::MAX, 1]))),
        |head| drop(head.settings.insert("size".into(), json!([1_u64 << 40, 50]))),
        |head| drop(head.settings.insert("crop".into(), json!([0, 81, 0, 1]))),
        |head| drop(head.settings.insert("crop".into(), json!([9, 3, 9, 3]))),
        |head| drop(head.settings.insert("spp".into(), json!(0))),
        |head| drop(head.settings.remove("crop")),
        |head| head.layers = "depth".into(),
        |head| head.units = [f32::NAN.to_bits(), 0],
    ];
    for (number, change) in changes.iter().enumerate() {
        let mut hostile = head(part(1, 1), 4);
        change(&mut hostile);
        write(&path, &hostile, &film(0)).unwrap();
        assert!(matches!(refused(std::slice::from_ref(&path)), PartError::Damaged { .. }), "{number}");
    }
    // The head states the largest possible picture, of which the file has no pixel.
    let mut large = head(part(1, 65_536), 4);
    large.settings.insert("size".into(), json!([1 << 14, 1 << 14]));
    large.settings.insert("crop".into(), json!([0, 1 << 14, 0, 1 << 14]));
    let blank =
        Film::new(1 << 14, 1 << 14, Window { x0: 0, x1: 1, y0: 0, y1: 1 }, *film(0).format()).unwrap();
    write(&path, &large, &blank).unwrap();
    assert!(matches!(refused(std::slice::from_ref(&path)), PartError::Damaged { .. }));
}

#[test]
fn parts_cover_all_items_once() {
    for (all, count) in [(0, 3), (1, 3), (10, 3), (1000, 7), (65_537, 2)] {
        let mut next = 0;
        for part in Part::all(count) {
            let [first, end] = part.range(all);
            assert_eq!(first, next);
            next = end;
        }
        assert_eq!(next, all);
    }
}
