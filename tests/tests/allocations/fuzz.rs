//! Fuzzes all readers of foreign bytes with thousands of mutated inputs; the example `fuzz` runs any number.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use photoncard_tests::fuzz::{NAMES, Random, Settings, Target, fuzz, target};

use crate::ALONE;

fn settings(inputs: u64, patience: Duration) -> Settings {
    Settings {
        seed: 0,
        first: 0,
        inputs,
        time: None,
        patience,
        folder: PathBuf::from(env!("CARGO_TARGET_TMPDIR")),
    }
}

fn check(name: &str, inputs: u64) {
    let _alone = ALONE.lock();
    let report = fuzz(&target(name).expect("a target"), &settings(inputs, Duration::from_secs(60)));
    println!("{report:?}");
    assert!(report.failures.is_empty(), "{:#?}", report.failures);
    assert_eq!(report.inputs, inputs);
    // At least one input in twenty must be valid: inputs that are all rejected at once would test nothing.
    assert!(report.sound * 20 > inputs && report.sound < inputs, "{report:?}");
}

/// Defines a test for each target, with a number of inputs that takes some seconds.
macro_rules! tests_of_targets {
    ($($name:ident: $inputs:literal,)*) => {
        $(#[test]
        fn $name() {
            super::check(stringify!($name), $inputs);
        })*

        #[test]
        fn all_targets_are_tested() {
            assert_eq!(super::NAMES, [$(stringify!($name)),*]);
        }
    };
}

mod no_input_panics_hangs_or_takes_much_memory {
    tests_of_targets! {
        frames: 30_000,
        messages: 100_000,
        session: 12_000,
        image: 1_000,
        gltf: 2_500,
        meshopt: 2_000,
        draco: 2_500,
        textures: 3_000,
        environments: 10_000,
        profiles: 10_000,
        exr: 2_500,
        parts: 3_000,
        prepared: 2_000,
    }
}

/// Target that panics, allocates too much or hangs, or does not fail, depending on the number in its input.
struct Faulty;

impl Target for Faulty {
    fn name(&self) -> &'static str {
        "faulty"
    }

    fn allocation_bound(&self, _input: usize) -> usize {
        1 << 24
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        vec![random.next() as u8 % 16]
    }

    fn read(&self, input: &[u8]) -> bool {
        match input {
            [0] => panic!("a panic"),
            [1] => drop(std::hint::black_box(vec![1_u8; 1 << 25])),
            [2] => loop {
                std::thread::park();
            },
            _ => {}
        }
        true
    }
}

#[test]
fn panics_hangs_and_allocations_are_found_and_replayed() {
    let _alone = ALONE.lock();
    let faulty: Arc<dyn Target> = Arc::new(Faulty);
    let input = |number| faulty.input(&mut Random::new("faulty", 0, number))[0];
    let long = Duration::from_secs(60);
    for (kind, patience, word) in
        [(0, long, "a panic"), (1, long, "allocated"), (2, Duration::from_millis(300), "hangs")]
    {
        let number = (0..).find(|&number| input(number) == kind).expect("an input of the kind");
        let failures = fuzz(&faulty, &Settings { first: number, ..settings(1, patience) }).failures;
        let [failure] = &failures[..] else { panic!("{failures:?}") };
        assert!(failure.number == number && failure.what.contains(word), "{failure:?}");
        let path = settings(1, Duration::ZERO).folder.join(format!("faulty-0-{number}.input"));
        assert_eq!(std::fs::read(path).expect("the input"), [kind]);
    }
}
