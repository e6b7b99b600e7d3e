//! A view without threads, sockets and clocks of its own, for a page whose host runs in the page.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::task::{Context, Waker};
use std::time::Duration;

use clap::Parser;
use photoncard_driver::render::{ChipWorkers, Renderer};

use super::hub::Hub;
use super::opening::Opening;
use super::pages::Outgoing;
use super::painter::Painter;
use super::state::PageNumber;
use crate::arguments::ViewOptions;
use crate::failure::Failure;

/// Message to the page.
#[derive(Debug, PartialEq, Eq)]
pub enum Message {
    /// JSON.
    Text(String),
    /// Pixels of a tile, or a file.
    Binary(Vec<u8>),
}

/// A view of a scene that one page sees, called with the page's messages and to go on. Emulated cards run
/// where [`ChipWorkers`] start them.
pub struct PageView {
    hub: Arc<Hub>,
    page: PageNumber,
    painting: Pin<Box<dyn Future<Output = ()>>>,
    is_over: bool,
}

#[derive(Parser)]
struct ViewArguments {
    #[command(flatten)]
    options: ViewOptions,
}

impl PageView {
    /// Reads a scene, and begins its view. `arguments` are those of `photoncard view`, without these two
    /// words.
    ///
    /// # Errors
    /// If the arguments are invalid, the scene cannot be read, or the picture cannot be rendered: the message
    /// with its causes and remedy.
    pub fn open(
        arguments: impl IntoIterator<Item = String>,
        workers: Arc<dyn ChipWorkers>,
    ) -> Result<Self, String> {
        let arguments = ["photoncard view".to_owned()].into_iter().chain(arguments);
        let ViewArguments { options } =
            ViewArguments::try_parse_from(arguments).map_err(|error| error.to_string())?;
        let opening = Opening::new(&options).map_err(|failure| with_help(&failure))?;
        let Opening { view, folder, denoiser, scene, dram_bytes } = opening;
        let hub = Arc::new(Hub::new(view, folder, Arc::new(AtomicBool::new(false))).without_waits());
        let renderer = Renderer::with_workers(workers);
        let painter = Painter::new(hub.clone(), (scene, dram_bytes), &options, denoiser, renderer);
        let page = hub.change(|view, _| view.connect());
        Ok(Self { hub, page, painting: Box::pin(painter.run()), is_over: false })
    }

    /// Takes a JSON message of the page.
    pub fn receive(&mut self, text: &str) {
        self.hub.receive(self.page, text);
    }

    /// Takes bytes of a file that the page has announced.
    pub fn receive_bytes(&mut self, bytes: &[u8]) {
        self.hub.receive_bytes(self.page, bytes);
    }

    /// Renders until it would wait: for bytes of a card, a message of the page, or some milliseconds to pass.
    /// Long work of the host, such as tracing photons, is done in one call.
    pub fn go_on(&mut self) {
        if !self.is_over {
            let context = &mut Context::from_waker(Waker::noop());
            self.is_over = self.painting.as_mut().poll(context).is_ready();
        }
    }

    /// Next message to the page, if there is one.
    pub fn next_message(&self) -> Option<Message> {
        loop {
            match self.hub.next_message(self.page, Duration::ZERO)? {
                Ok(text) => return Some(Message::Text(text)),
                Err(Outgoing::Tile(patch, shown)) => return Some(Message::Binary(patch.message(shown))),
                Err(Outgoing::File(message)) => return Some(Message::Binary(message)),
                Err(_) => {}
            }
        }
    }
}

fn with_help(failure: &Failure) -> String {
    let object = failure.json();
    match object["remedy"].as_str() {
        Some(remedy) => format!("{}; {remedy}", failure.line()),
        None => failure.line(),
    }
}
