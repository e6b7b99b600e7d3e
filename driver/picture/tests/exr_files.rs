//! `OpenEXR` files: a written film reads back unchanged, and damaged files are rejected.

use std::fs;
use std::path::Path;

use exr::prelude::{
    AttributeValue, Compression, Encoding, FlatSamples, Image, LayerAttributes, ReadChannels, ReadLayers,
    SpecificChannels, Vec2, WritableImage,
};
use photoncard_picture::cryptomatte::Identities;
use photoncard_picture::exr::{Content, ExrError, SampleFormat, Shown, bytes, is_intact, read, write};
use photoncard_picture::film::{
    Film, FilmPixel, PixelForm, PixelLayers, PixelSums, PixelValue, SumFormat, SumScale, Window,
};
use photoncard_picture::layer::Layers;
use photoncard_shared::message::{COVERAGE_STEPS, IdentityCoverage};
use proptest::prelude::{ProptestConfig, any, proptest};

const WINDOW: Window = Window { x0: 3, x1: 20, y0: 5, y1: 45 };

fn value(x: u32, y: u32) -> PixelValue {
    let (x, y) = (x as f32, y as f32);
    PixelValue {
        radiance: [x / 7.0, y / 3.0, 0.01 * x * y],
        albedo: [0.1, 0.2, 0.3],
        normal: [0.0, -1.0, 0.5],
        depth: 1000.0 + x / 1024.0,
    }
}

/// Format whose units suit the values of these tests.
const FORMAT: SumFormat = SumFormat {
    samples: 1,
    probes: 0,
    form: PixelForm::PLAIN,
    scale: SumScale { radiance: 1.0, depth: 1.0 / 1024.0 },
};

fn write_pixel(film: &mut Film, x: u32, y: u32, pixel: PixelValue, layers: PixelLayers) {
    let sums = film.format().sums(&FilmPixel { pixel, layers, ..FilmPixel::default() });
    film.write(x, y, &sums).unwrap();
}

fn film() -> Film {
    let mut film = Film::new(64, 48, WINDOW, FORMAT).unwrap();
    for y in WINDOW.y0..WINDOW.y1 {
        for x in WINDOW.x0..WINDOW.x1 {
            write_pixel(&mut film, x, y, value(x, y), PixelLayers::default());
        }
    }
    film
}

fn content<'a>(film: &'a Film, layers: &'a Layers) -> Content<'a> {
    Content::new(film, layers)
}

fn written(format: SampleFormat, provenance: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.exr");
    write(&path, &content(&film(), &Layers::default()), provenance, format).unwrap();
    (folder, path)
}

/// No byte of a file can be changed, added or removed without being detected.
#[test]
fn a_file_is_intact_only_as_it_was_written() {
    for format in [SampleFormat::Float, SampleFormat::Half] {
        // The provenance contains the same text as the attribute with the checksum.
        let (_folder, path) = written(format, r#"{"name": "photoncard checksum 00000000"}"#);
        let bytes = fs::read(&path).unwrap();
        assert!(is_intact(&path));
        let is_kept = |changed: &[u8]| {
            fs::write(&path, changed).unwrap();
            is_intact(&path)
        };
        for place in (0..bytes.len()).step_by(97).chain((0..600).step_by(5)) {
            let mut changed = bytes.clone();
            changed[place] ^= 1 << (place % 8);
            assert!(!is_kept(&changed), "byte {place}");
            assert!(!is_kept(&bytes[..place]), "the first {place} bytes");
        }
        assert!(!is_kept(&[&bytes[..], &[0]].concat()));
        assert!(is_kept(&bytes));
    }
    assert!(!is_intact(Path::new("absent.exr")));
}

#[test]
fn radiance_is_read_back_to_the_precision_of_the_format() {
    for (format, precision) in [(SampleFormat::Float, 0.0), (SampleFormat::Half, 1.0 / 2048.0)] {
        let (_folder, path) = written(format, "{}");
        let image = read(&path, Shown::Rendered).unwrap();
        assert_eq!((image.width, image.height, image.data_window_origin), (17, 40, [3, 5]));
        for (index, pixel) in image.pixels.iter().enumerate() {
            let written = film().pixel(3 + index as u32 % 17, 5 + index as u32 / 17).unwrap();
            let expected = written.radiance;
            for (read, expected) in pixel.iter().zip(expected) {
                assert!((read - expected).abs() <= precision * expected, "{format:?}: {read} {expected}");
            }
        }
    }
}

/// Writes a picture of 40 x 40 pixels with DWA compression. Returns its path and its bytes.
fn dwa(folder: &std::path::Path, compression: Compression) -> (std::path::PathBuf, Vec<u8>) {
    let path = folder.join("picture.exr");
    let channels = SpecificChannels::rgb(|Vec2(x, y)| {
        (x as f32 * 0.1, (y as f32 * 0.3).sin() + 1.5, if (x / 7 + y / 5) % 2 == 0 { 4.0_f32 } else { 0.5 })
    });
    let encoding = Encoding { compression, ..Encoding::default() };
    let layer = exr::prelude::Layer::new((40, 40), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().to_file(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    (path, bytes)
}

#[test]
fn pictures_with_dwa_compression_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for compression in [Compression::DWAA(None), Compression::DWAB(None)] {
        let (path, _) = dwa(folder.path(), compression);
        let picture = read(&path, Shown::Rendered).unwrap();
        for (index, pixel) in picture.pixels.iter().enumerate() {
            let (x, y) = (index % 40, index / 40);
            let blue = if (x / 7 + y / 5) % 2 == 0 { 4.0 } else { 0.5 };
            let expected = [x as f32 * 0.1, (y as f32 * 0.3).sin() + 1.5, blue];
            let is_near = |(found, expected): (&f32, f32)| (found - expected).abs() < 0.15;
            assert!(pixel.iter().zip(expected).all(is_near), "{compression}: {x} {y} {pixel:?}");
        }
    }
}

/// The decoder would allocate as much as a block states.
#[test]
fn dwa_blocks_that_state_impossible_sizes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for compression in [Compression::DWAA(None), Compression::DWAB(None)] {
        let (path, bytes) = dwa(folder.path(), compression);
        // The version of a block, the first of its counters, follows its coordinate and size.
        let start = (0..bytes.len() - 88).rev().find(|&at| {
            let counter = |index: usize| u64::from_le_bytes(bytes[at + 8 * index..][..8].try_into().unwrap());
            counter(0) == 2 && (1..11).all(|index| counter(index) < 1 << 20) && counter(8) > 0
        });
        let start = start.unwrap();
        for counter in [1, 6, 7, 8, 9] {
            for stated in [1_u64 << 30, 1 << 40, i64::MAX as u64] {
                let mut hostile = bytes.clone();
                hostile[start + 8 * counter..][..8].copy_from_slice(&stated.to_le_bytes());
                std::fs::write(&path, &hostile).unwrap();
                let error = read(&path, Shown::Rendered).unwrap_err();
                let is_refused =
                    matches!(&error, ExrError::Malformed { reason, .. } if reason.contains("more samples"));
                assert!(is_refused, "{compression} {counter} {stated}: {error}");
            }
        }
    }
}

#[test]
fn windows_channels_and_provenance_are_as_documented() {
    let (_folder, path) = written(SampleFormat::Half, r#"{"scene":"Küche 🍳"}"#);
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(&path)
        .unwrap();
    let display = image.attributes.display_window;
    assert_eq!((display.position, display.size), (Vec2(0, 0), Vec2(64, 48)));
    assert_eq!(image.layer_data.attributes.layer_position, Vec2(3, 5));
    assert_eq!(image.layer_data.size, Vec2(17, 40));
    assert_eq!(image.layer_data.attributes.layer_name, None);
    let channels: Vec<_> =
        image.layer_data.channel_data.list.iter().map(|channel| channel.name.to_string()).collect();
    assert_eq!(channels, ["B", "G", "N.X", "N.Y", "N.Z", "R", "Z", "albedo.B", "albedo.G", "albedo.R"]);
    let depth = &image.layer_data.channel_data.list[6].sample_data;
    assert_eq!(depth.value_by_flat_index(16).to_f32(), value(19, 5).depth);
    let custom: Vec<_> = image.attributes.other.iter().chain(&image.layer_data.attributes.other).collect();
    let [(name, attribute)] = custom[..] else { panic!("{custom:?}") };
    assert_eq!(name.to_string(), "photoncard");
    let exr::prelude::AttributeValue::Text(json) = attribute else { panic!("{attribute:?}") };
    let json: serde_json::Value = serde_json::from_str(&json.to_string()).unwrap();
    assert_eq!(json["scene"], "Küche 🍳");
}

/// Channels of a file: name, whether single precision, and values.
fn channels(path: &Path) -> Vec<(String, bool, Vec<f32>)> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .unwrap();
    let list = image.layer_data.channel_data.list.into_iter();
    list.map(|channel| {
        let is_single = matches!(channel.sample_data, FlatSamples::F32(_));
        (channel.name.to_string(), is_single, channel.sample_data.values_as_f32().collect())
    })
    .collect()
}

#[test]
fn requested_layers_are_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("layers.exr");
    let layers = PixelLayers {
        direct: [0.5, 1.0, 1.5],
        indirect: [2.0, 2.5, 3.0],
        caustic: [3.5, 4.0, 4.5],
        gathers: 2049.0,
    };
    let format = SumFormat { form: PixelForm::LAYERED, samples: 2100, ..FORMAT };
    let mut film = Film::new(1, 1, Window::full(1, 1), format).unwrap();
    write_pixel(&mut film, 0, 0, value(3, 5), layers);
    let written = |list: &str, format| {
        write(&path, &content(&film, &list.parse().unwrap()), "{}", format).unwrap();
        channels(&path)
    };
    for format in [SampleFormat::Half, SampleFormat::Float] {
        let is_float = format == SampleFormat::Float;
        let names = |list| written(list, format).into_iter().map(|(name, ..)| name).collect::<Vec<_>>();
        assert_eq!(names("none"), ["B", "G", "R"]);
        assert_eq!(
            names("N,direct"),
            ["B", "G", "N.X", "N.Y", "N.Z", "R", "direct.B", "direct.G", "direct.R"]
        );
        let all = written("all", format);
        assert_eq!(all.len(), 24);
        let channel = |name: &str| all.iter().find(|(other, ..)| other == name).unwrap();
        for (name, is_single, value) in [
            ("direct.R", is_float, 0.5),
            ("direct.B", is_float, 1.5),
            ("indirect.G", is_float, 2.5),
            ("caustic.R", is_float, 3.5),
            ("N.Y", is_float, -1.0),
            ("gathers.Y", true, 2049.0),
            ("Z", true, 1000.0 + 3.0 / 1024.0),
        ] {
            assert_eq!(*channel(name), (name.to_owned(), is_single, vec![value]));
        }
    }
}

#[test]
fn denoised_radiance_is_a_layer_beside_the_rendered_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("denoised.exr");
    let film = film();
    let denoised: Vec<_> = (0..film.pixels().len()).map(|index| [index as f32, 0.5, 2.0]).collect();
    let layers = Layers::NONE;
    let content = Content { denoised: Some(&denoised), ..content(&film, &layers) };
    write(&path, &content, "{}", SampleFormat::Float).unwrap();
    let found = channels(&path);
    let names: Vec<_> = found.iter().map(|(name, ..)| name.as_str()).collect();
    assert_eq!(names, ["B", "G", "R", "denoised.B", "denoised.G", "denoised.R"]);
    let expected: Vec<_> = denoised.iter().map(|[red, ..]| *red).collect();
    assert_eq!(found[5].2, expected);
    let rendered: Vec<_> = film.pixels().map(|pixel| pixel.radiance).collect();
    let read = |shown| read(&path, shown).unwrap().pixels;
    assert_eq!([read(Shown::Rendered), read(Shown::Denoised)], [rendered, denoised]);
}

#[test]
fn two_writes_give_the_same_bytes() {
    let provenance = format!(r#"{{"scene":"{}"}}"#, "a".repeat(3000));
    let (_first_folder, first) = written(SampleFormat::Half, &provenance);
    for _ in 0..4 {
        let (_folder, again) = written(SampleFormat::Half, &provenance);
        assert_eq!(fs::read(&first).unwrap(), fs::read(&again).unwrap());
    }
}

#[test]
fn a_bright_light_stays_finite_in_halves() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bright.exr");
    let scale = SumScale { radiance: 256.0, ..FORMAT.scale };
    let mut film = Film::new(2, 1, Window::full(2, 1), SumFormat { scale, ..FORMAT }).unwrap();
    for (x, radiance) in [[1e6, 65504.0, 65530.0], [1e9, 0.0, 1e-9]].into_iter().enumerate() {
        let pixel = PixelValue { radiance, ..PixelValue::default() };
        write_pixel(&mut film, x as u32, 0, pixel, PixelLayers::default());
    }
    write(&path, &content(&film, &Layers::default()), "{}", SampleFormat::Half).unwrap();
    let image = read(&path, Shown::Rendered).unwrap();
    assert_eq!(image.pixels, [[65504.0; 3], [65504.0, 0.0, 0.0]]);
}

#[test]
fn errors_name_the_bad_file() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(
        read(&folder.path().join("absent.exr"), Shown::Rendered),
        Err(ExrError::Unreadable { .. })
    ));
    assert!(matches!(read(folder.path(), Shown::Rendered), Err(ExrError::Unreadable { .. })));
    let path = folder.path().join("bad.exr");
    for bytes in [&b""[..], b"text", b"\x76\x2f\x31\x01", b"\x89PNG\r\n\x1a\n"] {
        fs::write(&path, bytes).unwrap();
        assert!(matches!(read(&path, Shown::Rendered), Err(ExrError::Malformed { .. })));
    }
    assert!(matches!(
        write(Path::new("absent/x.exr"), &content(&film(), &Layers::default()), "{}", SampleFormat::Half),
        Err(ExrError::Output(_))
    ));
    assert!(matches!(
        write(&path, &content(&film(), &Layers::default()), "", SampleFormat::Half),
        Err(ExrError::Encode { .. })
    ));
}

#[test]
fn a_picture_without_colour_channels_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grey.exr");
    let grey = exr::image::AnyChannel::new("Y", exr::image::FlatSamples::F32(vec![1.0; 4]));
    let mut list = exr::prelude::SmallVec::new();
    list.push(grey);
    let image = exr::image::Image::from_channels((2, 2), exr::image::AnyChannels::sort(list));
    exr::prelude::WritableImage::write(&image).to_file(&path).unwrap();
    let error = read(&path, Shown::Rendered).unwrap_err();
    assert!(matches!(error, ExrError::NoColour { .. }) && error.to_string().contains('Y'), "{error}");
}

/// The decoder must refuse a window whose pixels the file cannot hold before it allocates them.
#[test]
fn absurd_windows_are_refused() {
    let (_folder, path) = written(SampleFormat::Float, "{}");
    let whole = fs::read(&path).unwrap();
    let name = b"dataWindow\0box2i\0";
    let at = whole.windows(name.len()).position(|window| window == name).unwrap() + name.len() + 4;
    for (x1, y1) in
        [(1 << 29, 44), (19, 1 << 29), (1 << 14, 1 << 14), (i32::MAX, i32::MAX), (-1, 5), (3000, 4000)]
    {
        let mut bytes = whole.clone();
        bytes[at + 8..at + 12].copy_from_slice(&i32::to_le_bytes(x1));
        bytes[at + 12..at + 16].copy_from_slice(&i32::to_le_bytes(y1));
        fs::write(&path, &bytes).unwrap();
        assert!(read(&path, Shown::Rendered).is_err(), "{x1} {y1}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_are_read_or_refused(
        flips in proptest::collection::vec((any::<usize>(), any::<u8>(), any::<bool>()), 1..6),
        cut in any::<usize>(),
        is_cut in any::<bool>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.exr");
        let mut film = Film::new(12, 20, Window::full(12, 20), FORMAT).unwrap();
        write_pixel(&mut film, 1, 1, value(1, 1), PixelLayers::default());
        write(&path, &content(&film, &Layers::default()), "{}", SampleFormat::Half).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        for (at, value, in_header) in flips {
            // Half of the damage is in the header, which holds the sizes.
            let at = at % if in_header { bytes.len().min(700) } else { bytes.len() };
            bytes[at] ^= value;
        }
        if is_cut {
            bytes.truncate(cut % bytes.len());
        }
        fs::write(&path, &bytes).unwrap();
        drop(read(&path, Shown::Rendered));
    }
}

/// Film of three pixels with coverage by identity, and the names of the identities.
fn covered() -> (Film, Identities) {
    let form = PixelForm { position: true, coverage: true, identities: true, ..PixelForm::PLAIN };
    let format = SumFormat { form, samples: 2, ..FORMAT };
    let mut film = Film::new(3, 1, Window::full(3, 1), format).unwrap();
    for (x, shares) in (0..).zip([&[(0, 2)][..], &[(2, 1), (1, 0)], &[]]) {
        let mut identities = IdentityCoverage::NONE;
        shares.iter().for_each(|&(identity, share)| identities.add(identity, share * COVERAGE_STEPS));
        let sums = PixelSums {
            light: [1 << 40; 3],
            coverage: Some(identities.total()),
            identities: Some(identities),
            position: Some([3 << 16, 0, -1 << 16]),
            surfaces: shares.len() as u32,
            ..PixelSums::default()
        };
        film.write(x, 0, &sums).unwrap();
    }
    let [objects, materials] =
        [["chair", "tisch \"ü\""], ["wood", "steel"]].map(|names| names.map(str::to_owned).to_vec());
    (film, Identities::new(objects, materials, vec![[0, 0], [0, 1], [1, 1]]).unwrap())
}

/// Attributes of mattes are in a hash map while a file is encoded; in the file they are sorted.
#[test]
fn files_with_mattes_and_alpha_have_equal_bytes_and_are_read() {
    let (mut film, identities) = covered();
    film.set_origin([100.0, 0.0, 0.0]);
    let layers: Layers = "alpha,position,object,material".parse().unwrap();
    let content = Content { is_transparent: true, identities: Some(&identities), ..content(&film, &layers) };
    let path = std::path::Path::new("picture.exr");
    let encoded = || bytes(path, &content, "{\"spp\":2}", SampleFormat::Half).unwrap();
    let first = encoded();
    assert!((0..20).all(|_| encoded() == first));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.exr");
    std::fs::write(&path, &first).unwrap();
    assert!(is_intact(&path));
    let picture = read(&path, Shown::Rendered).unwrap();
    assert_eq!(picture.alpha, Some(vec![1.0, 0.5, 0.0]));
    assert_eq!(picture.provenance.as_deref(), Some("{\"spp\":2}"));
    let image = exr::prelude::read_all_flat_layers_from_file(&path).unwrap();
    let layer = &image.layer_data[0];
    let channel = |name: &str| {
        let found = layer.channel_data.list.iter().find(|channel| channel.name.eq(name)).unwrap();
        assert_eq!(
            matches!(found.sample_data, FlatSamples::F32(_)),
            name != "A" && name != "alpha.Y",
            "{name}"
        );
        found.sample_data.values_as_f32().collect::<Vec<f32>>()
    };
    assert_eq!(channel("alpha.Y"), [1.0, 0.5, 0.0]);
    assert_eq!(channel("P.X"), [100.0 + 3.0 / 1024.0, 100.0 + 1.5 / 1024.0, 0.0]);
    assert_eq!(channel("CryptoObject00.g"), [1.0, 0.5, 0.0]);
    assert_eq!(channel("CryptoMaterial00.g"), [1.0, 0.5, 0.0]);
    let [chair, table, none] = channel("CryptoObject00.r")[..] else { panic!("three pixels") };
    assert!(chair != table && chair.is_normal() && table.is_normal() && none == 0.0);
    assert_eq!(channel("CryptoObject05.a"), [0.0; 3]);
    let manifest = layer.attributes.other.iter().find(|&(name, _)| name.eq("cryptomatte/3ae39a5/manifest"));
    let Some((_, AttributeValue::Text(manifest))) = manifest else { panic!("there is a manifest") };
    let names: std::collections::BTreeMap<String, String> =
        serde_json::from_str(&manifest.to_string()).unwrap();
    assert_eq!(names["chair"], format!("{:08x}", chair.to_bits()));
    assert_eq!(names["tisch \"ü\""], format!("{:08x}", table.to_bits()));
}
