//! Command `photoncard study`: wrong arguments, an interrupt, and sweeps.

use crate::support::{Room, scene, shipped};

fn refused(arguments: &[&str], words: &[&str]) {
    let room = Room::new();
    room.write("taken", "");
    let outcome = room.run(&[&["study"], arguments].concat());
    assert_eq!((outcome.status, outcome.stdout.as_str()), (Some(2), ""), "{arguments:?}: {}", outcome.stderr);
    for word in words {
        assert!(outcome.stderr.contains(word), "{arguments:?}: {word:?} is not in: {}", outcome.stderr);
    }
}

#[test]
fn wrong_arguments_are_refused_with_a_remedy() {
    refused(&["figure-6.18", "--out", "out"], &["figure-6.18", "figure-6.17", "all"]);
    refused(&["reordering"], &["--out"]);
    refused(&[], &["--out", "NAME"]);
    for sample in ["0/5", "3/2", "1/0", "text", "-1/2"] {
        refused(&["scaling", "--out", "out", "--sample", sample], &[sample, "1/17"]);
    }
    refused(&["scaling", "--out", "out", "--threads", "0"], &["threads"]);
    for (option, value) in [("--bandwidth", "0"), ("--flops", "x"), ("--latency", "-1"), ("--tasks", "0")] {
        refused(&["interactive", "--out", "out", option, value], &[option, value, "use a number from"]);
    }
    refused(&["scaling", "--out", "out"], &["cornell.gltf", "scenes", "--scenes"]);
    refused(&["scaling", "--out", "out", "--scenes", "nowhere"], &["cornell.gltf", "nowhere", "--scenes"]);
    refused(&["scaling", "--out", "taken"], &["taken", "--out"]);
    for name in ["techniques", "figure-6.17", "all"] {
        refused(
            &[name, "--out", "out", "--card", "emulated-micro"],
            &["--card emulated-micro is not for", "table-7.1"],
        );
    }
    refused(&["table-7.1", "--out", "out", "--card", "serial:a"], &["serial:a", "emulated:CHIP.toml"]);
    refused(&["table-7.1", "--out", "out", "--vary", "R_IC=2"], &["R_IC cannot be", "from 0 to 1"]);
    refused(&["table-7.1", "--out", "out", "--vary", "tile=8"], &["no symbol", "R_IC"]);
    refused(
        &["scaling", "--out", "out", "--vary", "R_IC=0.5"],
        &["--vary is of symbols of table-7.1", "sweep"],
    );
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_a_study_and_keeps_its_points() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};

    let room = room_with_a_scene();
    let seeds = format!("seed={}", (0..200).map(|seed| seed.to_string()).collect::<Vec<_>>().join(","));
    let own = ["--vary", &seeds, "--threads", "1"];
    let (_quiet, sweep) = SWEEP.split_last().unwrap();
    let mut child = room.command().arg("study").args(sweep).args(own).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    let finished = |line: &String| -> Option<usize> {
        line.strip_prefix("photoncard: sweep ")?.split(' ').next()?.parse().ok()
    };
    // A line follows each tenth of the points: the first may count several.
    let finished = lines.find_map(|line| finished(&line).filter(|&count| count > 0)).unwrap();
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let last = lines.last().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{last}");
    assert!(last.contains("stopped") && last.contains("points are kept"), "{last}");
    assert!(std::fs::read_dir(room.path("out/points")).unwrap().count() >= finished);
    assert!(!room.path("out/index.html").exists());
}

/// Options of a sweep of `my scene.gltf` with few points.
const SWEEP: [&str; 15] = [
    "sweep",
    "my scene.gltf",
    "--out",
    "out",
    "--size",
    "16x16",
    "--photons",
    "200",
    "--neighbors",
    "5",
    "--gather-rays",
    "8",
    "--tile",
    "4",
    "--quiet",
];

fn room_with_a_scene() -> Room {
    let room = Room::new();
    room.write_scene("my scene.gltf", &scene());
    room
}

#[test]
fn a_sweep_measures_every_combination_of_values() {
    let room = room_with_a_scene();
    let arguments = [
        "--vary",
        "order=naive,sort",
        "--vary",
        "cache=1K",
        "--vary",
        "set=floor.diffuse=0.2,floor.diffuse=0.8",
    ];
    let outcome = room.run(&[&["study"], &SWEEP[..], &arguments].concat());
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    let points = String::from_utf8(room.read("out/points.csv")).unwrap();
    let rows: Vec<_> = points.lines().skip(1).map(|row| row.split(',').take(3).collect::<Vec<_>>()).collect();
    assert_eq!(rows.len(), 4);
    assert_eq!(rows[1], ["naive", "1K", "floor.diffuse=0.8"]);
    let page = String::from_utf8(room.read("out/index.html")).unwrap();
    for text in ["Sweep of my scene.gltf", "by-order.svg", "scene-checksum", "unified"] {
        assert_eq!(page.contains(text), text != "unified", "{text}");
    }
    let points = || std::fs::read_dir(room.path("out/points")).unwrap().count();
    assert_eq!(points(), 4);
    // One of the two points of this sweep is measured already.
    let more = ["--cache", "photon=1K/128/4", "--cache", "unified=2K/128/4", "--vary", "order=sort"];
    let set = ["--vary", "set=floor.diffuse=0.2"];
    let machine = ["--bandwidth", "12.5", "--flops", "80"];
    let outcome = room.run(&[&["study"], &SWEEP[..], &more, &set, &machine].concat());
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    assert_eq!(points(), 5);
    let page = String::from_utf8(room.read("out/index.html")).unwrap();
    assert!(page.contains("12.5 GB/s and 80 GFLOPS, reads of 100 ns, 128 tasks in flight"), "the provenance");
}

/// The numbers of memory requests of a sweep over all tiles equal those of a render with `--counters`.
#[test]
fn the_counts_of_a_sweep_over_all_tiles_equal_those_of_a_render() {
    let room = room_with_a_scene();
    let options =
        ["--size", "16x16", "--photons", "200", "--neighbors", "5", "--gather-rays", "8", "--tile", "4"];
    let render = [
        "--quality",
        "paper",
        "--shadow-rays",
        "8",
        "-o",
        "a.exr",
        "--counters",
        "--stats",
        "a.json",
        "--card",
        "emulated-micro:1",
    ];
    room.rendered("my scene.gltf", &[&options[..], &render].concat());
    let outcome =
        room.run(&[&["study"], &SWEEP[..], &["--sample", "1", "--card", "emulated-micro"]].concat());
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    let statistics: serde_json::Value = serde_json::from_slice(&room.read("a.json")).unwrap();
    let structures = String::from_utf8(room.read("out/structures.csv")).unwrap();
    let rows: Vec<Vec<_>> = structures.lines().skip(1).map(|row| row.split(',').collect()).collect();
    assert!(rows.len() >= 4, "{structures}");
    for row in rows {
        let counted = statistics["memory"]["structures"][row[0]]["requests"].as_f64().unwrap();
        assert_eq!((row[1].parse::<f64>().unwrap() * 1e6).round(), counted, "{row:?}");
    }
}

#[test]
fn sweeps_that_are_not_possible_are_refused_with_value_and_remedy() {
    let many = format!("seed={}", (0..300).map(|seed| seed.to_string()).collect::<Vec<_>>().join(","));
    for (arguments, words) in [
        (&["--vary", "order=naive,best"][..], &["order=best", "naive", "sort"][..]),
        (&["--vary", "oder=naive"], &["\"oder\"", "order, bins, queue"]),
        (&["--vary", "order"], &["OPTION=VALUE"]),
        (&["--vary", "tile=4,,8"], &["a value is empty"]),
        (&["--vary", "tile=4,8,4"], &["--vary tile has the value 4 twice", "leave one"]),
        (&["--vary", "tile=4", "--vary", "tile=8"], &["tile is varied twice", "in one --vary"]),
        (
            &["--vary", "cache=8K", "--cache", "unified=8K/128/4", "--cache", "unified=4K/128/4"],
            &["cache is varied twice"],
        ),
        (&["--vary", "cache=8K,100"], &["cache=100", "whole number of sets", "correct the values"]),
        (&["--vary", &many, "--vary", "tile=4,8"], &["300 x 2 values make more than 512 points", "fewer"]),
        (&["--vary", "queue=16,100000000"], &["--queue 100000000", "choose"]),
        (&["--vary", "tile=4,64", "--card", "emulated-micro"], &["--tile 64", "or less"]),
        (&["--vary", "order=hilbert", "--card", "emulated-micro"], &["--order hilbert", "--card emulated"]),
        (&["--vary", "set=flor.diffuse=1"], &["flor", "floor"]),
        (&["--vary", "camera=eye,back"], &["back", "eye"]),
        (&["--vary", "chip.queue=5"], &["\"chip.queue\"", "chip.gather_queue"]),
        (&["--vary", "chip.in_flight=1,9"], &["chip.in_flight=9", "from 1 to 8"]),
        (&["--vary", "chip.sram_bytes=9000"], &["chip.sram_bytes=9000", "parts take", "photon cache 131072"]),
        (&["--card", "emulated:absent.toml"], &["--card", "absent.toml cannot be read"]),
        (&["--cache", "8K"], &["--cache", "photon=128K/128/4"]),
        (&["--vary", "cache=photon=8K/128/4,scene=8K/128/4"], &["parts of one cache", "by semicolons"]),
        (&["--latency", "50"], &["unexpected argument", "--latency"]),
        (&["--tasks", "3"], &["unexpected argument", "--tasks"]),
    ] {
        let room = room_with_a_scene();
        let outcome = room.run(&[&["study"], &SWEEP[..], arguments].concat());
        assert_eq!(outcome.status, Some(2), "{arguments:?}: {}", outcome.stderr);
        for word in words {
            assert!(outcome.stderr.contains(word), "{arguments:?}: {word:?} is not in: {}", outcome.stderr);
        }
        assert_eq!(room.names(), ["my scene.gltf"], "{arguments:?}");
    }
    refused(&["sweep", "absent.gltf", "--out", "out"], &["absent.gltf"]);
    refused(&["sweep", "--out", "out"], &["SCENE"]);
}

#[test]
fn a_quick_study_says_that_it_is_a_trial() {
    let room = Room::new();
    let folder = shipped("");
    let arguments = ["study", "figure-6.17", "--quick", "--out", "taken", "--scenes", &folder];
    room.write("taken", "");
    let outcome = room.run(&arguments);
    assert_eq!(outcome.status, Some(2));
    let first = outcome.stderr.lines().next().unwrap();
    assert!(first.starts_with("photoncard: Trial, no result: 128x128 pixels"), "{first}");
}

/// A chip of a file is measured with the file's capacities and caches, timed with its rates, and its
/// capacities can be varied.
#[test]
fn a_sweep_measures_the_chip_of_a_file() {
    let (room, cornell) = (Room::new(), shipped("cornell.gltf"));
    room.write(
        "chip.toml",
        "[memory]\ngather_queue = 64\n[caches]\nunified = \"512/128/4\"\n[units]\ngflops = 80\nbandwidth_gb_s = 25\n\
         [energy]\nflop_pj = 0\n",
    );
    let own =
        ["--card", "emulated:chip.toml", "--vary", "chip.gather_queue=4,64", "--vary", "bandwidth=25,50"];
    let sweep = [&["study", "sweep", &cornell], &SWEEP[2..], &own, &["--order", "sort"]].concat();
    let outcome = room.run(&sweep);
    assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
    let rows: Vec<serde_json::Value> = serde_json::from_slice(&room.read("out/points.json")).unwrap();
    let column = |name: &str| rows.iter().map(|row| row[name].as_f64().unwrap()).collect::<Vec<_>>();
    assert_eq!(column("chip.gather_queue"), [4.0, 4.0, 64.0, 64.0]);
    let drained = column("photon map (GB)");
    assert!(drained[0] > drained[2], "a shorter queue reads more lines: {drained:?}");
    let seconds = column("chip's memory (s)");
    assert!((seconds[0] / seconds[1] - 2.0).abs() < 1e-9, "twice the bandwidth halves the time: {seconds:?}");
    assert_eq!(column("energy of arithmetic (J)"), [0.0; 4]);
    let parts = ["energy of caches (J)", "energy of DRAM (J)"].map(column);
    for (index, sum) in column("energy (J)").into_iter().enumerate() {
        assert!(sum > 0.0 && (parts[0][index] + parts[1][index]) == sum, "{sum}");
    }
    for row in &rows {
        assert_eq!(row["chip"], "emulated:chip.toml");
        assert_eq!(
            (&row["scene"], &row["seed"], &row["photons"]),
            (&"cornell.gltf".into(), &0.into(), &200.into())
        );
    }
    let page = String::from_utf8(room.read("out/index.html")).unwrap();
    assert!(page.contains("unified=512/128/4"), "the provenance");
    assert_eq!(std::fs::read_dir(room.path("out/points")).unwrap().count(), 2);
}

/// `table-7.1` on a chip of one's own leaves published figures out, and evaluates its formulas for stated
/// values of symbols.
#[test]
fn a_table_is_of_a_chip_of_a_file_and_of_stated_symbols() {
    let room = Room::new();
    room.write("chip.toml", "[memory]\ntile_pixels = 1024\n[units]\ngflops = 1\n");
    let folder = shipped("");
    let own = ["--scenes", &folder, "--card", "emulated:chip.toml", "--vary", "R_IC=0.2,0.9"];
    let arguments = [&["study", "table-7.1", "--quick", "--out", "out", "--quiet"], &own[..]].concat();
    let outcome = room.run(&arguments);
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    let text = String::from_utf8(room.read("out/varied.csv")).unwrap();
    let chips = |share: &str| -> f64 {
        let row = text.lines().find(|row| row.starts_with(&format!("{share},\"table, all")));
        row.unwrap().rsplit(',').nth(1).unwrap().parse().unwrap()
    };
    assert!(chips("0.2") > chips("0.9"), "interpolated pixels take less arithmetic: {text}");
    let page = String::from_utf8(room.read("out/index.html")).unwrap();
    assert!(page.contains("emulated:chip.toml") && page.contains("1 GFLOPS"), "the provenance");
}

/// All files below a folder, by their paths in it.
fn files(folder: &std::path::Path) -> std::collections::BTreeMap<std::path::PathBuf, Vec<u8>> {
    let mut found = std::collections::BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = std::path::PathBuf::from(path.file_name().unwrap());
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(below, bytes)| (name.join(below), bytes)));
        } else {
            found.insert(name, std::fs::read(path).unwrap());
        }
    }
    found
}

/// Runs a command of `photoncard study` without an output folder, whole and in three parts. Their union must
/// be the whole, byte for byte.
fn check_parts(room: &Room, study: &[&str]) {
    let run = |own: &[&str]| {
        let outcome = room.run(&[&["study"], study, own].concat());
        assert_eq!(outcome.status, Some(0), "{own:?}: {}", outcome.stderr);
    };
    run(&["--out", "whole", "--threads", "1"]);
    for (folder, part) in [("c", "3/3"), ("a", "1/3"), ("b", "2/3")] {
        run(&["--part", part, "--out", folder, "--quiet", "--threads", "1"]);
        assert!(
            room.path(folder).join("part.json").exists() && !room.path(folder).join("index.html").exists()
        );
    }
    let counts = ["a", "b", "c"].map(|part| files(&room.path(part)).len() - 1);
    assert!(counts.iter().all(|&count| count > 0), "{counts:?}");
    let merged = room.run(&["study", "merge", "b", "a", "c", "--out", "merged"]);
    assert_eq!((merged.status, merged.stdout.as_str()), (Some(0), ""), "{}", merged.stderr);
    let [whole, merged] = ["whole", "merged"].map(|folder| files(&room.path(folder)));
    assert_eq!(whole.keys().collect::<Vec<_>>(), merged.keys().collect::<Vec<_>>());
    for (path, bytes) in whole {
        assert!(merged[&path] == bytes, "{}", path.display());
    }
}

/// Sweep of [`SWEEP`] without its output.
fn sweep_without_output() -> Vec<&'static str> {
    SWEEP.iter().copied().filter(|word| !["--out", "out", "--quiet"].contains(word)).collect()
}

#[test]
fn the_parts_of_a_sweep_add_up_to_the_whole() {
    let room = room_with_a_scene();
    let vary = ["--vary", "order=naive,sort", "--vary", "chip.gather_queue=16,64"];
    check_parts(&room, &[&sweep_without_output()[..], &vary].concat());
    // Each seed has a card image of its own, of which a part measures all points.
    let room = room_with_a_scene();
    check_parts(&room, &[&sweep_without_output()[..], &["--vary", "seed=1,2,3,4"]].concat());
}

#[test]
fn parts_that_cannot_be_united_are_refused_with_a_remedy() {
    let room = room_with_a_scene();
    let sweep = sweep_without_output();
    let measure = |folder: &str, own: &[&str]| {
        let own = [own, &["--out", folder, "--quiet"]].concat();
        let outcome = room.run(&[&["study"], &sweep[..], &["--vary", "order=naive,sort"], &own].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    };
    measure("a", &["--part", "1/2"]);
    measure("b", &["--part", "2/2"]);
    measure("seeded", &["--part", "2/2", "--seed", "7"]);
    measure("thirds", &["--part", "2/3"]);
    measure("whole", &[]);
    let merge = |folders: &[&str], words: &[&str]| {
        let outcome = room.run(&[&["study", "merge"], folders, &["--out", "merged"]].concat());
        assert_eq!(outcome.status, Some(2), "{folders:?}: {}", outcome.stderr);
        let said = outcome.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.iter().all(|word| said.contains(word)), "{folders:?}: {said}");
        assert!(!room.path("merged/index.html").exists());
    };
    merge(&["a"], &["part 2/2", "is missing", "--part 2/2 --out DIR"]);
    merge(&["a", "seeded"], &["a and seeded are of different studies", "--seed 7"]);
    merge(&["a", "thirds"], &["a and thirds are of different studies", "in 3 parts"]);
    merge(&["a", "whole"], &["whole is no finished part of a study", "part.json", "--part K/N --out whole"]);
    merge(&["a", "absent"], &["absent is no finished part"]);
    let record = String::from_utf8(room.read("b/part.json")).unwrap();
    room.write("b/part.json", record.replace("photoncard 0.", "photoncard 99."));
    merge(&["a", "b"], &["b was measured by photoncard 99.", "measure all parts with this one"]);
    room.write("b/part.json", &record);
    let mut other = scene();
    other["materials"][1]["emissiveFactor"] = serde_json::json!([0.5, 0.25, 0.125]);
    room.write_scene("my scene.gltf", &other);
    merge(&["a", "b"], &["my scene.gltf is not the one that the parts have measured"]);
    room.write_scene("my scene.gltf", &scene());
    std::fs::remove_dir_all(room.path("merged")).unwrap();
    for entry in std::fs::read_dir(room.path("b/points")).unwrap() {
        std::fs::remove_file(entry.unwrap().path()).unwrap();
    }
    merge(&["a", "b"], &["of part 2/2 is missing", "measure the part again"]);
}

/// Classes of misses add up to the misses of the caches, and histograms to the requests, of each structure.
#[test]
fn the_reuse_of_a_sweep_adds_up_to_its_reads() {
    let room = room_with_a_scene();
    let own = ["--reuse", "--sample", "1", "--cache", "photon=1K/128/1,scene=1K/128/1"];
    for order in ["order=naive,sort", "in-flight=1,2;order=sort"] {
        let vary: Vec<_> = order.split(';').flat_map(|axis| ["--vary", axis]).collect();
        let outcome =
            room.run(&[&["study"], &SWEEP[..], &own, &vary, &["--card", "emulated-large"]].concat());
        assert_eq!((outcome.status, outcome.stderr.as_str()), (Some(0), ""));
        let read = |name: &str| -> Vec<serde_json::Value> {
            serde_json::from_slice(&room.read(&format!("out/{name}.json"))).unwrap()
        };
        let (structures, classes, distances) = (read("structures"), read("reuse"), read("reuse-distances"));
        let number = |row: &serde_json::Value, column: &str| (1e6 * row[column].as_f64().unwrap()).round();
        assert!(structures.len() >= 8 && classes.len() == structures.len(), "{classes:?}");
        for (structure, classes) in structures.iter().zip(&classes) {
            assert_eq!(structure["structure"], classes["structure"]);
            let misses = number(classes, "misses (million)");
            // Each miss reads a line of 128 bytes.
            let bytes = (1e9 * structure["from DRAM (GB)"].as_f64().unwrap()).round();
            assert_eq!(128.0 * misses, bytes, "{structure}");
            let parts = ["compulsory", "capacity", "conflict"]
                .map(|class| number(classes, &format!("{class} (million)")));
            assert_eq!(parts.iter().sum::<f64>(), misses, "{classes}");
            let is_of = |row: &&serde_json::Value| {
                ["order", "in-flight", "structure"].iter().all(|column| row[*column] == classes[*column])
            };
            let again: f64 = distances.iter().filter(is_of).map(|row| number(row, "reads (million)")).sum();
            assert_eq!(again + parts[0], number(structure, "requests (million)"), "{classes}");
        }
        assert!(
            classes.iter().any(|row| number(row, "conflict (million)") != 0.0),
            "caches of one way conflict"
        );
    }
    let curve = room.run(&[&["study"], &SWEEP[..], &["--reuse", "--vary", "order=hilbert"]].concat());
    assert_eq!(curve.status, Some(2), "{}", curve.stderr);
    assert!(curve.stderr.contains("--order hilbert") && curve.stderr.contains("reuse"), "{}", curve.stderr);
}
