//! Apparent position of the sun: the formula of the *Astronomical Almanac* (Michalsky 1988, *The Astronomical
//! Almanac's algorithm for approximate solar position (1950-2050)*), with errors of some 0.01 degrees, and
//! the refraction of Bennett 1982 as in Reda, Andreas 2004 (*Solar position algorithm*, NREL), at 1010 mbar
//! and 10 degrees C.

use std::f64::consts::{PI, TAU};

/// Place of the sun in the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SunPlace {
    /// Angle above the horizon, radians; refraction raises the sun by half a degree at the horizon.
    pub(super) elevation: f64,
    /// Angle from north towards east, 0 to 2 pi.
    pub(super) azimuth: f64,
}

/// Refraction is left out below this elevation, radians: the sun's diameter and the refraction at the
/// horizon.
const LOWEST_REFRACTED: f64 = -0.8333 * PI / 180.0;

impl SunPlace {
    /// Place at `days` since 2000-01-01T12:00Z, seen from a latitude and a longitude, radians, north and east
    /// positive.
    pub(super) fn new(days: f64, [latitude, longitude]: [f64; 2]) -> Self {
        let degrees = |value: f64| value.rem_euclid(360.0) * (PI / 180.0);
        let mean_longitude = 280.460 + 0.985_647_4 * days;
        let anomaly = degrees(357.528 + 0.985_600_3 * days);
        let wobble = 1.915 * libm::sin(anomaly) + 0.020 * libm::sin(2.0 * anomaly);
        let (y, x) = libm::sincos(degrees(mean_longitude + wobble));
        let (sine, cosine) = libm::sincos(degrees(23.439 - 0.000_000_4 * days));
        let right_ascension = libm::atan2(cosine * y, x);
        // sin and cos of the declination.
        let sin_declination = sine * y;
        let cos_declination = (1.0 - sin_declination * sin_declination).max(0.0).sqrt();
        let universal_hours = (days + 0.5).rem_euclid(1.0) * 24.0;
        let sidereal_hours = 6.697_375 + 0.065_709_824_2 * days + universal_hours;
        let (sin_hour, cos_hour) = libm::sincos(degrees(15.0 * sidereal_hours) + longitude - right_ascension);
        let (sin_latitude, cos_latitude) = libm::sincos(latitude);
        let up = sin_latitude * sin_declination + cos_latitude * cos_declination * cos_hour;
        let north = cos_latitude * sin_declination - sin_latitude * cos_declination * cos_hour;
        let east = -cos_declination * sin_hour;
        let elevation = libm::asin(up.clamp(-1.0, 1.0));
        Self {
            elevation: elevation + refraction(elevation),
            azimuth: libm::atan2(east, north).rem_euclid(TAU),
        }
    }
}

/// Refraction of a body at a true elevation, radians.
fn refraction(elevation: f64) -> f64 {
    if elevation < LOWEST_REFRACTED {
        return 0.0;
    }
    let degrees = elevation * (180.0 / PI);
    let inner = (degrees + 10.3 / (degrees + 5.11)) * (PI / 180.0);
    (1.02 / (60.0 * libm::tan(inner)) * (PI / 180.0)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::moment;
    use super::*;

    fn place(text: &str, place: [f64; 2]) -> [f64; 2] {
        let days = moment::parse(text).expect("a moment");
        let SunPlace { elevation, azimuth } = SunPlace::new(days, place.map(f64::to_radians));
        [elevation, azimuth].map(f64::to_degrees)
    }

    /// The example of Reda, Andreas 2004, at an air pressure of 820 mbar, which refracts 0.003 degrees less.
    #[test]
    fn the_sun_is_where_the_solar_position_algorithm_has_it() {
        let [elevation, azimuth] = place("2003-10-17T12:30:30-07:00", [39.742_476, -105.178_6]);
        assert!((elevation - (90.0 - 50.111_62)).abs() < 0.015, "{elevation}");
        assert!((azimuth - 194.340_24).abs() < 0.02, "{azimuth}");
    }

    /// Elevations and azimuths of pysolar 0.13, which is the solar position algorithm of NREL.
    #[test]
    fn the_sun_is_where_another_implementation_has_it() {
        for (text, at, elevation, azimuth) in [
            ("2026-06-21T20:05+02:00", [52.5, 13.4], 10.3759, 295.3032),
            ("2026-12-21T12:00+01:00", [69.65, 18.96], -3.1450, 184.0918),
            ("2026-12-21T12:53:20+11:00", [-33.87, 151.2], 79.5661, 359.6249),
            ("2027-01-10T20:00Z", [-54.8, -68.3], 40.5476, 291.1520),
            ("2050-08-01T22:30Z", [21.3, -157.86], 86.0191, 152.2076),
        ] {
            let found = place(text, at);
            let off = [found[0] - elevation, (found[1] - azimuth) * elevation.to_radians().cos()];
            assert!(off.iter().all(|degrees| degrees.abs() < 0.03), "{text}: {found:?}");
        }
    }

    /// Elevations at solar noon: 90 degrees minus the distance of latitude and declination, which is 23.44
    /// degrees at the solstices.
    #[test]
    fn the_noon_sun_is_as_high_as_latitude_and_season_say() {
        for (text, at, elevation, azimuth) in [
            // London in summer and in winter: the equation of time is -1.8 and 1.9 minutes.
            ("2026-06-21T12:01:50Z", [51.5, 0.0], 61.94, 180.0),
            ("2026-12-21T11:58:10Z", [51.5, 0.0], 15.06, 180.0),
            // Sydney: the sun is in the north.
            ("2026-12-21T11:53:20+10:00", [-33.87, 151.2], 79.57, 0.0),
            ("2026-06-21T11:57:00+10:00", [-33.87, 151.2], 32.69, 0.0),
            // Quito on an equinox, noon.
            ("2026-03-20T12:21:30-05:00", [-0.2, -78.5], 89.8, 0.0),
        ] {
            let [found, direction] = place(text, at);
            assert!((found - elevation).abs() < 0.15, "{text}: {found} instead of {elevation}");
            let off = (direction - azimuth + 180.0).rem_euclid(360.0) - 180.0;
            assert!(elevation > 85.0 || off.abs() < 1.0, "{text}: {direction} instead of {azimuth}");
        }
    }

    #[test]
    fn the_sun_rises_in_the_east_and_sets_in_the_west() {
        for latitude in [-50.0, 0.0, 50.0] {
            let [_, morning] = place("2026-03-20T08:00Z", [latitude, 0.0]);
            let [_, evening] = place("2026-03-20T16:00Z", [latitude, 0.0]);
            assert!((20.0..160.0).contains(&morning) && (200.0..340.0).contains(&evening), "{latitude}");
        }
    }

    #[test]
    fn poles_have_days_and_nights_of_half_a_year() {
        for hour in 0..24 {
            let summer = place(&format!("2026-06-21T{hour:02}:00Z"), [90.0, 0.0])[0];
            let winter = place(&format!("2026-12-21T{hour:02}:00Z"), [90.0, 0.0])[0];
            let tromso = place(&format!("2026-12-21T{hour:02}:00Z"), [69.65, 18.96])[0];
            assert!((summer - 23.47).abs() < 0.05 && (winter + 23.44).abs() < 0.05, "{summer} {winter}");
            assert!(tromso < 0.0, "{hour}: {tromso}");
        }
    }
}
