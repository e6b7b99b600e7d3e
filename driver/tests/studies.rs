//! Studies as a whole, on tiny pictures: their files, reuse of finished points, and sums of samples.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use photoncard_driver::choice::Choice;
use photoncard_driver::render::{Unobserved, render};
use photoncard_driver::scene::gltf;
use photoncard_driver::scheduler::GatherOrder;
use photoncard_driver::study::report::Provenance;
use photoncard_driver::study::{
    Laboratory, SampleRate, Scale, Study, StudyError, StudyObserver, StudyOptions, run,
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
        gather_rays: 4,
        shadow_rays: 1,
        least_tiles: 2,
        quality_tiles: 2,
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
    let second = Counting::up_to(usize::MAX);
    run(&options, &second).unwrap();
    assert_eq!(second.measured(), 0);
    assert_eq!(files(folder.path()), written);
}

#[test]
fn a_stopped_study_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let options = options(folder.path(), &[Study::Reordering]);
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

#[test]
fn all_tiles_add_up_to_the_render() {
    let folder = tempfile::tempdir().unwrap();
    let observer = Counting::up_to(usize::MAX);
    let mut laboratory = Laboratory::new(folder.path(), &scenes(), Some(2), &observer).unwrap();
    let scene = gltf::load(&scenes().join("cornell.gltf")).unwrap();
    for settings in
        [tiny().all_on(), tiny().settings(GatherOrder::Naive), tiny().settings(GatherOrder::Hilbert)]
    {
        let point = tiny().whole("cornell.gltf", settings.clone());
        let results = laboratory.measure("sum", std::slice::from_ref(&point)).unwrap();
        let measured = results.traffic(&point);
        let statistics = render(&scene, &settings, &Unobserved).unwrap().statistics;
        for (total, expected) in [
            (measured.gathers(), statistics.gathers),
            (measured.total(|tile| tile.counters.gather_rays as f64), statistics.rays.gather),
            (measured.total(|tile| tile.counters.records as f64), statistics.records),
            (measured.total(|tile| tile.counters.photons_tested as f64), statistics.photons_tested),
        ] {
            assert_eq!(
                (total.value, total.half_width),
                (expected as f64, 0.0),
                "{:?}",
                settings.schedule.order
            );
        }
        let [raw, dram] = [measured.raw_bytes(), measured.photon_map_bytes()];
        assert!(raw.value > 0.0 && dram.value > 0.0 && raw.half_width == 0.0 && dram.half_width == 0.0);
    }
}

/// The reference has as many rays of the same sampling: the error is zero.
#[test]
fn a_render_like_its_reference_has_no_error_and_fewer_rays_have_some() {
    let folder = tempfile::tempdir().unwrap();
    let observer = Counting::up_to(usize::MAX);
    let mut laboratory = Laboratory::new(folder.path(), &scenes(), Some(2), &observer).unwrap();
    let scale = tiny();
    let of = |gather_rays| {
        let settings = scale.all_on().with(|s| {
            s.integrator.gather_rays = gather_rays;
            s.integrator.irradiance_error = None;
        });
        scale.quality("cornell.gltf", settings)
    };
    let [same, fewer] = [of(scale.reference_rays), of(2)];
    let results = laboratory.measure("quality", &[same.clone(), fewer.clone()]).unwrap();
    let (same, fewer) = (results.quality(&same), results.quality(&fewer));
    assert_eq!((same.rmse, same.mean), (0.0, 1.0));
    assert!(same.pixels > 0 && same.pixels == fewer.pixels);
    assert!(fewer.rmse > 0.05, "{fewer:?}");
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
