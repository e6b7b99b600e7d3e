//! Options that have no effect because another option is missing: a notice reports them.

use crate::support::{Room, scene, shipped};

#[test]
fn options_without_effect_are_reported() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    room.rendered("scene.gltf", &["-o", "plain.exr"]);
    let plain = room.read("plain.exr");
    for (options, said) in [
        (&["--ic-error=0.1"][..], "--ic-error has no effect without --irradiance-cache on"),
        (
            &["--bins=9", "--order=tiled"],
            "--bins has no effect with --order tiled, which has no direction bins",
        ),
        (
            &["--queue=9", "--order=dirbin"],
            "--queue has no effect with --order dirbin, by which no gathers wait",
        ),
        (
            &["--in-flight=1", "--order=naive"],
            "--in-flight has no effect with --order naive, by which no gathers wait",
        ),
        (
            &["--caustic-neighbors=9"],
            "--caustic-neighbors has no effect without a caustic map: nothing in the scene",
        ),
        (
            &["--caustic-photons=9"],
            "--caustic-photons has no effect without a caustic map: nothing in the scene",
        ),
        (
            &["--caustic-neighbors=9", "--caustic-photons=0"],
            "--caustic-neighbors has no effect with --caustic-photons 0",
        ),
        (&["--exposure=1"], "--exposure has no effect without -o OUT.png"),
        (&["--tonemap=aces"], "--tonemap has no effect without -o OUT.png"),
    ] {
        let outcome = room.rendered("scene.gltf", &[&["-o", "plain.exr"], options].concat());
        assert!(outcome.stderr.contains(&format!("photoncard: {said}")), "{said}: {}", outcome.stderr);
        assert_eq!(outcome.stderr.matches("no effect").count(), 1, "{}", outcome.stderr);
        assert!(room.read("plain.exr") == plain, "{options:?}");
        let quiet = room.rendered("scene.gltf", &[&["-o", "plain.exr", "--quiet"], options].concat());
        assert_eq!(quiet.stderr, "", "{options:?}");
    }
    // The picture differs from the plain one by the units in its provenance.
    let outcome = room.rendered("scene.gltf", &["-o", "units.exr", "--light-units=watts"]);
    let said = "--light-units has no effect without point, spot or directional lights in the file";
    assert!(outcome.stderr.contains(said), "{}", outcome.stderr);
    let sky = ["-o", "sky.exr", "--environment=1,1,1", "--environment-rotation=90"];
    let outcome = room.rendered("scene.gltf", &sky);
    let said = "--environment-rotation has no effect with an environment that is equal all around";
    assert!(outcome.stderr.contains(said), "{}", outcome.stderr);
    let prepared = [&["prepare", "scene.gltf", "-o", "a.card"][..], &sky[2..]].concat();
    assert!(room.run(&prepared).stderr.contains(said));
    let alone = room.render("scene.gltf", &["-o", "a.exr", "--environment-rotation=90"]);
    assert!(alone.status == Some(2) && alone.stderr.contains("--environment <"), "{}", alone.stderr);
    for option in ["--irradiance-cache=on", "--radiance=precomputed"] {
        let options = ["-o", "plain.exr", "--gather-rays", "0", option];
        let outcome = room.rendered("scene.gltf", &options);
        assert!(outcome.stderr.contains("has no effect with --gather-rays 0"), "{}", outcome.stderr);
    }
}

#[test]
fn options_of_an_exr_are_reported_without_one() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for option in ["--sample-type=half", "--aov=none"] {
        let said = room.rendered("scene.gltf", &["-o", "a.png", option]).stderr;
        let (name, _) = option.split_once('=').unwrap();
        assert!(said.contains(&format!("{name} has no effect without -o OUT.exr")), "{said}");
        let both = room.rendered("scene.gltf", &["-o", "a.png", "-o", "a.exr", option]).stderr;
        assert!(!both.contains("no effect"), "{both}");
    }
}

#[test]
fn options_with_effect_are_not_reported() {
    let room = Room::new();
    let small = ["-o", "a.exr", "--caustic-photons=99"];
    for options in [
        &["--irradiance-cache=on", "--ic-error=0.1"][..],
        &["--bins=9", "--queue=9", "--in-flight=1", "--order=hash"],
        &["--bins=9", "--order=dirbin"],
        &["--caustic-neighbors=9"],
        &["--radiance=precomputed", "--faults=flips=1e-9"],
    ] {
        let outcome = room.rendered(&shipped("cornell-spheres.glb"), &[&small, options].concat());
        assert!(!outcome.stderr.contains("no effect"), "{options:?}: {}", outcome.stderr);
    }
}
