//! Command `photoncard measure`.

use std::f64::consts::PI;
use std::io::Write as _;
use std::process::{Command, Stdio};

use photoncard_driver::render::measure::harmonics;
use photoncard_driver::scene::{Daylight, Sky};
use serde_json::json;

use crate::support::{Outcome, Room, mirrored_cornell};

const QUICK: [&str; 9] =
    ["--photons", "3000", "--spp", "4", "--gather-rays", "8", "--shadow-rays", "4", "--quiet"];
const NAMES: &str = "x,y,z,nx,ny,nz,illuminance_lx,direct_lx,indirect_lx,error_lx,\
                     direct_r_w_m2,direct_g_w_m2,direct_b_w_m2,indirect_r_w_m2,indirect_g_w_m2,indirect_b_w_m2";

fn room() -> Room {
    let room = Room::new();
    room.write_scene("box.gltf", &mirrored_cornell());
    room
}

fn measure(room: &Room, options: &[&str]) -> Outcome {
    room.run(&[&["measure", "box.gltf"], &QUICK[..], options].concat())
}

fn table(room: &Room, options: &[&str]) -> String {
    let outcome = measure(room, &[options, &["-o", "-"]].concat());
    assert_eq!((outcome.status, &*outcome.stderr), (Some(0), ""), "{options:?}");
    outcome.stdout
}

/// Numbers of a table, line by line.
fn numbers(table: &str) -> Vec<Vec<f64>> {
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some(NAMES));
    lines.map(|line| line.split(',').map(|number| number.parse().expect("a number")).collect()).collect()
}

#[test]
fn points_of_a_file_a_pipe_and_a_table_have_one_result() {
    let room = room();
    room.write("points.txt", "# desk\n0 -0.5 0 0 1 0\n0.3 0.2 -0.4 0 0 2\n\n-0.2 0 0.1 1 1 1\n");
    let expected = table(&room, &["--points", "points.txt"]);
    let rows = numbers(&expected);
    assert_eq!(rows.len(), 3);
    assert_eq!(rows[1][..6], [0.3, 0.2, -0.4, 0.0, 0.0, 2.0]);
    for row in &rows {
        let [illuminance, direct, indirect, error] = row[6..10] else { panic!("four") };
        assert!(illuminance > 0.0 && (direct + indirect - illuminance).abs() < 1e-6 * illuminance);
        assert!(error > 0.0 && error < illuminance);
        let weighted = |light: &[f64]| 0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2];
        assert!((weighted(&row[10..13]) - direct).abs() < 1e-5 * illuminance);
        assert!((weighted(&row[13..16]) - indirect).abs() < 1e-5 * illuminance);
    }
    // A table is a file of points.
    room.write("table.csv", &expected);
    assert_eq!(table(&room, &["--points", "table.csv"]), expected);
    let mut command = room.command();
    command.args(["measure", "box.gltf", "--points", "-", "-o", "-"]).args(QUICK);
    let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    process.stdin.take().unwrap().write_all(&room.read("points.txt")).unwrap();
    let output = process.wait_with_output().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout), expected);
}

/// A plate above the scene gets the sun's light by the cosine, and that of the sky.
#[test]
fn a_plate_outdoors_reads_the_light_of_sun_and_sky() {
    let room = room();
    room.write("points.txt", "0 9 0 0 1 0\n0 9 0 0 0 1\n");
    let text = "52.5,13.4,2026-06-21T13:08+02:00";
    let many = ["--sky", text, "--points", "points.txt", "--spp", "64", "--shadow-rays", "16", "-o", "-"];
    let outcome = room.run(&[&["measure", "box.gltf", "--photons", "3000", "--quiet"], &many[..]].concat());
    let rows = numbers(&outcome.stdout);
    let Daylight { environment, sun, elevation } = text.parse::<Sky>().unwrap().daylight(0.0);
    let lux = |[red, green, blue]: [f32; 3]| {
        0.2126 * f64::from(red) + 0.7152 * f64::from(green) + 0.0722 * f64::from(blue)
    };
    let direct = lux(sun.unwrap().intensity.to_array());
    let ground = lux(*environment.texels.last().unwrap());
    // A fifth of the light from above comes back from the ground.
    let expected = PI * ground / 0.2;
    assert!((rows[0][7] / expected - 1.0).abs() < 0.01, "{} lx instead of {expected}", rows[0][7]);
    let elevation = elevation.to_radians();
    assert!(expected > direct * elevation.sin() + 1e4 && direct > 8e4, "{expected} {direct}");
    // A wall that faces south gets the sun and half of sky and ground.
    let wall = rows[1][7] - direct * elevation.cos();
    assert!((1e4..3e4).contains(&wall), "{wall} lx");
}

#[test]
fn a_sky_by_night_is_black_and_said_to_be() {
    let room = room();
    let night =
        ["--sky", "69.65,18.96,2026-12-21T12:00+01:00", "--size", "8x8", "--photons", "300", "-o", "a.exr"];
    let outcome = room.run(&[&["render", "box.gltf"], &night[..]].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("degrees below the horizon"), "{}", outcome.stderr);
}

#[test]
fn parts_one_after_another_are_the_table_of_all_points() {
    let room = room();
    let points: String = (0..11).map(|index| format!("0 0 {} 0 1 0\n", f64::from(index) / 20.0)).collect();
    room.write("points.txt", points);
    let whole = ["--points", "points.txt", "-o", "whole.csv"];
    assert_eq!(measure(&room, &whole).status, Some(0));
    let mut joined = Vec::new();
    for (part, cards) in [("1/3", "emulated:1"), ("2/3", "emulated-micro:2"), ("3/3", "emulated:3")] {
        let outcome = measure(
            &room,
            &["--points", "points.txt", "--part", part, "--card", cards, "--order", "hash", "-o", "p.csv"],
        );
        assert_eq!((outcome.status, &*outcome.stderr), (Some(0), ""));
        joined.extend(room.read("p.csv"));
    }
    assert!(joined == room.read("whole.csv"));
    // Of fewer points than parts, the first has the names of the columns.
    let tables =
        (1..=13).map(|part| table(&room, &["--points", "points.txt", "--part", &format!("{part}/13")]));
    assert!(tables.collect::<String>().into_bytes() == room.read("whole.csv"));
}

#[test]
fn grids_lie_above_nodes_and_in_rectangles() {
    let room = room();
    let rows = numbers(&table(&room, &["--grid", "-0.8,-0.5,-0.4,0.8,-0.5,0.4", "--spacing", "0.4"]));
    let places: Vec<[f64; 6]> = rows.iter().map(|row| row[..6].try_into().unwrap()).collect();
    assert_eq!(places.len(), 8);
    assert_eq!(places[0], [-0.6, -0.5, -0.2, 0.0, 1.0, 0.0]);
    assert!(places.contains(&[0.6, -0.5, 0.2, 0.0, 1.0, 0.0]));
    let upright = ["--grid", "0,-0.4,-0.4,0,0.4,0.4", "--spacing", "0.4", "--normal", "-1,0,0"];
    assert!(numbers(&table(&room, &upright)).iter().all(|row| row[3..6] == [-1.0, 0.0, 0.0]));

    let refused = measure(&room, &["--grid", "nowhere", "--spacing", "0.5", "-o", "-"]);
    assert_eq!(refused.status, Some(2));
    assert!(refused.stderr.contains("no node nowhere"), "{}", refused.stderr);
}

#[test]
fn lumens_follow_from_the_units_of_the_file_and_from_options() {
    let room = room();
    let of_blender = {
        let mut scene = mirrored_cornell();
        scene["asset"]["generator"] = json!("Khronos glTF Blender I/O v4.2.0");
        scene["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        scene["extensions"]["KHR_lights_punctual"]["lights"] = json!([{"type": "point", "intensity": 1e-6}]);
        let nodes = scene["nodes"].as_array_mut().unwrap();
        nodes.push(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
        let last = nodes.len() - 1;
        scene["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(last));
        scene
    };
    room.write_scene("blender.gltf", &of_blender);
    room.write("points.txt", "0 -0.5 0 0 1 0\n");
    let lux = |scene: &str, options: &[&str]| {
        let words = [&["measure", scene, "--points", "points.txt", "-o", "-"], &QUICK[..], options].concat();
        numbers(&room.run(&words).stdout)[0].clone()
    };
    let plain = lux("box.gltf", &[]);
    let watts = lux("blender.gltf", &[]);
    let green = |row: &[f64]| row[11] + row[14];
    let weighted =
        |row: &[f64]| 0.2126 * (row[10] + row[13]) + 0.7152 * green(row) + 0.0722 * (row[12] + row[15]);
    assert!((plain[6] / weighted(&plain) - 1.0).abs() < 1e-5);
    assert!((watts[6] / weighted(&watts) / 683.0 - 1.0).abs() < 1e-5);
    // Also of a file without lights, whose lamps are emissive planes.
    let mut planes = mirrored_cornell();
    planes["asset"]["generator"] = json!("Khronos glTF Blender I/O v4.2.0");
    room.write_scene("planes.gltf", &planes);
    let planes = lux("planes.gltf", &[]);
    assert!((planes[6] / weighted(&planes) / 683.0 - 1.0).abs() < 1e-5);
    let radiance = lux("box.gltf", &["--lumens-per-watt", "179", "--weights", "0,1,0"]);
    assert!((radiance[6] / green(&radiance) / 179.0 - 1.0).abs() < 1e-5);
}

/// Coefficients of the probes of a table, per line and channel.
fn probes(table: &str) -> Vec<[[f64; 3]; 9]> {
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().expect("names").split(',').collect();
    assert_eq!((names.len(), names[..5].join(",")), (30, "x,y,z,l0_m0_r,l0_m0_g".into()));
    assert_eq!((names[6], names[29]), ("l1_m-1_r", "l2_m2_b"));
    let line = |line: &str| {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().expect("a number")).collect();
        std::array::from_fn(|index| std::array::from_fn(|channel| numbers[3 + 3 * index + channel]))
    };
    lines.map(line).collect()
}

/// Normals at which the sum of a probe's harmonics is compared with readings.
const AXES: [[i32; 3]; 6] = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];

/// Irradiances of the green channel at a place for each of the axes: direct light by a reading, all light by
/// a reading, and that by the harmonics of a probe.
fn beside_a_probe(place: &str, options: &[&str]) -> Vec<[f64; 3]> {
    let room = room();
    room.write("axes.txt", AXES.map(|[x, y, z]| format!("{place} {x} {y} {z}\n")).concat());
    room.write("probe.txt", place);
    let rays = ["--photons", "30000", "--spp", "64", "--gather-rays", "64", "--shadow-rays", "32", "--quiet"];
    let measured = |points: &str, more: &[&str]| {
        let words = [&["measure", "box.gltf", "--points", points, "-o", "-"], &rays[..], options, more];
        room.run(&words.concat()).stdout
    };
    let [coefficients] = probes(&measured("probe.txt", &["--probes"]))[..] else { panic!("one probe") };
    let rows = numbers(&measured("axes.txt", &[]));
    let beside = |(row, axis): (&Vec<f64>, [i32; 3])| {
        let harmonics = harmonics(axis.map(f64::from));
        let found = coefficients.iter().zip(harmonics).map(|(of, harmonic)| of[1] * harmonic).sum();
        [row[11], row[11] + row[14], found]
    };
    rows.iter().zip(AXES).map(beside).collect()
}

fn greatest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

/// A probe of order 2 is off by up to 0.117 of a lamp of one direction, and by little of light from all
/// sides.
#[test]
fn a_probe_tells_the_irradiance_of_every_normal() {
    let in_room = beside_a_probe("0.2 -0.3 0.1", &[]);
    let noise = 0.02 * greatest(in_room.iter().map(|of| of[1]));
    let left_out = 0.117 * greatest(in_room.iter().map(|of| of[0]));
    for ([_, expected, found], axis) in in_room.iter().zip(AXES) {
        assert!((found - expected).abs() < left_out + noise, "{axis:?}: {found} instead of {expected}");
    }
    // Half of the white sky is hidden by the box.
    let outdoors = beside_a_probe("0 1.5 0", &["--environment", "1,1,1"]);
    let noise = 0.03 * greatest(outdoors.iter().map(|of| of[1]));
    for ([_, expected, found], axis) in outdoors.iter().zip(AXES) {
        assert!((found - expected).abs() < noise, "{axis:?}: {found} instead of {expected}");
    }
}

#[test]
fn under_a_constant_sky_a_probe_has_one_coefficient() {
    let room = room();
    room.write("probe.txt", "0 60 0\n");
    let sky =
        ["--environment", "1,2,3", "--points", "probe.txt", "--probes", "--spp", "64", "--quiet", "-o", "-"];
    let table = room.run(&[&["measure", "box.gltf", "--photons", "3000"], &sky[..]].concat()).stdout;
    let [coefficients] = probes(&table)[..] else { panic!("one probe") };
    for (index, of) in coefficients.iter().enumerate() {
        for (channel, value) in of.iter().enumerate() {
            // Irradiance pi times the radiance, times the root of 4 pi.
            let radiance = [1.0, 2.0, 3.0][channel];
            let expected = if index == 0 { PI * radiance * (4.0 * PI).sqrt() } else { 0.0 };
            assert!((value - expected).abs() < 0.05 * radiance, "{index} {channel}: {value}");
        }
    }
}

#[test]
fn probes_in_parts_on_other_cards_are_those_of_one_measurement() {
    let room = room();
    room.write(
        "points.txt",
        (0..5).map(|index| format!("0 0 {}\n", f64::from(index) / 10.0)).collect::<String>(),
    );
    let probes = ["--points", "points.txt", "--probes"];
    let whole = table(&room, &probes);
    let parts = [("1/2", "emulated:1"), ("2/2", "emulated-micro:2")].map(|(part, card)| {
        table(&room, &[&probes[..], &["--part", part, "--card", card, "--order", "hash"]].concat())
    });
    assert_eq!(parts.concat(), whole);
    let refused = measure(&room, &["--points", "points.txt", "-o", "-"]);
    assert!(refused.status == Some(2) && refused.stderr.contains("six numbers"), "{}", refused.stderr);
}

#[test]
fn what_cannot_be_measured_is_refused_before_any_work() {
    let room = room();
    room.write("bad.txt", "0 0 0 0 1 0\n0 0 0 0 1\n");
    room.write("zero.txt", "0 0 0 0 0 0\n");
    room.write("empty.txt", "# nothing\n");
    for (options, parts) in [
        (&["--points", "bad.txt"][..], &["bad.txt, line 2", "six numbers"][..]),
        (&["--points", "zero.txt"], &["line 1", "normal is 0"]),
        (&["--points", "missing.txt"], &["missing.txt"]),
        (&["--points", "empty.txt", "--weights", "0,0,0"], &["weights"]),
        (&["--points", "bad.txt", "--lumens-per-watt", "0"], &["line 2"]),
        (&["--points", "empty.txt", "--lumens-per-watt", "-1"], &["positive number"]),
        (&["--points", "-", "--part", "1/2"], &["--part"]),
        (&["--grid", "0,0,0,1,1,1", "--spacing", "1"], &["no rectangle"]),
        (&["--grid", "0,0,0,1,0,1", "--spacing", "0"], &["above 0"]),
        (&["--grid", "0,0,0,1,0,1", "--spacing", "1e-6"], &["greater --spacing"]),
        (&["--grid", "0,0,0,1,0,1"], &["--spacing"]),
        (&[], &["--points"]),
    ] {
        let outcome = measure(&room, &[options, &["-o", "out.csv"]].concat());
        assert_eq!(outcome.status, Some(2), "{options:?}: {}", outcome.stderr);
        assert!(parts.iter().all(|part| outcome.stderr.contains(part)), "{options:?}: {}", outcome.stderr);
        assert!(!room.names().contains(&"out.csv".to_owned()));
    }
    assert_eq!(table(&room, &["--points", "empty.txt"]), format!("{NAMES}\n"));
    let same = room.run(&["measure", "box.gltf", "--points", "bad.txt", "-o", "bad.txt"]);
    assert_eq!(same.status, Some(2));
    assert!(same.stderr.contains("the points"), "{}", same.stderr);
}

#[test]
fn an_interrupt_leaves_no_table() {
    let room = room();
    let mut command = room.command();
    let grid = ["--grid", "-0.9,-0.5,-0.9,0.9,-0.5,0.9", "--spacing", "0.005"];
    command.args(["measure", "box.gltf", "--spp", "1024", "-o", "out.csv"]).args(grid);
    let mut process = command.stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    Command::new("kill").args(["-INT", &process.id().to_string()]).status().unwrap();
    assert_eq!(process.wait().unwrap().code(), Some(130));
    assert_eq!(room.names(), ["box.gltf"]);
}
