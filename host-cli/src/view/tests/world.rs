//! Simulated view with model pages, a model card and a painter of model pictures, in one thread and virtual
//! time.

use std::collections::{BTreeMap, HashMap};
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};
use std::time::Duration;

use photoncard_driver::film::{FilmPixel, PixelValue, SumFormat, Window};
use photoncard_driver::scene::{Camera, Material, Scene, SceneContents, Triangle};
use photoncard_driver::scheduler::{GatherOrder, tiles};
use photoncard_driver::sink::FinishedTile;
use photoncard_shared::message::Tile;
use serde_json::Value;

use super::commands::view_options;
use crate::view::canvas::Shown;
use crate::view::describe::SceneFacts;
use crate::view::pages::Outgoing;
use crate::view::refinement::{Outcome, Pass};
use crate::view::state::{Effect, PageNumber, Start, Task, View};
use crate::view::wish::{Sketch, Wish};

/// Side of the tiles, pixels.
const TILE: u32 = 16;

/// Model of a page in a browser.
#[derive(Default)]
pub(super) struct ModelPage {
    /// `f32::to_bits` of the radiance of each pixel.
    pub(super) pixels: HashMap<(u32, u32), u32>,
    pub(super) received: u64,
    pub(super) state: Option<Value>,
    pub(super) errors: u64,
    version: u32,
    /// Number of requests for which the page has received a tile.
    pub(super) versions: u64,
}

/// Pass that the painter is rendering.
struct Job {
    task: Task,
    /// Number of steps that the preparation has left.
    preparing: u64,
    left: Vec<Tile>,
}

pub(super) struct World {
    pub(super) view: View,
    pub(super) pages: BTreeMap<PageNumber, ModelPage>,
    pub(super) now: Duration,
    pub(super) has_card: bool,
    /// Maximum number of gather rays; the card refuses a pass with more.
    pub(super) max_rays: u32,
    job: Option<Job>,
    /// Request whose photons are on the card.
    prepared: Option<Wish>,
    /// Number of completed first passes.
    pub(super) firsts: u64,
}

/// Scene of a floor below an emissive triangle.
fn scene() -> Scene {
    use glam::Vec3;
    let triangle = |y: f32, material| {
        Triangle::new([Vec3::new(0.0, y, 0.0), Vec3::new(1.0, y, 0.0), Vec3::new(0.0, y, 1.0)], material)
    };
    let mut lamp = Material::lambertian("lamp", Vec3::splat(0.5));
    lamp.emission = Vec3::ONE;
    let camera =
        Camera::perspective("eye", Vec3::new(0.0, 0.5, 3.0), [Vec3::X, Vec3::Y, Vec3::NEG_Z], 0.8, None);
    Scene::from(SceneContents {
        triangles: vec![triangle(0.0, 0), triangle(1.0, 1)],
        materials: vec![Material::lambertian("floor", Vec3::splat(0.5)), lamp],
        cameras: vec![camera],
        ..SceneContents::default()
    })
}

/// `f32::to_bits` of the radiance of every pixel in the model picture: a hash of `wish` and `step`.
fn bits(wish: &Wish, step: u32) -> u32 {
    let hasher = BuildHasherDefault::<DefaultHasher>::default();
    // Exponent bits that make any hash a positive normal number.
    0x3f00_0000 | (hasher.hash_one((format!("{wish:?}"), step)) as u32 & 0x00ff_ffff)
}

impl World {
    pub(super) fn new() -> Self {
        let options =
            view_options(&["scene.gltf", "--size=40x24", "--card=tcp:card:7000"].map(str::to_owned));
        let scene = scene();
        let start = Start {
            quality: options.quality,
            finish: options.finish(),
            wish: Wish::new(options.settings(), options.stated(), Vec::new()),
            sketch: Sketch::new(&scene),
            facts: SceneFacts::new("scene.gltf".into(), &scene),
            is_size_stated: true,
            out: Some("out".into()),
            options: options.scene,
        };
        let view = View::new(start).unwrap_or_else(|error| panic!("{error}"));
        let now = Duration::from_secs(1);
        Self {
            view,
            pages: BTreeMap::new(),
            now,
            has_card: true,
            max_rays: u32::MAX,
            job: None,
            prepared: None,
            firsts: 0,
        }
    }

    pub(super) fn connect(&mut self) {
        let number = self.view.connect();
        self.pages.insert(number, ModelPage::default());
    }

    pub(super) fn disconnect(&mut self, number: PageNumber) {
        self.view.disconnect(number);
        self.pages.remove(&number);
    }

    pub(super) fn send(&mut self, number: PageNumber, message: &Value) -> Effect {
        self.view.receive(number, &message.to_string(), self.now)
    }

    /// Performs one step of the painter: a tile, a part of the preparation, or the end of a pass.
    pub(super) fn paint(&mut self) {
        let Some(job) = &mut self.job else {
            self.job = self.view.next(self.now).ok().map(|task| self.begin(task));
            return;
        };
        self.now += Duration::from_millis(2);
        if self.view.must_stop() {
            return self.end(Outcome::Stopped);
        }
        if !self.has_card {
            self.view.lose_card("card 0 (tcp:card:7000)", "gone".into(), self.now);
            return self.end(Outcome::NoCard);
        }
        if job.task.settings.integrator.gather_rays > self.max_rays {
            let task = self.job.take().unwrap().task;
            return self.view.refuse(&task, "too many rays", self.now);
        }
        if job.preparing > 0 {
            self.view.prepares(true, self.now);
            job.preparing -= 1;
            if job.preparing == 0 {
                self.prepared = Some(job.task.wish.clone());
                self.view.prepares(false, self.now);
            }
            return;
        }
        match job.left.pop() {
            Some(tile) => {
                let radiance = [f32::from_bits(bits(&job.task.wish, job.task.origin.step)); 3];
                let pixel = PixelValue { radiance, depth: 2.0, ..PixelValue::default() };
                let sums = SumFormat::ONE.sums(&FilmPixel { pixel, ..FilmPixel::default() });
                let sums = std::iter::repeat_n(sums, tile.pixels() as usize);
                let tile = FinishedTile::of_pixels(tile, sums, SumFormat::ONE).unwrap();
                let origin = job.task.origin;
                self.view.put(origin, "card 0 (tcp:card:7000)", None, &tile);
                // Now and then a tile is revoked and sent again, as after a card that lied.
                if self.now.as_millis().is_multiple_of(64) {
                    self.view.revoke(origin, tile.tile().id);
                    self.view.put(origin, "card 0 (tcp:card:7000)", None, &tile);
                }
            }
            None if job.task.work.pass == Pass::Fit => {
                let task = self.job.take().unwrap().task;
                self.view.fit(&task, None, self.now);
            }
            None => {
                self.firsts += u64::from(job.task.work.pass == Pass::FIRST);
                self.end(Outcome::Done);
            }
        }
    }

    fn begin(&self, task: Task) -> Job {
        let picture = &task.settings.picture;
        let window = Window::full(picture.width, picture.height);
        let is_fit = task.work.pass == Pass::Fit;
        let is_kept = is_fit || self.prepared.as_ref().is_some_and(|wish| !task.wish.is_other_edition(wish));
        let left = if is_fit { Vec::new() } else { tiles(window, TILE, GatherOrder::Sort) };
        Job { task, preparing: if is_kept { 0 } else { 5 }, left }
    }

    fn end(&mut self, outcome: Outcome) {
        let task = self.job.take().unwrap().task;
        self.view.finish(&task, outcome, None, self.now);
    }

    /// Delivers the next message to a page. Returns whether there was one.
    pub(super) fn read(&mut self, number: PageNumber) -> bool {
        let Some(message) = self.view.take(number) else { return false };
        let Some(page) = self.pages.get_mut(&number) else { return false };
        match message {
            Ok(text) => page.read(&serde_json::from_str(&text).unwrap()),
            Err(Outgoing::Tile(patch, Shown::Rendered)) => page.draw(&patch.message(Shown::Rendered)),
            Err(Outgoing::Tile(patch, shown)) => page.received += patch.message(shown).len() as u64,
            Err(other) => panic!("{other:?}"),
        }
        true
    }

    /// Acknowledges all tiles that a page has received.
    pub(super) fn acknowledge(&mut self, number: PageNumber) {
        let bytes = self.pages[&number].received;
        self.send(number, &serde_json::json!({"type": "shown", "version": 1, "bytes": bytes}));
    }

    /// Lets the painter finish all work on an available card, while all pages read and acknowledge. Panics if
    /// the work does not end.
    pub(super) fn settle(&mut self) {
        self.has_card = true;
        for _ in 0..20_000 {
            self.paint();
            if self.job.is_none() {
                self.now += Duration::from_millis(50);
            }
            let numbers: Vec<_> = self.pages.keys().copied().collect();
            let mut is_quiet = self.job.is_none();
            for number in numbers {
                while self.read(number) {
                    is_quiet = false;
                    self.acknowledge(number);
                }
            }
            if is_quiet && self.is_settled() {
                return;
            }
        }
        panic!("the view does not settle");
    }

    fn is_settled(&self) -> bool {
        let is_shown = |page: &ModelPage| page.state.as_ref().is_some_and(|state| state["settled"] == true);
        self.view.is_settled() && self.pages.values().all(is_shown)
    }

    /// Checks that every page shows the final picture of the newest request.
    pub(super) fn check_pictures(&self) {
        let wish = self.view.wish();
        let settled = bits(wish, 1);
        let [width, height] = [wish.settings.picture.width, wish.settings.picture.height];
        for page in self.pages.values() {
            assert_eq!(page.state.as_ref().unwrap()["size"], serde_json::json!([width, height]));
            for x in 0..width {
                for y in 0..height {
                    assert_eq!(page.pixels.get(&(x, y)), Some(&settled), "{x} {y}");
                }
            }
        }
    }

    /// Maximum number of tiles that the view may hold: those of two pictures.
    pub(super) fn most_tiles(&self) -> usize {
        let picture = &self.view.wish().settings.picture;
        2 * (picture.width.div_ceil(TILE) * picture.height.div_ceil(TILE)) as usize
    }
}

impl ModelPage {
    fn read(&mut self, message: &Value) {
        match message["type"].as_str() {
            Some("state") => self.state = Some(message.clone()),
            Some("error") => self.errors += 1,
            _ => {}
        }
    }

    fn draw(&mut self, message: &[u8]) {
        self.received += message.len() as u64;
        let (words, rest) = message.as_chunks::<4>();
        assert!(rest.is_empty());
        let words: Vec<u32> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
        let [version, step, x, y, columns, rows, ..] = words[..] else { panic!("no header") };
        assert!(version >= self.version, "a tile of an older wish");
        self.versions += u64::from(version != self.version);
        self.version = version;
        assert_eq!(words.len(), 11 + 3 * (columns * rows) as usize);
        for index in 0..columns * rows {
            let [left, top] = [x + index % columns * step, y + index / columns * step];
            let value = words[11 + 3 * index as usize];
            for offset in 0..step * step {
                self.pixels.insert((left + offset % step, top + offset / step), value);
            }
        }
    }
}
