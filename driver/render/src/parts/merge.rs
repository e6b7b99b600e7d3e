//! Merges parts into the whole picture.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use photoncard_picture::cryptomatte::Identities;
use photoncard_picture::film::Film;
use photoncard_picture::layer::Layers;
use photoncard_shared::message::Tile;
use serde_json::{Map, Value};

use super::dealing::{Part, deal};
use super::error::PartError;
use super::file::PartFile;
use super::head::PartHead;

/// Files of parts of one picture, in any order.
pub struct Parts {
    files: Vec<PartFile>,
    /// Patches of each part of the picture, whether or not its file is given.
    patches: BTreeMap<Part, Vec<Tile>>,
}

/// Picture merged from all parts.
pub struct Merged {
    /// Pixels of the picture.
    pub film: Film,
    /// Layers of the picture besides radiance.
    pub layers: Layers,
    /// True if the picture has alpha, and its radiance is premultiplied.
    pub is_transparent: bool,
    /// Names for the picture's mattes; `None` without mattes.
    pub identities: Option<Identities>,
    /// Provenance of the picture: everything that its pixels depend on.
    pub provenance: Map<String, Value>,
}

impl Parts {
    /// Reads the heads of parts, and checks that they are of one picture.
    ///
    /// # Errors
    /// If a file is not a part, is truncated or has a damaged head, or settings differ.
    pub fn open(paths: &[PathBuf]) -> Result<Self, PartError> {
        let mut this = Self { files: Vec::new(), patches: BTreeMap::new() };
        for path in paths {
            this.add(PartFile::open(path)?)?;
        }
        Ok(this)
    }

    fn add(&mut self, file: PartFile) -> Result<(), PartError> {
        match self.files.first() {
            Some(first) => check_alike(first, &file)?,
            None => {
                let count = file.head.part.count();
                self.patches = Part::all(count).map(|part| (part, Vec::new())).collect();
                for (part, patch) in deal(file.picture.window, count) {
                    self.patches.entry(part).or_default().push(patch);
                }
            }
        }
        file.check_length(self.patches_of(&file))?;
        self.files.push(file);
        Ok(())
    }

    fn patches_of(&self, file: &PartFile) -> &[Tile] {
        self.patches.get(&file.head.part).map_or(&[], |patches| patches)
    }

    /// Parts of the picture that none of the files contains.
    pub fn missing(&self) -> Vec<Part> {
        let found: BTreeSet<Part> = self.files.iter().map(|file| file.head.part).collect();
        self.patches.keys().filter(|part| !found.contains(part)).copied().collect()
    }

    /// Head of the first file; `None` if there are no files.
    pub fn any(&self) -> Option<&PartHead> {
        self.files.first().map(|file| &file.head)
    }

    /// Reads and checks the pixels of all files.
    ///
    /// # Errors
    /// If a file is damaged or unreadable.
    pub fn check_pixels(&self) -> Result<(), PartError> {
        self.files.iter().try_for_each(|file| file.read(self.patches_of(file), |_| Ok(())))
    }

    /// Merges the parts. Several files of the same part must have equal pixels.
    ///
    /// # Errors
    /// If parts are missing, a file is damaged, two files of a part differ, or there is no memory for the
    /// picture.
    pub fn merge(&self) -> Result<Merged, PartError> {
        let missing = self.missing();
        let first = self.files.first().filter(|_| missing.is_empty());
        let Some(PartFile { picture, head, .. }) = first else {
            return Err(PartError::Missing { count: self.patches.len() as u32, missing });
        };
        // The lengths of the files were checked: the film takes about as much memory as the files are long.
        let mut film = picture.film()?;
        let mut done: BTreeMap<Part, &PartFile> = BTreeMap::new();
        for file in &self.files {
            match done.get(&file.head.part) {
                Some(first) => compare(file, self.patches_of(file), &film, &first.path)?,
                None => take(file, self.patches_of(file), &mut film)?,
            }
            done.entry(file.head.part).or_insert(file);
        }
        let (layers, identities) = (picture.layers.clone(), head.identities.clone());
        let provenance = head.settings.clone();
        Ok(Merged { film, layers, is_transparent: head.is_transparent(), identities, provenance })
    }
}

/// Checks that two parts are of one picture.
fn check_alike(first: &PartFile, file: &PartFile) -> Result<(), PartError> {
    let names = [first, file].map(|file| file.path.display().to_string());
    let differences = first.head.differences(&file.head, [&names[0], &names[1]]);
    if differences.is_empty() { Ok(()) } else { Err(PartError::Differs { differences }) }
}

/// Writes the pixels of a part into the film.
fn take(file: &PartFile, patches: &[Tile], film: &mut Film) -> Result<(), PartError> {
    file.read(patches, |patch| patch.sums().try_for_each(|((x, y), sums)| Ok(film.write(x, y, &sums)?)))
}

/// Checks that a part has the same pixels as the film, which come from the file `first`.
fn compare(file: &PartFile, patches: &[Tile], film: &Film, first: &Path) -> Result<(), PartError> {
    file.read(patches, |patch| {
        let is_equal = film.finished(patch.tile()).is_some_and(|own| own.records() == patch.records());
        let unequal = || PartError::Unequal {
            part: file.head.part,
            first: first.to_owned(),
            second: file.path.clone(),
        };
        is_equal.then_some(()).ok_or_else(unequal)
    })
}
