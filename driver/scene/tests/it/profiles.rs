//! Photometric files: intensities, flux, symmetries, and what is refused.

use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

use glam::Vec3;
use photoncard_firmware::scene::light::environment_coordinates;
use photoncard_scene::error::SceneError;
use photoncard_scene::{LightProfile, PunctualKind, PunctualLight, Scene};
use proptest::prelude::*;
use serde_json::{Value, json};

use crate::support::{add_node, load_changed};

/// Angles and intensities of a file of LM-63.
struct Table {
    kind: u8,
    horizontal: Vec<f64>,
    vertical: Vec<f64>,
    /// Intensity by horizontal and vertical angle.
    candelas: Box<dyn Fn(f64, f64) -> f64>,
}

fn range(first: f64, last: f64, step: f64) -> Vec<f64> {
    let count = ((last - first) / step).round() as u32;
    (0..=count).map(|index| first + f64::from(index) * step).collect()
}

impl Table {
    fn text(&self) -> String {
        let Self { kind, horizontal, vertical, candelas } = self;
        let (rows, planes) = (vertical.len(), horizontal.len());
        let mut text = format!(
            "IESNA:LM-63-2002\n[TEST] of photoncard\nTILT=NONE\n1 1000 2.5 {rows} {planes} {kind} 2 0.1 0.2 0\n0.8 1 40\n"
        );
        let mut line = |numbers: Vec<f64>| {
            numbers.iter().for_each(|number| write!(text, "{number} ").unwrap());
            text.push('\n');
        };
        line(vertical.clone());
        line(horizontal.clone());
        for &plane in horizontal {
            line(vertical.iter().map(|&angle| candelas(plane, angle)).collect());
        }
        text
    }

    fn profile(&self) -> LightProfile {
        profile(&self.text()).unwrap()
    }
}

fn profile(text: &str) -> Result<LightProfile, SceneError> {
    LightProfile::parse(text.as_bytes(), Path::new("lamp.ies"))
}

/// Intensity of a profile at C and gamma, degrees, as a chip reads it.
fn intensity(profile: &LightProfile, c: f64, gamma: f64) -> f64 {
    let (c, gamma) = (c.to_radians() as f32, gamma.to_radians() as f32);
    let local = Vec3::new(gamma.sin() * c.sin(), gamma.cos(), -gamma.sin() * c.cos());
    let [u, v] = environment_coordinates(local);
    let [[a, _], [_, d]] = profile.texture.matrix;
    let [x, y] = profile.texture.offset;
    let size = [profile.image.width, profile.image.height];
    let place = [a * u + x, d * v + y];
    let at = |axis: usize| f64::from(place[axis]) * f64::from(size[axis]) - 0.5;
    let (column, row) = (at(0).rem_euclid(f64::from(size[0])), at(1).clamp(0.0, f64::from(size[1] - 1)));
    let texel = |column: f64, row: f64| {
        let column = column as u32 % size[0];
        let row = (row as u32).min(size[1] - 1);
        let [low, high, ..] = profile.image.texels[(row * size[0] + column) as usize];
        f64::from(u16::from_le_bytes([low, high])) / 65_535.0
    };
    let mix = |a: f64, b: f64, share: f64| a + (b - a) * share;
    let along = |row: f64| mix(texel(column, row), texel(column + 1.0, row), column.fract());
    mix(along(row), along(row + 1.0), row.fract()) * profile.peak
}

/// Flux of a type C intensity, lm, by the midpoint rule in C and in gamma.
fn flux(candelas: impl Fn(f64, f64) -> f64) -> f64 {
    let (columns, rows) = (720, 3600);
    let mut sum = 0.0;
    for row in 0..rows {
        let gamma = (f64::from(row) + 0.5) * PI / f64::from(rows);
        for column in 0..columns {
            let c = (f64::from(column) + 0.5) * 360.0 / f64::from(columns);
            sum += candelas(c, gamma.to_degrees()) * gamma.sin();
        }
    }
    sum * PI / f64::from(rows) * 2.0 * PI / f64::from(columns)
}

/// Interpolates between the angles of a table, as LM-63 asks for.
fn linear(table: &Table, c: f64, gamma: f64) -> f64 {
    let [low, high] = [*table.vertical.first().unwrap(), *table.vertical.last().unwrap()];
    if !(low..=high).contains(&gamma) {
        return 0.0;
    }
    let pair = |angles: &[f64], angle: f64| {
        let high = angles.partition_point(|&other| other < angle).clamp(1, angles.len() - 1);
        (angles[high - 1], angles[high], (angle - angles[high - 1]) / (angles[high] - angles[high - 1]))
    };
    let (above, below, down) = pair(&table.vertical, gamma);
    let along = |c: f64| (table.candelas)(c, above) * (1.0 - down) + (table.candelas)(c, below) * down;
    if table.horizontal.len() == 1 {
        return along(table.horizontal[0]);
    }
    let (left, right, across) = pair(&table.horizontal, c);
    along(left) * (1.0 - across) + along(right) * across
}

/// Table with its name, and the fold of C to its planes.
type Symmetry = (&'static str, Table, fn(f64) -> f64);

/// Files of every symmetry.
fn symmetries() -> Vec<Symmetry> {
    let half = |c: f64| if c > 180.0 { 360.0 - c } else { c };
    let table = |horizontal: Vec<f64>, vertical: Vec<f64>, candelas: Box<dyn Fn(f64, f64) -> f64>| Table {
        kind: 1,
        horizontal,
        vertical,
        candelas,
    };
    let lobe = |c: f64, gamma: f64| {
        let across = 1.0 + 0.8 * (c - 40.0).to_radians().cos();
        1000.0 * across * gamma.to_radians().cos().abs().powi(3) + 3.0
    };
    let downlight = |_: f64, gamma: f64| 3000.0 * (-gamma * gamma / 400.0).exp();
    vec![
        ("axial downlight", table(vec![0.0], range(0.0, 90.0, 2.5), Box::new(downlight)), |_| 0.0),
        ("axial ball", table(vec![0.0], range(0.0, 180.0, 10.0), Box::new(|_, _| 80.0)), |_| 0.0),
        ("hemisphere", table(vec![0.0], range(0.0, 90.0, 15.0), Box::new(|_, _| 80.0)), |_| 0.0),
        (
            "uplight",
            table(vec![0.0], range(90.0, 180.0, 5.0), Box::new(|_, gamma| 2.0 * (gamma - 90.0))),
            |_| 0.0,
        ),
        ("quadrants", table(range(0.0, 90.0, 22.5), range(0.0, 180.0, 5.0), Box::new(lobe)), |c| {
            let half = if c > 180.0 { 360.0 - c } else { c };
            half.min(180.0 - half)
        }),
        ("halves", table(range(0.0, 180.0, 15.0), range(0.0, 180.0, 5.0), Box::new(lobe)), half),
        ("halves from 90", table(range(90.0, 270.0, 10.0), range(0.0, 90.0, 1.0), Box::new(lobe)), |c| {
            if c < 90.0 {
                180.0 - c
            } else if c > 270.0 {
                540.0 - c
            } else {
                c
            }
        }),
        ("all planes", table(range(0.0, 360.0, 7.5), range(0.0, 120.0, 4.0), Box::new(lobe)), |c| c),
        (
            "steps of a tenth",
            table(vec![0.0], range(0.0, 9.0, 0.1), Box::new(|_, gamma| 1e5 * (-gamma * gamma).exp())),
            |_| 0.0,
        ),
        (
            "uneven steps",
            table(
                vec![0.0, 30.0, 37.5, 90.0],
                vec![0.0, 1.5, 4.0, 10.0, 25.5, 60.0, 75.0, 90.0],
                Box::new(|c, gamma| (90.0 - gamma) * (1.0 + c / 90.0)),
            ),
            |c| {
                let half = if c > 180.0 { 360.0 - c } else { c };
                half.min(180.0 - half)
            },
        ),
    ]
}

/// Product of the multiplier and the ballast factor of the tables.
const FACTOR: f64 = 2.5 * 0.8;

#[test]
fn the_flux_of_a_file_is_kept() {
    for (name, table, fold) in symmetries() {
        let found = table.profile();
        let expected = FACTOR * flux(|c, gamma| linear(&table, fold(c), gamma));
        let stated = found.lumens / expected - 1.0;
        assert!(stated.abs() < 1e-3, "{name}: {} lm instead of {expected}", found.lumens);
        let shown = flux(|c, gamma| intensity(&found, c, gamma)) / expected - 1.0;
        assert!(shown.abs() < 1e-3, "{name}: the texels have {shown} too much");
    }
}

#[test]
fn intensities_are_those_of_the_file_at_its_angles() {
    for (name, table, fold) in symmetries() {
        let found = table.profile();
        for c in [0.0, 30.0, 90.0, 150.0, 180.0, 270.0, 337.5] {
            // Ends of the measured angles may be sharp edges.
            for &gamma in &table.vertical[1..table.vertical.len() - 1] {
                let expected = FACTOR * linear(&table, fold(c), gamma);
                let error = (intensity(&found, c, gamma) - expected).abs() / found.peak;
                assert!(error < 2e-4, "{name}: at C {c}, gamma {gamma}: off by {error} of the peak");
            }
        }
    }
}

#[test]
fn planes_that_end_before_360_degrees_are_closed() {
    let candelas = |c: f64, _: f64| c;
    let open = Table {
        kind: 1,
        horizontal: range(0.0, 345.0, 15.0),
        vertical: vec![0.0, 90.0],
        candelas: Box::new(candelas),
    };
    let found = open.profile();
    assert!((intensity(&found, 345.0, 45.0) - FACTOR * 345.0).abs() < 0.1);
    assert!((intensity(&found, 352.5, 45.0) - FACTOR * 172.5).abs() < 0.5);
}

#[test]
fn floodlights_and_headlamps_are_turned_to_their_axes() {
    // A beam around vertical angle 30 and horizontal angle 20 degrees.
    for (kind, [x, y]) in [(2, [30.0_f64, 20.0_f64]), (3, [30.0, 20.0])] {
        let beam = |h: f64, v: f64| 1000.0 * (-((h - 20.0).powi(2) + (v - 30.0).powi(2)) / 500.0).exp();
        let table = Table {
            kind,
            horizontal: range(-90.0, 90.0, 5.0),
            vertical: range(-90.0, 90.0, 5.0),
            candelas: Box::new(beam),
        };
        let (v, h) = (x.to_radians(), y.to_radians());
        // Longitude about the pole of the planes and latitude from their equator.
        let [x, y] = if kind == 2 { [v.sin() * h.cos(), -h.sin()] } else { [v.sin(), -v.cos() * h.sin()] };
        let gamma = x.hypot(y).asin().to_degrees();
        let c = y.atan2(x).to_degrees();
        let found = intensity(&table.profile(), c, gamma);
        assert!((found / (FACTOR * 1000.0) - 1.0).abs() < 0.02, "type {kind}: {found}");
    }
}

const EULUMDAT_HEAD: [&str; 25] = [
    "Maker", "2", "4", "8", "45", "5", "45", "R1", "lamp", "17", "lamp.ldt", "2026", "600", "600", "80",
    "600", "600", "0", "0", "0", "0", "100", "80,5", "1", "0",
];

/// EULUMDAT of 8 planes and 5 angles, with `symmetry` and the intensities of the planes that it states.
fn eulumdat(symmetry: &str, planes: &[[f64; 5]]) -> String {
    let mut lines: Vec<String> = EULUMDAT_HEAD.map(str::to_owned).to_vec();
    lines[2] = symmetry.to_owned();
    lines.extend(["1", "2", "LED", "4000", "3000", "90", "36"].map(str::to_owned));
    lines.extend(vec!["0.5".to_owned(); 10]);
    lines.extend((0..8).map(|plane| (45 * plane).to_string()));
    lines.extend((0..5).map(|angle| (45 * angle).to_string()));
    lines.extend(planes.iter().flatten().map(f64::to_string));
    lines.join("\r\n")
}

#[test]
fn eulumdat_states_candelas_for_a_thousand_lumens() {
    let planes: Vec<[f64; 5]> =
        (0..8).map(|plane| [100.0, 80.0 + f64::from(plane), 20.0, 5.0, 0.0]).collect();
    for (symmetry, given, at) in [
        ("0", &planes[..], [(0.0, 80.0), (45.0, 81.0), (180.0, 84.0), (315.0, 87.0)]),
        ("1", &planes[..1], [(0.0, 80.0), (45.0, 80.0), (180.0, 80.0), (315.0, 80.0)]),
        ("2", &planes[..5], [(0.0, 80.0), (45.0, 81.0), (180.0, 84.0), (315.0, 81.0)]),
        // From C 270 over 0 to 90: 80, 81, 82, 83, 84.
        ("3", &planes[..5], [(270.0, 80.0), (0.0, 82.0), (180.0, 82.0), (135.0, 83.0)]),
        ("4", &planes[..3], [(0.0, 80.0), (45.0, 81.0), (90.0, 82.0), (225.0, 81.0)]),
    ] {
        let found = profile(&eulumdat(symmetry, given)).unwrap();
        assert_eq!(found.peak, 400.0, "4,000 lm");
        for (c, expected) in at {
            let found = intensity(&found, c, 45.0) / 4.0;
            assert!((found - expected).abs() < 0.01, "symmetry {symmetry}, C {c}: {found}, not {expected}");
        }
    }
}

#[test]
fn faults_are_refused_by_their_line() {
    let good = "IESNA:LM-63-2002\n[TEST] x\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 40\n0 90\n0\n100 0\n";
    assert!(profile(good).is_ok());
    for (from, to, line, reason) in [
        ("TILT=NONE", "NONE", 8, "no line TILT="),
        ("1 1000 1 2 1 1 2", "1 1000 one 2 1 1 2", 4, "no number"),
        ("1 1000 1 2 1 1 2", "1 1000 -1 2 1 1 2", 5, "product of multiplier"),
        ("1 1000 1 2 1 1 2", "1 1000 1 2.5 1 1 2", 4, "number of vertical angles is 2.5"),
        ("1 1000 1 2 1 1 2", "1 1000 1 2 4000000000 1 2", 4, "number of horizontal angles"),
        ("1 1000 1 2 1 1 2", "1 1000 1 2 1 4 2", 4, "photometric type is 4"),
        ("1 1000 1 2 1 1 2", "1 1000 1 200 1 1 2", 8, "ends before vertical angle"),
        ("100 0\n", "100 0 7\n", 8, "more than the counts"),
        ("1 1000 1 2", "1 1000 1e308 2", 8, "too large"),
        ("0 90\n", "90 0\n", 7, "vertical angle 0 comes after 90"),
        ("0 90\n", "0 190\n", 7, "not within 0 to 180"),
        ("100 0\n", "100\n", 8, "ends before intensity 2 of 2"),
        ("100 0\n", "100 -2\n", 8, "negative"),
        ("100 0\n", "nan 0\n", 8, "no number"),
        ("100 0\n", "0 0\n", 1, "gives no light"),
        ("1 1 40", "0 1 40", 5, "ballast"),
        ("2 1 1 2 0 0 0\n1 1 40\n0 90\n0\n", "2 2 1 2 0 0 0\n1 1 40\n0 90\n0 50\n1 1 ", 7, "end at 50"),
    ] {
        match profile(&good.replace(from, to)) {
            Err(SceneError::Profile { line: found, reason: text, .. }) => {
                assert_eq!(found, line, "{from} -> {to}: {text}");
                assert!(text.contains(reason), "{from} -> {to}: {text}");
            }
            other => panic!("{from} -> {to}: {other:?}"),
        }
    }
    for (line, text, reason) in [(3, "7", "symmetry is 7"), (4, "0", "C planes is 0"), (29, "x", "no number")]
    {
        let mut lines: Vec<String> = eulumdat("4", &[[1.0; 5]; 3]).lines().map(str::to_owned).collect();
        lines[line - 1] = text.to_owned();
        let error = profile(&lines.join("\n")).unwrap_err().to_string();
        assert!(error.contains(&format!("line {line}: ")) && error.contains(reason), "{error}");
    }
    let utf16 = LightProfile::parse(&[0xff, 0xfe, 0x49, 0], Path::new("lamp.ies")).unwrap_err();
    assert!(utf16.to_string().contains("line 1: it is UTF-16"), "{utf16}");
    assert!(profile("").is_err() && profile("\u{0}\u{1}\u{2}").is_err());
}

#[test]
fn tilts_of_lamps_and_commas_between_numbers_are_read() {
    let plain = "IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 40\n0 90\n0\n100 50\n";
    let tilted =
        plain.replace("TILT=NONE", "TILT=INCLUDE\n1\n3\n0 45 90\n1 .9 .8").replace("100 50", "100,\n50");
    assert_eq!(profile(plain).unwrap(), profile(&tilted).unwrap());
    let typed = plain.replace("TILT=NONE", " tilt = none").replace('\n', "\r\n");
    assert_eq!(profile(plain).unwrap(), profile(&format!("\u{feff}{typed}\u{1a}")).unwrap());
    let old = plain.replace("IESNA:LM-63-1995\n", "");
    assert_eq!(profile(plain).unwrap(), profile(&old).unwrap());
}

const FILE: &str = "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 40\n0 180\n0\n100 50\n";

fn data_uri() -> String {
    format!("data:,{}", FILE.replace('\n', "%0A").replace(' ', "%20"))
}

/// Adds a node with this content to the scene's nodes.
#[test]
fn lights_of_the_extension_have_the_files_candelas_and_their_nodes_axes() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let scene = load_changed(|json| {
        json["extensions"] = json!({"EXT_lights_ies": {"lights": [{"uri": data_uri(), "name": "web"}]}});
        json["extensionsUsed"] = json!(["EXT_lights_ies"]);
        json["extensionsRequired"] = json!(["EXT_lights_ies"]);
        // -z of the node becomes -y.
        let turned = json!([-half, 0.0, 0.0, half]);
        let light = json!({"light": 0, "multiplier": 2.0, "color": [1.0, 0.5, 0.25]});
        let extensions = json!({"EXT_lights_ies": light});
        add_node(json, json!({"translation": [1.0, 2.0, 3.0], "rotation": turned, "extensions": extensions}));
        add_node(json, json!({"extensions": {"EXT_lights_ies": {"light": 0}}}));
    });
    let scene = scene.unwrap();
    let [first, second] = &scene.lights[..] else { panic!("{:?}", scene.lights) };
    let PunctualLight { name, kind, intensity, axes } = first;
    assert_eq!((name.as_str(), *intensity), ("web", Vec3::new(200.0, 100.0, 50.0)));
    assert!(axes.aim.distance(Vec3::NEG_Y) < 1e-6 && axes.across.distance(Vec3::X) < 1e-6, "{axes:?}");
    let PunctualKind::Profile { position, texture } = *kind else { panic!("{kind:?}") };
    assert_eq!(position, Vec3::new(1.0, 2.0, 3.0));
    let PunctualKind::Profile { texture: other, .. } = second.kind else { panic!("{:?}", second.kind) };
    assert_eq!(texture, other, "a file is stored once");
    assert_eq!(scene.notices, [""; 0], "nothing of it is ignored");
}

#[test]
fn damaged_lights_of_the_extension_are_refused_by_their_place() {
    let refused = |of_file: Value, of_node: Value| {
        let loaded = load_changed(|json| {
            json["extensions"] = json!({"EXT_lights_ies": of_file});
            add_node(json, json!({"extensions": {"EXT_lights_ies": of_node}}));
        });
        loaded.unwrap_err().to_string()
    };
    let good = json!({"lights": [{"uri": data_uri()}]});
    for (of_file, of_node, place) in [
        (good.clone(), json!({"light": 1}), "nodes[2].extensions.EXT_lights_ies: there is no light 1"),
        (good.clone(), json!({}), "nodes[2].extensions.EXT_lights_ies"),
        (good.clone(), json!({"light": 0, "multiplier": -1.0}), "nodes[2].extensions.EXT_lights_ies"),
        (json!({}), json!({"light": 0}), "extensions.EXT_lights_ies"),
        (json!({"lights": [{}]}), json!({"light": 0}), "lights[0]: the light has neither"),
        (json!({"lights": [{"bufferView": 9}]}), json!({"light": 0}), "lights[0]"),
        (json!({"lights": [{"uri": "../lamp.ies"}]}), json!({"light": 0}), "leaves the scene's folder"),
        (json!({"lights": [{"uri": "none.ies"}]}), json!({"light": 0}), "none.ies"),
        (json!({"lights": [{"uri": "data:,TILT=NONE"}]}), json!({"light": 0}), "line 1"),
    ] {
        let error = refused(of_file, of_node);
        assert!(error.contains(place), "{error}");
    }
}

fn bulb(json: &mut Value, extras: &Value) {
    json["extensions"]["KHR_lights_punctual"] =
        json!({"lights": [{"type": "point", "name": "bulb", "color": [1.0, 0.5, 0.5], "intensity": 7.0}]});
    let extensions = json!({"KHR_lights_punctual": {"light": 0}});
    add_node(json, json!({"extensions": extensions, "extras": extras}));
}

#[test]
fn a_light_takes_the_flux_of_a_file_and_keeps_its_hue() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lamp=1.ies");
    std::fs::write(&path, FILE).unwrap();
    let bright = folder.path().join("bright.ies");
    std::fs::write(&bright, FILE.replace("1 1000 1 2", "1 1000 1e36 2")).unwrap();
    let mut assigned = load_changed(|json| bulb(json, &json!({}))).unwrap();
    assigned.apply(&format!("bulb.ies={}", path.display())).unwrap();
    let stated = load_changed(|json| bulb(json, &json!({"photoncard": {"ies": data_uri()}}))).unwrap();
    for scene in [&assigned, &stated] {
        let [PunctualLight { kind: PunctualKind::Profile { .. }, intensity, .. }] = scene.lights[..] else {
            panic!("{:?}", scene.lights);
        };
        let luminance = intensity.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        assert!((luminance - 100.0).abs() < 1e-3 && (intensity.y / intensity.x - 0.5).abs() < 1e-6);
    }
    let watts = |scene: Scene| scene.with(|scene| scene.is_in_watts = true);
    let mut of_blender = watts(load_changed(|json| bulb(json, &json!({}))).unwrap());
    of_blender.apply(&format!("bulb.ies={}", path.display())).unwrap();
    assert!((of_blender.lights[0].intensity * 683.0).distance(assigned.lights[0].intensity) < 1e-3);
    for (assignment, reason) in [
        (format!("lamp.ies={}", path.display()), "'lamp' is a material"),
        ("bulb.ies=none.ies".to_owned(), "none.ies"),
        (format!("bulb.ies={}", bright.display()), "no light has the intensity"),
        (format!("bulb.ies={}", folder.path().display()), "regular file"),
    ] {
        let before = assigned.lights.clone();
        let error = assigned.apply(&assignment).unwrap_err();
        let text = format!("{error} {:?}", std::error::Error::source(&error));
        assert!(text.contains(reason), "{text}");
        assert_eq!(assigned.lights, before);
    }
    assert!(assigned.assign(&format!("bulb.ies={}", path.display())).is_err(), "of a stranger");
    assigned.apply("bulb.intensity=3").unwrap();
    assert_eq!(assigned.lights[0].intensity, Vec3::new(3.0, 1.5, 1.5), "of the peak");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn any_text_is_a_profile_or_an_error(words in prop::collection::vec("[0-9.-]{1,5}|\n|TILT=NONE\n|1|2|90", 0..80)) {
        for head in ["", "IESNA:LM-63-2002\nTILT=NONE\n"] {
            if let Ok(profile) = profile(&format!("{head}{}", words.join(" "))) {
                prop_assert!(profile.peak > 0.0 && profile.lumens >= 0.0);
            }
        }
    }
}
