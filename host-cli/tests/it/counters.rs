//! Modelled memory: counters add up, the trace has the reads that are counted, and the picture stays the
//! same.

use std::collections::BTreeMap;
use std::io;

use crate::support::{Room, scene, shipped};
use flate2::read::GzDecoder;
use serde_json::Value;

const KEYS: [&str; 5] = ["requests", "raw_bytes", "line_hits", "line_misses", "dram_bytes"];

fn statistics(room: &Room, name: &str) -> Value {
    serde_json::from_slice(&room.read(name)).unwrap()
}

/// Counter `key` at `/memory/POINTER` in the statistics.
fn count(statistics: &Value, pointer: &str, key: &str) -> u64 {
    let count = statistics.pointer(&format!("/memory/{pointer}/{key}")).and_then(Value::as_u64);
    count.unwrap_or_else(|| panic!("no memory/{pointer}/{key} in {statistics:#}"))
}

/// Sum of the counter `key` at `/memory/PART/NAME` in the statistics over all `names`.
fn sum(statistics: &Value, part: &str, names: &[&str], key: &str) -> u64 {
    names.iter().map(|name| count(statistics, &format!("{part}/{name}"), key)).sum()
}

fn check_sums(statistics: &Value) {
    let photon_map = [
        "photon_nodes",
        "photons",
        "irradiance_nodes",
        "irradiance_points",
        "caustic_nodes",
        "caustic_photons",
    ];
    let scene = ["nodes", "triangles", "materials", "emitters", "attributes", "textures"];
    let stages = ["eye", "survey", "table", "shadow", "gather_ray", "gather", "caustic"];
    for key in KEYS {
        let halves = ["photon_map", "scene"].map(|half| count(statistics, half, key));
        let waiting = count(statistics, "waiting", key);
        assert_eq!(sum(statistics, "structures", &photon_map, key), halves[0], "{key}");
        assert_eq!(sum(statistics, "structures", &scene, key), halves[1], "{key}");
        assert_eq!(sum(statistics, "structures", &["waiting"], key), waiting, "{key}");
        assert_eq!(sum(statistics, "stages", &stages, key), halves[0] + halves[1] + waiting, "{key}");
        assert!(halves.iter().all(|&half| half > 0), "{key}: {halves:?}");
    }
    for half in ["photon_map", "scene"] {
        let of = |key| count(statistics, half, key);
        assert_eq!(of("line_hits") + of("line_misses"), of("requests"), "{half}");
    }
}

#[test]
fn counters_add_up_and_change_no_picture() {
    let room = Room::new();
    let cornell = shipped("cornell-glossy.gltf");
    let render = |name: &str, options: &[&str]| {
        let (exr, json) = (format!("{name}.exr"), format!("{name}.json"));
        let common =
            ["-o", &exr, "--stats", &json, "--quality", "paper", "--size", "20x20", "--photons", "3000"];
        room.rendered(&cornell, &[&common, options].concat())
    };
    let plain = render("plain", &[]);
    assert!(!plain.stderr.contains("memory"), "{}", plain.stderr);
    let without = statistics(&room, "plain.json");
    assert!(without.get("memory").is_none());
    for key in ["photons_taken", "photons_selected", "drains", "most_waiting"] {
        assert!(without[key].as_u64().is_some_and(|count| count > 0), "{key}");
    }
    for unit in ["ray_caster", "controller", "gather_unit"] {
        assert!(without["flops"][unit].as_f64().is_some_and(|flops| flops > 0.0), "{unit}");
    }
    for (name, caches, options) in [
        ("default", "photon=128K/128/4,scene=75K/128/4", &["--counters"][..]),
        ("small", "photon=1K/128/2,scene=2K/256/2,index=hash", &["--card", "emulated:2"]),
        ("unified", "unified=4K/512/8", &["--card", "emulated-micro:1", "--counters"]),
        ("jensen", "photon=1536/128/4,scene=75K/128/4", &["--photon-map", "jensen"]),
        ("records", "unified=8K/128/1", &["--irradiance-cache", "on"]),
        ("precomputed", "photon=8K/128/4,scene=8K/128/4", &["--radiance", "precomputed"]),
    ] {
        let outcome = render(name, &[&["--cache", caches], options].concat());
        let is_another = ["records", "precomputed"].contains(&name);
        assert!(is_another != (room.read(&format!("{name}.exr")) == room.read("plain.exr")), "{name}");
        let told: Vec<_> = outcome.stderr.lines().filter(|line| line.contains("DRAM")).collect();
        assert_eq!(told.len(), 3, "{}", outcome.stderr);
        let statistics = statistics(&room, &format!("{name}.json"));
        assert_eq!(statistics["memory"]["caches"], caches);
        check_sums(&statistics);
        let is_counted = |part: &str| count(&statistics, part, "requests") > 0;
        assert_eq!(is_counted("structures/photon_nodes"), name != "jensen");
        assert_eq!(is_counted("stages/survey"), name == "records");
        assert_eq!(is_counted("structures/irradiance_points"), name == "precomputed");
    }
}

/// Renders the picture of the first row of `docs/memory.csv` again, which takes a second.
#[test]
fn the_figures_of_the_document_on_memory_are_of_this_program() {
    let csv = include_str!("../../../docs/memory.csv");
    let row: Vec<&str> = csv.lines().nth(1).expect("a row").split(',').collect();
    let [scene, rays, "emulated", "48", order, photon_map, geometry, waiting, program] = row[..] else {
        panic!("{row:?}")
    };
    assert!(program.starts_with("photoncard "), "{row:?}");
    let room = Room::new();
    let options =
        ["--quality", "paper", "--size", "48x48", "--aov", "none", "--gather-rays", rays, "--order", order];
    let techniques =
        ["--irradiance-cache", "on", "--ic-error", "0.025", "--counters", "--card", "emulated:1"];
    let outputs = ["-o", "out.exr", "--stats", "stats.json"];
    let scene = shipped(scene);
    let outcome = room.run(&[&["render", &scene][..], &outputs, &options, &techniques].concat());
    assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
    let statistics = statistics(&room, "stats.json");
    let bytes = ["photon_map", "scene"].map(|part| count(&statistics, part, "dram_bytes").to_string());
    assert_eq!(bytes, [photon_map, geometry], "run tests/memory_figures.sh");
    let written = statistics.pointer("/memory/tile_written_bytes").and_then(Value::as_u64).expect("a count");
    let both = count(&statistics, "waiting", "dram_bytes") + written;
    assert_eq!(both.to_string(), waiting, "run tests/memory_figures.sh");
}

#[test]
fn a_trace_has_a_line_for_every_request_and_every_emptied_cache() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    room.rendered("scene.gltf", &["-o", "plain.exr", "--tile", "4"]);
    for (card, layout, order, begun) in [
        ("emulated:1", "jensen", "sort", 4..5),
        ("emulated-micro:1", "lines", "sort", 4..5),
        ("emulated:1", "lines", "buckets", 2..20),
    ] {
        let files = ["-o", "a.exr", "--stats", "a.json", "--trace", "a.din.gz"];
        let options = ["--card", card, "--photon-map", layout, "--tile", "4", "--order", order, "--quiet"];
        let outcome = room.rendered("scene.gltf", &[&files[..], &options].concat());
        assert_eq!(outcome.stderr, "");
        assert!(room.read("a.exr") == room.read("plain.exr"));
        let statistics = statistics(&room, "a.json");
        check_sums(&statistics);
        let text = io::read_to_string(GzDecoder::new(&*room.read("a.din.gz"))).unwrap();
        assert!(text.starts_with("4 0\n") && text.ends_with('\n'));
        let image_bytes = statistics["image_bytes"].as_u64().unwrap();
        let [mut requests, mut waiting, mut written, mut emptied] = [0_u64; 4];
        for line in text.lines() {
            let (label, address) = line.split_once(' ').unwrap();
            let is_of_image = u64::from_str_radix(address, 16).unwrap() < image_bytes;
            match (label, is_of_image) {
                ("4", _) if address == "0" => emptied += 1,
                ("0", true) => requests += 1,
                ("0", false) => waiting += 1,
                ("1", false) => written += 1,
                _ => panic!("{line}"),
            }
        }
        let counted = ["photon_map", "scene"].map(|half| count(&statistics, half, "requests"));
        assert_eq!(requests, counted[0] + counted[1]);
        assert!(begun.contains(&emptied), "{emptied}");
        assert_eq!(waiting, count(&statistics, "waiting", "requests"));
        assert_eq!(waiting, written, "each line that waits is read once");
        assert_eq!(statistics["memory"]["tile_written_bytes"], 128 * written);
    }
}

/// Number of misses in a labelled trace of a frame whose gathers wait in card memory, by an LRU cache of four
/// ways with `sets` sets for each kind of work, casting and gathering.
fn misses_by_work(text: &str, sets: [u64; 2]) -> u64 {
    let mut cache: Vec<Vec<u64>> = Vec::new();
    let mut misses = 0;
    for line in text.lines() {
        let words: Vec<_> = line.split(' ').collect();
        match words[..] {
            ["4", "0"] | ["1", ..] | ["0", _, "waiting", ..] => {}
            ["4", "0", "casting"] => cache = vec![Vec::new(); sets[0] as usize],
            ["4", "0", "gathering"] => cache = vec![Vec::new(); sets[1] as usize],
            ["0", address, ..] => {
                let line = u64::from_str_radix(address, 16).unwrap() / 128;
                let place = (line % cache.len() as u64) as usize;
                let set = &mut cache[place];
                misses += u64::from(!set.contains(&line));
                set.retain(|held| *held != line);
                set.push(line);
                if set.len() > 4 {
                    set.remove(0);
                }
            }
            _ => panic!("{line}"),
        }
    }
    misses
}

#[test]
fn a_simulator_of_a_labelled_trace_counts_the_bytes_of_each_kind_of_work() {
    let room = Room::new();
    let spheres = shipped("cornell-spheres.glb");
    for (cache, sets) in [
        ("casting=32K/128/4,gathering=8K/128/4", [64, 16]),
        ("casting=2K/128/4,gathering=64K/128/4", [4, 128]),
    ] {
        let files = ["-o", "a.exr", "--stats", "a.json", "--trace", "a.din.gz", "--trace-labels"];
        let options = ["--card", "emulated:1", "--order", "buckets", "--cache", cache, "--size", "24x24"];
        room.rendered(
            &spheres,
            &[&files[..], &options, &["--quality", "paper", "--photons", "20000"]].concat(),
        );
        let statistics = statistics(&room, "a.json");
        let text = io::read_to_string(GzDecoder::new(&*room.read("a.din.gz"))).unwrap();
        let fetched: u64 =
            ["photon_map", "scene"].map(|half| count(&statistics, half, "dram_bytes")).iter().sum();
        assert_eq!(128 * misses_by_work(&text, sets), fetched, "{cache}");
        assert!(text.contains("4 0 gathering"));
    }
}

/// Numbers of requests and of bytes in a trace for Dinero, by the label in column `column`.
fn sums_by_label(text: &str, column: usize) -> BTreeMap<&str, [u64; 2]> {
    let mut sums: BTreeMap<_, [u64; 2]> = BTreeMap::new();
    for line in text.lines().filter(|line| line.starts_with("0 ")) {
        let words: Vec<_> = line.split(' ').collect();
        assert_eq!(words.len(), 5, "{line}");
        let [requests, bytes] = sums.entry(words[column]).or_default();
        *requests += 1;
        *bytes += words[4].parse::<u64>().unwrap();
    }
    sums
}

#[test]
fn a_labelled_trace_adds_up_to_the_counters_and_begins_its_lines_as_one_without_labels() {
    let room = Room::new();
    let spheres = shipped("cornell-spheres.glb");
    let options =
        ["--trace", "a.din.gz", "--caustic-photons", "99", "--irradiance-cache", "on", "--tile", "4"];
    let traced = |more: &[&str]| {
        let common = ["-o", "a.exr", "--stats", "a.json", "--card", "emulated:1"];
        room.rendered(&spheres, &[&common[..], &options, more].concat());
        io::read_to_string(GzDecoder::new(&*room.read("a.din.gz"))).unwrap()
    };
    let (plain, labelled) = (traced(&[]), traced(&["--trace-labels"]));
    let statistics = statistics(&room, "a.json");
    for (column, part) in [(2, "structures"), (3, "stages")] {
        let sums = sums_by_label(&labelled, column);
        let counted = statistics["memory"][part].as_object().unwrap();
        assert!(sums.keys().all(|name| counted.contains_key(*name)), "{sums:?}");
        for name in counted.keys() {
            let pair =
                ["requests", "raw_bytes"].map(|key| count(&statistics, &format!("{part}/{name}"), key));
            assert_eq!(sums.get(name.as_str()).copied().unwrap_or_default(), pair, "{part} {name}");
        }
        assert!(sums.len() > 5, "{sums:?}");
    }
    let without_labels = |line: &str| line.splitn(3, ' ').take(2).collect::<Vec<_>>().join(" ") + "\n";
    assert!(labelled.lines().map(without_labels).collect::<String>() == plain);
    let outcome = room.render(&spheres, &["-o", "b.exr", "--trace-labels"]);
    assert!(outcome.status == Some(2) && outcome.stderr.contains("--trace <"), "{}", outcome.stderr);
}

#[test]
fn a_trace_of_the_dram_has_a_line_for_every_line_that_was_fetched() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for (format, cache) in [
        ("ramulator", "photon=4K/128/4,scene=4K/128/4"),
        ("dramsim3", "unified=8K/256/2"),
        ("dramsim3", "photon=4K/128/4,scene=4K/128/4"),
    ] {
        let files = ["-o", "a.exr", "--stats", "a.json", "--trace", "a.gz", "--trace-format", format];
        let options = ["--card", "emulated:1", "--tile", "4", "--cache", cache];
        room.rendered("scene.gltf", &[&files[..], &options].concat());
        let statistics = statistics(&room, "a.json");
        let fetched: u64 =
            ["photon_map", "scene"].map(|half| count(&statistics, half, "dram_bytes")).iter().sum();
        let text = io::read_to_string(GzDecoder::new(&*room.read("a.gz"))).unwrap();
        assert_eq!(text.lines().count() as u64 * 128, fetched, "{format} {cache}");
        for (cycle, line) in text.lines().enumerate() {
            let address = match line.split(' ').collect::<Vec<_>>()[..] {
                ["LD", address] if format == "ramulator" => address,
                [address, "READ", at] if format == "dramsim3" && at == cycle.to_string() => address,
                _ => panic!("{line}"),
            };
            let address = u64::from_str_radix(address.strip_prefix("0x").unwrap(), 16).unwrap();
            assert!(address.is_multiple_of(128) && address < statistics["image_bytes"].as_u64().unwrap());
        }
    }
}

#[test]
fn a_trace_of_several_chips_is_refused() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let before = room.names();
    for (options, words) in [
        (&["--card", "emulated:2"][..], ["several chips", "--card emulated:1"]),
        (&["--card", "emulated:1", "--card", "emulated:1"], ["several chips", "--card emulated:1"]),
        (
            &["--card", "emulated:1", "--trace-labels", "--trace-format", "ramulator"],
            ["has no labels", "--trace-format dinero"],
        ),
        (&["--card", "emulated:1", "--trace", "absent/a.gz"], ["folder absent", "create it"]),
        (&["--card", "emulated:1", "--trace", "out.exr"], ["another output", "a name of its own"]),
    ] {
        let trace = if options.contains(&"--trace") { &[][..] } else { &["--trace", "a.gz"] };
        let outcome = room.render("scene.gltf", &[&["-o", "out.exr"], options, trace].concat());
        assert_eq!(outcome.status, Some(2), "{options:?}: {}", outcome.stderr);
        for word in words {
            assert!(outcome.stderr.contains(word), "{options:?}: {word:?} is not in: {}", outcome.stderr);
        }
        assert_eq!(room.names(), before);
    }
}

#[test]
fn invalid_caches_are_refused_with_the_valid_form() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for (cache, words) in [
        ("128K", "such as photon=128K/128/4"),
        ("photon=128K/64/4", "128 bytes"),
        ("photon=128K/128/3", "whole number of sets"),
        ("unified=128K/128/4,scene=1K/128/1", "give unified, or the others"),
        ("unified=128K/128/4,index=best", "use modulo or hash"),
    ] {
        let outcome = room.render("scene.gltf", &["-o", "a.exr", "--cache", cache]);
        assert_eq!(outcome.status, Some(2), "{cache}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(words) && outcome.stderr.contains("--cache"), "{}", outcome.stderr);
        assert_eq!(room.names(), ["scene.gltf"]);
    }
}

/// The trace is the first file that reaches the shell's limit of file sizes.
#[cfg(target_os = "linux")]
#[test]
fn a_trace_that_cannot_be_written_ends_the_render() {
    let room = Room::new();
    let cornell = shipped("cornell.gltf");
    let small = ["--size", "16x16", "--gather-rays", "64"];
    let options = [&["-o", "a.exr", "--trace", "a.din.gz", "--card", "emulated:1"][..], &small].concat();
    let limited = "ulimit -f 32; trap '' XFSZ; exec \"$0\" \"$@\"";
    let program = room.command().get_program().to_owned();
    let mut shell = std::process::Command::new("sh");
    shell.current_dir(room.path("")).args(["-c", limited]).arg(program);
    let output = shell.args(crate::support::small_render(&cornell, &options)).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("cannot write a.din.gz") && message.contains("free space"), "{message}");
    assert_eq!(room.names(), [""; 0]);
}
