//! `photoncard view`: a page in the browser that shows a scene while it is rendered.
//!
//! - `wish`, `command_line`: the wish, which is the picture that pages request (settings, camera, changes of
//!   the scene), and the command that renders it.
//! - `refinement`: the order of the passes that render a wish, as a state machine.
//! - `canvas`, `pages`, `cards`: tiles of the newest wish; the next message to each page; states of the
//!   cards.
//! - `request`, `describe`: messages from a page, and messages to it.
//! - `state`, `painting`: all of these as one state, without threads, clock, input or output.
//! - `hub`, `painter`, `fitting`: the state under a lock; the thread that renders, and that of pilot renders.
//! - `http`, `gate`, `page_files`, `socket`, `server`: requests, access control, the page's files,
//!   web sockets.
//! - `lending`: cards that browsers lend.
//! - `saving`: pictures that a page saves.
//! - `opening`, `command`, `browser`: beginning of a view; the command; the view whose host is in the page.

pub(crate) mod browser;
mod canvas;
mod cards;
#[cfg(not(target_family = "wasm"))]
mod command;
mod command_line;
mod describe;
mod fitting;
#[cfg(not(target_family = "wasm"))]
mod gate;
#[cfg(not(target_family = "wasm"))]
mod http;
mod hub;
#[cfg(not(target_family = "wasm"))]
mod lending;
mod opening;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod page_files;
mod pages;
mod painter;
mod painting;
mod refinement;
mod request;
mod saving;
#[cfg(not(target_family = "wasm"))]
mod server;
#[cfg(not(target_family = "wasm"))]
mod socket;
mod state;
#[cfg(test)]
mod tests;
mod wish;

#[cfg(not(target_family = "wasm"))]
pub(crate) use self::command::run;
