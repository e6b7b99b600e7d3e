//! Renders in turns on one thread, with cards that are called, as in a browser's page.

use std::collections::VecDeque;
use std::io;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use photoncard_driver::emulator::{Emulated, PolledCard};
use photoncard_driver::film::Film;
use photoncard_driver::render::{
    ChipWorkers, Integrator, PhotonMaps, Picture, RenderError, RenderSettings, Renderer, Rendering,
    Unobserved,
};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_shared::link::{Port, PortError};

/// Work of a card on the bytes of one write.
const SLICE: Duration = Duration::from_micros(200);

/// Starts cards that work while the host reads their links. Card 0 ends after `bytes_of_first` bytes of its
/// answers.
struct Called {
    bytes_of_first: usize,
    started: AtomicUsize,
}

impl ChipWorkers for Called {
    fn start(&self, index: usize, chip: Emulated) -> io::Result<Box<dyn Port + Send>> {
        self.started.fetch_add(1, Ordering::Relaxed);
        let left = if index == 0 { self.bytes_of_first } else { usize::MAX };
        Ok(Box::new(Link { card: PolledCard::new(chip), received: Vec::new(), sent: VecDeque::new(), left }))
    }
}

struct Link {
    card: PolledCard,
    received: Vec<u8>,
    sent: VecDeque<u8>,
    left: usize,
}

impl Port for Link {
    fn read(&mut self, buffer: &mut [u8], _: Duration) -> Result<usize, PortError> {
        let mut sent = Vec::new();
        self.card.go_on(&std::mem::take(&mut self.received), SLICE, &mut sent);
        self.sent.extend(sent);
        let count = buffer.len().min(self.sent.len());
        self.left = self.left.checked_sub(count).ok_or(PortError::Closed)?;
        for (place, byte) in buffer.iter_mut().zip(self.sent.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8], _: Duration) -> Result<usize, PortError> {
        self.received.extend(bytes);
        Ok(bytes.len())
    }
}

/// Renders in turns. Returns the picture, and how often the render has pended.
fn in_turns(
    renderer: &mut Renderer,
    scene: &Scene,
    settings: &RenderSettings,
    base: Option<Arc<Film>>,
) -> (Result<Rendering, RenderError>, usize) {
    let mut work = pin!(renderer.picture(scene, settings, base, &Unobserved));
    let context = &mut Context::from_waker(Waker::noop());
    for turns in 0.. {
        if let Poll::Ready(rendering) = work.as_mut().poll(context) {
            return (rendering, turns);
        }
    }
    unreachable!("a render ends")
}

fn workers(bytes_of_first: usize) -> Arc<Called> {
    Arc::new(Called { bytes_of_first, started: AtomicUsize::new(0) })
}

fn cornell() -> Scene {
    gltf::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf").as_ref()).unwrap()
}

fn settings() -> RenderSettings {
    let settings = RenderSettings {
        picture: Picture { width: 40, height: 24, ..Picture::default() },
        photons: PhotonMaps { count: 2000, neighbors: 10, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 3, shadow_rays: 1, ..Integrator::default() },
        ..RenderSettings::default()
    };
    settings.with(|settings| {
        settings.cards.addresses = vec!["emulated:3".parse().unwrap()];
        settings.schedule.tile = Some(8);
    })
}

fn bits(film: &Film) -> Vec<[u32; 3]> {
    assert!(film.is_complete());
    film.pixels().map(|pixel| pixel.radiance.map(f32::to_bits)).collect()
}

#[test]
fn a_render_in_turns_equals_one_on_threads() {
    let (scene, settings) = (cornell(), settings());
    let expected = Renderer::default().render(&scene, &settings, &Unobserved).unwrap().film;
    let workers = workers(usize::MAX);
    let mut renderer = Renderer::with_workers(workers.clone());
    let (rendering, turns) = in_turns(&mut renderer, &scene, &settings, None);
    assert!(bits(&rendering.unwrap().film) == bits(&expected));
    assert!(turns > 10, "the host waited for its cards in one call: {turns}");

    // More samples on the same cards.
    let more = settings.clone().with(|settings| settings.integrator.samples *= 2);
    let more = more.with(|settings| settings.integrator.planned_samples = Some(settings.integrator.samples));
    let first = more.clone().with(|settings| settings.integrator.samples /= 2);
    let base = in_turns(&mut renderer, &scene, &first, None).0.unwrap().film;
    let refined = in_turns(&mut renderer, &scene, &more, Some(Arc::new(base))).0.unwrap().film;
    let expected = Renderer::default().render(&scene, &more, &Unobserved).unwrap().film;
    assert!(bits(&refined) == bits(&expected));
    assert_eq!(workers.started.load(Ordering::Relaxed), 3);
}

#[test]
fn tiles_of_a_lost_worker_are_rendered_by_others() {
    let (scene, settings) = (cornell(), settings());
    let expected = Renderer::default().render(&scene, &settings, &Unobserved).unwrap().film;
    // It is lost before it has answered, and while it renders.
    for bytes in [0, 4000] {
        let (rendering, _) = in_turns(&mut Renderer::with_workers(workers(bytes)), &scene, &settings, None);
        assert!(bits(&rendering.unwrap().film) == bits(&expected), "{bytes}");
    }

    let alone = settings.with(|settings| settings.cards.addresses = vec!["emulated:1".parse().unwrap()]);
    let (rendering, _) = in_turns(&mut Renderer::with_workers(workers(4000)), &scene, &alone, None);
    assert!(matches!(rendering, Err(RenderError::Card { .. })), "no card is left");
}

#[test]
fn memory_of_workers_is_not_modelled() {
    let (scene, settings) = (cornell(), settings());
    let modelled =
        settings.with(|settings| settings.cards.caches = Some("unified=64K/128/4".parse().unwrap()));
    let (rendering, _) = in_turns(&mut Renderer::with_workers(workers(usize::MAX)), &scene, &modelled, None);
    let Err(RenderError::Setting { field, .. }) = rendering else { panic!("it was modelled") };
    assert_eq!(field, "cards.caches");
}
