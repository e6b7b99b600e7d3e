//! Opening of a relay's cards, and its loop.

use std::fmt;
use std::time::Instant;

use photoncard_shared::budget::Budget;

use super::link::{CardPort, HostLink};
use super::state::Relay;
use crate::address::check_chips;
use crate::emulator::SharedImage;
use crate::greeting::{GreetedCard, GreetingError, greet, session_number};
use crate::hands::{Hands, completed, on_threads};
use crate::open_card::OpenCard;
use crate::{CardAddress, RenderError, Unobserved};

/// Cards of a relay, which have answered a greeting.
pub struct RelayCards(Vec<(String, CardPort, Budget)>);

impl RelayCards {
    /// Starts or reaches all cards at these addresses, and greets them.
    ///
    /// # Errors
    /// If there is no card, or too many are emulated. The error of the first card that cannot be started or
    /// reached, or whose answer is invalid.
    pub fn open(addresses: &[CardAddress]) -> Result<Self, RenderError> {
        check_chips(addresses.iter().map(CardAddress::emulated_chips).sum())?;
        let start = Instant::now();
        let each = (addresses.iter())
            .flat_map(|address| std::iter::repeat_n(address, address.emulated_chips().max(1)))
            .enumerate();
        let greetings = each.map(|(index, address)| {
            move || {
                let hands = &Hands::Threads;
                let card = OpenCard::open(index, address, hands, None, &SharedImage::default(), None);
                let greeted = card.map_err(GreetingError::from);
                let greeted = greeted.and_then(|card| completed(greet(card, hands, start, &Unobserved)));
                let name = address.name_of(index);
                match greeted {
                    Ok(GreetedCard { card, budget, .. }) => Ok((name, CardPort::new(card), budget)),
                    Err(error) => Err(error.of_card(name)),
                }
            }
        });
        on_threads(greetings).into_iter().collect::<Result<_, _>>().map(Self)
    }

    /// Serves one host after another until the link to them fails. `say` receives messages about cards.
    pub fn serve(self, host: &mut impl HostLink, say: &dyn Fn(fmt::Arguments)) {
        let start = Instant::now();
        let Some(mut relay) = Relay::new(self.0, session_number(), say) else { return };
        while relay.step(host, start.elapsed()).is_ok() {}
    }
}
