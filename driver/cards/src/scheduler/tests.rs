use photoncard_picture::sums::SumFormat;
use photoncard_shared::message::{PIXEL_BYTES, PixelSums};

use super::*;

const SECOND: Duration = Duration::from_secs(1);

/// Scheduler of `tiles` one-pixel tiles.
fn scheduler(tiles: u32, cards: usize) -> Scheduler {
    Scheduler::new((0..tiles).map(tile).collect(), cards)
}

fn tile(id: u32) -> Tile {
    Tile { id, x: id, y: 0, width: 1, height: 1 }
}

fn finished(id: u32, value: u8) -> FinishedTile {
    let counters = Counters { eye_rays: 10, drains: u64::from(value), ..Counters::ZERO };
    let mut records = vec![0; PIXEL_BYTES];
    records[0] = value;
    FinishedTile::new(tile(id), records, SumFormat::ONE, counters).unwrap()
}

/// Finished tile with this sum of green light.
fn lit(id: u32, light: i64) -> FinishedTile {
    let sums = PixelSums { light: [0, light, 0], ..PixelSums::default() };
    FinishedTile::of_pixels(tile(id), [sums], SumFormat::ONE).unwrap()
}

/// Assigns the next tile to a card and returns its id.
fn take(scheduler: &mut Scheduler, card: CardNumber, now: Duration) -> Option<u32> {
    scheduler.take(card, now).map(|assignment| assignment.tile.id)
}

/// Answers with a tile and stores it in the sinks. Returns the outvoted cards.
fn answer(scheduler: &mut Scheduler, card: CardNumber, id: u32, value: u8, now: Duration) -> Vec<CardNumber> {
    let answered = scheduler.answer(card, finished(id, value), now);
    scheduler.complete(id);
    answered.liars
}

#[test]
fn an_idle_card_duplicates_a_late_tile_and_the_first_answer_counts() {
    let mut scheduler = scheduler(4, 3).with_helpers();
    for (card, id) in [(0, 0), (1, 1), (2, 2)] {
        assert_eq!(take(&mut scheduler, card, Duration::ZERO), Some(id));
    }
    // A card that is alone takes more.
    [0, 2].into_iter().for_each(|card| scheduler.set_standing(card, Standing::Lost));
    assert_eq!(take(&mut scheduler, 1, Duration::ZERO), Some(3));
    [0, 2].into_iter().for_each(|card| scheduler.set_standing(card, Standing::Living));
    answer(&mut scheduler, 2, 2, 0, SECOND);
    // The mean time is a second: tiles are duplicated after two.
    assert_eq!(take(&mut scheduler, 2, 3 * SECOND / 2), None);
    assert_eq!(take(&mut scheduler, 2, 2 * SECOND), Some(0));
    assert_eq!(take(&mut scheduler, 2, 9 * SECOND), None, "it is at work");
    answer(&mut scheduler, 2, 0, 0, 3 * SECOND);
    answer(&mut scheduler, 0, 0, 0, 4 * SECOND);
    assert_eq!((scheduler.counts().repeated, scheduler.counters().eye_rays), (1, 20));
    // A card's second tile is not late while it works on the first.
    answer(&mut scheduler, 1, 1, 0, 5 * SECOND);
    assert_eq!(take(&mut scheduler, 0, 6 * SECOND), None);
    answer(&mut scheduler, 1, 3, 0, 6 * SECOND);
    assert!(scheduler.is_complete() && scheduler.counters().eye_rays == 40);
}

#[test]
fn the_last_tiles_go_singly_to_idle_cards() {
    let mut scheduler = scheduler(20, 4);
    let taken = |scheduler: &mut Scheduler, card| {
        std::iter::from_fn(|| take(scheduler, card, Duration::ZERO)).count()
    };
    // 19 tiles wait after the first is assigned, more than 4 for each of the three other cards.
    assert_eq!([0, 1, 2, 3].map(|card| taken(&mut scheduler, card)), [2, 2, 2, 2]);
    for id in 0..8 {
        answer(&mut scheduler, id as CardNumber / 2, id, 0, SECOND);
    }
    assert_eq!([0, 1, 2, 3].map(|card| taken(&mut scheduler, card)), [1, 1, 1, 1]);
}

#[test]
fn a_render_continues_while_its_last_tile_is_in_transit_to_the_sinks() {
    let mut scheduler = scheduler(1, 2);
    for card in 0..2 {
        scheduler.set_standing(card, Standing::Living);
    }
    assert_eq!(take(&mut scheduler, 0, Duration::ZERO), Some(0));
    assert!(scheduler.answer(0, finished(0, 0), SECOND).found.is_some());
    // The other card's thread checks before the sinks have the tile.
    scheduler.check(SECOND).unwrap();
    scheduler.complete(0);
    scheduler.check(SECOND).unwrap();
}

#[test]
fn a_card_finds_a_tile_to_verify_behind_many_of_its_own() {
    const TILES: u32 = 300;
    let mut scheduler = scheduler(TILES, 2).verifying(1.0, 0);
    for card in 0..2 {
        scheduler.set_standing(card, Standing::Living);
    }
    assert_eq!(take(&mut scheduler, 1, SECOND), Some(0));
    for id in 1..TILES {
        assert_eq!(take(&mut scheduler, 0, SECOND), Some(id));
        answer(&mut scheduler, 0, id, 0, SECOND);
    }
    assert_eq!(take(&mut scheduler, 0, SECOND), None);
    answer(&mut scheduler, 1, 0, 0, SECOND);
    scheduler.set_standing(1, Standing::GivenUp);
    assert_eq!(take(&mut scheduler, 0, SECOND), Some(0));
    answer(&mut scheduler, 0, 0, 0, SECOND);
    // No card is left to verify the others.
    assert!(matches!(scheduler.check(SECOND), Err(SchedulerError::Unverified { .. })));
}

#[test]
fn a_late_tile_with_a_crash_is_duplicated() {
    let mut scheduler = scheduler(1, 3).with_helpers();
    assert_eq!(take(&mut scheduler, 0, Duration::ZERO), Some(0));
    scheduler.give_back(0, 0, true, SECOND);
    assert_eq!(take(&mut scheduler, 1, SECOND), Some(0));
    assert_eq!(take(&mut scheduler, 2, 9 * SECOND), Some(0));
}

#[test]
fn without_helpers_no_tile_is_rendered_twice() {
    let mut scheduler = scheduler(1, 2);
    assert_eq!(take(&mut scheduler, 0, Duration::ZERO), Some(0));
    assert_eq!(take(&mut scheduler, 1, 1000 * SECOND), None);
}

#[test]
fn a_card_outvoted_by_two_loses_all_its_tiles() {
    for liar in 0..3 {
        let mut scheduler = scheduler(2, 3).verifying(1e-9, 7);
        let verified = scheduler.entries.iter().position(|entry| entry.is_verified).unwrap() as u32;
        // The wrong card renders the tile that is not verified, and a different version of the verified one.
        let [second, third] = [(liar + 1) % 3, (liar + 2) % 3];
        let [first, other] = if verified == 0 { [second, liar] } else { [liar, second] };
        assert_eq!(
            [take(&mut scheduler, first, SECOND), take(&mut scheduler, other, SECOND)],
            [Some(0), Some(1)]
        );
        answer(&mut scheduler, liar, 1 - verified, 1, SECOND);
        answer(&mut scheduler, second, verified, 0, SECOND);
        assert_eq!(take(&mut scheduler, liar, SECOND), Some(verified));
        assert!(answer(&mut scheduler, liar, verified, 1, SECOND).is_empty());
        assert!(scheduler.check(SECOND).is_ok(), "a third card is left");
        assert_eq!(take(&mut scheduler, third, SECOND), Some(verified));
        assert_eq!(answer(&mut scheduler, third, verified, 0, SECOND), [liar]);
        assert_eq!(scheduler.expel(liar, Some(tile(verified))), [tile(1 - verified)]);
        assert_eq!((scheduler.progress(), scheduler.lie_of(liar)), ((1, 2), Some(tile(verified))));
        assert_eq!(
            [take(&mut scheduler, liar, SECOND), take(&mut scheduler, third, SECOND)],
            [None, Some(1 - verified)]
        );
        answer(&mut scheduler, third, 1 - verified, 0, SECOND);
        assert!(scheduler.is_complete() && scheduler.counters().eye_rays == 20);
    }
}

#[test]
fn two_cards_that_differ_end_the_render() {
    let mut scheduler = scheduler(1, 2).verifying(1.0, 0);
    for card in 0..2 {
        assert!(scheduler.check(SECOND).is_ok());
        assert_eq!(take(&mut scheduler, card, Duration::ZERO), Some(0));
        assert!(answer(&mut scheduler, card, 0, card as u8, SECOND).is_empty());
        assert_eq!(take(&mut scheduler, card, SECOND), None, "a card does not verify itself");
    }
    let sources = vec![Source::Card(0), Source::Card(1)];
    assert_eq!(scheduler.check(SECOND), Err(SchedulerError::Disagreement { tile: tile(0), sources }));
}

/// Checks dazzling (implausibly bright) answers. The answer of a single card is accepted. Of two different
/// answers, the one that is not dazzling is accepted. Two equal answers are accepted.
#[test]
fn dazzling_tiles_are_verified_if_there_is_another_card() {
    let dazzling = 1 << 57;
    for (cards, second, liars, end) in
        [(1, None, vec![], dazzling), (2, Some(7), vec![0], 7), (2, Some(dazzling), vec![], dazzling)]
    {
        let mut scheduler = scheduler(1, cards).with_helpers();
        assert_eq!(take(&mut scheduler, 0, Duration::ZERO), Some(0));
        let mut answered = scheduler.answer(0, lit(0, dazzling), SECOND);
        if let Some(light) = second {
            assert!(answered.found.is_none());
            assert_eq!(take(&mut scheduler, 1, SECOND), Some(0));
            answered = scheduler.answer(1, lit(0, light), SECOND);
        }
        assert_eq!((answered.found, answered.liars), (Some(lit(0, end)), liars));
        scheduler.complete(0);
        assert!(scheduler.is_complete());
        // A tile on which two cards agree counts for neither.
        let of_cards: usize = (0..cards).map(|card| scheduler.dazzling_of(card)).sum();
        assert_eq!(of_cards, usize::from(cards == 1));
    }
    let mut verified = scheduler(1, 2).verifying(1.0, 0);
    for (card, light) in [(0, 7), (1, dazzling)] {
        assert_eq!(take(&mut verified, card, Duration::ZERO), Some(0));
        verified.answer(card, lit(0, light), SECOND);
    }
    assert_eq!((verified.dazzling_of(0), verified.dazzling_of(1)), (0, 0));
    // The other card ends before it is asked, or while it renders.
    for is_at_work in [false, true] {
        let mut scheduler = scheduler(1, 2).with_helpers();
        assert_eq!(take(&mut scheduler, 0, Duration::ZERO), Some(0));
        assert!(scheduler.answer(0, lit(0, dazzling), SECOND).found.is_none());
        if is_at_work {
            assert_eq!(take(&mut scheduler, 1, SECOND), Some(0));
        }
        scheduler.set_standing(1, Standing::GivenUp);
        scheduler.give_back(1, 0, true, SECOND);
        assert!(scheduler.check(SECOND).is_ok());
        assert_eq!(take(&mut scheduler, 0, SECOND), Some(0));
        assert_eq!(scheduler.answer(0, lit(0, dazzling), SECOND).found, Some(lit(0, dazzling)));
        scheduler.complete(0);
        assert_eq!(scheduler.dazzling_of(0), 1);
        scheduler.expel(0, None);
        assert_eq!(scheduler.dazzling_of(0), 0);
    }
    // Without helpers, as with modelled memory, no tile is rendered twice.
    let mut alone = scheduler(1, 2);
    assert_eq!(take(&mut alone, 0, Duration::ZERO), Some(0));
    assert!(alone.answer(0, lit(0, dazzling), SECOND).found.is_some());
    // Radiance within a scene's units is not dazzling, with many samples nor with one.
    for (samples, light, is_dazzling) in
        [(1, 1 << 56, false), (1, i64::MAX, true), (64, 1 << 61, false), (64, 1 << 62, true)]
    {
        let format = SumFormat { samples, ..SumFormat::ONE };
        let sums = PixelSums { light: [light, 0, 0], ..PixelSums::default() };
        let tile = FinishedTile::of_pixels(tile(0), [sums], format).unwrap();
        assert_eq!(tile.is_dazzling(), is_dazzling, "{light} of {samples}");
    }
}

#[test]
fn counters_must_agree_except_those_of_the_gather_queue() {
    for (counters, agrees) in [
        (Counters { eye_rays: 10, drains: 7, most_waiting: 9, ..Counters::ZERO }, true),
        (Counters { eye_rays: 11, ..Counters::ZERO }, false),
        // A card that reads records back works less.
        (Counters { kept_records: 3, ..Counters::default() }, true),
    ] {
        let mut scheduler = scheduler(1, 2).verifying(1.0, 0);
        let mut other = finished(0, 0);
        other.counters = counters;
        for (card, tile) in [finished(0, 0), other].into_iter().enumerate() {
            assert_eq!(take(&mut scheduler, card, Duration::ZERO), Some(0));
            scheduler.answer(card, tile, SECOND);
            scheduler.complete(0);
        }
        assert_eq!(scheduler.is_complete(), agrees);
    }
}

#[test]
fn a_share_of_the_tiles_is_verified_and_one_at_least() {
    let verified = |share, seed| {
        let scheduler = scheduler(10_000, 2).verifying(share, seed);
        scheduler.entries.iter().map(|entry| entry.is_verified).collect::<Vec<_>>()
    };
    let count = |share| verified(share, 1).iter().filter(|&&is_verified| is_verified).count();
    assert_eq!([count(1e-12), count(1.0)], [1, 10_000]);
    assert!((150..250).contains(&count(0.02)), "{}", count(0.02));
    assert!(verified(0.02, 1) == verified(0.02, 1) && verified(0.02, 1) != verified(0.02, 2));
}

#[test]
fn a_tile_with_two_crashes_waits_until_all_others_are_done() {
    let mut scheduler = scheduler(3, 4);
    for card in 0..2 {
        assert_eq!(take(&mut scheduler, card, SECOND), Some(0));
        scheduler.give_back(card, 0, true, SECOND);
        scheduler.set_standing(card, Standing::GivenUp);
    }
    assert_eq!([take(&mut scheduler, 2, SECOND), take(&mut scheduler, 3, SECOND)], [Some(1), Some(2)]);
    answer(&mut scheduler, 3, 2, 0, SECOND);
    assert_eq!(take(&mut scheduler, 3, SECOND), None);
    answer(&mut scheduler, 2, 1, 0, SECOND);
    for card in [3, 2, 2] {
        assert!(scheduler.check(SECOND).is_ok());
        let other = 5 - card;
        let is_next = scheduler.entries[0].crashes_of(card) <= scheduler.entries[0].crashes_of(other);
        assert!(is_next && take(&mut scheduler, card, SECOND) == Some(0));
        scheduler.give_back(card, 0, true, SECOND);
        if card == 2 {
            scheduler.set_standing(3, Standing::GivenUp);
        }
    }
    assert_eq!(scheduler.check(SECOND), Err(SchedulerError::Unrendered { tiles: vec![tile(0)] }));
}

#[test]
fn a_card_that_is_lost_with_several_tiles_in_shares_receives_as_many_one_at_a_time() {
    let mut scheduler = scheduler(9, 2).in_shares(true);
    let taken = |scheduler: &mut Scheduler, card| -> Vec<u32> {
        std::iter::from_fn(|| take(scheduler, card, SECOND)).collect()
    };
    assert_eq!(taken(&mut scheduler, 0), [0, 1, 2, 3, 4]);
    for id in (0..5).rev() {
        scheduler.give_back(0, id, false, SECOND);
    }
    assert!(scheduler.entries.iter().all(|entry| entry.crashes.is_empty()));
    for id in 0..5 {
        assert_eq!(taken(&mut scheduler, 0), [id]);
        answer(&mut scheduler, 0, id, 0, SECOND);
    }
    assert_eq!([taken(&mut scheduler, 1), taken(&mut scheduler, 0)], [[5, 6], [7, 8]]);
}

#[test]
fn tiles_in_shares_take_the_time_of_a_round_together() {
    let mut scheduler = scheduler(12, 2).with_helpers().in_shares(true);
    let taken = |scheduler: &mut Scheduler, card, now| -> Vec<u32> {
        std::iter::from_fn(|| take(scheduler, card, now)).collect()
    };
    assert_eq!(taken(&mut scheduler, 0, Duration::ZERO), [0, 1, 2, 3, 4, 5]);
    assert_eq!(taken(&mut scheduler, 1, Duration::ZERO), [6, 7, 8, 9, 10, 11]);
    for id in 0..6 {
        answer(&mut scheduler, 0, id, 0, 12 * SECOND);
    }
    // Six tiles of ten rays in twelve seconds.
    let of_ray = scheduler.slowest(0).unwrap() / SLOWER_THAN_BEFORE;
    assert!((of_ray - 0.2).abs() < 1e-9, "{of_ray}");
    // The slower card has another twelve seconds for its round.
    assert_eq!(take(&mut scheduler, 0, 23 * SECOND), None);
    assert_eq!(take(&mut scheduler, 0, 25 * SECOND), Some(6));
}

#[test]
fn kept_tiles_are_verified_by_one_card() {
    let window = photoncard_picture::film::Window::full(2, 1);
    let mut film = Film::new(2, 1, window, SumFormat::ONE).unwrap();
    film.write(0, 0, &photoncard_picture::film::PixelSums::default()).unwrap();
    film.write(1, 0, &photoncard_picture::film::PixelSums::default()).unwrap();
    assert!(scheduler(2, 1).with_kept(&film).is_complete());
    assert_eq!(scheduler(2, 1).with_kept(&film).counts().kept_dazzling, 0);
    let dazzling = PixelSums { light: [1 << 57, 0, 0], ..PixelSums::default() };
    let mut bright = film.clone();
    bright.write(1, 0, &dazzling).unwrap();
    let counts = scheduler(2, 1).with_kept(&bright).counts();
    assert_eq!((counts.kept, counts.kept_dazzling, bright.dazzling_pixels()), (2, 1, 1));
    for (values, end) in [([0, 0], None), ([1, 1], Some(SchedulerError::KeptDiffers { tile: tile(0) }))] {
        let mut scheduler = Scheduler::new(vec![tile(0)], 2).verifying(1.0, 0).with_kept(&film);
        let mut fault = None;
        for (card, value) in values.into_iter().enumerate() {
            if take(&mut scheduler, card, SECOND).is_some() {
                fault = scheduler.answer(card, finished(0, value), SECOND).fault;
            }
        }
        assert_eq!((fault, scheduler.is_complete()), (end, values == [0, 0]));
    }
}

#[test]
fn the_time_limit_of_a_card_follows_from_its_own_tiles_or_those_of_others() {
    let mut scheduler = scheduler(3, 2);
    assert_eq!(scheduler.slowest(0), None);
    take(&mut scheduler, 0, Duration::ZERO);
    answer(&mut scheduler, 0, 0, 0, SECOND);
    // Ten rays took a second.
    assert_eq!([scheduler.slowest(0), scheduler.slowest(1)], [Some(0.1 * 50.0), Some(0.1 * 1000.0)]);
}

/// Scheduler of `tiles` tiles for two cards. The first `of_first` are reserved for card 0, the others for
/// card 1.
fn with_homes(tiles: u32, of_first: u32) -> Scheduler {
    let before: Vec<Tile> = (0..tiles).map(tile).collect();
    scheduler(tiles, 2).with_homes(before.iter().map(|tile| (usize::from(tile.id >= of_first), tile)))
}

#[test]
fn a_card_takes_the_tiles_that_it_has_rendered_before() {
    let mut first = scheduler(30, 2);
    for id in 0..30 {
        let card = [0, 1, 1][id as usize % 3];
        assert_eq!(take(&mut first, card, Duration::ZERO), Some(id));
        answer(&mut first, card, id, 0, SECOND);
    }
    let homes: Vec<(CardNumber, Tile)> =
        (0..2).flat_map(|card| first.rendered_by(card).map(move |tile| (card, *tile))).collect();
    let mut second = scheduler(31, 2).with_homes(homes.iter().map(|(card, tile)| (*card, tile)));
    for id in (0..30).step_by(3) {
        assert_eq!(take(&mut second, 0, Duration::ZERO), Some(id));
        answer(&mut second, 0, id, 0, SECOND);
    }
    // A tile that no card has rendered before is available to every card.
    assert_eq!(take(&mut second, 0, SECOND), Some(30));
}

#[test]
fn an_idle_card_takes_the_last_of_many_tiles_of_another() {
    let mut scheduler = with_homes(8, 0);
    assert_eq!(take(&mut scheduler, 1, Duration::ZERO), Some(0));
    for id in [7, 6, 5] {
        assert_eq!(take(&mut scheduler, 0, SECOND / 2), Some(id));
        answer(&mut scheduler, 0, id, 0, SECOND);
    }
    // Four reserved tiles are left to the other card.
    assert_eq!(take(&mut scheduler, 0, SECOND / 2), None);
    // The other card has been at its tile for twice the mean time.
    assert_eq!(take(&mut scheduler, 0, 2 * SECOND), Some(4));
}

#[test]
fn any_card_takes_tiles_reserved_for_a_lost_card_or_of_another_size() {
    let mut scheduler = with_homes(3, 0);
    assert_eq!(take(&mut scheduler, 1, Duration::ZERO), Some(0));
    assert_eq!(take(&mut scheduler, 0, Duration::ZERO), None);
    scheduler.set_standing(1, Standing::Lost);
    scheduler.give_back(1, 0, false, SECOND);
    for id in 0..3 {
        assert_eq!(take(&mut scheduler, 0, SECOND), Some(id));
    }
    let wider = Tile { width: 2, ..tile(0) };
    let mut others = self::scheduler(1, 2).with_homes([(1, &wider)]);
    assert_eq!(take(&mut others, 0, Duration::ZERO), Some(0));
}
