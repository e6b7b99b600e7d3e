use proptest::prelude::*;

use super::*;

fn daylight(text: &str, north: f32) -> Daylight {
    text.parse::<Sky>().unwrap_or_else(|error| panic!("{text}: {error}")).daylight(north)
}

fn luminance([red, green, blue]: [f32; 3]) -> f64 {
    0.2126 * f64::from(red) + 0.7152 * f64::from(green) + 0.0722 * f64::from(blue)
}

/// Illuminance of the horizontal plane by the sky alone, lx.
fn diffuse(environment: &Environment) -> f64 {
    let rows = environment.texels.chunks_exact(MAP[0] as usize).take(MAP[1] as usize / 2);
    let of_row = |(row, texels): (usize, &[[f32; 3]])| {
        texels.iter().map(|texel| luminance(*texel)).sum::<f64>() * solid_angle_times_cosine(row as u32)
    };
    rows.enumerate().map(of_row).sum()
}

/// Illuminances of clear skies: those of the sky are 10 to 20 klx by day, the sun's 80 to 100 klx where it is
/// high.
#[test]
fn a_clear_sky_has_the_illuminance_of_the_day() {
    for (text, elevation, sky, direct) in [
        ("52.5,13.4,2026-06-21T13:08+02:00", 60.9, [14e3, 20e3], [85e3, 97e3]),
        ("52.5,13.4,2026-06-21T13:08+02:00,2", 60.9, [12e3, 18e3], [95e3, 106e3]),
        ("52.5,13.4,2026-06-21T20:05+02:00", 10.3, [6e3, 12e3], [15e3, 30e3]),
        ("-33.87,151.2,2026-12-21T12:53:20+11:00", 79.6, [14e3, 20e3], [90e3, 100e3]),
    ] {
        let Daylight { environment, sun, elevation: found } = daylight(text, 0.0);
        let sun = sun.expect("day");
        assert!((found - elevation).abs() < 0.4, "{text}: {found}");
        let diffuse = diffuse(&environment);
        assert!((sky[0]..sky[1]).contains(&diffuse), "{text}: {diffuse}");
        let lux = luminance(sun.intensity.to_array());
        assert!((direct[0]..direct[1]).contains(&lux), "{text}: {lux}");
    }
}

#[test]
fn the_ground_reflects_a_fifth_of_the_light_of_sun_and_sky() {
    let Daylight { environment, sun, elevation } = daylight("52.5,13.4,2026-06-21T13:08+02:00", 0.0);
    let direct = luminance(sun.expect("day").intensity.to_array()) * elevation.to_radians().sin();
    let expected = 0.2 * (direct + diffuse(&environment)) / PI;
    let below = &environment.texels[environment.texels.len() / 2..];
    assert!(below.iter().all(|texel| texel == &below[0]));
    let found = luminance(below[0]);
    assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
}

#[test]
fn the_sky_is_symmetric_about_the_meridian_of_the_sun_and_brightest_beside_it() {
    // 2026-03-20: the sun is due east of the equator at 45 degrees.
    let Daylight { environment, sun, elevation } = daylight("0,0,2026-03-20T09:07:30Z", 0.0);
    let PunctualKind::Directional { direction, angle } = sun.expect("day").kind else { panic!("a disk") };
    assert!((elevation - 45.0).abs() < 0.1 && (angle.to_degrees() - 0.533).abs() < 1e-4, "{elevation}");
    assert!(direction.distance(Vec3::new(-1.0, -1.0, 0.0).normalize()) < 0.02, "{direction}");
    let width = MAP[0] as usize;
    // Without the bright band above the horizon, whose texels are the last third of these.
    let brightest = environment.texels[..width * MAP[1] as usize / 3]
        .chunks_exact(width)
        .enumerate()
        .flat_map(|(row, texels)| {
            texels.iter().enumerate().map(move |(column, texel)| (luminance(*texel), row, column))
        })
        .fold((0.0, 0, 0), |a, b| if b.0 > a.0 { b } else { a });
    // +x is three quarters of the map from the left; 45 degrees are a quarter from the top.
    assert!(
        brightest.2.abs_diff(3 * width / 4) <= 2 && brightest.1.abs_diff(MAP[1] as usize / 4) <= 8,
        "{brightest:?}"
    );
    let mirrored = |row: usize, offset: usize| {
        let texel = |column: usize| luminance(environment.texels[row * width + column % width]);
        [texel(3 * width / 4 + offset), texel(3 * width / 4 - 1 - offset)]
    };
    for (row, offset) in [(10, 30), (60, 5), (60, 100), (120, 250)] {
        let [one, other] = mirrored(row, offset);
        assert!((one / other - 1.0).abs() < 0.05, "{row} {offset}: {one} {other}");
    }
}

#[test]
fn north_turns_sun_and_sky_together() {
    let text = "52.5,13.4,2026-06-21T16:00+02:00";
    let [plain, turned] = [0.0, 90.0].map(|north| daylight(text, north));
    assert_eq!(plain.elevation, turned.elevation);
    let direction = |daylight: &Daylight| match daylight.sun.as_ref().expect("day").kind {
        PunctualKind::Directional { direction, .. } => direction,
        _ => panic!("a disk"),
    };
    // Counter-clockwise from above, -z becomes -x and +x becomes -z.
    let Vec3 { x, y, z } = direction(&plain);
    assert!(direction(&turned).distance(Vec3::new(z, y, -x)) < 1e-6);
    let expected = plain.environment.turned(90.0);
    for (found, expected) in turned.environment.texels.iter().zip(&expected.texels) {
        assert!((luminance(*found) / luminance(*expected) - 1.0).abs() < 1e-4);
    }
}

#[test]
fn the_sky_is_black_by_night() {
    let Daylight { environment, sun, elevation } = daylight("69.65,18.96,2026-12-21T12:00+01:00", 0.0);
    assert!(!environment.is_lit() && sun.is_none() && (-5.0..-2.0).contains(&elevation), "{elevation}");
}

#[test]
fn light_in_watts_is_lumens_by_their_efficacy() {
    let lumens = daylight("52.5,13.4,2026-06-21T13:08+02:00", 0.0);
    let watts = lumens.clone().in_watts(683.0);
    let [a, b] =
        [&lumens, &watts].map(|light| luminance(light.sun.as_ref().expect("day").intensity.to_array()));
    assert!((a / b / 683.0 - 1.0).abs() < 1e-6);
    assert!((diffuse(&lumens.environment) / diffuse(&watts.environment) / 683.0 - 1.0).abs() < 1e-6);
}

#[test]
fn what_is_no_sky_is_refused_with_its_part() {
    for (text, said) in [
        ("91,0,2026-06-21T12:00Z", "'91' is no latitude: it is -90 to 90"),
        ("nan,0,2026-06-21T12:00Z", "latitude"),
        ("0,181,2026-06-21T12:00Z", "longitude"),
        ("0,east,2026-06-21T12:00Z", "longitude"),
        ("0,0,2026-13-21T12:00Z", "month 13"),
        ("0,0,2026-06-21T12:00", "no offset"),
        ("0,0,2026-06-21T12:00Z,0", "'0' is no turbidity: it is 1.7 to 10"),
        ("0,0,2026-06-21T12:00Z,11", "turbidity"),
        ("0,0,2026-06-21T12:00Z,3,4", "'4' follows"),
        ("0,0", "LAT,LON,TIME"),
        ("", "LAT,LON,TIME"),
    ] {
        let error = text.parse::<Sky>().expect_err(text).to_string();
        assert!(error.contains(said), "{text}: {error}");
    }
    let sky: Sky = " 1, -2.5,2026-06-21T12:00Z ".parse().expect("a sky");
    assert_eq!(sky.to_string(), "1,-2.5,2026-06-21T12:00Z");
    assert_eq!(sky.to_string().parse::<Sky>(), Ok(sky));
}

proptest! {
    #[test]
    fn no_text_is_a_panic(text in "\\PC{0,40}|[0-9TZ:+.,-]{0,40}") {
        let _ = text.parse::<Sky>();
    }
}
