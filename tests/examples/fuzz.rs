//! Fuzzes readers of foreign bytes.
//!
//! `cargo run --profile PROFILE -p photoncard-tests --example fuzz -- TARGET|all [--inputs N] [--seed N]
//! [--first N] [--seconds N] [--folder PATH]`
//!
//! The targets are `frames`, `messages`, `session`, `image`, `gltf`, `meshopt`, `draco`, `textures`,
//! `environments`, `profiles`, `exr`, `parts` and `prepared`. The profile `dev` checks for arithmetic
//! overflow; `release` is that of users' programs. An input is a function of target, seed and number:
//! `--first N --inputs 1` repeats input N. The bytes of an input that failed are written into the folder, by
//! default `photoncard-fuzz` in the system's temporary folder. Several runs with different `--first` can
//! share the work. If a failure ends the process, a file `*.at` contains the number of its input.

use std::error::Error;
use std::process::ExitCode;
use std::time::Duration;

use peak_alloc::PeakAlloc;
use photoncard_tests::fuzz::{NAMES, Report, Settings, fuzz, target};

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// Default of `--inputs`: number of inputs of a target.
const INPUTS: u64 = 10_000;

fn arguments() -> Result<(Vec<String>, Settings), Box<dyn Error>> {
    let mut settings = Settings {
        seed: 1,
        first: 0,
        inputs: INPUTS,
        time: None,
        patience: Duration::from_secs(20),
        folder: std::env::temp_dir().join("photoncard-fuzz"),
    };
    let mut names = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--inputs" => settings.inputs = value()?.parse()?,
            "--seed" => settings.seed = value()?.parse()?,
            "--first" => settings.first = value()?.parse()?,
            "--seconds" => settings.time = Some(Duration::from_secs(value()?.parse()?)),
            "--folder" => settings.folder = value()?.into(),
            "all" => names.extend(NAMES.map(str::to_owned)),
            name if NAMES.contains(&name) => names.push(name.to_owned()),
            other => return Err(format!("{other} is no target; those are: {}, all", NAMES.join(", ")).into()),
        }
    }
    if names.is_empty() {
        return Err(format!("name a target: {}, all", NAMES.join(", ")).into());
    }
    Ok((names, settings))
}

fn print(name: &str, report: &Report) {
    let rate = report.inputs as f64 / report.elapsed.as_secs_f64();
    let (peak, largest) = report.peak;
    let (slowest, longest) = report.slowest;
    println!(
        "{name}: {} inputs, {} of them sound, in {:.1} s: {rate:.0} a second; at most {:.2} MB (input {largest}) and {:.1} ms \
         (input {longest})",
        report.inputs,
        report.sound,
        report.elapsed.as_secs_f64(),
        peak as f64 / 1e6,
        slowest.as_secs_f64() * 1e3,
    );
    for failure in &report.failures {
        println!("{name}: input {} FAILS: {}", failure.number, failure.what);
    }
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let (names, settings) = arguments()?;
    let mut is_sound = true;
    for name in names {
        let target = target(&name).ok_or("no such target")?;
        let report = fuzz(&target, &settings);
        print(&name, &report);
        is_sound &= report.failures.is_empty();
    }
    Ok(if is_sound { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
