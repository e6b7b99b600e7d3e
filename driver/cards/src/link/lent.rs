//! Links to cards that another part of this program reaches, such as those in pages of browsers.

use std::fmt;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use super::system::LinkError;
use super::{LoopbackPort, loopback};

/// Bytes that a link holds in each direction.
const CAPACITY: usize = 64 << 10;

/// Card that its owner lends to the renders of this process. The owner carries the bytes of each link.
#[derive(Clone, Debug)]
pub struct LentCard {
    name: Arc<str>,
    links: Sender<LoopbackPort>,
}

impl LentCard {
    /// Lends a card of this name. The owner receives the card's end of each link that a host opens, one after
    /// another, and takes the card back by dropping the receiver. Two calls lend different cards, also by one
    /// name.
    pub fn lend(name: &str) -> (Self, Receiver<LoopbackPort>) {
        let (links, opened) = channel();
        (Self { name: name.into(), links }, opened)
    }

    /// Opens a link to the card. Returns the host's end.
    ///
    /// # Errors
    /// If the owner has taken the card back.
    pub(super) fn open(&self) -> Result<LoopbackPort, LinkError> {
        let (host, card) = loopback(CAPACITY);
        let sent = self.links.send(card);
        sent.map(|()| host).map_err(|_| LinkError::taken_back(self))
    }
}

impl PartialEq for LentCard {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.name, &other.name)
    }
}

impl Eq for LentCard {}

impl fmt::Display for LentCard {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use photoncard_shared::link::{Port, PortError};

    use super::*;

    const SOON: Duration = Duration::from_millis(100);

    #[test]
    fn each_host_has_a_link_of_its_own() {
        let (card, links) = LentCard::lend("phone");
        for byte in [1, 2] {
            let mut host = card.open().unwrap();
            let mut end = links.try_recv().unwrap();
            assert_eq!(host.write(&[byte], SOON), Ok(1));
            let mut buffer = [0; 2];
            assert_eq!((end.read(&mut buffer, SOON), buffer[0]), (Ok(1), byte));
            drop(host);
            assert_eq!(end.read(&mut buffer, SOON), Err(PortError::Closed));
        }
    }

    #[test]
    fn a_card_that_is_taken_back_is_not_reached() {
        let (card, links) = LentCard::lend("phone");
        assert!(card.open().is_ok());
        drop(links);
        let error = card.open().map(|_| ()).unwrap_err();
        assert_eq!(error.to_string(), "cannot connect to phone: its owner has taken it back");
    }

    #[test]
    fn cards_are_equal_to_themselves_alone() {
        let [(one, _a), (two, _b)] = [LentCard::lend("phone"), LentCard::lend("phone")];
        assert!(one == one.clone() && one != two);
    }
}
