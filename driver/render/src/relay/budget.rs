//! Budget of a relay: that which all its cards meet.

use photoncard_cards::session::MAX_CREDITS;
use photoncard_shared::budget::Budget;

/// Returns the budget that a relay states: of each capacity the least of all cards, and the sum of their
/// tiles, at most [`MAX_CREDITS`]. Waiting blocks are tiles of frames whose gathers wait in card memory:
/// their sum too, or none if a card has none. Returns `None` for no cards.
pub fn common_budget(budgets: &[Budget]) -> Option<Budget> {
    budgets.iter().copied().reduce(both)
}

fn both(a: Budget, b: Budget) -> Budget {
    let sum = |a: u32, b: u32| a.saturating_add(b).min(MAX_CREDITS);
    let waits = a.waiting_blocks > 0 && b.waiting_blocks > 0;
    Budget {
        tiles: sum(a.tiles, b.tiles),
        waiting_blocks: if waits { sum(a.waiting_blocks, b.waiting_blocks) } else { 0 },
        ..least(a, b)
    }
}

/// Least of both in each capacity.
fn least(a: Budget, b: Budget) -> Budget {
    Budget {
        sram_bytes: a.sram_bytes.min(b.sram_bytes),
        dram_bytes: a.dram_bytes.min(b.dram_bytes),
        photon_cache_bytes: a.photon_cache_bytes.min(b.photon_cache_bytes),
        scene_cache_bytes: a.scene_cache_bytes.min(b.scene_cache_bytes),
        stack_bytes: a.stack_bytes.min(b.stack_bytes),
        tile_pixels: a.tile_pixels.min(b.tile_pixels),
        neighbors: a.neighbors.min(b.neighbors),
        gather_rays: a.gather_rays.min(b.gather_rays),
        gather_queue: a.gather_queue.min(b.gather_queue),
        irradiance_records: a.irradiance_records.min(b.irradiance_records),
        shadow_rays: a.shadow_rays.min(b.shadow_rays),
        samples: a.samples.min(b.samples),
        tiles: a.tiles.min(b.tiles),
        in_flight: a.in_flight.min(b.in_flight),
        waiting_blocks: a.waiting_blocks.min(b.waiting_blocks),
    }
}

/// Returns whether a card has all capacities of the budget that its relay has stated, except numbers of
/// tiles, which are those of all cards together.
pub(super) fn meets(card: &Budget, stated: &Budget) -> bool {
    let Budget { tiles, waiting_blocks, .. } = *stated;
    let of_one = Budget { tiles, waiting_blocks, ..*card };
    least(of_one, *stated) == *stated && card.tiles > 0 && (waiting_blocks == 0 || card.waiting_blocks > 0)
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::kind::{LARGE, MICRO, REFERENCE};

    use super::*;

    #[test]
    fn every_kind_of_card_meets_the_common_budget() {
        let kinds = [REFERENCE, LARGE, MICRO];
        let common = common_budget(&kinds).unwrap();
        assert_eq!(common.tiles, REFERENCE.tiles + LARGE.tiles + MICRO.tiles);
        assert!(kinds.iter().all(|card| meets(card, &common)));
        assert!(!meets(&Budget { neighbors: MICRO.neighbors - 1, ..REFERENCE }, &common));
        assert_eq!(common_budget(&[REFERENCE; 1000]).unwrap().tiles, MAX_CREDITS);
        let without = Budget { waiting_blocks: 0, ..REFERENCE };
        assert_eq!(common_budget(&[REFERENCE, without, LARGE]).unwrap().waiting_blocks, 0);
        assert_eq!(common_budget(&[]), None);
    }
}
