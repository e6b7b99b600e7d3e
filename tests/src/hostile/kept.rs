//! Files that the command writes and reads again, damaged before it starts or while it runs.
//!
//! Scenes are so small that an input takes some hundredths of a second. The command must end with the picture
//! of undamaged files, or with an error message and without a picture. Damage with matching checksums would
//! make another valid file, and is not tested here.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::ops::Range;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::inputs::edit_window;
use super::supervisor::{ended, limited};
use super::{Finding, Kept, Kind, Report, Settings};
use crate::fuzz::{Random, mutation};

/// First bytes of a tile's record, in parts and in partial files.
const RECORD: &[u8] = b"\x89TILE";
/// Options of photons and rays with which a picture takes some milliseconds.
const LIGHT: &str = "--photons 200 --neighbors 10 --caustic-photons 0 --gather-rays 2 --shadow-rays 1 --spp 1 --adaptive off \
                     --irradiance-cache off";
/// Options of a picture with four tiles.
const PICTURE: &str = "--size 8x8 --tile 4 --card emulated:1 --threads 1 --quiet";

/// Bytes of each file in a folder, by name.
type Files = BTreeMap<String, Vec<u8>>;

/// Command line that reads kept files, and these files.
struct Work {
    arguments: String,
    kept: Files,
    /// Duration of the command on undamaged files.
    usual: Duration,
}

/// Command lines that read files of one kind, and the folder in which they run.
struct Bench<'s> {
    settings: &'s Settings,
    program: &'s Path,
    folder: PathBuf,
    works: Vec<Work>,
    /// Valid results: the pictures that each command line renders from its own undamaged files, from those of
    /// the other command line, and without files.
    right: Vec<Files>,
}

impl Kept {
    /// Suffixes of the files that may be damaged.
    fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Cards => &[".card"],
            Self::Parts => &[".part"],
            Self::Partials => &[".partial"],
            Self::Frames => &[".exr", ".png"],
        }
    }

    /// Command lines, of which the last reads the files that the others write.
    fn commands(self, seed: u32) -> Vec<String> {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes");
        let scene = format!("{root}/furnace.gltf");
        match self {
            Self::Cards => vec![
                format!("prepare {scene} -o a.card {LIGHT} --seed {seed} --quiet"),
                format!("render --prepared a.card -o a.exr -o a.png {PICTURE}"),
            ],
            Self::Parts => {
                let part = |part| {
                    format!("render {scene} -o {part}.part --part {part}/3 {LIGHT} {PICTURE} --seed {seed}")
                };
                let merge = "merge 1.part 2.part 3.part -o a.exr -o a.png".to_owned();
                [1, 2, 3].map(part).into_iter().chain([merge]).collect()
            }
            Self::Partials => {
                // The second command takes the numbers of photons and rays from the partial file.
                let render = format!("render {scene} -o a.exr --quality draft --neighbors 10 {PICTURE}");
                let (photons, samples) = (200 + 100 * seed, 4 >> seed);
                vec![
                    format!("{render} --photons {photons} --gather-rays 2 --spp 2 --keep-samples"),
                    format!("{render} --spp {samples} --resume"),
                ]
            }
            Self::Frames => {
                let scene = format!("{root}/cornell-moving.glb");
                let render = format!(
                    "render {scene} --frames 1-2 -o f.#.exr -o f.#.png {LIGHT} {PICTURE} --seed {seed}"
                );
                let resume = format!("{render} --resume");
                vec![render, resume]
            }
        }
    }
}

/// Runs the command on inputs: damaged files.
///
/// # Errors
/// If no command is stated or it cannot be started, if it fails on undamaged files, or if a file cannot be
/// written.
pub fn supervise(settings: &Settings, kind: Kept, tell: &dyn Fn(&Report)) -> io::Result<Report> {
    fs::create_dir_all(&settings.folder)?;
    let bench = Bench::new(settings, kind)?;
    let mut report = Report::default();
    for number in settings.first..settings.first + settings.inputs {
        let begun = Instant::now();
        match bench.run(number)? {
            Ok(status) => {
                report.sound += u64::from(status == 0);
                report.statuses[status] += 1;
            }
            Err(what) => report.findings.push(Finding { number, what }),
        }
        report.slowest = report.slowest.max((begun.elapsed(), number));
        report.inputs += 1;
        if report.inputs.is_multiple_of(settings.batch) {
            tell(&report);
        }
    }
    Ok(report)
}

impl<'s> Bench<'s> {
    fn new(settings: &'s Settings, kind: Kept) -> io::Result<Self> {
        let program = settings.command.as_deref().ok_or_else(|| io::Error::other("--command is missing"))?;
        let folder = settings.folder.join("work");
        fs::create_dir_all(&folder)?;
        let mut this = Self { settings, program, folder, works: Vec::new(), right: Vec::new() };
        for seed in [0, 1] {
            this.add(kind, seed)?;
        }
        // Damage may replace a file by the undamaged one of the other command line.
        let none = Files::new();
        for work in &this.works {
            for kept in this.works.iter().map(|work| &work.kept).chain([&none]) {
                this.fill(kept)?;
                let slow = || io::Error::other(format!("{} takes too long", work.arguments));
                if this.finish(this.start(&work.arguments)?)?.ok_or_else(slow)?.success() {
                    this.right.push(this.pictures()?);
                }
            }
        }
        Ok(this)
    }

    /// Adds a command line, and writes the files that it reads.
    fn add(&mut self, kind: Kept, seed: u32) -> io::Result<()> {
        self.fill(&Files::new())?;
        let mut commands = kind.commands(seed);
        let arguments = commands.pop().unwrap_or_default();
        for command in commands {
            self.done(&command)?;
        }
        let mut kept = self.files()?;
        kept.retain(|name, _| kind.endings().iter().any(|ending| name.ends_with(ending)));
        self.fill(&kept)?;
        let begun = Instant::now();
        self.done(&arguments)?;
        self.works.push(Work { arguments, kept, usual: begun.elapsed() });
        Ok(())
    }

    /// Runs a command, which must succeed.
    fn done(&self, arguments: &str) -> io::Result<()> {
        let status = self.finish(self.start(arguments)?)?;
        let failed = || io::Error::other(format!("{arguments}: {status:?} {}", self.said()));
        status.filter(ExitStatus::success).map(drop).ok_or_else(failed)
    }

    fn start(&self, arguments: &str) -> io::Result<Child> {
        let mut command: Command = limited(self.settings, self.program);
        command.args(arguments.split_whitespace()).current_dir(&self.folder);
        command.stderr(File::create(self.settings.folder.join("said"))?).spawn()
    }

    fn finish(&self, mut child: Child) -> io::Result<Option<ExitStatus>> {
        ended(&mut child, self.settings.patience)
    }

    /// Messages of the last command that ran.
    fn said(&self) -> String {
        fs::read(self.settings.folder.join("said"))
            .map_or(String::new(), |text| String::from_utf8_lossy(&text).into_owned())
    }

    /// Replaces all files of the folder by `files`.
    fn fill(&self, files: &Files) -> io::Result<()> {
        self.files()?.keys().try_for_each(|name| fs::remove_file(self.folder.join(name)))?;
        files.iter().try_for_each(|(name, bytes)| fs::write(self.folder.join(name), bytes))
    }

    fn files(&self) -> io::Result<Files> {
        let read = |entry: io::Result<fs::DirEntry>| {
            let entry = entry?;
            Ok((entry.file_name().to_string_lossy().into_owned(), fs::read(entry.path())?))
        };
        fs::read_dir(&self.folder)?.map(read).collect()
    }

    fn pictures(&self) -> io::Result<Files> {
        let mut files = self.files()?;
        files.retain(|name, _| name.ends_with(".exr") || name.ends_with(".png"));
        Ok(files)
    }

    /// Runs the command on input `number`. Returns the exit status, or a description of the finding.
    fn run(&self, number: u64) -> io::Result<Result<usize, String>> {
        let mut random = Random::new(self.settings.kind.name(), self.settings.seed, number);
        let work = random.pick(&self.works);
        let damaged = self.damaged(work, &mut random);
        let is_before = random.once_in(2);
        let mut pause = || work.usual.mul_f64(random.below(1000) as f64 / 1000.0);
        let pauses = [pause(), pause()];
        self.fill(&work.kept)?;
        if is_before {
            self.write_over(&damaged, &mut random)?;
        }
        let child = self.start(&work.arguments)?;
        if !is_before {
            sleep(pauses[0]);
            self.write_over(&damaged, &mut random)?;
            if random.once_in(4) {
                sleep(pauses[1]);
                self.write_over(&work.kept, &mut random)?;
            }
        }
        let status = self.finish(child)?;
        let mut judged = self.judge(work, status)?;
        // A frame's file that is damaged after this run has read or written it must be found by another run.
        let is_late = !is_before && self.settings.kind == Kind::Kept(Kept::Frames);
        if is_late && judged.is_err() && status.is_some_and(|status| status.success()) {
            let again = self.finish(self.start(&work.arguments)?)?;
            judged = self.judge(work, again)?;
        }
        if judged.is_err() {
            self.keep(number, &damaged)?;
        }
        let when = if is_before { "before" } else { "while" };
        Ok(judged.map_err(|what| format!("{:?} damaged {when} {}: {what}", damaged.keys(), work.arguments)))
    }

    /// One or two damaged files that a command line reads.
    fn damaged(&self, work: &Work, random: &mut Random) -> Files {
        let names: Vec<&String> = work.kept.keys().collect();
        let chosen = (0..=random.below(2)).map(|_| *random.pick(&names)).collect::<Vec<_>>();
        let damage = |name: &String| {
            let donors: Vec<&[u8]> = self
                .works
                .iter()
                .flat_map(|other| &other.kept)
                .filter(|(other, _)| *other == name || random.once_in(8))
                .map(|(_, bytes)| &**bytes)
                .collect();
            let mut bytes = work.kept[name].clone();
            for _ in 0..random.edits() {
                damage(&mut bytes, &donors, random);
            }
            (name.clone(), bytes)
        };
        chosen.into_iter().map(damage).collect()
    }

    /// Overwrites files in place, as `cp` and `rsync --inplace` do.
    fn write_over(&self, files: &Files, random: &mut Random) -> io::Result<()> {
        for (name, bytes) in files {
            let is_cut = random.once_in(2);
            match File::options().write(true).truncate(is_cut).open(self.folder.join(name)) {
                // The command has removed the file.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
                Ok(mut file) => {
                    file.write_all(bytes)?;
                    file.set_len(bytes.len() as u64)?;
                }
            }
        }
        Ok(())
    }

    fn judge(&self, work: &Work, status: Option<ExitStatus>) -> io::Result<Result<usize, String>> {
        let Some(status) = status else { return Ok(Err("it takes too long".to_owned())) };
        let (said, pictures) = (self.said(), self.pictures()?);
        Ok(match status.code() {
            _ if said.contains("panicked") => Err(format!("it panics: {said}")),
            Some(0) if self.right.contains(&pictures) => Ok(0),
            Some(0) => Err("it ends with another picture and status 0".to_owned()),
            Some(1 | 2) if said.trim().is_empty() => Err("it fails without a word".to_owned()),
            Some(code @ 1..=2) => match pictures.keys().find(|name| !work.kept.contains_key(*name)) {
                None => Ok(code as usize),
                Some(name) => Err(format!("it fails and leaves {name}: {said}")),
            },
            code => Err(format!("it ends with status {code:?}, signal {:?}: {said}", status.signal())),
        })
    }

    /// Stores the damaged files of a finding.
    fn keep(&self, number: u64, damaged: &Files) -> io::Result<()> {
        let name = format!("{}-{}-{number}", self.settings.kind.name(), self.settings.seed);
        let folder = self.settings.folder.join(name);
        fs::create_dir_all(&folder)?;
        damaged.iter().try_for_each(|(name, bytes)| fs::write(folder.join(name), bytes))
    }
}

/// Damages a file as faulty copies, disks and memory do. Ranges of `donors` may replace ranges of the file.
fn damage(bytes: &mut Vec<u8>, donors: &[&[u8]], random: &mut Random) {
    let length = bytes.len();
    match random.below(12) {
        0..=3 => edit_window(bytes, random),
        4..=5 => edit_head(bytes, random),
        6 => bytes.truncate(random.below(length)),
        7 => bytes.resize(length + random.below(5000), *random.pick(&[0, 0xff, b'\n'])),
        8 => bytes[block(length, random)].fill(0),
        9 => {
            let (one, other) = (block(length, random), block(length, random));
            let same = one.len().min(other.len());
            let copy = bytes[one.start..one.start + same].to_vec();
            bytes.copy_within(other.start..other.start + same, one.start);
            bytes[other.start..other.start + same].copy_from_slice(&copy);
        }
        10 => *bytes = random.pick(donors).to_vec(),
        _ => {
            let donor = random.pick(donors);
            let mut ends = [boundary(donor, random), boundary(donor, random)];
            ends.sort_unstable();
            let end = if random.once_in(2) { donor.len() } else { ends[1] };
            bytes.splice(ends[0].min(length)..end.min(length), donor[ends[0]..end].iter().copied());
        }
    }
}

/// Edits a JSON token in the first two lines, which are the file's head.
fn edit_head(bytes: &mut Vec<u8>, random: &mut Random) {
    let ends = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(place, _)| place);
    let end = ends.take(2).last().unwrap_or(bytes.len());
    let mut head = bytes[..end].to_vec();
    mutation::edit_json(&mut head, random);
    bytes.splice(..end, head);
}

/// Random aligned block of a file, of 16, 512 or 4096 bytes.
fn block(length: usize, random: &mut Random) -> Range<usize> {
    let size = *random.pick(&[16, 512, 4096]);
    let start = random.below(length.div_ceil(size)) * size;
    start.min(length)..(start + size).min(length)
}

/// Random position in a file at which a damaged file may continue as another one: the start of a block or of
/// a record.
fn boundary(bytes: &[u8], random: &mut Random) -> usize {
    let records: Vec<usize> = (0..bytes.len()).filter(|&place| bytes[place..].starts_with(RECORD)).collect();
    if records.is_empty() || random.once_in(2) {
        block(bytes.len(), random).start
    } else {
        *random.pick(&records)
    }
}
