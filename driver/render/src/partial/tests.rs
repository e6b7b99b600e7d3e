use std::fs::{self, TryLockError};
use std::path::Path;

use photoncard_picture::film::{SumFormat, Window};
use photoncard_picture::sink::pixel_positions;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{LayerSums, PIXEL_BYTES, PixelForm, PixelSums, Tile};
use serde_json::json;

use super::file::{FAMILY, check_lock, is_at};
use super::head::title;
use super::records::{CHECKSUM_BYTES, HEAD_BYTES, MAGIC};
use super::*;

const TILES: u32 = 6;
/// Size of a tile's record, bytes.
const RECORD_BYTES: usize = HEAD_BYTES + 12 * PIXEL_BYTES + CHECKSUM_BYTES;

fn film_of(samples: u32) -> Film {
    let format = SumFormat { samples, ..SumFormat::ONE };
    Film::new(4 * TILES, 3, Window::full(4 * TILES, 3), format).unwrap()
}

fn film() -> Film {
    film_of(1)
}

fn tile(id: u32) -> Tile {
    Tile { id, x: 4 * id, y: 0, width: 4, height: 3 }
}

/// Tile of black pixels.
fn blank(tile: &Tile) -> FinishedTile {
    let records = vec![0; PIXEL_BYTES * tile.pixels() as usize];
    FinishedTile::new(*tile, records, SumFormat::ONE, Counters::ZERO).unwrap()
}

/// Begins a render and asserts that no samples of an earlier one are complete.
fn begin_render(
    settings: &PartialSettings,
    identity: Value,
    film: &mut Film,
) -> Result<PartialRender, PartialError> {
    let (partial, base) = PartialRender::begin(settings, identity, film)?;
    assert!(base.is_none());
    Ok(partial)
}

fn partial(folder: &tempfile::TempDir, resume: bool) -> PartialSettings {
    PartialSettings { path: folder.path().join("partial"), resume }
}

/// Writes a file with all tiles. Returns its bytes.
fn written(folder: &tempfile::TempDir) -> Vec<u8> {
    let mut film = film();
    for (number, (x, y)) in
        pixel_positions(&Tile { id: 0, x: 0, y: 0, width: 4 * TILES, height: 3 }).enumerate()
    {
        film.write(x, y, &PixelSums { depth: number as i64, ..PixelSums::default() }).unwrap();
    }
    let settings = partial(folder, false);
    let partial = begin_render(&settings, json!({ "seed": 1 }), &mut film).unwrap();
    (0..TILES).for_each(|id| partial.put(&film.finished(&tile(id)).unwrap()));
    partial.check().unwrap();
    fs::read(settings.path).unwrap()
}

/// Numbers of the tiles that a resumed render takes over.
fn taken_over(folder: &tempfile::TempDir, bytes: &[u8]) -> Vec<u32> {
    let settings = partial(folder, true);
    fs::write(&settings.path, bytes).unwrap();
    let mut film = film();
    let partial = begin_render(&settings, json!({ "seed": 1 }), &mut film).unwrap();
    let taken: Vec<u32> = (0..TILES).filter(|&id| film.has(&tile(id))).collect();
    // Missing tiles are appended.
    for id in (0..TILES).filter(|id| !taken.contains(id)) {
        partial.put(&blank(&tile(id)));
    }
    drop(partial);
    let mut again = self::film();
    begin_render(&settings, json!({ "seed": 1 }), &mut again).unwrap();
    assert!((0..TILES).all(|id| again.has(&tile(id))));
    taken
}

#[test]
fn damage_loses_only_the_tile_that_it_hits() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = written(&folder);
    let start = bytes.len() - TILES as usize * RECORD_BYTES;
    assert_eq!(taken_over(&folder, &bytes), [0, 1, 2, 3, 4, 5]);
    for place in 0..RECORD_BYTES {
        let mut damaged = bytes.clone();
        damaged[start + 2 * RECORD_BYTES + place] ^= 0x81;
        assert_eq!(taken_over(&folder, &damaged), [0, 1, 3, 4, 5], "{place}");
    }
    // Lost and repeated bytes.
    let middle = start + 2 * RECORD_BYTES;
    for range in [middle + 30..middle + 50, middle..middle + 1, middle..middle + HEAD_BYTES] {
        let mut shorter = bytes.clone();
        shorter.drain(range.clone());
        assert_eq!(taken_over(&folder, &shorter), [0, 1, 3, 4, 5], "{range:?}");
        let twice = [&bytes[..range.end], &bytes[range.start..]].concat();
        let taken = taken_over(&folder, &twice);
        assert!([0, 1, 3, 4, 5].iter().all(|id| taken.contains(id)), "{range:?}: {taken:?}");
    }
    assert_eq!(taken_over(&folder, &bytes[..bytes.len() - 1]), [0, 1, 2, 3, 4]);
}

/// A tile that an outvoted card has rendered must not be taken over, unless another card has rendered it
/// again.
#[test]
fn revoked_tiles_are_struck_out_and_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let settings = partial(&folder, true);
    let begin = |film: &mut Film| begin_render(&settings, json!({ "seed": 1 }), film).unwrap();
    let of_depth = |id: u32, depth: i64| {
        let mut film = film();
        pixel_positions(&tile(id))
            .for_each(|(x, y)| film.write(x, y, &PixelSums { depth, ..PixelSums::default() }).unwrap());
        film.finished(&tile(id)).unwrap()
    };
    let render = begin(&mut film());
    (0..TILES).for_each(|id| render.put(&of_depth(id, 1)));
    [1, 4].iter().for_each(|&id| render.revoke(&tile(id)));
    render.put(&of_depth(4, 2));
    render.check().unwrap();
    drop(render);
    let mut again = film();
    let render = begin(&mut again);
    assert_eq!((0..TILES).filter(|&id| !again.has(&tile(id))).collect::<Vec<_>>(), [1]);
    let depth = |id: u32| again.sums_at(4 * id, 0).unwrap().depth;
    assert_eq!([depth(3), depth(4), depth(5)], [1, 2, 1]);
    // Tiles of the earlier render are not struck out.
    render.revoke(&tile(0));
    render.check().unwrap();
    assert!(render.holds_tiles());
}

#[test]
fn a_file_with_only_revoked_tiles_holds_none() {
    let folder = tempfile::tempdir().unwrap();
    let render = begin_render(&partial(&folder, false), json!({}), &mut film()).unwrap();
    render.put(&blank(&tile(0)));
    assert!(render.holds_tiles());
    render.revoke(&tile(0));
    assert!(!render.holds_tiles());
}

#[test]
fn the_later_record_of_a_tile_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = written(&folder);
    let mut film = film();
    for (x, y) in pixel_positions(&tile(1)) {
        film.write(x, y, &PixelSums { depth: -1, ..PixelSums::default() }).unwrap();
    }
    let (_, head) = encode(&json!({ "seed": 1 }));
    bytes.extend(record(&film.finished(&tile(1)).unwrap(), 0, head));
    let depth = |bytes: &[u8]| {
        let settings = partial(&folder, true);
        fs::write(&settings.path, bytes).unwrap();
        let mut film = self::film();
        begin_render(&settings, json!({ "seed": 1 }), &mut film).unwrap();
        assert!(film.is_complete());
        film.sums_at(5, 1).unwrap().depth
    };
    assert_eq!(depth(&bytes), -1);
    // A damaged tile is rendered again.
    *bytes.last_mut().unwrap() ^= 1;
    assert_eq!(depth(&bytes), 4 * i64::from(TILES) + 5);
}

#[test]
fn layers_survive_a_partial_render() {
    let folder = tempfile::tempdir().unwrap();
    let settings = partial(&folder, true);
    let with_layers = || {
        Film::new(4, 3, Window::full(4, 3), SumFormat { form: PixelForm::LAYERED, ..SumFormat::ONE }).unwrap()
    };
    let mut film = with_layers();
    for (number, (x, y)) in pixel_positions(&tile(0)).enumerate() {
        let view = PixelSums { depth: number as i64, ..PixelSums::default() };
        let layers = LayerSums { gathers: 2 * number as u32, ..LayerSums::default() };
        film.write(x, y, &view.with_layers(layers)).unwrap();
    }
    let partial = begin_render(&settings, json!({}), &mut film).unwrap();
    partial.put(&film.finished(&tile(0)).unwrap());
    drop(partial);
    let mut again = with_layers();
    begin_render(&settings, json!({}), &mut again).unwrap();
    assert!(again.is_complete());
    assert!(again.sums().eq(film.sums()));
}

#[test]
fn a_partial_file_is_locked_by_one_render() {
    let folder = tempfile::tempdir().unwrap();
    let [mut one, mut two, mut three] = [film(), film(), film()];
    let begin = |resume, film: &mut Film| begin_render(&partial(&folder, resume), json!({}), film);
    // Neither render has created the file yet.
    let (first, second) = (begin(false, &mut one).unwrap(), begin(false, &mut two).unwrap());
    for partial in [&first, &second] {
        partial.put(&blank(&tile(0)));
    }
    first.check().unwrap();
    assert!(matches!(second.check(), Err(PartialError::Busy { .. })));
    for resume in [false, true] {
        assert!(matches!(begin(resume, &mut three), Err(PartialError::Busy { .. })));
    }
    // The second render has not created the file: it belongs to the first.
    second.remove().unwrap();
    assert!(partial(&folder, false).path.exists());
    first.remove().unwrap();
    begin(false, &mut three).unwrap();
}

/// The file is appended with heads of records of the largest tiles, without pixels. The reader computes the
/// checksum of each in vain.
#[test]
fn a_hostile_file_is_read_quickly() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = written(&folder);
    let settings = partial(&folder, true);
    let side = 64_u32;
    let (width, height) = (4 * TILES + side, 2 * side);
    let wide = || Film::new(width, height, Window::full(width, height), SumFormat::ONE).unwrap();
    let sound = bytes.len() as u64;
    let place = [4 * TILES, side, side, side, 0, 1].map(u32::to_le_bytes).concat();
    bytes.extend([&MAGIC[..], &place].concat().repeat(3 << 16));
    fs::write(&settings.path, bytes).unwrap();
    let mut film = wide();
    let partial = begin_render(&settings, json!({ "seed": 1 }), &mut film).unwrap();
    assert!((0..TILES).all(|id| film.has(&tile(id))) && partial.holds_tiles());
    assert_eq!(fs::metadata(&settings.path).unwrap().len(), sound);
}

#[test]
fn a_truncated_head_holds_no_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = written(&folder);
    let head = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').nth(1).unwrap().0;
    let settings = partial(&folder, true);
    for length in [0, 1, FAMILY.len(), title().len() - 1, title().len(), title().len() + 1, head, head + 4] {
        fs::write(&settings.path, &bytes[..length]).unwrap();
        assert_eq!(settings.kept().unwrap(), None, "{length}");
        assert!(taken_over(&folder, &bytes[..length]).is_empty(), "{length}");
    }
    assert_eq!(taken_over(&folder, &bytes), [0, 1, 2, 3, 4, 5]);
    assert_eq!(settings.kept().unwrap().map(Value::Object), Some(json!({ "seed": 1 })));
    assert_eq!(partial(&folder, false).kept().unwrap(), None);
}

#[test]
fn a_file_whose_head_cannot_be_written_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    let path = partial(&folder, false).path;
    let mut film = film();
    let partial = begin_render(&partial(&folder, false), json!({}), &mut film).unwrap();
    fs::write(&path, b"").unwrap();
    // A file opened for reading only fails on writes, like a full disk.
    partial.lock().file = Some(File::open(&path).unwrap());
    partial.put(&blank(&tile(0)));
    assert!(matches!(partial.check(), Err(PartialError::File { .. })));
    assert!(!path.exists() && !partial.holds_tiles());
    // Once there is room again, the file is begun anew.
    partial.put(&blank(&tile(0)));
    partial.check().unwrap();
    assert!(partial.holds_tiles() && fs::read(&path).unwrap().starts_with(title().as_bytes()));
}

#[cfg(unix)]
#[test]
fn a_file_that_was_removed_is_not_at_its_path() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("partial");
    let file = File::create(&path).unwrap();
    assert!(is_at(&file, &path).unwrap());
    fs::remove_file(&path).unwrap();
    assert!(!is_at(&file, &path).unwrap());
    let other = File::create(&path).unwrap();
    assert!(!is_at(&file, &path).unwrap() && is_at(&other, &path).unwrap());
}

#[test]
fn a_render_works_where_the_system_refuses_locks() {
    let path = Path::new("partial");
    check_lock(path, &Err(TryLockError::Error(io::Error::other("no locks available")))).unwrap();
    assert!(check_lock(path, &Err(TryLockError::WouldBlock)).is_err());
}

/// A foreign file with the partial render's name must be refused and left unchanged.
#[test]
fn a_foreign_file_is_refused_and_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let path = partial(&folder, false).path;
    let long = "photoncard partial render of a room\n".repeat(100_000);
    for foreign in [
        "notes",
        "photoncard partial render of",
        "photoncard partial render 2x\n",
        "photoncard partial render 99999999999999\n",
        "\n",
        &long,
    ] {
        fs::write(&path, foreign).unwrap();
        for resume in [false, true] {
            let begun = begin_render(&partial(&folder, resume), json!({}), &mut film());
            assert!(matches!(begun, Err(PartialError::Foreign { .. })), "{foreign}");
        }
        assert_eq!(fs::read(&path).unwrap(), foreign.as_bytes());
    }
    // A foreign file that appears after the beginning is neither written nor removed.
    fs::remove_file(&path).unwrap();
    let film = &mut film();
    let begun = begin_render(&partial(&folder, false), json!({}), film).unwrap();
    fs::write(&path, "notes").unwrap();
    begun.put(&blank(&tile(0)));
    assert!(matches!(begun.check(), Err(PartialError::Foreign { .. })));
    begun.remove().unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"notes");
    // A foreign file that replaces a file that was begun is neither written nor removed.
    fs::remove_file(&path).unwrap();
    let begun = begin_render(&partial(&folder, false), json!({}), film).unwrap();
    begun.put(&blank(&tile(0)));
    begun.check().unwrap();
    #[cfg(unix)]
    {
        fs::write(folder.path().join("notes"), "notes").unwrap();
        fs::rename(folder.path().join("notes"), &path).unwrap();
        begun.remove().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"notes");
    }
}

/// Without `resume`, a file with tiles must be neither overwritten nor removed. It does not matter who wrote
/// it, nor when.
#[test]
fn finished_tiles_are_not_lost_without_resume() {
    let folder = tempfile::tempdir().unwrap();
    let settings = partial(&folder, false);
    let film = &mut film();
    // The file appears after the render has begun.
    let begun = begin_render(&settings, json!({ "seed": 1 }), film).unwrap();
    let bytes = written(&folder);
    begun.put(&blank(&tile(0)));
    assert!(matches!(begun.check(), Err(PartialError::Unfinished { .. })));
    begun.remove().unwrap();
    for identity in [json!({ "seed": 1 }), json!({ "seed": 2 })] {
        assert!(matches!(settings.check_free(), Err(PartialError::Unfinished { .. })));
        let begun = begin_render(&settings, identity, film);
        assert!(matches!(begun, Err(PartialError::Unfinished { .. })));
    }
    assert!(fs::read(&settings.path).unwrap() == bytes);
    partial(&folder, true).check_free().unwrap();
    let head = bytes.len() - TILES as usize * RECORD_BYTES;
    for length in [0, 10, head, head + MAGIC.len() - 1] {
        fs::write(&settings.path, &bytes[..length]).unwrap();
        settings.check_free().unwrap();
    }
}

/// A file that replaces the one being read belongs to another picture, and must be refused.
#[test]
fn a_file_that_changes_while_it_is_read_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = written(&folder);
    let settings = partial(&folder, true);
    let render = begin_render(&settings, json!({ "seed": 1 }), &mut film()).unwrap();
    let file = File::open(&settings.path).unwrap();
    let mut reader = BufReader::new(&file);
    let head = read_head(&mut reader, &settings.path).unwrap().unwrap();
    render.check_unchanged(&mut reader, &head).unwrap();
    let [(own, _), (other, _)] =
        [json!({ "seed": 1 }), json!({ "seed": 2 })].map(|settings| encode(&settings));
    assert!(bytes.starts_with(&own));
    for changed in [&other[..], &bytes[..20], b"notes"] {
        fs::write(&settings.path, changed).unwrap();
        assert!(render.check_unchanged(&mut reader, &head).is_err());
    }
}

/// The file of another picture overwrites the file of a running render, which must then append no tiles.
#[test]
fn an_overwritten_file_gets_no_more_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = written(&folder);
    let settings = partial(&folder, true);
    let (other, _) = encode(&json!({ "seed": 2 }));
    for changed in [&other[..], &bytes[..20]] {
        fs::write(&settings.path, &bytes).unwrap();
        let render = begin_render(&settings, json!({ "seed": 1 }), &mut film()).unwrap();
        fs::write(&settings.path, changed).unwrap();
        render.put(&blank(&tile(0)));
        assert!(matches!(render.check(), Err(PartialError::Differs { .. })));
        assert!(fs::read(&settings.path).unwrap() == changed);
    }
}

/// A resumed render takes unstated settings from the file. With a damaged number, the picture would mix two
/// settings.
#[test]
fn damaged_settings_are_refused_and_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = written(&folder);
    let (head, _) = encode(&json!({ "seed": 1 }));
    for place in title().len()..head.len() {
        let mut damaged = bytes.clone();
        damaged[place] ^= 1;
        for resume in [false, true] {
            let settings = partial(&folder, resume);
            fs::write(&settings.path, &damaged).unwrap();
            let begun = begin_render(&settings, json!({ "seed": 1 }), &mut film());
            assert!(matches!(begun, Err(PartialError::Damaged { .. })), "{place}");
            assert!(!resume || settings.kept().is_err(), "{place}");
            assert!(settings.check_free().is_err() != resume, "{place}");
            assert!(fs::read(&settings.path).unwrap() == damaged);
        }
    }
}

/// Copying the file of another picture over this one was interrupted. The file then has the settings of the
/// other picture, and tiles of both.
#[test]
fn tiles_of_another_picture_are_not_taken_over() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = written(&folder);
    let [(own, sum), (other, _)] =
        [json!({ "seed": 1 }), json!({ "seed": 2 })].map(|settings| encode(&settings));
    let tiles = &bytes[own.len()..];
    let path = partial(&folder, true).path;
    fs::write(&path, [&other, tiles].concat()).unwrap();
    let mut film = film();
    let render = begin_render(&partial(&folder, true), json!({ "seed": 2 }), &mut film).unwrap();
    assert!(!render.holds_tiles() && (0..TILES).all(|id| !film.has(&tile(id))));
    drop(render);
    let added = record(&blank(&tile(0)), 0, sum ^ 1);
    assert_eq!(taken_over(&folder, &[&own, &added, &tiles[RECORD_BYTES..]].concat()), [1, 2, 3, 4, 5]);
}

#[test]
fn another_version_is_reported_and_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let path = partial(&folder, false).path;
    let old = b"photoncard partial render 1\n{}\nsomething";
    fs::write(&path, old).unwrap();
    let film = &mut film();
    for resume in [false, true] {
        let begun = begin_render(&partial(&folder, resume), json!({}), film);
        assert!(matches!(begun, Err(PartialError::Version { found: 1, .. })));
    }
    assert_eq!(fs::read(&path).unwrap(), old);
}

/// Links can lead to other people's files, and a pipe would block. Neither may be opened.
#[cfg(unix)]
#[test]
fn links_and_pipes_are_refused_and_unchanged() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let path = partial(&folder, false).path;
    let own = folder.path().join("own");
    // Links are refused even if the target is a partial render.
    let bytes = written(&folder);
    fs::rename(&path, &own).unwrap();
    let make_pipe = || Ok(rustix::fs::mkfifoat(rustix::fs::CWD, &path, rustix::fs::Mode::RWXU)?);
    let cases: [(&str, &dyn Fn() -> io::Result<()>); 5] = [
        ("symbolic link", &|| symlink(&own, &path)),
        ("symbolic link", &|| symlink("absent", &path)),
        ("file with other hard links", &|| fs::hard_link(&own, &path)),
        ("named pipe", &make_pipe),
        ("folder", &|| fs::create_dir(&path)),
    ];
    for (expected, make) in cases {
        make().unwrap();
        for resume in [false, true] {
            let begun = begin_render(&partial(&folder, resume), json!({ "seed": 1 }), &mut film());
            assert!(
                matches!(begun, Err(PartialError::NotAFile { kind, .. }) if kind == expected),
                "{expected}"
            );
        }
        assert_eq!(fs::read(&own).unwrap(), bytes);
        assert!(fs::remove_file(&path).or_else(|_| fs::remove_dir(&path)).is_ok(), "{expected}");
    }
    assert!(!folder.path().join("absent").exists());
}
