//! Pilot renders: small test renders by which a quality chooses settings. They run on a thread of their own:
//! a newer [request](super::wish) can be rendered meanwhile.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use photoncard_driver::pack::PackedScene;
use photoncard_driver::quality::{Finish, Fit, Quality};
use photoncard_driver::render::{Observer, Phase, RenderError, RenderSettings};
use photoncard_driver::scene::Scene;

/// Result of pilot renders; `None` if no setting depends on the scene.
pub(super) type Found = Result<Option<Fit>, RenderError>;

/// Time between two polls of the thread.
const LOOK: Duration = Duration::from_millis(2);

/// Pilot renders in progress on their thread.
pub(super) struct Fitting {
    thread: JoinHandle<Found>,
    stop: Arc<AtomicBool>,
}

impl Fitting {
    /// Starts pilot renders for the camera of `settings`, on a pool of `threads` threads; on rayon's global
    /// pool if `None`.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub(super) fn start(
        scene: Arc<Scene>,
        by: (Quality, Finish),
        settings: RenderSettings,
        threads: Option<usize>,
    ) -> std::io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let observer = Stop(stop.clone());
        let work = move || {
            let fit = || find(&scene, by, &settings, &observer);
            let pool = threads.map(|count| rayon::ThreadPoolBuilder::new().num_threads(count).build());
            match pool {
                Some(Ok(pool)) => pool.install(fit),
                _ => fit(),
            }
        };
        Ok(Self { thread: std::thread::Builder::new().name("pilot".into()).spawn(work)?, stop })
    }

    /// Waits for the result. If `must_stop` returns true before, returns `self`; the pilot renders continue.
    pub(super) fn wait(self, must_stop: &dyn Fn() -> bool) -> Result<Found, Self> {
        while !self.thread.is_finished() {
            if must_stop() {
                return Err(self);
            }
            std::thread::sleep(LOOK);
        }
        Ok(self.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    }

    /// Stops the pilot renders without a result.
    pub(super) fn stop(self) {
        self.stop.store(true, Ordering::Relaxed);
        // A panic of the thread concerns only its result, which is dropped.
        let _ = self.thread.join();
    }
}

/// Settings that a quality chooses for a scene and the camera of `settings`, by pilot renders on this thread.
pub(super) fn find(
    scene: &Scene,
    (quality, finish): (Quality, Finish),
    settings: &RenderSettings,
    observer: &dyn Observer,
) -> Found {
    quality.fit((finish, None), (scene, &PackedScene::new(scene)?), settings, observer)
}

struct Stop(Arc<AtomicBool>);

impl Observer for Stop {
    fn progress(&self, _: Phase, _: u64, _: u64) {}

    fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
