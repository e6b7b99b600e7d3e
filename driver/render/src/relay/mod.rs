//! A relay: a host of hosts. To its own host it is one card, and it is the host of the cards behind it, which
//! may be relays as well: a tree.
//!
//! Each frame with lines of the card image is forwarded to all cards as soon as it has arrived, so that an
//! image reaches the cards of a tree after the time of one link, and one frame for each level. The relay
//! stores no line: its host receives a checksum as far as all cards agree on it. Tiles go to the cards as
//! they have room, and come back whole, so that the tiles of a lost card can be rendered by another. The
//! relay checks the order of messages. Values of pixels are checked by its host, which can revoke tiles.
//!
//! | module | contents |
//! |---|---|
//! | [`Relay`], `commands` | the state: the answers of the cards, and tiles; checks of the host's commands |
//! | `card`, `link` | a card and its session; its link, and the link to the host |
//! | `host` | transport to the host, replies and finished tiles that wait for it |
//! | `answers`, `memory_test` | one answer from those of all cards |
//! | `budget` | the budget that all cards meet |
//! | `serve` | opening of the cards, and the loop |

mod answers;
mod budget;
mod card;
mod commands;
mod host;
mod link;
mod memory_test;
mod serve;
mod state;

pub use self::budget::common_budget;
pub use self::link::{CardLink, HostLink};
pub use self::serve::RelayCards;
pub use self::state::Relay;
