//! Thread that reconnects lost cards. It greets each after a pause that doubles, until it answers.

use std::time::Duration;

use photoncard_driver::render::card_ping;

use super::hub::Hub;

/// Time between two polls of the list of lost cards.
const LOOK: Duration = Duration::from_millis(200);
/// Time that a card takes to notice that its host has gone, and to accept another one.
const CHANGE_OF_HOSTS: Duration = Duration::from_millis(100);

/// Greets lost cards until the view is over.
pub(super) fn look_for_cards(hub: &Hub) {
    while !hub.is_over() {
        std::thread::sleep(LOOK);
        let Some((number, address)) = hub.change(|view, now| view.cards.next_to_try(now)) else { continue };
        if card_ping(&address, 1).is_ok() {
            std::thread::sleep(CHANGE_OF_HOSTS);
            hub.card_returns(number);
        }
    }
}
