//! Fuzzing of files that begin with a head: parts of pictures, and prepared scenes. Half of the inputs have
//! correct checksums, as from an attacker.

use std::fs;
use std::path::{Path, PathBuf};

use photoncard_driver::cryptomatte::Identities;
use photoncard_driver::film::{Film, SumFormat, Window};
use photoncard_driver::layer::Layers;
use photoncard_driver::parts::{self, Part, PartError, PartHead, Parts};
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, PreparedScene, RenderSettings, Unobserved};
use photoncard_firmware::kind::REFERENCE;
use photoncard_shared::checksum::{Checksum, checksum};
use tempfile::TempDir;

use super::mutation;
use super::random::Random;
use super::target::{Target, write_anew};
use crate::everything::everything;

/// Maximum number of bytes in use for a small file. The file's head may state the largest picture, whose
/// patches take memory even if the file lacks them.
const BOUND: usize = 256 << 20;
/// Alignment of a prepared scene's lines in its file, bytes.
const PAGE: usize = 4096;
/// First bytes of a tile's record in the file of a part.
const TILE: &[u8] = b"\x89TILE";

/// Target for the files of one kind.
pub(super) struct Files {
    name: &'static str,
    seeds: Vec<Vec<u8>>,
    folder: TempDir,
    read: fn(&Path) -> bool,
}

impl Files {
    /// Creates the target for parts. The seeds are a part that is the whole picture, and one of three parts.
    pub(super) fn parts() -> Self {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let settings = settings();
        let window = Window::full(settings.picture.width, settings.picture.height);
        let layers: Layers = "albedo,position,object".parse().expect("layers");
        let format = SumFormat { form: layers.form(), ..SumFormat::ONE };
        let mut film = Film::new(window.x1, window.y1, window, format).expect("a film");
        film.set_origin([1.0, 2.0, 3.0]);
        let names = ["wall", "lamp"].map(str::to_owned);
        let identities = Identities::new(names.to_vec(), names.to_vec(), vec![[0, 0], [1, 1]]);
        for (x, y) in (0..window.y1).flat_map(|y| (0..window.x1).map(move |x| (x, y))) {
            film.write(x, y, &Default::default()).expect("a pixel of the film");
        }
        let written = |(number, count): (u32, u32)| {
            let part = Part::new(number, count).expect("a part");
            let command = vec!["render".to_owned()];
            let head =
                PartHead::new(part, &film, settings.of_pixels(), &layers, identities.as_ref(), command);
            let path = folder.path().join("part");
            parts::write(&path, &head, &film).expect("there is room for a part");
            fs::read(path).expect("a part")
        };
        let seeds = [(1, 1), (2, 3)].map(written).into();
        Self { name: "parts", seeds, folder, read: read_part }
    }

    /// Creates the target for prepared scenes. The seed has every kind of section.
    pub(super) fn prepared() -> Self {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let RenderSettings { photons, integrator, .. } = settings();
        let choose = |_: &_| Ok((photons.clone(), integrator.clone()));
        let scene = everything();
        let prepared =
            PreparedScene::new(&scene, &settings(), &[REFERENCE], &choose, Default::default(), &Unobserved);
        let path = folder.path().join("scene.card");
        prepared.expect("the scene is sound").write(&path).expect("there is room for a scene");
        Self { name: "prepared", seeds: vec![fs::read(path).expect("a scene")], folder, read: read_prepared }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("file")
    }
}

fn settings() -> RenderSettings {
    RenderSettings::default().with(|settings| {
        settings.picture = Picture { width: 20, height: 17, ..Picture::default() };
        settings.photons =
            PhotonMaps { count: 60, neighbors: 8, caustic_photons: Some(30), ..PhotonMaps::default() };
        settings.integrator = Integrator { gather_rays: 8, shadow_rays: 1, ..Integrator::default() };
    })
}

/// Reads a part, and merges the picture if this is its only part.
fn read_part(path: &Path) -> bool {
    match Parts::open(&[path.to_owned()]).and_then(|parts| parts.merge()) {
        Ok(merged) => {
            assert!(merged.film.is_complete());
            true
        }
        Err(error) => {
            let _ = error.to_string();
            matches!(error, PartError::Missing { .. })
        }
    }
}

fn read_prepared(path: &Path) -> bool {
    let settings = match PreparedScene::open(path) {
        Ok(prepared) => prepared.settings(RenderSettings::default()),
        Err(error) => {
            let _ = error.to_string();
            return false;
        }
    };
    // Settings may be invalid: a render would refuse them.
    let _ = settings.check();
    true
}

/// File with an edited head, and with correct checksums of the head and of tiles.
fn resigned(file: &[u8], page: usize, random: &mut Random) -> Vec<u8> {
    let mut lines = file.splitn(3, |&byte| byte == b'\n');
    let [title, head, rest] = [(); 3].map(|()| lines.next().unwrap_or_default().to_vec());
    let old = title.len() + head.len() + 2 + 4;
    let mut body = rest.get(4 + (old.next_multiple_of(page) - old)..).unwrap_or_default().to_vec();
    let mut text = head;
    mutation::edit_json(&mut text, random);
    text.retain(|&byte| byte != b'\n');
    let mut bytes = [&title[..], b"\n", &text, b"\n"].concat();
    let sum = checksum(&bytes).to_le_bytes();
    bytes.extend(sum);
    bytes.resize(bytes.len().next_multiple_of(page), 0);
    bind_tiles(&mut body, sum);
    [bytes, body].concat()
}

/// Recomputes the checksums of all tile records, which cover the head's checksum too.
fn bind_tiles(body: &mut [u8], head: [u8; 4]) {
    let starts: Vec<usize> = (0..body.len()).filter(|&place| body[place..].starts_with(TILE)).collect();
    let ends: Vec<usize> = starts.iter().skip(1).copied().chain([body.len()]).collect();
    for (start, end) in starts.into_iter().zip(ends) {
        if let Some((record, sum)) = body[start..end].split_last_chunk_mut() {
            let mut own = Checksum::default();
            own.update(&head);
            own.update(record);
            *sum = own.value().to_le_bytes();
        }
    }
}

impl Target for Files {
    fn name(&self) -> &'static str {
        self.name
    }

    fn allocation_bound(&self, input: usize) -> usize {
        BOUND + 8 * input
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut file = random.pick(&self.seeds).clone();
        let page = if self.name == "prepared" { PAGE } else { 1 };
        if random.once_in(2) {
            return resigned(&file, page, random);
        }
        mutation::edit_bytes(&mut file, &self.seeds, random);
        file
    }

    fn read(&self, input: &[u8]) -> bool {
        write_anew(&self.path(), input);
        (self.read)(&self.path())
    }
}
