//! State of a view, which all its threads share under one lock. A condition variable is notified of each
//! change.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use photoncard_driver::cryptomatte::Identities;
use photoncard_driver::exr::mix::{Gain, Mix, MixError};
use photoncard_driver::exr::{self, SampleFormat};
use photoncard_driver::film::Film;
use photoncard_driver::link::LentCard;
use photoncard_driver::output;
use photoncard_driver::render::{CardAddress, NamedSettings, Rendering, turn};
use photoncard_driver::tone_mapping::{ToneMapping, png_bytes};
use serde_json::{Value, json};

use super::canvas::Gains;
use super::pages::{Outgoing, file_message};
use super::request::Saving;
use super::saving::{Folder, format_of, unsettled_name};
use super::state::{Effect, PageNumber, Task, Unsettled, View};
use super::wish::Wish;
use crate::arguments::PictureFormat;
use crate::console::printable_json;
use crate::failure::Failure;
use crate::picture_files::{Form, picture_bytes};

/// Final picture of a request, equal to that of `photoncard render`. Pages can save it.
pub(super) struct Settled {
    pub(super) version: u32,
    pub(super) rendering: Rendering,
    /// The denoised picture, if the view denoises.
    pub(super) denoised: Option<Denoised>,
    pub(super) wish: Wish,
    /// Provenance of the pixels, with the names of the input files.
    pub(super) provenance: NamedSettings,
}

/// A denoised picture.
#[derive(Clone)]
pub(super) struct Denoised {
    pub(super) radiance: Vec<[f32; 3]>,
    /// Entry of the provenance for the denoiser.
    pub(super) by: (String, Value),
}

/// Work of the painter.
pub(super) enum Job {
    /// Reads the scene's files again.
    Reload,
    Pass(Box<Task>),
}

/// State of a view that all threads share.
pub(super) struct Hub {
    view: Mutex<View>,
    /// Notified of each change.
    changed: Condvar,
    must_stop: AtomicBool,
    /// True once the view is over: set by signals, and by the rendering thread when it ends.
    is_over: Arc<AtomicBool>,
    is_card_back: AtomicBool,
    settled: Mutex<Option<Arc<Settled>>>,
    /// Folder of saved pictures, locked while a picture is written.
    folder: Mutex<Option<Folder>>,
    start: Instant,
    /// False if this thread serves the pages too, and may not wait for them.
    may_wait: bool,
}

impl Hub {
    pub(super) fn new(view: View, folder: Option<Folder>, is_over: Arc<AtomicBool>) -> Self {
        Self {
            view: Mutex::new(view),
            changed: Condvar::new(),
            must_stop: AtomicBool::new(false),
            is_over,
            is_card_back: AtomicBool::new(false),
            settled: Mutex::new(None),
            folder: Mutex::new(folder),
            start: Instant::now(),
            may_wait: true,
        }
    }

    /// Makes the painter pend where it would wait.
    pub(super) fn without_waits(self) -> Self {
        Self { may_wait: false, ..self }
    }

    /// Returns whether the painter may wait.
    pub(super) fn may_wait(&self) -> bool {
        self.may_wait
    }

    fn lock(&self) -> MutexGuard<'_, View> {
        self.view.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the state by `act`, which is given the time since the start, and notifies all threads.
    pub(super) fn change<T>(&self, act: impl FnOnce(&mut View, Duration) -> T) -> T {
        let mut view = self.lock();
        let result = act(&mut view, self.start.elapsed());
        self.must_stop.store(view.must_stop(), Ordering::Relaxed);
        drop(view);
        self.changed.notify_all();
        result
    }

    /// Reads the state by `act`.
    pub(super) fn look<T>(&self, act: impl FnOnce(&View) -> T) -> T {
        act(&self.lock())
    }

    /// Returns whether the running pass should stop.
    pub(super) fn must_stop(&self) -> bool {
        self.must_stop.load(Ordering::Relaxed) || self.is_over()
    }

    pub(super) fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    pub(super) fn end(&self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.changed.notify_all();
    }

    /// Waits for the next work of the painter; `None` when the view is over. Pends where it may not wait.
    pub(super) async fn next_job(&self) -> Option<Job> {
        if self.may_wait {
            return self.wait_for_job();
        }
        while !self.is_over() {
            if let Ok(job) = self.look_for_job(&mut self.lock()) {
                return Some(job);
            }
            turn().await;
        }
        None
    }

    fn wait_for_job(&self) -> Option<Job> {
        /// Interval of checks whether the view is over: a signal does not notify the condition variable.
        const ATTENTION: Duration = Duration::from_millis(100);
        let mut view = self.lock();
        while !self.is_over() {
            match self.look_for_job(&mut view) {
                Ok(job) => return Some(job),
                Err(wait) => {
                    let wait = wait.map_or(ATTENTION, |wait| wait.min(ATTENTION));
                    view = self.changed.wait_timeout(view, wait).unwrap_or_else(PoisonError::into_inner).0;
                }
            }
        }
        None
    }

    /// Returns the next work of the painter, or the time until there may be some; `Err(None)` if a change has
    /// to come first.
    fn look_for_job(&self, view: &mut View) -> Result<Job, Option<Duration>> {
        let now = self.start.elapsed();
        if view.takes_reload() {
            self.must_stop.store(view.must_stop(), Ordering::Relaxed);
            return Ok(Job::Reload);
        }
        let task = view.next(now).map_err(|until| until.map(|until| until.saturating_sub(now)))?;
        self.must_stop.store(false, Ordering::Relaxed);
        Ok(Job::Pass(Box::new(task)))
    }

    /// Keeps a final picture, so that pages can save it.
    pub(super) fn keep(&self, settled: Settled) {
        *self.settled.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(settled));
    }

    /// Processes a message from a page. Returns whether its connection stays open.
    pub(super) fn receive(&self, page: PageNumber, text: &str) -> bool {
        match self.change(|view, now| view.receive(page, text, now)) {
            Effect::Nothing => true,
            Effect::Close => false,
            Effect::Save(saving) => {
                match self.save(&saving) {
                    Ok(Saved::File(path)) => {
                        let message = json!({"type": "saved", "path": path.display().to_string()});
                        self.change(|view, _| view.reply(page, &message));
                    }
                    Ok(Saved::Message(message)) => self.change(|view, _| view.send_file(page, message)),
                    Err(text) => {
                        let message = json!({"type": "error", "text": text});
                        self.change(|view, _| view.reply(page, &message));
                    }
                }
                true
            }
        }
    }

    /// Processes bytes of a file from a page. Returns whether its connection stays open.
    pub(super) fn receive_bytes(&self, page: PageNumber, bytes: &[u8]) -> bool {
        self.change(|view, _| view.receive_bytes(page, bytes))
    }

    /// Saves the picture of the newest request: the final one, or the last whole one on the way to it, whose
    /// name says so.
    fn save(&self, saving: &Saving) -> Result<Saved, String> {
        let (version, look, unsettled) = {
            let view = self.lock();
            let look = Look { tone: saving.tone, gains: view.gains(), is_denoised: view.denoises() };
            (view.version(), look, view.unsettled())
        };
        let settled = self.settled.lock().unwrap_or_else(PoisonError::into_inner).clone();
        match settled.filter(|settled| settled.version == version) {
            Some(settled) => {
                let Settled { rendering, denoised, wish, provenance, .. } = &*settled;
                let identities = rendering.identities.clone();
                let mut provenance = provenance.clone();
                let denoised =
                    denoised.clone().filter(|_| look.is_denoised).map(|Denoised { radiance, by }| {
                        provenance.extend([by]);
                        radiance
                    });
                let film = &rendering.film;
                let subject = Subject { film, identities, denoised, wish, provenance: &provenance };
                self.put(saving, &saving.name, &subject, &look)
            }
            None => {
                let unsettled =
                    unsettled.ok_or("there is no whole picture yet: save it when there is one")?;
                let film = unsettled.film().ok_or("a tile of the picture is missing: save it again")?;
                let Unsettled { wish, provenance, .. } = &unsettled;
                let subject = Subject { film: &film, identities: None, denoised: None, wish, provenance };
                self.put(saving, &unsettled_name(&saving.name), &subject, &look)
            }
        }
    }

    /// Writes a picture to the folder, or makes a message of it.
    fn put(&self, saving: &Saving, name: &str, subject: &Subject, look: &Look) -> Result<Saved, String> {
        if saving.is_download {
            let bytes = encoded(Path::new(name), format_of(name)?, subject, look)?;
            return Ok(Saved::Message(file_message(name, &bytes)));
        }
        let mut folder = self.folder.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_over() {
            return Err("the view is over".into());
        }
        let folder = folder.as_mut().ok_or("pictures are saved only by a view with --out DIR")?;
        let write = |path: &Path, format| {
            let bytes = encoded(path, format, subject, look)?;
            output::write(path, &bytes).map_err(|error| Failure::work_error(&error).line())
        };
        folder.save(name, write).map(Saved::File)
    }

    /// Waits until no picture is being written. Once the view is over, no further picture can be saved.
    pub(super) fn finish_saving(&self) {
        drop(self.folder.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Waits for the next message to a page; `None` after the time `longest`, or once the page is
    /// disconnected or the view is over.
    pub(super) fn next_message(
        &self,
        page: PageNumber,
        longest: Duration,
    ) -> Option<Result<String, Outgoing>> {
        let begin = Instant::now();
        let mut view = self.lock();
        loop {
            if let Some(message) = view.take(page) {
                return Some(message);
            }
            let left = longest.saturating_sub(begin.elapsed());
            if left.is_zero() || self.is_over() || !view.has(page) {
                return None;
            }
            view = self.changed.wait_timeout(view, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Records that a remote card answers again.
    pub(super) fn card_returns(&self, address: &CardAddress) {
        self.is_card_back.store(true, Ordering::Relaxed);
        self.change(|view, _| view.card_returns(address));
    }

    /// Adds a lent card that has answered.
    pub(super) fn borrow_card(&self, card: &LentCard) {
        self.is_card_back.store(true, Ordering::Relaxed);
        self.change(|view, _| view.borrow_card(card));
    }

    /// Returns whether a card has returned since the last call.
    pub(super) fn take_card_back(&self) -> bool {
        self.is_card_back.swap(false, Ordering::Relaxed)
    }
}

/// Saved picture.
enum Saved {
    File(PathBuf),
    /// Message to the page, which offers the file as a download.
    Message(Vec<u8>),
}

/// Appearance of a picture on the page that saves it.
struct Look {
    tone: ToneMapping,
    gains: Option<Gains>,
    is_denoised: bool,
}

/// Picture to save.
struct Subject<'a> {
    film: &'a Film,
    identities: Option<Arc<Identities>>,
    denoised: Option<Vec<[f32; 3]>>,
    wish: &'a Wish,
    provenance: &'a NamedSettings,
}

/// Encodes a picture as `photoncard render` would and, with gains, as `photoncard mix` does with its EXR.
fn encoded(path: &Path, format: PictureFormat, subject: &Subject, look: &Look) -> Result<Vec<u8>, String> {
    let Subject { film, identities, denoised, wish, provenance } = subject;
    let provenance = serde_json::to_string(provenance).map_err(|error| error.to_string())?;
    let provenance = printable_json(&provenance);
    let picture = &wish.settings.picture;
    let form = Form {
        layers: picture.layers.clone(),
        is_transparent: picture.transparent,
        identities: identities.clone(),
        illuminance: None,
        sample_type: SampleFormat::Float,
        tone: look.tone,
        denoised: denoised.clone(),
        part: None,
    };
    let Some(gains) = look.gains else {
        let bytes = picture_bytes(path, format, film, &provenance, &form);
        return bytes.map_err(|failure| failure.line());
    };
    let mix = mixed(path, film, (&provenance, &form), &gains).map_err(|error| error.to_string())?;
    match format {
        PictureFormat::Exr => mix.bytes().map_err(|error| error.to_string()),
        _ => {
            let (alpha, provenance) = (mix.alpha(), mix.provenance());
            let radiance = mix.radiance().into_iter();
            png_bytes(path, mix.size(), radiance, alpha.as_deref(), look.tone, provenance.as_deref())
                .map_err(|error| error.to_string())
        }
    }
}

/// Mix of a picture.
fn mixed(
    path: &Path,
    film: &Film,
    (provenance, form): (&str, &Form),
    gains: &Gains,
) -> Result<Mix, MixError> {
    let mut mix = Mix::of_bytes(path, &exr::bytes(path, &form.content(film), provenance, form.sample_type)?)?;
    let gains = film.light_groups().iter().cloned().zip(*gains);
    let gains: Vec<Gain> = gains.map(|(group, factors)| Gain { group, factors }).collect();
    mix.apply(&gains)?;
    Ok(mix)
}
