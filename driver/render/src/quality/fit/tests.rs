use super::super::paths::Deviations;
use super::super::pilot::ForCamera;
use super::*;

const VARIANCES: Variances = Variances {
    place: 0.0036,
    shadow_ray: 0.04,
    gather_ray: 0.12,
    photon: 3.0,
    lambertian: 1.0,
    gather_rays_per_ray: 0.2,
    paths_of_photon: 0.3,
    has_soft_caustics: false,
    for_camera: None,
    level: 4.0,
    deviations: Deviations::NONE,
};
const PICTURED: Pictured = Pictured { pixels: 65_536.0, triangles: 32, is_cached: true };

fn good(variances: &Variances) -> Fit {
    Quality::Good.level(Finish::Rendered).unwrap().fit(variances, &PICTURED)
}

/// Time plus weighted variance of a pixel.
fn loss(variances: &Variances, [samples, shadow_rays, gather_rays, photons]: [f64; 4]) -> f64 {
    let Variances { place, shadow_ray, gather_ray, photon, gather_rays_per_ray, .. } = variances;
    let rays = samples * shadow_rays;
    let time = samples
        + rays * COST_OF_SHADOW_RAY
        + gather_rays * gather_rays_per_ray * COST_OF_GATHER_RAY
        + photons * COST_OF_PHOTON / PICTURED.pixels;
    let variance = place / samples
        + shadow_ray / rays
        + gather_ray * WEIGHT_OF_RECORDS / gather_rays
        + photon * WEIGHT_OF_MAP / photons;
    time + Quality::Good.level(Finish::Rendered).unwrap().worth.powi(2) * variance
}

/// Each chosen number has a smaller loss than 0.7 and 1.4 times the number, a margin for rounding.
#[test]
fn fitted_settings_minimise_time_plus_weighted_variance() {
    let (fit, level) = (good(&VARIANCES), Quality::Good.level(Finish::Rendered).unwrap());
    assert!((level.samples.start()..level.samples.end()).contains(&&fit.samples));
    let chosen = [fit.samples, fit.shadow_rays, fit.gather_rays, fit.photons as u32].map(f64::from);
    for (index, factor) in (0..4).flat_map(|index| [(index, 0.7), (index, 1.4)]) {
        let mut other = chosen;
        other[index] *= factor;
        if index == 0 {
            // The number of shadow rays of a pixel is kept, not that of a sample.
            other[1] /= factor;
        }
        assert!(loss(&VARIANCES, other) > loss(&VARIANCES, chosen), "{index} {factor}");
    }
}

#[test]
fn light_without_noise_takes_the_fewest_rays_and_noisy_light_no_more_than_the_most() {
    let all = |value| {
        let values =
            Variances { place: value, shadow_ray: value, gather_ray: value, photon: value, ..VARIANCES };
        let fit = good(&values);
        (fit.samples, fit.shadow_rays, fit.gather_rays, fit.photons)
    };
    let Level { samples, gather_rays, photons, .. } = Quality::Good.level(Finish::Rendered).unwrap();
    assert_eq!(all(0.0), (*samples.start(), 1, *gather_rays.start(), *photons.start()));
    for endless in [1e12, f64::INFINITY] {
        let most = (*samples.end(), *SHADOW_RAYS.end(), *gather_rays.end(), *photons.end());
        assert_eq!(all(endless), most);
    }
    assert_eq!(good(&Variances { photon: f64::NAN, ..VARIANCES }).photons, *photons.end());
    let without = Variances { gather_ray: 0.0, gather_rays_per_ray: 0.0, ..VARIANCES };
    assert_eq!(good(&without).gather_rays, *gather_rays.start());
}

#[test]
fn a_scene_of_many_triangles_has_photons_for_each() {
    let few = Variances { photon: 0.0, ..VARIANCES };
    let photons = |quality: Quality, triangles| {
        let of = Pictured { triangles, ..PICTURED };
        quality.level(Finish::Rendered).unwrap().fit(&few, &of).photons
    };
    assert_eq!(photons(Quality::Good, 10_000), 200_000);
    assert_eq!(photons(Quality::Good, 100_000), 800_000);
    assert_eq!(photons(Quality::Good, usize::MAX), MOST_FOR_TRIANGLES);
    assert_eq!(photons(Quality::Draft, 100_000), 400_000);
}

#[test]
fn photons_that_take_many_paths_are_fewer() {
    let by = |photon, paths_of_photon| good(&Variances { photon, paths_of_photon, ..VARIANCES });
    assert_eq!([0.5, 1.0, 5.0, 1e6].map(|paths| by(0.0, paths).photons), [200_000, 200_000, 40_000, 25_000]);
    let [in_room, of_object] = [1.0, 10.0].map(|paths| by(VARIANCES.photon, paths));
    assert!(in_room.photons > of_object.photons && of_object.photons > in_room.photons / 2);
    let [in_room, of_object] = [in_room, of_object].map(|fit| {
        let time = TimeOfPicture { cpu_seconds: 5.0, pixels: 64.0, finish: Finish::Rendered };
        fit.for_time(time, &Quality::Good.settings().integrator, Stated::default())
    });
    assert!((45..=52).contains(&(100 * of_object.photons / in_room.photons)), "{of_object:?}");
}

#[test]
fn soft_caustics_have_no_map_unless_it_is_stated_or_nothing_else_brings_them() {
    let by = |has_soft_caustics, stated, gather_rays| {
        let fit = good(&Variances { has_soft_caustics, ..VARIANCES });
        let settings = Quality::Good.settings().with(|settings| {
            settings.integrator.gather_rays = gather_rays;
            fit.apply(settings, stated);
        });
        settings.photons.caustic_photons
    };
    let (open, own) = (Stated::default(), Quality::Good.settings().photons.caustic_photons);
    let rays_are_stated = Stated { gather_rays: true, ..open };
    assert_eq!([by(true, open, 8), by(true, rays_are_stated, 8)], [Some(0); 2]);
    for (has_soft_caustics, stated, gather_rays) in
        [(false, open, 8), (true, Stated { caustic_photons: true, ..open }, 8), (true, rays_are_stated, 0)]
    {
        assert_eq!(by(has_soft_caustics, stated, gather_rays), own);
    }
}

#[test]
fn fewer_photons_are_traced_for_the_camera_where_that_gains() {
    let by = |ratio: f64| {
        let maps = ForCamera { photon: 0.01 * VARIANCES.photon, ratio };
        good(&Variances { for_camera: Some(maps), ..VARIANCES })
    };
    let [gaining, even] = [by(0.25), by(0.8)];
    assert_eq!([gaining.photons_for, even.photons_for], [PhotonsFor::Camera, PhotonsFor::Scene]);
    assert_eq!(even.photons, good(&VARIANCES).photons);
    assert!(gaining.photons < even.photons && gaining.measured.photons_for_camera == Some(0.25));
    let applied = |photons_for| {
        let mut settings = Quality::Good.settings();
        settings.photons.photons_for = photons_for;
        gaining.apply(&mut settings, Stated::default());
        settings.photons.photons_for
    };
    assert_eq!(applied(PhotonsFor::Auto), PhotonsFor::Camera);
    assert_eq!(applied(PhotonsFor::Scene), PhotonsFor::Scene);
}

#[test]
fn numbers_beyond_the_limits_are_reported() {
    let beyond = |photon, gather_ray| good(&Variances { photon, gather_ray, ..VARIANCES }).beyond;
    assert_eq!(beyond(VARIANCES.photon, VARIANCES.gather_ray), Beyond::default());
    let Beyond { photons, gather_rays, .. } = beyond(400.0 * VARIANCES.photon, 400.0 * VARIANCES.gather_ray);
    // 400 times the variance take 20 times the number; 4 % cover the rounding of both.
    let is_multiple = |more: f64, number: f64| (19.2..20.8).contains(&(more / number));
    let fit = good(&VARIANCES);
    assert!(photons.is_some_and(|more| is_multiple(more as f64, fit.photons as f64)), "{photons:?}");
    assert!(gather_rays.is_some_and(|more| is_multiple(more.into(), fit.gather_rays.into())));
    let most = beyond(f64::INFINITY, f64::INFINITY);
    assert_eq!((most.photons, most.gather_rays), (Some(MAX_PHOTONS), Some(MAX_RAYS_OF_RECORD)));
}

#[test]
fn a_short_time_takes_few_photons_and_tells_how_many_the_scene_would_take() {
    let fit = good(&VARIANCES);
    let in_time = |seconds| {
        let time = TimeOfPicture { cpu_seconds: seconds, pixels: 64.0, finish: Finish::Rendered };
        fit.for_time(time, &Quality::Good.settings().integrator, Stated::default())
    };
    assert_eq!(in_time(1e4), Fit { max_caustic_photons: MAX_PHOTONS / 8, ..fit });
    let [short, twice] = [5.0, 10.0].map(in_time);
    assert!((100_000..=110_000).contains(&short.photons) && twice.photons > 19 * short.photons / 10);
    assert_eq!(short.beyond, Beyond { photons_in_time: Some(fit.photons), ..Beyond::default() });
    assert_eq!(in_time(1e-3).photons, MIN_PHOTONS_IN_TIME);
    let caustics = |fit: &Fit, caustic_photons| {
        let stated = Stated { caustic_photons, ..Stated::default() };
        Quality::Good.settings().with(|settings| fit.apply(settings, stated)).photons.caustic_photons
    };
    let own = Quality::Good.settings().photons.caustic_photons;
    assert_eq!([caustics(&fit, false), caustics(&short, true)], [own; 2]);
    assert_eq!(caustics(&short, false), Some(short.photons / 8));
}

/// Adjusts `fit` to a time limit of [`PICTURED`]. Half of the limit suffices for the denoiser and for the
/// cost `costs` of each pixel, in units of 6 microseconds.
fn in_time(fit: Fit, costs: f64, finish: Finish, stated: Stated) -> Fit {
    let pixels = PICTURED.pixels;
    let of_denoiser = TimeOfPicture { cpu_seconds: 0.0, pixels, finish }.cpu_seconds_of_denoiser();
    let cpu_seconds = 2.0 * (costs * 6e-6 * pixels + of_denoiser);
    fit.for_time(TimeOfPicture { cpu_seconds, pixels, finish }, &Quality::Good.settings().integrator, stated)
}

/// Cost of four samples with four shadow rays.
const FOUR_SAMPLES: f64 = 4.0 * (1.0 + 4.0 * 0.4);

#[test]
fn a_short_time_takes_the_rays_of_records_that_fit_or_none() {
    let fit = Fit { shadow_rays: 4, gather_rays: 200, ..good(&VARIANCES) };
    // A fifth of the pixels have a record.
    let by = |rays: f64, stated| {
        let Fit { interpolates, gather_rays, .. } =
            in_time(fit, FOUR_SAMPLES + 1.2 * 0.2 * rays, Finish::Rendered, stated);
        (interpolates, gather_rays)
    };
    let open = Stated::default();
    assert_eq!([300.5, 150.5].map(|rays| by(rays, open)), [(true, 200), (true, 151)]);
    // Four samples have 25 rays, or 4.
    assert_eq!([126.5, 20.5].map(|rays| by(rays, open)), [(false, 6 * 24), (false, 24)]);
    assert_eq!(by(20.5, Stated { cache: true, ..open }), (true, 21));
    assert!(by(20.5, Stated { gather_rays: true, ..open }).0);
}

#[test]
fn a_short_time_takes_the_gather_rays_of_samples_that_fit_and_at_least_one() {
    let fit = Fit { samples: 8, shadow_rays: 4, gather_rays: 100, interpolates: false, ..good(&VARIANCES) };
    for finish in [Finish::Rendered, Finish::Denoised] {
        let by = |costs| in_time(fit, costs, finish, Stated::default()).gather_rays;
        for rays_of_sample in [2, 3] {
            assert_eq!(by(FOUR_SAMPLES + 4.0 * 1.2 * (f64::from(rays_of_sample) + 0.1)), 8 * rays_of_sample);
        }
        assert_eq!([by(0.0), by(1e9)], [8, 100]);
    }
}

#[test]
fn rays_that_an_aimed_noise_raises_fit_the_time_as_well() {
    let noisy = Fit { shadow_rays: 4, ..good(&VARIANCES) }.for_noise(1e-3);
    assert!(noisy.gather_rays > 2000);
    let fit = in_time(noisy, FOUR_SAMPLES + 1.2 * 0.2 * 400.5, Finish::Rendered, Stated::default());
    assert_eq!((fit.interpolates, fit.gather_rays), (true, 401));
}

/// Without irradiance records, pixels do not share gather rays, so that equal costs allow more rays.
#[test]
fn pixels_without_records_take_more_rays_for_equal_costs() {
    let level = Quality::Good.level(Finish::Rendered).unwrap();
    let alone = level.fit(&VARIANCES, &Pictured { is_cached: false, ..PICTURED });
    assert!(!alone.interpolates && alone.gather_rays > good(&VARIANCES).gather_rays);
    assert_eq!(alone.gather_rays, good(&Variances { lambertian: 0.0, ..VARIANCES }).gather_rays);
}

#[test]
fn a_low_noise_aim_raises_photons_and_record_rays_to_keep_their_errors_below_it() {
    let fit = good(&VARIANCES);
    assert_eq!(Fit { max_irradiance_error: f32::INFINITY, ..fit.for_noise(1.0) }, fit);
    for noise in [0.02, 0.01, 0.005] {
        let Fit { photons, gather_rays, interpolates, .. } = fit.for_noise(noise);
        assert!(interpolates);
        let of_map = VARIANCES.photon / photons as f64;
        let of_records = WEIGHT_OF_RECORDS * VARIANCES.gather_ray / f64::from(gather_rays);
        let settings =
            Quality::Good.settings().with(|settings| fit.for_noise(noise).apply(settings, Stated::default()));
        assert!(settings.integrator.irradiance_error.is_some_and(|error| f64::from(error) <= 2.501 * noise));
        assert!(of_map <= (0.25 * noise).powi(2), "{of_map}");
        assert!(of_records <= (0.5 * noise).powi(2) || gather_rays == MAX_RAYS_OF_RECORD, "{of_records}");
    }
    let least = fit.for_noise(1e-6);
    assert_eq!((least.photons, least.gather_rays), (MAX_PHOTONS, MAX_RAYS_OF_RECORD));
    let alone = Fit { interpolates: false, ..fit };
    assert_eq!(alone.for_noise(1e-3).gather_rays, fit.gather_rays);
}

#[test]
fn a_fit_changes_only_settings_that_are_not_stated() {
    let fit = Fit { interpolates: false, ..good(&VARIANCES) };
    let initial = Quality::Good.settings();
    let applied = |stated| initial.clone().with(|settings| fit.apply(settings, stated));
    assert_eq!(applied(Stated::ALL), initial);
    let of_samples = applied(Stated::default()).integrator;
    let of_sample = fit.gather_rays.div_ceil(fit.samples);
    assert_eq!((of_samples.irradiance_error, of_samples.gather_rays), (None, of_sample));
    assert_eq!((of_samples.samples, of_samples.shadow_rays), (fit.samples, fit.shadow_rays));
    let cached = applied(Stated { cache: true, ..Stated::default() }).integrator;
    assert_eq!(cached.irradiance_error, initial.integrator.irradiance_error);
    assert_eq!(cached.gather_rays, fit.gather_rays);
    let photons = applied(Stated { photons: true, ..Stated::default() });
    assert_eq!(photons.photons.count, initial.photons.count);
    assert_eq!(photons.integrator.shadow_rays, fit.shadow_rays);
}

#[test]
fn the_adaptive_threshold_stays_near_that_of_the_model() {
    let fit = good(&VARIANCES);
    let threshold = |spent, samples| {
        let integrator = Integrator { samples, shadow_rays: 4, ..Quality::Good.settings().integrator };
        Fit { spent_threshold: spent, ..fit }.adaptive_threshold(&integrator)
    };
    // 24 samples of cost 2.6, median radiance 4, worth 400.
    let of_model = 24.0 * (4.0 * 2.6_f64).sqrt() / 400.0;
    for (spent, expected) in [(0.0, 0.5), (0.9, 0.9), (7.0, 7.0), (1e9, 8.0)] {
        let found = f64::from(threshold(Some(spent * of_model), 24).unwrap());
        assert!((found / (expected * of_model) - 1.0).abs() < 0.05, "{spent}: {found} {expected}");
    }
    assert_eq!([threshold(Some(of_model), PROBES), threshold(None, 24)], [None; 2]);
}

#[test]
fn one_shadow_ray_has_twice_the_deviation_of_four() {
    let Measured { place, .. } = good(&VARIANCES).measured;
    let by_rays = Measured { place: 0.0, ..good(&VARIANCES).measured };
    assert!((by_rays.deviation_by(1) - 2.0).abs() < 1e-9 && (by_rays.deviation_by(16) - 0.5).abs() < 1e-9);
    let by_place = Measured { place, shadow_ray: 0.0, ..by_rays };
    assert_eq!([0, 1, 16].map(|rays| by_place.deviation_by(rays)), [1.0; 3]);
    assert_eq!(by_rays.deviation_by(0), 0.0);
    assert_eq!(Measured { shadow_ray: 0.0, ..by_rays }.deviation_by(1), 1.0);
}

#[test]
fn samples_of_a_stated_number_share_the_rays_of_a_pixel() {
    let fit = good(&VARIANCES);
    for samples in [1, 64, 1000] {
        let mut settings = Quality::Good.settings();
        settings.integrator.samples = samples;
        fit.apply(&mut settings, Stated { samples: true, ..Stated::default() });
        let of_sample = (fit.samples * fit.shadow_rays).div_ceil(samples);
        assert_eq!(settings.integrator.samples, samples);
        assert_eq!(settings.integrator.shadow_rays, of_sample.min(*SHADOW_RAYS.end()));
    }
}

#[test]
fn a_better_quality_never_lowers_a_number() {
    let fits = [Quality::Draft, Quality::Good, Quality::Final]
        .map(|quality| quality.level(Finish::Rendered).unwrap().fit(&VARIANCES, &PICTURED));
    for [worse, better] in [[fits[0], fits[1]], [fits[1], fits[2]]] {
        assert!(worse.samples <= better.samples && worse.photons <= better.photons);
        assert!(worse.gather_rays <= better.gather_rays);
        assert!(worse.samples * worse.shadow_rays <= better.samples * better.shadow_rays);
    }
    assert!(Quality::Paper.level(Finish::Rendered).is_none());
}
