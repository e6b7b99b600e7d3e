use std::fs;
use std::path::{Path, PathBuf};

use photoncard_firmware::kind::REFERENCE;
use photoncard_firmware::sampler::hash;
use photoncard_map::pack::PackedScene;
use photoncard_picture::film::Film;
use photoncard_picture::heading::Heading;
use photoncard_scene::{Scene, gltf};
use serde_json::{Value, json};

use super::file::KIND;
use super::*;
use crate::{Integrator, PhotonMaps, Picture, RenderSettings, Unobserved, render};

fn scene() -> Scene {
    gltf::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/cornell-glossy.gltf").as_ref()).unwrap()
}

fn settings() -> RenderSettings {
    RenderSettings::default().with(|settings| {
        settings.picture = Picture { width: 12, height: 8, ..Picture::default() };
        settings.photons =
            PhotonMaps { count: 700, neighbors: 20, caustic_photons: Some(300), ..PhotonMaps::default() };
        settings.integrator = Integrator { seed: 7, gather_rays: 5, shadow_rays: 2, ..Integrator::default() };
    })
}

/// Prepares the scene of all tests. Returns the path of its file.
fn prepared(folder: &Path) -> PathBuf {
    let RenderSettings { photons, integrator, .. } = settings();
    let choose = |_: &PackedScene| Ok((photons.clone(), integrator.clone()));
    let notes = json!({ "name": "cornell" }).as_object().unwrap().clone();
    let (scene, other) = (scene(), RenderSettings::default());
    let prepared = PreparedScene::new(&scene, &other, &[REFERENCE], &choose, notes, &Unobserved).unwrap();
    let path = folder.join("scene.card");
    prepared.write(&path).unwrap();
    path
}

fn sums(film: &Film) -> Vec<photoncard_picture::film::PixelSums> {
    film.sums().collect()
}

#[test]
fn a_prepared_scene_gives_the_same_pictures_as_its_scene() {
    let folder = tempfile::tempdir().unwrap();
    let prepared = PreparedScene::open(&prepared(folder.path())).unwrap();
    assert_eq!(prepared.notes().get("name"), Some(&json!("cornell")));
    let unlike = RenderSettings { photons: PhotonMaps::default(), ..settings() };
    let own = prepared.settings(unlike);
    assert_eq!(own, settings());
    let (mut renderer, cameras) = (prepared.renderer(), prepared.scene());
    for at in [None, Some([0.3, 0.4, 3.0])] {
        let settings = own.clone().with(|settings| settings.picture.camera_at = at);
        let expected = render(&scene(), &settings, &Unobserved).unwrap();
        let found = renderer.render(cameras, &settings, &Unobserved).unwrap();
        assert_eq!(sums(&found.film), sums(&expected.film));
        let [found, expected] = [found, expected].map(|rendering| rendering.statistics);
        assert_eq!(found.provenance.pixels, expected.provenance.pixels);
        assert_eq!(found.photon_paths, expected.photon_paths);
        assert_eq!((found.time_s.photons, found.time_s.pack), (0.0, 0.0));
    }
}

/// The file is overwritten and truncated while the scene is open. Pictures must be those of the opened scene.
#[test]
fn later_changes_of_the_file_change_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = prepared(folder.path());
    let bytes = fs::read(&path).unwrap();
    let expected = sums(&render(&scene(), &settings(), &Unobserved).unwrap().film);
    let changed: Vec<u8> = bytes.iter().map(|byte| byte.rotate_left(3)).collect();
    for (name, later) in [("other bytes", &changed[..]), ("cut off", &bytes[..5000]), ("empty", &[])] {
        fs::write(&path, &bytes).unwrap();
        let prepared = PreparedScene::open(&path).unwrap();
        // Writes into the file that is open, as `rsync --inplace` does.
        fs::write(&path, later).unwrap();
        let own = prepared.settings(settings());
        let found = prepared.renderer().render(prepared.scene(), &own, &Unobserved).unwrap();
        assert!(sums(&found.film) == expected, "{name}");
    }
}

/// Frames have their own cameras. A scene with other contents than the prepared one must be refused.
#[test]
fn a_prepared_scene_gives_the_same_frames_as_its_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = prepared(folder.path());
    let mut of_rest = PreparedScene::open(&path).unwrap();
    let mut moved = scene();
    moved.cameras[0].origin.x += 0.25;
    let mut other = moved.clone();
    other.triangles.pop();
    assert!(of_rest.add_frame(7, &moved) && !of_rest.add_frame(8, &other));
    of_rest.write(&path).unwrap();
    let prepared = PreparedScene::open(&path).unwrap();
    assert_eq!(prepared.frames().collect::<Vec<_>>(), [7]);
    assert!(prepared.frame(8).is_none());
    let (found, expected) = (prepared.frame(7).unwrap(), moved);
    let found = prepared.renderer().render(&found, &settings(), &Unobserved).unwrap();
    let expected = render(&expected, &settings(), &Unobserved).unwrap();
    assert_eq!(sums(&found.film), sums(&expected.film));
    assert_eq!(found.statistics.provenance.pixels, expected.statistics.provenance.pixels);
    // Cards of this process have the image from their start.
    assert!(found.statistics.link.image_bytes.iter().all(|&bytes| bytes == 0));
}

#[test]
fn preparing_a_scene_twice_gives_equal_files() {
    let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [first, second] = folders.each_ref().map(|folder| fs::read(prepared(folder.path())).unwrap());
    assert!(first == second);
}

#[test]
fn a_damaged_prepared_scene_is_refused_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = prepared(folder.path());
    let bytes = fs::read(&path).unwrap();
    let refuses = |bytes: &[u8], case: &str| {
        fs::write(&path, bytes).unwrap();
        let error = PreparedScene::open(&path).err();
        assert!(error.is_some_and(|error| error.to_string().contains("scene.card")), "{case}");
    };
    for number in 0..200 {
        // Half of the damage is in the head.
        let most = if number % 2 == 0 { bytes.len() } else { 4096 };
        let place = hash(number) as usize % most;
        let mut damaged = bytes.clone();
        damaged[place] ^= 1 << (number / 2 % 8);
        refuses(&damaged, &format!("bit {} of byte {place}", number / 2 % 8));
        refuses(&bytes[..place], &format!("the first {place} bytes"));
        refuses(&[&bytes[..place], &bytes[place..=place], &bytes[place..]].concat(), "a repeated byte");
    }
    refuses(&[&bytes[..], &[0; 128]].concat(), "one line more");
    refuses(b"{\"asset\": {\"version\": \"2.0\"}}", "a glTF file");
    fs::write(&path, b"photoncard prepared scene 99\n{}\n").unwrap();
    assert!(matches!(PreparedScene::open(&path), Err(PreparedError::Version { found: 99, .. })));
    assert!(matches!(PreparedScene::open(folder.path()), Err(PreparedError::Unreadable { .. })));
}

/// Files with valid checksums that no preparation has written.
#[test]
fn a_hostile_prepared_scene_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = prepared(folder.path());
    let bytes = fs::read(&path).unwrap();
    let Heading { head, bytes: length, .. }: Heading<Value> = KIND.read(&mut &bytes[..]).unwrap();
    let lines = &bytes[(length as usize).next_multiple_of(4096)..];
    let refused = |head: &Value, lines: &[u8]| {
        let (mut file, _) = KIND.heading(head).unwrap();
        file.resize(file.len().next_multiple_of(4096), 0);
        file.extend(lines);
        fs::write(&path, file).unwrap();
        PreparedScene::open(&path).err().map(|error| error.to_string())
    };
    assert_eq!(refused(&head, lines), None);
    for (name, value) in [
        ("program", json!("photoncard 0.0.0")),
        ("lines", json!(u32::MAX)),
        ("lines", json!(u32::MAX / 128 + 1)),
        ("lines", json!(0)),
        ("gathers", json!({"max_distance": -1.0, "near_distance": 0.1, "caustics": null})),
        ("gathers", json!({"max_distance": 1.0, "near_distance": -0.1, "caustics": null})),
        ("gathers", json!({"max_distance": null, "near_distance": 0.1, "caustics": null})),
        ("cameras", json!([])),
        ("frames", json!({"7": {"checksum": "0", "cameras": []}})),
        ("frames", json!({"-1": {"checksum": "0", "cameras": head["cameras"]}})),
        ("scene", json!(["0"])),
        ("paths", json!(-1)),
        ("extra", json!(1)),
    ] {
        let mut hostile = head.clone();
        hostile[name] = value;
        assert!(refused(&hostile, lines).is_some(), "{name}");
    }
    let mut hostile = head.clone();
    hostile["cameras"][0]["projection"]["vertical_fov"] = json!(4.0);
    assert!(refused(&hostile, lines).is_some());
    // Card images with a wrong section, length or layout, and a right checksum.
    for (place, value) in [(8, 99), (12, 1), (70, 255), (0, 0)] {
        let mut image = lines.to_vec();
        image[place] = value;
        let mut hostile = head.clone();
        hostile["checksum"] = json!(photoncard_shared::checksum::checksum(&image));
        assert!(refused(&hostile, &image).is_some_and(|error| error.contains("card image")), "{place}");
    }
}
