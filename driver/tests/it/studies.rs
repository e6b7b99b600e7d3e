//! Studies as a whole, on tiny pictures: their files, reuse of finished points, and sums of samples.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use photoncard_driver::choice::Choice;
use photoncard_driver::cost_model::Machine;
use photoncard_driver::emulator::EmulatedKind;
use photoncard_driver::emulator::memory_model::CacheSettings;
use photoncard_driver::parts::Part;
use photoncard_driver::render::{Unobserved, render};
use photoncard_driver::scene::gltf;
use photoncard_driver::scheduler::GatherOrder;
use photoncard_driver::study::{
    Axis, AxisError, Extent, Hardware, Laboratory, Point, Provenance, Quality, RECORD, SampleRate, Scale,
    Study, StudyError, StudyObserver, StudyOptions, Sweep, SweepOptions, Task, UnitedPoints, run, run_sweep,
    unite,
};

/// Observer that counts measured points, and stops the study after a number of them.
struct Counting {
    measured: AtomicUsize,
    most: usize,
}

impl Counting {
    fn up_to(most: usize) -> Self {
        Self { measured: AtomicUsize::new(0), most }
    }

    fn measured(&self) -> usize {
        self.measured.load(Ordering::Relaxed)
    }
}

impl StudyObserver for Counting {
    fn progress(&self, _: &str, done: usize, total: usize, is_new: bool) {
        assert!(done <= total);
        self.measured.fetch_add(usize::from(is_new), Ordering::Relaxed);
    }

    fn notice(&self, text: &str) {
        panic!("{text}");
    }

    fn is_stopped(&self) -> bool {
        self.measured() >= self.most
    }
}

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

fn tiny() -> Scale {
    Scale {
        side: 32,
        photons: 1000,
        neighbors: 5,
        gather_rays: 8,
        shadow_rays: 1,
        least_tiles: 2,
        quality_tiles: 2,
        quality_seeds: 2,
        reference_rays: 8,
        ..Scale::QUICK
    }
    .with_sample(SampleRate::new(1, 2).unwrap())
}

fn options(out: &Path, studies: &[Study]) -> StudyOptions {
    StudyOptions {
        studies: studies.to_vec(),
        scale: tiny(),
        scenes: scenes(),
        out: out.to_owned(),
        is_collection: studies.len() > 1,
        threads: Some(2),
        provenance: Provenance::here("photoncard study"),
        extent: Extent::Whole,
    }
}

/// All files below a folder but finished points.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.ends_with("points") {
            continue;
        }
        if path.is_dir() {
            files.extend(self::files(&path));
        } else {
            files.insert(path.clone(), fs::read(path).unwrap());
        }
    }
    files
}

#[test]
fn studies_report_and_a_second_run_renders_nothing_and_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let options = options(folder.path(), Study::ALL);
    let first = Counting::up_to(usize::MAX);
    run(&options, &first).unwrap();
    assert!(first.measured() > 100, "{}", first.measured());
    let written = files(folder.path());
    let index = String::from_utf8(written[&folder.path().join("index.html")].clone()).unwrap();
    for study in Study::ALL {
        assert!(index.contains(&format!("{}/index.html", study.name())));
        let of_kind = |extension: &str| {
            let is_of = |path: &&PathBuf| {
                path.starts_with(folder.path().join(study.name()))
                    && path.extension().is_some_and(|found| found == extension)
            };
            written.keys().filter(is_of).count()
        };
        assert!(of_kind("html") == 1 && of_kind("csv") > 0 && of_kind("svg") > 0, "{}", study.name());
    }
    is_a_trial_without_published_figures(&written);
    let second = Counting::up_to(usize::MAX);
    run(&options, &second).unwrap();
    assert_eq!(second.measured(), 0);
    assert_eq!(files(folder.path()), written);
}

/// Every page of a tiny scale has the banner, every plot its mark, and no file a figure of a publication or a
/// statement on one.
fn is_a_trial_without_published_figures(files: &BTreeMap<PathBuf, Vec<u8>>) {
    let banner = tiny().banner().unwrap();
    for (path, bytes) in files {
        let (name, text) = (path.display(), String::from_utf8_lossy(bytes));
        let [is_page, is_plot] =
            ["html", "svg"].map(|kind| path.extension().is_some_and(|found| found == kind));
        assert!(!is_page || text.contains(&banner), "{name}");
        assert!(!is_plot || text.contains("Trial: "), "{name}");
        assert_ne!(path.file_stem().unwrap(), "published");
        let text = text.replace(&banner, "");
        for word in [
            "ublished",
            "Figures of Graphics Interface",
            "dissertation gives",
            "dissertation says",
            "is cited",
            "table, naive",
        ] {
            assert!(!text.contains(word), "{word} in {name}");
        }
    }
}

#[test]
fn a_stopped_study_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let scale = Scale { side: 24, gather_rays: 4, ..tiny() };
    let options = StudyOptions { scale, ..options(folder.path(), &[Study::Reordering]) };
    let stopped = Counting::up_to(3);
    assert!(matches!(run(&options, &stopped), Err(StudyError::Stopped)));
    assert!(files(folder.path()).is_empty());
    let resumed = Counting::up_to(usize::MAX);
    run(&options, &resumed).unwrap();
    let other = tempfile::tempdir().unwrap();
    let whole = Counting::up_to(usize::MAX);
    run(&StudyOptions { out: other.path().to_owned(), ..options }, &whole).unwrap();
    assert_eq!(stopped.measured() + resumed.measured(), whole.measured());
    assert_eq!(
        fs::read(folder.path().join("orders.csv")).unwrap(),
        fs::read(other.path().join("orders.csv")).unwrap()
    );
}

/// The union of parts is the whole, byte for byte, but for the times of the host's work, which no two runs
/// share.
#[test]
fn parts_of_studies_add_up_to_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let of = |name: &str, extent: Extent| {
        let scale = Scale { side: 24, gather_rays: 4, ..tiny() };
        let studies = [Study::Table71, Study::Interactive];
        StudyOptions { scale, extent, ..options(&folder.path().join(name), &studies) }
    };
    let all = Counting::up_to(usize::MAX);
    run(&of("whole", Extent::Whole), &all).unwrap();
    let parts: Vec<_> = (1..=3).map(|number| folder.path().join(number.to_string())).collect();
    for (part, path) in Part::all(3).zip(&parts) {
        let command = vec!["study".to_owned()];
        run(&of(&part.number().to_string(), Extent::Part { part, command }), &all).unwrap();
        let names: Vec<_> =
            files(path).into_keys().map(|file| file.file_name().unwrap().to_owned()).collect();
        assert_eq!(names, [RECORD], "a part writes no report");
    }
    let united = unite(&parts).unwrap();
    UnitedPoints::copy(&parts, &folder.path().join("merged")).unwrap().keep();
    let none = Counting::up_to(usize::MAX);
    run(&of("merged", Extent::Merged(united.clone())), &none).unwrap();
    assert_eq!(none.measured(), 0);
    let [whole, merged] = ["whole/table-7.1", "merged/table-7.1"].map(|name| folder.path().join(name));
    let names = |root: &Path| -> Vec<_> {
        files(root).into_iter().map(|(path, bytes)| (path.file_name().unwrap().to_owned(), bytes)).collect()
    };
    assert!(names(&whole) == names(&merged) && !names(&whole).is_empty());
    assert!(folder.path().join("merged/interactive/host.csv").exists());
    // The host's work is a point of the first part.
    fs::remove_dir_all(folder.path().join("merged")).unwrap();
    let error = run(&of("merged", Extent::Merged(united)), &none).unwrap_err();
    assert!(error.is_input() && error.to_string().contains("is missing"), "{error}");
}

#[test]
fn all_tiles_add_up_to_the_render() {
    let folder = tempfile::tempdir().unwrap();
    let observer = Counting::up_to(usize::MAX);
    let mut laboratory = Laboratory::new(folder.path(), &scenes(), Some(2), &observer).unwrap();
    let scene = gltf::load(&scenes().join("cornell.gltf")).unwrap();
    let sorted = tiny().settings(GatherOrder::Sort);
    for (settings, is_along_curve) in
        [(tiny().all_on(), false), (tiny().settings(GatherOrder::Naive), false), (sorted, true)]
    {
        let point = Point { is_along_curve, ..tiny().whole("cornell.gltf", settings.clone()) };
        let results = laboratory.measure("sum", std::slice::from_ref(&point)).unwrap();
        let measured = results.traffic(&point);
        let statistics = render(&scene, &settings, &Unobserved).unwrap().statistics;
        for (total, expected) in [
            (measured.gathers(), statistics.gathers),
            (measured.total(|tile| tile.counters.gather_rays as f64), statistics.rays.gather),
            (measured.total(|tile| tile.counters.records as f64), statistics.records),
            (measured.total(|tile| tile.counters.photons_tested as f64), statistics.photons_tested),
        ] {
            assert_eq!((total.value, total.half_width), (expected as f64, 0.0), "{point:?}");
        }
        let [raw, dram] = [measured.raw_bytes(), measured.photon_map_bytes()];
        assert!(raw.value > 0.0 && dram.value > 0.0 && raw.half_width == 0.0 && dram.half_width == 0.0);
    }
}

#[test]
fn more_gather_rays_have_less_error_in_the_same_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let observer = Counting::up_to(usize::MAX);
    let mut laboratory = Laboratory::new(folder.path(), &scenes(), Some(2), &observer).unwrap();
    let scale = Scale { reference_rays: 128, ..tiny() };
    let of = |gather_rays| {
        let settings = scale.all_on().with(|s| {
            s.integrator.gather_rays = gather_rays;
            s.integrator.irradiance_error = None;
        });
        scale.quality("cornell.gltf", &settings)
    };
    let [many, few] = [of(128), of(2)];
    let results = laboratory.measure("quality", &[many.clone(), few.clone()].concat()).unwrap();
    let pixels = |quality: &Quality| quality.tiles.iter().map(|tile| tile.pixels).collect::<Vec<_>>();
    let mut errors = Vec::new();
    for (many, few) in many.iter().zip(&few) {
        let (many, few) = (results.quality(many), results.quality(few));
        assert!(pixels(many).iter().sum::<usize>() > 0 && pixels(many) == pixels(few));
        assert!(few.rmse() > 0.05 && few.rmse() > 3.0 * many.rmse(), "{} {}", few.rmse(), many.rmse());
        errors.push(few.rmse());
    }
    assert!(
        matches!(errors[..], [first, second] if first != second),
        "each seed has its own error: {errors:?}"
    );
}

#[test]
fn a_missing_scene_is_named_with_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let options =
        StudyOptions { scenes: folder.path().to_owned(), ..options(folder.path(), &[Study::Scaling]) };
    let error = run(&options, &Counting::up_to(usize::MAX)).unwrap_err();
    assert!(error.is_input());
    let text = error.to_string();
    assert!(text.contains("cornell.gltf") && text.contains(&folder.path().display().to_string()), "{text}");
}

/// Sweep of a small scene over orders and caches.
fn sweep(machine: Machine) -> Sweep {
    let axis = |name: &str, values: &[&str]| Axis {
        name: name.to_owned(),
        values: values.iter().map(|&value| value.to_owned()).collect(),
    };
    let axes =
        vec![axis("order", &["naive", "sort"]), axis("cache", &["unified=8K/128/4", "unified=32K/128/4"])];
    let point = |values: Vec<(&str, &str)>| {
        let [(_, order), (_, caches)] = values[..] else { panic!("{values:?}") };
        let settings = tiny().settings(GatherOrder::of_name(order).unwrap());
        let hardware = Hardware::new(&EmulatedKind::Reference.into(), machine);
        Ok::<_, AxisError>((tiny().traffic_behind("mine.gltf", settings, caches.parse().unwrap()), hardware))
    };
    Sweep::new(axes, point).unwrap()
}

fn sweep_options(out: &Path) -> SweepOptions {
    sweep_options_on(out, Machine::NOMINAL)
}

fn sweep_options_on(out: &Path, machine: Machine) -> SweepOptions {
    SweepOptions {
        sweep: sweep(machine),
        name: "mine.gltf".to_owned(),
        scene: gltf::load(&scenes().join("cornell.gltf")).unwrap(),
        out: out.to_owned(),
        threads: Some(2),
        provenance: Provenance::here("photoncard study sweep"),
        extent: Extent::Whole,
    }
}

/// Rows of a CSV file without its head.
fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn a_sweep_is_measured_like_a_study_and_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let stopped = Counting::up_to(1);
    assert!(matches!(run_sweep(sweep_options(folder.path()), &stopped), Err(StudyError::Stopped)));
    assert!(files(folder.path()).is_empty());
    let resumed = Counting::up_to(usize::MAX);
    run_sweep(sweep_options(folder.path()), &resumed).unwrap();
    assert_eq!(stopped.measured() + resumed.measured(), 4);
    let names: Vec<_> =
        files(folder.path()).into_keys().map(|path| path.file_name().unwrap().to_owned()).collect();
    let expected = [
        "by-cache.svg",
        "by-order.svg",
        "index.html",
        "points.csv",
        "points.json",
        "structures-by-cache.svg",
        "structures-by-order.svg",
        "structures.csv",
        "structures.json",
    ];
    assert_eq!(names, expected);
    let values: Vec<_> =
        rows(&folder.path().join("points.csv")).into_iter().map(|row| row[..2].join(" ")).collect();
    assert_eq!(
        values,
        [
            "naive unified=8K/128/4",
            "naive unified=32K/128/4",
            "sort unified=8K/128/4",
            "sort unified=32K/128/4"
        ]
    );
    let again = Counting::up_to(usize::MAX);
    run_sweep(sweep_options(folder.path()), &again).unwrap();
    assert_eq!(again.measured(), 0);
}

/// Seconds of memory and of arithmetic of a sweep's points.
fn seconds(path: &Path) -> [Vec<f64>; 2] {
    let rows: Vec<serde_json::Value> = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    ["chip's memory (s)", "chip's arithmetic (s)"]
        .map(|column| rows.iter().map(|row| row[column].as_f64().unwrap()).collect())
}

#[test]
fn another_machine_changes_times_of_the_points_that_are_measured_already() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.json");
    let run_on = |machine| {
        let observer = Counting::up_to(usize::MAX);
        run_sweep(sweep_options_on(folder.path(), machine), &observer).unwrap();
        (observer.measured(), seconds(&path))
    };
    let Machine { bandwidth, flops, .. } = Machine::NOMINAL;
    let (measured, [memory, arithmetic]) = run_on(Machine::NOMINAL);
    let (again, [half_memory, double_arithmetic]) =
        run_on(Machine { bandwidth: 2.0 * bandwidth, flops: 0.5 * flops, ..Machine::NOMINAL });
    assert_eq!((measured, again), (4, 0));
    assert_eq!(memory, half_memory.iter().map(|seconds| 2.0 * seconds).collect::<Vec<_>>());
    assert_eq!(arithmetic, double_arithmetic.iter().map(|seconds| 0.5 * seconds).collect::<Vec<_>>());
    let page = fs::read_to_string(folder.path().join("index.html")).unwrap();
    assert!(page.contains("180 GB/s and 250 GFLOPS, reads of 100 ns, 128 tasks in flight"), "the provenance");
}

#[test]
fn kinds_of_chips_differ_in_traffic_and_are_checked_for_their_room() {
    let folder = tempfile::tempdir().unwrap();
    let observer = Counting::up_to(usize::MAX);
    let mut laboratory = Laboratory::new(folder.path(), &scenes(), Some(2), &observer).unwrap();
    let on = |chip, settings| {
        let (caches, sample) = (CacheSettings::default(), SampleRate::ALL);
        let task = Task::Traffic { chip, caches, sample, least_tiles: 1, has_reuse: false };
        Point { task, ..tiny().traffic("cornell.gltf", settings) }
    };
    let sorted = tiny().settings(GatherOrder::Sort).with(|s| s.integrator.gather_rays = 32);
    let micro = EmulatedKind::Micro;
    let points = [on(EmulatedKind::Reference, sorted.clone()), on(micro, sorted.clone())];
    let results = laboratory.measure("chips", &points).unwrap();
    let [reference, micro_traffic] = points.each_ref().map(|point| results.traffic(point));
    assert_eq!(reference.gathers(), micro_traffic.gathers());
    let drains = |tile: &photoncard_driver::study::TileMeasurement| tile.counters.drains as f64;
    assert!(
        micro_traffic.total(drains).value > reference.total(drains).value,
        "a smaller queue is drained more often"
    );
    for (point, field) in [
        (on(micro, sorted.clone().with(|s| s.schedule.tile = Some(64))), "`schedule.tile`"),
        (Point { is_along_curve: true, ..on(micro, sorted) }, "`schedule.order`"),
    ] {
        let error = laboratory.measure("chips", &[point]).unwrap_err();
        assert!(error.is_input() && error.to_string().starts_with(field), "{error}");
    }
}
