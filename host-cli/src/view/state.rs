//! State of a view: the [pictures that pages request](super::wish), their tiles, and the connected pages.
//! Threads, clock, input and output are in [`super::hub`].

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use photoncard_driver::film::Film;
use photoncard_driver::link::LentCard;
use photoncard_driver::quality::{Finish, Quality};
use photoncard_driver::render::{CardAddress, NamedSettings, RenderError, RenderSettings};
use photoncard_driver::scene::Scene;
use photoncard_shared::budget::MAX_LIGHT_GROUPS;
use serde_json::{Value, json};

use super::canvas::{Canvas, Gains, Origin, Patch, Shown, film_of};
use super::cards::CardBoard;
use super::command_line;
use super::describe::{self, Cost, SceneFacts};
use super::pages::{Outgoing, Page, Revisions};
use super::refinement::{COARSEST, Refinement, Work};
use super::request::{Announced, Fault, Request, Saving, parse};
use super::wish::{Sketch, Wish};
use crate::arguments::SceneOptions;
use crate::environment::{DroppedFile, EnvironmentOption};
use crate::flags::with_flags;
use crate::input;

/// Identifier of a connected page.
pub(super) type PageNumber = u64;

/// Initial values of a view.
pub(super) struct Start {
    pub(super) options: SceneOptions,
    pub(super) quality: Quality,
    pub(super) finish: Finish,
    pub(super) wish: Wish,
    pub(super) sketch: Sketch,
    pub(super) facts: SceneFacts,
    /// True if the size of the picture is stated, false if it follows the page's window.
    pub(super) is_size_stated: bool,
    /// Folder in which pages may save pictures; `None` if they may not.
    pub(super) out: Option<String>,
}

impl Start {
    /// Returns whether pilot renders have no setting of a picture to choose.
    fn is_fitted(&self, wish: &Wish) -> bool {
        wish.states_all() || self.quality == Quality::Paper
    }
}

/// Pass to render, with the request that it belongs to and its settings.
pub(super) struct Task {
    pub(super) work: Work,
    pub(super) wish: Wish,
    /// Settings of the pass. For [`super::refinement::Pass::Fit`] they are those of the request.
    pub(super) settings: RenderSettings,
    pub(super) origin: Origin,
}

/// Whole picture of the newest request that is not its final one.
pub(super) struct Unsettled {
    patches: Vec<Arc<Patch>>,
    pub(super) wish: Wish,
    /// Provenance of the pixels, which says that they are not those of the final picture.
    pub(super) provenance: NamedSettings,
    /// Position of the scene's origin in the file's coordinates.
    origin: [f64; 3],
}

impl Unsettled {
    /// Film of the picture, with a pixel for each of the final one.
    pub(super) fn film(&self) -> Option<Film> {
        let picture = &self.wish.settings.picture;
        let mut film = film_of(&self.patches, [picture.width, picture.height])?;
        film.set_origin(self.origin);
        film.set_light_groups(&picture.light_groups);
        Some(film)
    }
}

/// Action for the caller after a message from a page.
#[derive(Debug, PartialEq)]
pub(super) enum Effect {
    Nothing,
    /// Save the picture.
    Save(Saving),
    /// Close the connection.
    Close,
}

/// State of a view.
pub(super) struct View {
    pub(super) start: Start,
    pub(super) wish: Wish,
    /// Sketch (reduced scene) with the file's cameras, and with the materials and lights of the newest
    /// request.
    scene: Scene,
    /// Sketch with the materials and lights of the first request, which `reset` restores.
    first: Scene,
    pub(super) refinement: Refinement,
    /// True after a page has asked for the scene's files to be read again.
    pub(super) is_outdated: bool,
    /// Options with which they are to be read. `start` has those of the present scene.
    pub(super) options: SceneOptions,
    /// Environment map that a page is sending, and the bytes so far.
    upload: Option<(PageNumber, Announced, Vec<u8>)>,
    /// Reason why the scene's files could not be read again, since when the scene is an older one.
    pub(super) unread: Option<String>,
    /// Request of the last complete final picture.
    pub(super) settled: Option<Wish>,
    /// Reason why the newest request cannot be rendered; `None` if it can.
    pub(super) refused: Option<String>,
    pub(super) canvas: Canvas,
    /// Last complete pass of the newest request.
    pub(super) done: Option<Origin>,
    /// Provenance of the pixels of the last complete pass.
    pub(super) provenance: NamedSettings,
    pub(super) cost: Cost,
    /// Gains of the light groups in the radiance that pages show; 1 for the picture as it is rendered.
    gains: Gains,
    /// State of the page's switch of the denoiser; `None` for a view without a denoiser.
    denoises: Option<bool>,
    /// Number of the first request that has the present size of the picture.
    of_size: u32,
    /// Pixel near which tiles are rendered first.
    pub(super) cursor: Option<[u32; 2]>,
    pub(super) cards: CardBoard,
    pages: BTreeMap<PageNumber, Page>,
    next_page: PageNumber,
    steering: Option<PageNumber>,
    /// Number of the last accepted message of the page that steers (controls the view).
    message: u64,
    pub(super) revisions: Revisions,
}

impl View {
    /// Creates a view without pages.
    ///
    /// # Errors
    /// If the first request cannot be rendered.
    pub(super) fn new(start: Start) -> Result<Self, RenderError> {
        let wish = start.wish.clone();
        wish.check_cards()?;
        Ok(Self {
            first: start.sketch.with(&wish)?,
            scene: start.sketch.with(&wish)?,
            cards: CardBoard::new(&wish.settings.cards),
            refinement: Refinement::new(start.is_fitted(&wish)),
            wish,
            denoises: (start.finish == Finish::Denoised).then_some(true),
            options: start.options.clone(),
            start,
            is_outdated: false,
            upload: None,
            unread: None,
            settled: None,
            refused: None,
            canvas: Canvas::default(),
            done: None,
            provenance: NamedSettings::default(),
            cost: Cost::default(),
            gains: [[1.0; 3]; MAX_LIGHT_GROUPS],
            of_size: 0,
            cursor: None,
            pages: BTreeMap::new(),
            next_page: 0,
            steering: None,
            message: 0,
            revisions: Revisions { state: 1, cards: 1 },
        })
    }

    /// Adds a page. If no other page steers (controls the view), the new page steers.
    pub(super) fn connect(&mut self) -> PageNumber {
        let number = self.next_page;
        self.next_page += 1;
        self.steering.get_or_insert(number);
        let mut page = Page::new();
        page.reply(self.hello(number));
        self.pages.insert(number, page);
        number
    }

    /// First message to a page.
    fn hello(&self, number: PageNumber) -> String {
        let out = self.start.out.as_deref();
        let mut hello = self.start.facts.hello(&self.first, out, self.steering == Some(number));
        hello["size_stated"] = json!(self.start.is_size_stated);
        hello["environment"] = describe::environment(&self.start.options);
        hello["denoises"] = json!(self.denoises.is_some());
        hello["light_groups"] = json!(self.wish.settings.picture.light_groups);
        hello.to_string()
    }

    /// Replaces the scene by one that was read again from its files with `options`. Edits of pages stay if
    /// they are possible in it. Pages are greeted anew.
    ///
    /// # Errors
    /// If the picture cannot be rendered of this scene; the view keeps the one before.
    pub(super) fn replace(
        &mut self,
        (sketch, facts): (Sketch, SceneFacts),
        options: &SceneOptions,
        light_groups: &[String],
    ) -> Result<(), RenderError> {
        let with_groups = |wish: &Wish| {
            let mut wish = wish.clone();
            wish.settings.picture.light_groups = light_groups.to_vec();
            wish
        };
        let [first, wish] = [&self.start.wish, &self.wish].map(|wish| with_groups(wish).for_scene(&sketch));
        let [scene_of_first, scene] = [sketch.with(&first)?, sketch.with(&wish)?];
        if light_groups != self.wish.settings.picture.light_groups {
            self.set_gains([[1.0; 3]; MAX_LIGHT_GROUPS]);
        }
        (self.start.sketch, self.start.facts, self.start.wish) = (sketch, facts, first);
        self.start.options.clone_from(options);
        (self.first, self.scene, self.wish) = (scene_of_first, scene, wish);
        (self.refused, self.settled, self.unread) = (None, None, None);
        self.refinement.wish(true);
        self.refinement.fit_again(self.start.is_fitted(&self.wish));
        self.begin_picture();
        let greetings: Vec<_> = self.pages.keys().map(|number| (*number, self.hello(*number))).collect();
        greetings.into_iter().for_each(|(number, hello)| self.of_page(number, |page| page.reply(hello)));
        Ok(())
    }

    /// Returns whether a page is connected.
    pub(super) fn has(&self, number: PageNumber) -> bool {
        self.pages.contains_key(&number)
    }

    /// Removes a page. If it steered, the page that has been connected longest steers next.
    pub(super) fn disconnect(&mut self, number: PageNumber) {
        self.pages.remove(&number);
        self.upload.take_if(|(page, ..)| *page == number);
        if self.steering == Some(number) {
            self.steering = None;
            if let Some(next) = self.pages.keys().next().copied() {
                self.steer(next);
            }
        }
    }

    fn steer(&mut self, number: PageNumber) {
        (self.steering, self.message) = (Some(number), 0);
        for (page, state) in &mut self.pages {
            state.reply(json!({"type": "steers", "value": *page == number}).to_string());
        }
    }

    /// Queues an answer to a page, if it is still connected.
    pub(super) fn reply(&mut self, number: PageNumber, message: &Value) {
        if let Some(page) = self.pages.get_mut(&number) {
            page.reply(message.to_string());
        }
    }

    /// Queues an error for all pages.
    pub(super) fn tell_error(&mut self, text: &str) {
        let message = json!({"type": "error", "text": with_flags(text)}).to_string();
        self.pages.values_mut().for_each(|page| page.reply(message.clone()));
    }

    /// Keeps the scene, whose files could not be read again, and tells pages the reason.
    pub(super) fn keep_scene(&mut self, reason: &str) {
        self.tell_error(reason);
        self.unread = Some(with_flags(reason));
        if !self.is_outdated {
            self.options.clone_from(&self.start.options);
        }
        self.revisions.state += 1;
    }

    /// Processes a message from a page.
    pub(super) fn receive(&mut self, number: PageNumber, text: &str, now: Duration) -> Effect {
        let (request, id) = parse(text);
        match request.and_then(|request| Ok(self.act(number, request, now)?)) {
            Ok(effect) => {
                self.note(number, id);
                effect
            }
            Err(Fault::Foreign) => Effect::Close,
            Err(Fault::Refused(reason)) => {
                self.reply(number, &json!({"type": "error", "text": reason, "id": id}));
                Effect::Nothing
            }
        }
    }

    /// Takes the next bytes of a file that a page has announced. After the last ones the scene is read again,
    /// with this environment. Returns false if the page has announced none, or fewer bytes.
    pub(super) fn receive_bytes(&mut self, number: PageNumber, more: &[u8]) -> bool {
        let Some((_, announced, mut bytes)) = self.upload.take_if(|(page, ..)| *page == number) else {
            return false;
        };
        bytes.extend(more);
        if bytes.len() < announced.length {
            self.upload = Some((number, announced, bytes));
            return true;
        }
        let is_whole = bytes.len() == announced.length;
        if is_whole && self.steering == Some(number) {
            let dropped = DroppedFile { name: announced.name, bytes };
            self.options.environment = Some(EnvironmentOption::Dropped(Arc::new(dropped)));
            (self.options.sky, self.options.north) = (None, None);
            self.is_outdated = true;
        }
        is_whole
    }

    /// If the page steers, records the number of its message; the next state message repeats this number.
    fn note(&mut self, number: PageNumber, id: Option<u64>) {
        if let Some(id) = id.filter(|_| self.steering == Some(number)) {
            self.message = id;
        }
    }

    fn act(&mut self, number: PageNumber, request: Request, now: Duration) -> Result<Effect, String> {
        match request {
            Request::Shown(bytes) => self.of_page(number, |page| page.acknowledge(bytes)),
            Request::Steer => self.steer(number),
            Request::Pick(at) => self.pick(number, at)?,
            Request::Layer(shown) => self.show(number, shown)?,
            Request::Save(Saving { is_download: false, .. }) if self.start.out.is_none() => {
                return Err("pictures are saved only by a view with --out DIR: download it".into());
            }
            Request::Save(Saving { is_download: true, .. })
                if self.pages.get(&number).is_some_and(Page::has_file) =>
            {
                return Err("the picture before is still on its way".into());
            }
            Request::Save(saving) => return Ok(Effect::Save(saving)),
            steering => {
                if self.steering != Some(number) {
                    return Err("another page steers: take over first".into());
                }
                self.turn(steering, now)?;
            }
        }
        Ok(Effect::Nothing)
    }

    /// Processes a request that is accepted only from the page that steers.
    fn turn(&mut self, request: Request, now: Duration) -> Result<(), String> {
        let mut wish = self.wish.clone();
        let mut moves = None;
        match request {
            Request::Camera { view, is_moving } => {
                wish.look(view);
                moves = Some(is_moving);
            }
            Request::Set { name, value } => wish.set(name, value),
            Request::Setting(setting) => {
                wish.change(setting);
                wish.check_cards().map_err(|error| with_remedy(&error))?;
            }
            Request::Size([width, height]) => {
                (wish.settings.picture.width, wish.settings.picture.height) = (width, height);
            }
            Request::Reset => {
                self.set_gains([[1.0; 3]; MAX_LIGHT_GROUPS]);
                self.denoises = self.denoises.map(|_| true);
                let picture = &self.wish.settings.picture;
                wish = self.start.wish.clone();
                (wish.settings.picture.width, wish.settings.picture.height) = (picture.width, picture.height);
                if self.pages.values().any(Page::shows_layer_of_chip) {
                    wish.add_layers();
                }
            }
            Request::Denoise(value) => return self.denoise(value),
            Request::Mix { group, gain } => return self.mix(&group, gain),
            Request::Reload => {
                self.is_outdated = true;
                return Ok(());
            }
            Request::Turn(degrees) => {
                if !self.options.environment.as_ref().is_some_and(EnvironmentOption::is_map) {
                    return Err("there is no environment map to turn: drop one, or use --environment".into());
                }
                self.options.environment_rotation = Some(degrees);
                self.is_outdated = true;
                return Ok(());
            }
            Request::Drop(announced) => {
                let page = self.steering.unwrap_or_default();
                self.upload = Some((page, announced, Vec::new()));
                self.reply(page, &json!({"type": "announced"}));
                return Ok(());
            }
            Request::Cursor(at) => {
                self.cursor = at;
                return Ok(());
            }
            _ => return Ok(()),
        }
        self.wish_for(wish).map_err(|error| with_remedy(&error))?;
        if let Some(is_moving) = moves {
            self.refinement.moves(is_moving, now);
        }
        Ok(())
    }

    /// Sets the gain of a light group. No pixel is rendered again.
    fn mix(&mut self, group: &str, gain: [f32; 3]) -> Result<(), String> {
        let names = &self.wish.settings.picture.light_groups;
        let found = names.iter().position(|name| name == group);
        let index = found.ok_or_else(|| format!("there is no light group {group:?}"))?;
        let mut gains = self.gains;
        gains[index] = gain;
        self.set_gains(gains);
        Ok(())
    }

    fn set_gains(&mut self, gains: Gains) {
        if gains != self.gains {
            self.gains = gains;
            self.pages.values_mut().for_each(Page::show_again);
        }
        self.revisions.state += 1;
    }

    /// Shows the final picture denoised, or as it is rendered. No pixel is rendered again.
    fn denoise(&mut self, value: bool) -> Result<(), String> {
        let denoises = self.denoises.as_mut().ok_or("the view has no denoiser: start it with --denoise")?;
        *denoises = value;
        self.pages.values_mut().for_each(Page::show_again);
        self.revisions.state += 1;
        Ok(())
    }

    /// Returns whether the final picture is shown and saved denoised.
    pub(super) fn denoises(&self) -> bool {
        self.denoises == Some(true)
    }

    /// Last whole pass of the newest request; `None` before its first.
    pub(super) fn unsettled(&self) -> Option<Unsettled> {
        let origin = self.done?;
        let mut provenance = self.provenance.clone();
        let assignments = self.wish.assignments();
        provenance.extend(input::provenance(&SceneOptions { assignments, ..self.start.options.clone() }));
        let Origin { step, samples, .. } = origin;
        let spp = self.wish.settings.integrator.samples;
        provenance.insert("unsettled".into(), json!({"step": step, "samples": samples, "of": spp}));
        Some(Unsettled {
            patches: self.canvas.of_pass(origin),
            wish: self.wish.clone(),
            provenance,
            origin: self.scene.offset.to_array(),
        })
    }

    /// Queues a file for a page, if it is still connected.
    pub(super) fn send_file(&mut self, number: PageNumber, message: Vec<u8>) {
        self.of_page(number, |page| page.send_file(message));
    }

    /// Gains of the light groups; `None` for the picture as it is rendered.
    pub(super) fn gains(&self) -> Option<Gains> {
        Some(self.gains).filter(|gains| gains.as_flattened().iter().any(|gain| *gain != 1.0))
    }

    /// Makes `wish` the newest request, if it differs from the present one.
    pub(super) fn wish_for(&mut self, wish: Wish) -> Result<(), RenderError> {
        if wish == self.wish {
            // A new state tells the page that its message was received.
            self.revisions.state += 1;
            return Ok(());
        }
        self.scene = self.start.sketch.with(&wish)?;
        self.refinement.wish(wish.is_other_edition(&self.wish));
        let size = |wish: &Wish| [wish.settings.picture.width, wish.settings.picture.height];
        if size(&wish) != size(&self.wish) {
            self.of_size = self.refinement.version();
        }
        self.wish = wish;
        self.refused = None;
        self.begin_picture();
        Ok(())
    }

    /// Drops the tiles that pages must not show any more. If a pass of an older request may run to its end,
    /// the tiles of that request stay until the newest request has a tile.
    pub(super) fn begin_picture(&mut self) {
        match self.spared() {
            Some(version) => self.canvas.keep_version(version),
            None => self.canvas.clear(),
        }
        self.done = None;
        self.revisions.state += 1;
    }

    /// Number of the request whose running pass is shown to pages; `None` if no pass runs, if it must stop,
    /// or if its picture has an earlier size.
    pub(super) fn spared(&self) -> Option<u32> {
        self.refinement.spares().filter(|version| *version >= self.of_size)
    }

    fn of_page(&mut self, number: PageNumber, act: impl FnOnce(&mut Page)) {
        if let Some(page) = self.pages.get_mut(&number) {
            act(page);
        }
    }

    /// Selects what a page shows. If it is a layer that chips render only on request, and is not rendered
    /// yet, the requested picture is rendered again with all layers.
    fn show(&mut self, number: PageNumber, shown: Shown) -> Result<(), String> {
        let mut wish = self.wish.clone();
        let is_rendered = wish.settings.picture.layers.iter().any(|layer| shown == Shown::Layer(layer));
        if shown.is_of_chip() && !is_rendered && wish.add_layers() {
            if self.steering != Some(number) {
                return Err("this layer is not rendered, and another page steers: take over first".into());
            }
            wish.check_cards().and_then(|()| self.wish_for(wish)).map_err(|error| with_remedy(&error))?;
        }
        self.of_page(number, |page| page.show(shown));
        self.revisions.state += 1;
        Ok(())
    }

    /// Answers a page with the point that pixel `at` shows, in the file's coordinates, and its depth.
    fn pick(&mut self, number: PageNumber, at: [u32; 2]) -> Result<(), String> {
        let camera = self.wish.settings.camera(&self.scene).map_err(|error| with_remedy(&error))?;
        let message = match self.canvas.depth(self.refinement.version(), at) {
            None => json!({"type": "picked", "point": null}),
            Some(depth) => {
                let point = self.wish.settings.seen_point(&camera, at, depth);
                json!({"type": "picked", "point": self.scene.in_file(point).to_array(), "depth": depth})
            }
        };
        self.reply(number, &message);
        Ok(())
    }

    /// Adds a card that a browser lends, from the next pass on.
    pub(super) fn borrow_card(&mut self, card: &LentCard) {
        self.cards.borrow(card);
        self.refinement.card_returns();
        self.revisions.cards += 1;
    }

    /// Removes a card that a browser has lent.
    pub(super) fn return_card(&mut self, card: &LentCard) {
        self.cards.leave(card);
        self.revisions.cards += 1;
    }

    /// Records that a lost card has answered.
    pub(super) fn card_returns(&mut self, address: &CardAddress) {
        self.cards.returns(address);
        self.refinement.card_returns();
        self.revisions.cards += 1;
    }

    /// Takes the next message to a page: `Ok` for text, `Err` for a tile; `None` if there is no message.
    pub(super) fn take(&mut self, number: PageNumber) -> Option<Result<String, Outgoing>> {
        let is_settled = self.refinement.is_settled();
        let version = self.refinement.version();
        let outgoing =
            self.pages.get_mut(&number)?.take(&self.canvas, self.revisions, version, is_settled)?;
        Some(match outgoing {
            Outgoing::Reply(text) => Ok(text),
            Outgoing::State(has_all) => Ok(self.describe(has_all).to_string()),
            Outgoing::Cards => Ok(self.cards.describe().to_string()),
            Outgoing::Tile(patch, shown) => {
                let rendered = if self.denoises() { Shown::Radiance } else { Shown::Rendered };
                let shown = match shown {
                    Shown::Radiance => self.gains().map_or(rendered, Shown::Mix),
                    other => other,
                };
                Err(Outgoing::Tile(patch, shown))
            }
            file @ Outgoing::File(_) => Err(file),
        })
    }

    /// Gives a scene the materials and lights of a request.
    ///
    /// # Errors
    /// If an assignment is not possible, or no light is left.
    pub(super) fn apply(&self, wish: &Wish, scene: &mut Scene) -> Result<(), RenderError> {
        self.start.sketch.apply(wish, scene)
    }

    /// Words of the command that renders the final picture of the newest request.
    pub(super) fn command(&self) -> Vec<String> {
        let Start { options, quality, .. } = &self.start;
        let finish = if self.denoises() { Finish::Denoised } else { Finish::Rendered };
        command_line::words(options, *quality, finish, &self.wish)
    }

    /// State as a message to a page. Its field `settled` can be true only if `has_all`: the page has all
    /// tiles.
    fn describe(&self, has_all: bool) -> Value {
        let settings = &self.wish.settings;
        // The camera is valid: it was checked when the wish was made.
        let camera = settings.camera(&self.scene).map(|camera| {
            let mut described = self.start.facts.camera(&camera, &self.scene);
            if let Some(look_at) = settings.picture.look_at {
                described["look_at"] = json!(look_at);
            }
            described
        });
        let done = self.done.unwrap_or(Origin { version: 0, is_coarse: true, step: COARSEST, samples: 0 });
        json!({
            "type": "state",
            "size": [settings.picture.width, settings.picture.height],
            "camera": camera.unwrap_or_default(),
            "step": done.step,
            "samples": done.samples,
            "spp": settings.integrator.samples,
            "settled": has_all && self.refinement.is_settled(),
            "refused": self.refused,
            "unread": self.unread,
            "version": self.refinement.version(),
            "id": self.message,
            "command": command_line::quoted(&self.command()),
            "changes": describe::changes(&self.wish),
            "settings": describe::settings(settings),
            "denoised": self.denoises(),
            "gains": describe::gains(settings, &self.gains),
            "cost": self.cost.describe(),
        })
    }

    /// Newest request.
    #[cfg(test)]
    pub(super) fn wish(&self) -> &Wish {
        &self.wish
    }

    /// Returns whether the final picture of the newest request is complete.
    #[cfg(test)]
    pub(super) fn is_settled(&self) -> bool {
        self.refinement.is_settled()
    }

    /// Number of tiles held in memory.
    #[cfg(test)]
    pub(super) fn tiles_held(&self) -> usize {
        self.canvas.len()
    }

    /// Number of the newest request.
    pub(super) fn version(&self) -> u32 {
        self.refinement.version()
    }
}

/// Text of an error and its remedy, with flags in place of settings' names.
pub(super) fn with_remedy(error: &RenderError) -> String {
    let remedy = miette::Diagnostic::help(error).map_or(String::new(), |help| format!("; {help}"));
    with_flags(&format!("{error}{remedy}"))
}
