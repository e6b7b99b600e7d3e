//! Damages real files and reads them in processes of limited memory.
//!
//! `cargo run --release -p photoncard-tests --example hostile -- images|scenes|cards|parts|partials|frames
//! [--inputs N] [--seed N] [--first N] [--batch N] [--command PHOTONCARD] [--every N] [--kilobytes N]
//! [--folder PATH]`
//!
//! An input that ends a process by a panic, an abort or a signal, or that takes more than 20 s, is a finding.
//! It is written into the folder, and `--first N --inputs 1` repeats it. The program of `--command` also
//! reads every 50th input; `--every` changes the interval.
//!
//! Files of the last four kinds (`cards`, `parts`, `partials`, `frames`) are written by this program, and
//! only it reads them. Half of them are damaged while it runs: such a finding may not repeat. A picture that
//! differs from that of undamaged files is a finding too. `tests/hostile_files.sh` builds everything, and
//! runs 100,000 images, 20,000 scenes and 50,000 files of the last four kinds.

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use photoncard_tests::hostile::{Kind, Report, Settings, read_batch, supervise, supervise_kept};

fn defaults(kind: Kind) -> Settings {
    Settings {
        kind,
        seed: 1,
        first: 0,
        inputs: 1000,
        batch: 500,
        patience: Duration::from_secs(20),
        kilobytes: 4_000_000,
        command: None,
        every: 50,
        folder: std::env::temp_dir().join("photoncard-hostile"),
    }
}

/// Runs as a reader. The arguments are kind, seed, first input, number of inputs, and folder.
fn read(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [kind, seed, first, inputs, folder] = arguments else { return Err("five arguments".into()) };
    let kind = Kind::of(kind).ok_or("no such kind")?;
    let [seed, first, inputs] = [seed.parse()?, first.parse()?, inputs.parse()?];
    read_batch(&Settings { seed, first, inputs, folder: folder.into(), ..defaults(kind) });
    Ok(())
}

fn settings(arguments: &[String]) -> Result<Settings, Box<dyn Error>> {
    let (kind, options) = arguments.split_first().ok_or("name a kind of files")?;
    let names = || format!("the kinds are {}", Kind::ALL.map(Kind::name).join(", "));
    let mut settings = defaults(Kind::of(kind).ok_or_else(names)?);
    for option in options.chunks(2) {
        let [name, value] = option else { return Err(format!("{option:?} needs a value").into()) };
        match name.as_str() {
            "--inputs" => settings.inputs = value.parse()?,
            "--seed" => settings.seed = value.parse()?,
            "--first" => settings.first = value.parse()?,
            "--batch" => settings.batch = value.parse()?,
            "--command" => settings.command = Some(PathBuf::from(value).canonicalize()?),
            "--every" => settings.every = value.parse()?,
            "--kilobytes" => settings.kilobytes = value.parse()?,
            "--folder" => settings.folder = value.into(),
            other => return Err(format!("{other} is no option").into()),
        }
    }
    Ok(settings)
}

fn line(kind: Kind, report: &Report, begun: Instant) -> String {
    let Report { inputs, sound, statuses, slowest: (longest, slowest), findings } = report;
    format!(
        "{}: {inputs} inputs, {sound} of them sound, in {:.0} s; at most {:.1} s (input {slowest}); the command ended with 0, 1, 2: \
         {statuses:?}; findings: {}",
        kind.name(),
        begun.elapsed().as_secs_f64(),
        longest.as_secs_f64(),
        findings.len(),
    )
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(("read", rest)) = arguments.split_first().map(|(first, rest)| (first.as_str(), rest)) {
        read(rest)?;
        return Ok(ExitCode::SUCCESS);
    }
    let settings = settings(&arguments)?;
    let begun = Instant::now();
    let tell = |report: &Report| eprintln!("{}", line(settings.kind, report, begun));
    let report = match settings.kind {
        Kind::Kept(files) => supervise_kept(&settings, files, &tell)?,
        _ => supervise(&std::env::current_exe()?, &settings, &tell)?,
    };
    println!("{}", line(settings.kind, &report, begun));
    for finding in &report.findings {
        println!("{}: input {} FAILS: {}", settings.kind.name(), finding.number, finding.what);
    }
    Ok(if report.findings.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
