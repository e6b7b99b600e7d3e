//! Parts of a study, which machines measure independently, and their union.
//!
//! The points of a study are dealt to parts by the points alone. A part measures its share, and then writes
//! the record [`RECORD`] beside them: the command, the versions, and the checksums of the scenes that it has
//! measured. [`unite`] compares the records, and [`UnitedPoints`] copies the points of all parts into one
//! folder, from which a run of the same command writes the report without measuring anything.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use miette::Diagnostic;
use photoncard_picture::output;
use photoncard_picture::printable::shell_word;
use photoncard_render::PROGRAM;
use photoncard_render::parts::Part;
use photoncard_shared::image::LAYOUT_VERSION;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::point::{ImageKey, Point};
use super::report::Provenance;
use super::store::{POINTS, StoreError};

/// Name of the file that a part writes when all of its points are finished.
pub const RECORD: &str = "part.json";

/// Maximum number of threads in a record.
const MAX_THREADS: usize = 1024;

/// Extent of a run of studies.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Extent {
    /// All points are measured, and reports are written.
    #[default]
    Whole,
    /// The share of a part is measured. `command` has the arguments of the study without those of its output.
    Part {
        /// Part to measure.
        part: Part,
        /// Arguments that state the study.
        command: Vec<String>,
    },
    /// No point is measured: those of all parts are in the folder. Reports are written.
    Merged(Union),
}

/// Union of the parts of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Union {
    /// Arguments that state the study.
    pub command: Vec<String>,
    /// Number of threads of the first part, of which the times of the host's work are.
    pub threads: usize,
    /// Newest date of a part.
    pub date: String,
    /// Hosts of the parts.
    pub host: String,
    /// Checksum of each scene, by name.
    pub(crate) scenes: BTreeMap<String, String>,
    /// Number of parts.
    pub(crate) parts: u32,
}

/// Contents of [`RECORD`].
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
struct Record {
    command: Vec<String>,
    part: u32,
    parts: u32,
    program: String,
    layout: u32,
    scenes: BTreeMap<String, String>,
    threads: usize,
    date: String,
    host: String,
}

/// Error of parts that cannot be united.
#[derive(Debug, Error, Diagnostic)]
pub enum PartError {
    /// A folder has no record.
    #[error("{} is no finished part of a study: {reason}", folder.display())]
    #[diagnostic(help("measure it by `photoncard study ... --part K/N --out {}`", folder.display()))]
    NoRecord {
        /// Folder of the part.
        folder: PathBuf,
        /// Reason, such as a missing file.
        reason: String,
    },
    /// Another version of the program has measured a part.
    #[error("{} was measured by {program}, card image layout {layout}; this is {PROGRAM}, layout {LAYOUT_VERSION}", folder.display())]
    #[diagnostic(help("merge with that version, or measure all parts with this one"))]
    OtherVersion {
        /// Folder of the part.
        folder: PathBuf,
        /// Version that has measured the part.
        program: String,
        /// Its card image layout.
        layout: u32,
    },
    /// Two parts are of different studies.
    #[error("{} and {} are of different studies:\n  {}\n  {}", first.display(), other.display(), of_first, of_other)]
    #[diagnostic(help("merge folders of one study, whose commands differ in --part and --out alone"))]
    OtherStudy {
        /// Folder of the first part.
        first: PathBuf,
        /// Folder of the other part.
        other: PathBuf,
        /// Command of the first part, with its number of parts.
        of_first: String,
        /// Command of the other part, with its number of parts.
        of_other: String,
    },
    /// A scene has another content than the scene that a part has measured.
    #[error("the scene {scene} is not the one that the parts have measured")]
    #[diagnostic(help("merge where the scene of the parts is, or measure all parts with this one"))]
    OtherScene {
        /// Name of the scene.
        scene: String,
    },
    /// A part is missing.
    #[error("part {part} of {command} is missing")]
    #[diagnostic(help("measure it by `{command} --part {part} --out DIR`, and merge with its folder"))]
    MissingPart {
        /// The part.
        part: String,
        /// Command of the parts.
        command: String,
    },
    /// A point of a part is missing or damaged.
    #[error("the point {point} of part {part} {reason}")]
    #[diagnostic(help(
        "measure the part again: a command with --part measures what is missing in its folder"
    ))]
    MissingPoint {
        /// Name of the point.
        point: String,
        /// Part that measures it.
        part: String,
        /// Reason, such as that it is missing.
        reason: String,
    },
    /// A file cannot be written.
    #[error("{0}")]
    #[diagnostic(help("choose another folder with --out, or make room in it"))]
    Store(#[from] StoreError),
}

/// Writes the record of a finished part. `scenes` has the checksum of each scene that was read.
pub(crate) fn write_record(
    folder: &Path,
    (part, command): (Part, &[String]),
    scenes: BTreeMap<String, String>,
    threads: usize,
    provenance: &Provenance,
) -> Result<(), StoreError> {
    let record = Record {
        command: command.to_owned(),
        part: part.number(),
        parts: part.count(),
        program: PROGRAM.to_owned(),
        layout: u32::from(LAYOUT_VERSION),
        scenes,
        threads,
        date: provenance.date.clone(),
        host: provenance.host.clone(),
    };
    let json = serde_json::to_string_pretty(&record)
        .map_err(|source| StoreError::NotJson { name: RECORD.to_owned(), source })?;
    Ok(output::write(&folder.join(RECORD), format!("{json}\n").as_bytes())?)
}

/// Checks that the folders hold all parts of one study.
///
/// # Errors
/// If a folder has no record, the parts are of several versions, studies or scenes, or a part is missing.
pub fn unite(folders: &[PathBuf]) -> Result<Union, PartError> {
    let records: Vec<Record> = folders.iter().map(|folder| read(folder)).collect::<Result<_, _>>()?;
    union(folders, &records)
}

/// Points of parts in one folder. Unless they are [kept](Self::keep), a folder of points that was made for
/// them is removed when they are dropped.
#[derive(Debug)]
pub struct UnitedPoints {
    new_folder: Option<PathBuf>,
}

impl UnitedPoints {
    /// Copies the points of the folders of parts into `out`.
    ///
    /// # Errors
    /// If a folder has no points, or a file cannot be written.
    pub fn copy(folders: &[PathBuf], out: &Path) -> Result<Self, PartError> {
        let target = out.join(POINTS);
        let points = Self { new_folder: (!target.exists()).then(|| target.clone()) };
        fs::create_dir_all(&target)
            .map_err(|source| StoreError::Folder { folder: target.clone(), source })?;
        for folder in folders {
            copy(&folder.join(POINTS), &target)
                .map_err(|reason| PartError::NoRecord { folder: folder.clone(), reason })??;
        }
        Ok(points)
    }

    /// Keeps the points, from which the reports were written.
    pub fn keep(mut self) {
        self.new_folder = None;
    }
}

impl Drop for UnitedPoints {
    fn drop(&mut self) {
        if let Some(folder) = &self.new_folder {
            // The reason for which the points are dropped is reported.
            let _ = fs::remove_dir_all(folder);
        }
    }
}

fn read(folder: &Path) -> Result<Record, PartError> {
    let refused = |reason| PartError::NoRecord { folder: folder.to_owned(), reason };
    let path = folder.join(RECORD);
    if !path.is_file() {
        return Err(refused(format!("it has no file {RECORD}")));
    }
    let bytes = fs::read(&path).map_err(|error| refused(format!("{RECORD} cannot be read ({error})")))?;
    let damaged = |reason: String| refused(format!("{RECORD} is damaged ({reason})"));
    let record: Record = serde_json::from_slice(&bytes).map_err(|error| damaged(error.to_string()))?;
    if Part::new(record.part, record.parts).is_none() {
        return Err(damaged(format!("there is no part {}/{}", record.part, record.parts)));
    }
    if !(1..=MAX_THREADS).contains(&record.threads) {
        return Err(damaged(format!("it states {} threads", record.threads)));
    }
    Ok(record)
}

/// Union of the parts with these records.
fn union(folders: &[PathBuf], records: &[Record]) -> Result<Union, PartError> {
    let ([first, ..], [first_folder, ..]) = (records, folders) else {
        return Err(PartError::NoRecord { folder: PathBuf::new(), reason: "no folder is stated".to_owned() });
    };
    let mut scenes = BTreeMap::new();
    for (record, folder) in records.iter().zip(folders) {
        if (record.program.as_str(), record.layout) != (PROGRAM, u32::from(LAYOUT_VERSION)) {
            let (program, layout) = (record.program.clone(), record.layout);
            return Err(PartError::OtherVersion { folder: folder.clone(), program, layout });
        }
        if (&record.command, record.parts) != (&first.command, first.parts) {
            let (first_folder, folder) = (first_folder.clone(), folder.clone());
            let [of_first, of_other] =
                [first, record].map(|record| format!("{} in {} parts", record.line(), record.parts));
            return Err(PartError::OtherStudy { first: first_folder, other: folder, of_first, of_other });
        }
        for (name, checksum) in &record.scenes {
            if scenes.insert(name.clone(), checksum.clone()).is_some_and(|other| other != *checksum) {
                return Err(PartError::OtherScene { scene: name.clone() });
            }
        }
    }
    let missing = (1..=first.parts).find(|&part| records.iter().all(|record| record.part != part));
    if let Some(part) = missing {
        let part = format!("{part}/{}", first.parts);
        return Err(PartError::MissingPart { part, command: first.line() });
    }
    let hosts: BTreeSet<&str> = records.iter().map(|record| record.host.as_str()).collect();
    let dates = records.iter().map(|record| record.date.as_str());
    let of_first_part = records.iter().find(|record| record.part == 1).unwrap_or(first);
    Ok(Union {
        command: first.command.clone(),
        threads: of_first_part.threads,
        date: dates.max().unwrap_or_default().to_owned(),
        host: hosts.into_iter().collect::<Vec<_>>().join("; "),
        scenes,
        parts: first.parts,
    })
}

impl Record {
    /// Command of the part, quoted for a shell.
    fn line(&self) -> String {
        let words = self.command.iter().map(|word| shell_word(word));
        std::iter::once("photoncard".into()).chain(words).collect::<Vec<_>>().join(" ")
    }
}

/// Copies the files of a folder of points. The outer error says why the folder cannot be read.
fn copy(from: &Path, to: &Path) -> Result<Result<(), StoreError>, String> {
    let unreadable = |error: std::io::Error| format!("its points cannot be read ({error})");
    for entry in fs::read_dir(from).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let is_point = path.is_file() && path.extension().is_some_and(|ending| ending == "json");
        let (Some(name), true) = (path.file_name(), is_point) else { continue };
        let bytes = fs::read(&path).map_err(unreadable)?;
        if let Err(error) = output::write(&to.join(name), &bytes) {
            return Ok(Err(error.into()));
        }
    }
    Ok(Ok(()))
}

/// Deals points to `count` parts: the number of each point's part, from 1. If there are as many card images
/// as parts, all points of an image are in one part, so that its photons are traced once; otherwise
/// neighbouring points are in different parts, so that all parts take about the same time.
pub(crate) fn deal(points: &[Point], count: u32) -> Vec<u32> {
    let mut images: Vec<ImageKey> = Vec::new();
    let image_of: Vec<usize> = points
        .iter()
        .map(|point| {
            let key = point.image_key();
            images.iter().position(|other| *other == key).unwrap_or_else(|| {
                images.push(key);
                images.len() - 1
            })
        })
        .collect();
    let by_image = images.len() >= count as usize;
    let dealt = image_of.iter().enumerate();
    dealt.map(|(index, &image)| (if by_image { image } else { index } as u32) % count + 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scale::Scale;
    use photoncard_cards::scheduler::GatherOrder;

    /// Points of `images` card images with `each` queues.
    fn points(images: u32, each: u32) -> Vec<Point> {
        let point = |image: u32, queue: u32| {
            let settings = Scale::QUICK.settings(GatherOrder::Sort).with(|s| {
                s.integrator.seed = image;
                s.schedule.queue = Some(queue + 1);
            });
            Scale::QUICK.traffic("cornell.gltf", settings)
        };
        (0..images).flat_map(|image| (0..each).map(move |queue| point(image, queue))).collect()
    }

    #[test]
    fn each_point_is_in_one_part_and_parts_are_of_about_equal_size() {
        for (images, each, count) in [(1, 8, 3), (5, 2, 3), (2, 5, 4), (1, 1, 5), (4, 4, 1)] {
            let dealt = deal(&points(images, each), count);
            assert_eq!(dealt.len() as u32, images * each);
            let sizes: Vec<_> =
                (1..=count).map(|part| dealt.iter().filter(|&&other| other == part).count() as u32).collect();
            assert_eq!(sizes.iter().sum::<u32>(), images * each);
            let unit = if images >= count { each } else { 1 };
            assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= unit, "{sizes:?}");
        }
    }

    #[test]
    fn an_image_is_of_one_part_if_there_are_enough_images() {
        let points = points(4, 3);
        let dealt = deal(&points, 3);
        for (point, part) in points.iter().zip(&dealt) {
            let sharing =
                points.iter().zip(&dealt).filter(|(other, _)| other.image_key() == point.image_key());
            assert!(sharing.map(|(_, other)| other).all(|other| other == part));
        }
    }

    fn record(part: u32) -> Record {
        Record {
            command: vec!["study".to_owned(), "sweep".to_owned()],
            part,
            parts: 2,
            program: PROGRAM.to_owned(),
            layout: u32::from(LAYOUT_VERSION),
            scenes: BTreeMap::from([("a.glb".to_owned(), "1".to_owned())]),
            threads: part as usize,
            date: format!("2007-05-0{part}"),
            host: format!("host {part}"),
        }
    }

    #[test]
    fn parts_of_one_study_are_united_in_any_order() {
        let folders = ["b", "a"].map(PathBuf::from);
        let united = union(&folders, &[record(2), record(1)]).unwrap();
        assert_eq!((united.threads, united.date.as_str()), (1, "2007-05-02"));
        assert_eq!(united.host, "host 1; host 2");
    }

    #[test]
    fn parts_that_differ_are_refused_with_their_folders() {
        let folders = ["first", "second"].map(PathBuf::from);
        let mut others: Vec<(Record, &[&str])> = vec![
            (Record { program: "photoncard 0.0.9".to_owned(), ..record(2) }, &["second", "photoncard 0.0.9"]),
            (Record { layout: 1, ..record(2) }, &["second", "layout 1"]),
            (
                Record { command: vec!["study".to_owned()], ..record(2) },
                &["first", "second", "study sweep in 2"],
            ),
            (Record { parts: 3, ..record(2) }, &["first", "second", "in 3 parts"]),
            (record(1), &["part 2/2", "photoncard study sweep"]),
        ];
        let other_scene = BTreeMap::from([("a.glb".to_owned(), "2".to_owned())]);
        others.push((Record { scenes: other_scene, ..record(2) }, &["a.glb"]));
        for (other, words) in others {
            let said = union(&folders, &[record(1), other]).unwrap_err().to_string();
            assert!(words.iter().all(|word| said.contains(word)), "{said}");
        }
    }
}
