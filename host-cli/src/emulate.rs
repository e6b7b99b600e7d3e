//! Command `photoncard emulate`.

use photoncard_driver::emulator::serve_card;
use photoncard_driver::link::{HostPort, Listener};

use crate::arguments::EmulateOptions;
use crate::console::{print, say};
use crate::failure::Failure;
use crate::progress::stop_on_signals;

/// Serves an emulated card to one host after another until an interrupt.
pub(crate) fn run(options: &EmulateOptions) -> Result<(), Failure> {
    let stop = stop_on_signals().map_err(|error| Failure::work_error(&error))?;
    let listener = Listener::new(&options.listen).map_err(Failure::work)?;
    if listener.is_public() {
        let address = listener.card_address();
        say(format_args!(
            "photoncard: warning: other machines can reach {address}, and the protocol has no authentication"
        ));
    }
    print(&[listener.card_address().to_owned()])?;
    serve_card(options.chip.or(options.card), &mut HostPort::new(listener, stop, say))
        .map_err(|error| Failure::work_error(&error))?;
    Err(Failure::Stopped("stopped; the card is gone"))
}
