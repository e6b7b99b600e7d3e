//! Where a render does the work of its cards: on a thread for each, or in turns on one thread.
//!
//! The work of a card is a future. On a thread of its own it waits inside the ports, and never pends. In
//! turns it pends where it would wait, so that a program that is called with messages, as a page of a
//! browser, goes on between them. Both are the same code.

use std::future::{Future, poll_fn};
use std::io;
use std::panic::resume_unwind;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::task::{Context, Poll, Waker};
use std::thread::ScopedJoinHandle;

use photoncard_shared::link::Port;

use crate::emulator::Emulated;

/// Starts emulated chips outside this program, such as in workers of a browser.
pub trait ChipWorkers: Send + Sync {
    /// Starts the card `index` with a chip, and returns the host's end of its link. Reads and writes of the
    /// port do not wait.
    ///
    /// # Errors
    /// If no card can be started.
    fn start(&self, index: usize, chip: Emulated) -> io::Result<Box<dyn Port + Send>>;
}

/// Place of the cards' work.
#[derive(Clone, Default)]
pub(crate) enum Hands {
    /// A thread for each card. Emulated chips run on threads of this process.
    #[default]
    Threads,
    /// Turns on the thread of the render. Emulated chips run elsewhere.
    Turns(Arc<dyn ChipWorkers>),
}

impl Hands {
    /// Does several pieces of work at the same time. Returns the results in the order of the work. Panics if
    /// a piece of work panics.
    pub(crate) async fn all<F>(&self, works: impl Iterator<Item = F>) -> Vec<F::Output>
    where
        F: Future + Send,
        F::Output: Send,
    {
        match self {
            Self::Threads => on_threads(works.map(|work| || completed(work))),
            Self::Turns(_) => in_turns(works).await,
        }
    }

    /// Lets other work go on, if this is work in turns.
    pub(crate) async fn pass(&self) {
        if let Self::Turns(_) = self {
            turn().await;
        }
    }

    /// Returns whether the work has a thread of its own, on which it may wait.
    pub(crate) fn may_wait(&self) -> bool {
        matches!(self, Self::Threads)
    }
}

/// Polls a future until it is complete. Work on threads is complete at the first call.
pub fn completed<F: Future>(future: F) -> F::Output {
    let mut future = pin!(future);
    let context = &mut Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(output) = future.as_mut().poll(context) {
            return output;
        }
    }
}

/// Runs each piece of work on its own thread. Returns the results in the order of the work. Panics if a piece
/// of work panics.
pub(crate) fn on_threads<W: FnOnce() -> T + Send, T: Send>(works: impl Iterator<Item = W>) -> Vec<T> {
    std::thread::scope(|scope| {
        let threads: Vec<_> = works.map(|work| scope.spawn(work)).collect();
        let join = |thread: ScopedJoinHandle<T>| thread.join().unwrap_or_else(|panic| resume_unwind(panic));
        threads.into_iter().map(join).collect()
    })
}

/// Polls pieces of work one after another, until all are complete.
async fn in_turns<F: Future>(works: impl Iterator<Item = F>) -> Vec<F::Output> {
    enum Work<F: Future> {
        Open(Pin<Box<F>>),
        Done(Option<F::Output>),
    }
    let mut works: Vec<Work<F>> = works.map(|work| Work::Open(Box::pin(work))).collect();
    poll_fn(move |context| {
        for work in &mut works {
            if let Work::Open(open) = work
                && let Poll::Ready(output) = open.as_mut().poll(context)
            {
                *work = Work::Done(Some(output));
            }
        }
        let results = works.iter_mut().map(|work| match work {
            Work::Open(_) => None,
            Work::Done(output) => Some(output),
        });
        match results.collect::<Option<Vec<_>>>() {
            Some(outputs) => Poll::Ready(outputs.into_iter().filter_map(Option::take).collect()),
            None => Poll::Pending,
        }
    })
    .await
}

/// Pends once, so that other work goes on.
pub async fn turn() {
    let mut is_over = false;
    poll_fn(|_| if std::mem::replace(&mut is_over, true) { Poll::Ready(()) } else { Poll::Pending }).await;
}
