//! A picture rendered by passes, each on other cards and in another order, equals the picture of one render
//! bit for bit.

use std::sync::Arc;
use std::time::Duration;

use photoncard_driver::layer::Layers;
use photoncard_driver::partial::PartialSettings;
use photoncard_driver::render::{Aim, CardAddress, Ending, RenderSettings, Renderer, Rendering, Unobserved};
use photoncard_driver::scene::Scene;
use photoncard_driver::scheduler::GatherOrder;
use photoncard_shared::message::Radiance;
use photoncard_tests::everything::everything;
use photoncard_tests::render_or_panic;
use proptest::prelude::*;

fn settings() -> RenderSettings {
    RenderSettings::default().with(|s| {
        (s.picture.width, s.picture.height) = (15, 12);
        s.photons.count = 2000;
        s.photons.neighbors = 20;
        s.photons.caustic_photons = Some(500);
        s.photons.caustic_neighbors = 20;
        s.integrator.gather_rays = 8;
        s.integrator.shadow_rays = 2;
        s.schedule.tile = Some(8);
    })
}

fn cards(text: &str) -> Vec<CardAddress> {
    text.split('+').map(|card| card.parse().expect("a card")).collect()
}

/// Renders until the picture has `samples` samples per pixel, on top of those of `before` if stated.
fn pass(
    renderer: &mut Renderer,
    scene: &Scene,
    settings: &RenderSettings,
    (samples, before): (u32, Option<Rendering>),
) -> Rendering {
    let settings = settings.clone().with(|s| s.integrator.samples = samples);
    let result = match before {
        Some(Rendering { film, .. }) => renderer.refine(scene, &settings, Arc::new(film), &Unobserved),
        None => renderer.render(scene, &settings, &Unobserved),
    };
    let Ok(rendering) = result else { panic!("{}", result.err().unwrap()) };
    rendering
}

fn technique() -> impl Strategy<Value = RenderSettings> {
    let radiance = prop_oneof![Just(Radiance::Density), Just(Radiance::Precomputed)];
    (any::<bool>(), any::<bool>(), any::<bool>(), radiance).prop_map(
        |(is_cached, has_layers, is_adaptive, radiance)| {
            settings().with(|s| {
                s.integrator.adaptive_threshold = is_adaptive.then_some(0.3);
                s.integrator.irradiance_error = is_cached.then_some(0.1);
                s.integrator.planned_samples = Some(3);
                s.photons.radiance = radiance;
                s.picture.layers = if has_layers { Layers::all() } else { Layers::default() };
            })
        },
    )
}

/// Samples per pixel after a pass, its gather order, and its cards.
type Pass = (u32, GatherOrder, &'static str);

/// Sequences of passes, whose cards may stay or change.
fn passes() -> impl Strategy<Value = Vec<Pass>> {
    use GatherOrder::{Buckets, DirectionBins, Hash, Naive, Sort, Tiled};
    let order = || prop::sample::select(vec![Naive, Tiled, DirectionBins, Hash, Sort, Buckets]);
    let cards = || {
        prop::sample::select(vec![
            "emulated:1",
            "emulated:2",
            "emulated-large:1",
            "emulated-micro:2",
            "emulated:1+emulated-micro:1",
        ])
    };
    let on_others = prop::collection::vec((1..4_u32, order(), cards()), 1..4);
    let on_same = (cards(), prop::collection::vec((1..4_u32, order()), 2..5));
    let on_same = on_same
        .prop_map(|(on, passes)| passes.into_iter().map(|(samples, order)| (samples, order, on)).collect());
    prop_oneof![on_others, on_same]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn passes_of_any_division_equal_one_render(technique in technique(), passes in passes()) {
        let scene = everything();
        let mut renderer = Renderer::default();
        let mut picture = None;
        let mut samples = 0;
        for &(more, order, on) in &passes {
            samples += more;
            let settings = technique.clone().with(|s| {
                s.schedule.order = order;
                s.schedule.keep_records = true;
                s.cards.addresses = cards(on);
            });
            picture = Some(pass(&mut renderer, &scene, &settings, (samples, picture)));
        }
        let at_once = technique.with(|s| s.integrator.samples = samples);
        let expected = render_or_panic(&everything(), &at_once).film;
        let found = picture.expect("a pass").film;
        prop_assert_eq!(found.format(), expected.format());
        prop_assert!(found.sums().eq(expected.sums()), "{:?}", passes);
    }
}

/// Settings of a picture by passes, with irradiance records that chips keep.
fn with_records() -> RenderSettings {
    settings().with(|s| {
        (s.integrator.irradiance_error, s.integrator.planned_samples) = (Some(0.1), Some(4));
        s.schedule.keep_records = true;
    })
}

#[test]
fn records_are_gathered_once_while_camera_scene_settings_and_cards_stay() {
    let scene = everything();
    for on in [
        "emulated:1",
        "emulated-large:1",
        "emulated-micro:1",
        "emulated-micro:2",
        "emulated:1+emulated-micro:2",
    ] {
        let settings = with_records().with(|s| s.cards.addresses = cards(on));
        let mut renderer = Renderer::default();
        let [mut gathers, mut records, mut kept] = [0; 3];
        let mut picture = None;
        for samples in [1, 2, 4] {
            let rendering = pass(&mut renderer, &scene, &settings, (samples, picture.take()));
            gathers += rendering.statistics.gathers;
            records += rendering.statistics.records;
            kept += rendering.statistics.kept_records;
            picture = Some(rendering);
        }
        let whole = render_or_panic(&everything(), &settings.clone().with(|s| s.integrator.samples = 4));
        assert!(picture.expect("a pass").film.sums().eq(whole.film.sums()), "{on}");
        let all = whole.statistics.records;
        assert_eq!(records + kept, 3 * all, "{on}");
        // With several cards, one may take over a late tile of another, whose records it has not kept.
        if settings.cards.count() == 1 {
            assert_eq!((gathers, records), (whole.statistics.gathers, all), "{on}");
        }
    }
}

#[test]
fn records_are_kept_where_gathers_wait_in_the_same_memory() {
    let scene = everything();
    let settings = with_records();
    let mut renderer = Renderer::default();
    let mut picture = None;
    use GatherOrder::{Buckets, Sort};
    for (samples, order) in [(1, Buckets), (2, Buckets), (3, Sort), (4, Buckets)] {
        let settings = settings.clone().with(|s| s.schedule.order = order);
        let next = pass(&mut renderer, &scene, &settings, (samples, picture.take()));
        assert_eq!(next.statistics.kept_records > 0, samples == 2, "{samples}");
        picture = Some(next);
    }
    let whole = render_or_panic(&everything(), &settings.with(|s| s.integrator.samples = 4));
    assert!(picture.expect("a pass").film.sums().eq(whole.film.sums()));
}

#[test]
fn records_are_gathered_again_on_other_cards_and_for_another_camera() {
    let scene = everything();
    let settings = with_records();
    let mut renderer = Renderer::default();
    let first = pass(&mut renderer, &scene, &settings, (1, None));
    let records = first.statistics.records;
    let second = pass(&mut renderer, &scene, &settings, (2, Some(first)));
    assert_eq!((second.statistics.records, second.statistics.kept_records), (0, records));
    // New cards take the place of those that kept the records.
    renderer.close_cards();
    let third = pass(&mut renderer, &scene, &settings, (3, Some(second)));
    assert_eq!((third.statistics.records, third.statistics.kept_records), (records, 0));
    let elsewhere = settings.clone().with(|s| s.picture.camera_at = Some([0.1, 0.2, 2.0]));
    pass(&mut renderer, &scene, &elsewhere, (1, None));
    let fourth = pass(&mut renderer, &scene, &settings, (4, Some(third)));
    assert_eq!((fourth.statistics.records, fourth.statistics.kept_records), (records, 0));
    // With verification, cards keep no records.
    let verified =
        settings.clone().with(|s| (s.cards.verify, s.cards.addresses) = (Some(0.5), cards("emulated:2")));
    let mut picture = Some(fourth);
    for samples in [5, 6] {
        let next = pass(&mut renderer, &scene, &verified, (samples, picture.take()));
        assert_eq!((next.statistics.records, next.statistics.kept_records), (records, 0));
        picture = Some(next);
    }
    let at_once = render_or_panic(&everything(), &settings.with(|s| s.integrator.samples = 6)).film;
    assert!(picture.expect("a pass").film.sums().eq(at_once.sums()));
}

#[test]
fn a_picture_with_kept_samples_continues_even_after_a_stop() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr.partial");
    let with = |samples: u32, resume: bool| {
        settings().with(|s| {
            s.integrator.samples = samples;
            s.outputs.partial = Some(PartialSettings { path: path.clone(), resume });
        })
    };
    let scene = everything();
    let expected =
        |samples| render_or_panic(&scene, &settings().with(|s| s.integrator.samples = samples)).film;
    // `render` leaves the partial file; removing it is up to the caller.
    drop(render_or_panic(&scene, &with(2, false)));
    let bytes = std::fs::read(&path).expect("kept");
    let more = render_or_panic(&scene, &with(5, true));
    assert!(more.film.sums().eq(expected(5).sums()));
    let all_rays =
        render_or_panic(&scene, &settings().with(|s| s.integrator.samples = 5)).statistics.rays.eye as f64;
    let share = more.statistics.rays.eye as f64 / all_rays;
    assert!((share - 0.6).abs() < 0.05, "two of five samples are taken over, and not {share}");
    drop(more);
    // The file ends within the first tile of the further samples, or has all their tiles.
    let all = std::fs::read(&path).expect("kept");
    for length in [bytes.len() + 9, all.len()] {
        std::fs::write(&path, &all[..length]).expect("written");
        let again = render_or_panic(&scene, &with(5, true));
        assert!(again.film.sums().eq(expected(5).sums()));
        assert_eq!(again.statistics.samples, 5);
    }
    // A render of more samples continues from the file.
    assert!(render_or_panic(&scene, &with(6, true)).film.sums().eq(expected(6).sums()));
    // A file of unfinished samples continues only with the number of samples that it was begun for.
    std::fs::write(&path, &bytes[..bytes.len() - 1]).expect("written");
    for samples in [1, 3] {
        let error = photoncard_driver::render::render(&scene, &with(samples, true), &Unobserved).err();
        let said = error.expect("another picture").to_string();
        assert!(said.contains("spp was 2") && said.contains(&format!("is {samples}")), "{said}");
    }
}

#[test]
fn a_picture_is_refined_only_by_samples_of_equal_settings() {
    let scene = everything();
    let mut renderer = Renderer::default();
    let two = settings().with(|s| s.integrator.samples = 2);
    let film = Arc::new(pass(&mut renderer, &scene, &two, (2, None)).film);
    for (changed, reason) in [
        (two.clone(), "2 samples a pixel is no part of a picture of 2"),
        (two.clone().with(|s| (s.integrator.samples, s.picture.width) = (3, 16)), "another window"),
        (two.with(|s| (s.integrator.samples, s.picture.layers) = (3, Layers::all())), "other layers"),
    ] {
        let error = renderer.refine(&scene, &changed, film.clone(), &Unobserved).err().expect("refused");
        assert!(error.is_input() && error.to_string().contains(reason), "{error}");
    }
}

#[test]
fn passes_until_an_aim_equal_a_render_of_their_samples() {
    let scene = everything();
    for (aim, is_cached) in [
        (Aim { noise: Some(0.2), time: None }, false),
        (Aim { noise: None, time: Some(Duration::from_millis(1)) }, true),
        (Aim { noise: Some(1e-6), time: Some(Duration::from_millis(600)) }, false),
    ] {
        let settings = settings().with(|s| {
            s.integrator.irradiance_error = is_cached.then_some(0.1);
            s.integrator.samples = 4;
        });
        let choose = |_: &_| Ok((settings.photons.clone(), settings.integrator.clone()));
        let passes = Renderer::default().render_until(&scene, &settings, &choose, aim, &Unobserved);
        let Ok(passes) = passes else { panic!("no passes") };
        assert!(matches!(passes.ending, Ending::Reached), "{:?}", passes.ending);
        let samples = passes.rendering.film.format().samples;
        let times = passes.rendering.statistics.time_s;
        assert!(times.photons > 0.0 && times.pack > 0.0, "{times:?} of {} passes", passes.count);
        let at_once =
            settings.with(|s| (s.integrator.samples, s.integrator.planned_samples) = (samples, Some(4)));
        let expected = render_or_panic(&everything(), &at_once).film;
        assert!(passes.rendering.film.sums().eq(expected.sums()), "{samples}");
        if aim.time.is_none() {
            assert!(
                samples >= 16 && passes.noise.is_some_and(|noise| noise <= 0.2),
                "{samples} {:?}",
                passes.noise
            );
        }
    }
}
