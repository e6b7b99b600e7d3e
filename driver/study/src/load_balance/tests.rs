use photoncard_firmware::sampler::hash;
use proptest::prelude::*;

use super::*;

const NO_LINK: LinkModel = LinkModel { command_seconds: 0.0, result_seconds: 0.0, latency_seconds: 0.0 };

fn balance(costs: &[f64], order: TileOrder, chips: usize, credits: usize, link: LinkModel) -> Balance {
    simulate(costs, order, &Setup { chips, credits, link }).unwrap()
}

/// Costs in whole milliseconds, so that sums are exact in nanoseconds.
fn costs() -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec((0..1000_u32).prop_map(|cost| cost as f64 / 1000.0), 1..200)
}

fn orders() -> impl Strategy<Value = TileOrder> {
    prop_oneof![
        Just(TileOrder::Picture),
        any::<u32>().prop_map(TileOrder::Random),
        Just(TileOrder::LongestFirst)
    ]
}

fn longest(costs: &[f64]) -> f64 {
    costs.iter().copied().fold(0.0, f64::max)
}

/// Minimum makespan over all assignments of tiles to chips.
fn best_makespan(costs: &[f64], chips: usize) -> f64 {
    let ways = chips.pow(costs.len() as u32);
    let makespan = |mut way: usize| {
        let mut work = vec![0.0; chips];
        for cost in costs {
            work[way % chips] += cost;
            way /= chips;
        }
        longest(&work)
    };
    (0..ways).map(makespan).fold(f64::INFINITY, f64::min)
}

/// Tolerance for conversions to and from seconds: a tenth of a nanosecond.
const ROUNDING: f64 = 1e-10;

#[test]
fn a_chip_waits_for_its_command_and_the_host_for_its_result() {
    let link = LinkModel { command_seconds: 0.01, result_seconds: 0.02, latency_seconds: 0.1 };
    let one = balance(&[1.0, 1.0], TileOrder::Picture, 1, 1, link);
    // Each of two tiles takes the time of the command, the latency, the render, the latency, and the result.
    assert!((one.makespan_seconds - 2.0 * (0.01 + 0.1 + 1.0 + 0.1 + 0.02)).abs() < ROUNDING);
    let two = balance(&[1.0, 1.0], TileOrder::Picture, 2, 1, link);
    // The command to the second chip is sent 0.01 s after that to the first. The second result arrives 0.01 s
    // after the first. It waits for the rest of the 0.02 s that the host takes for the first result.
    assert!((two.makespan_seconds - (0.02 + 0.1 + 1.0 + 0.1 + 0.01 + 0.02)).abs() < ROUNDING, "{two:?}");
    assert!((two.host_seconds - 0.06).abs() < ROUNDING);
    assert_eq!([one.most_in_flight, two.most_in_flight], [1, 2]);
}

#[test]
fn a_second_credit_hides_the_latency_of_the_link() {
    let costs = [0.01; 400];
    let link = LinkModel { latency_seconds: 0.005, ..NO_LINK };
    let [one, two, four] = [1, 2, 4].map(|credits| balance(&costs, TileOrder::Picture, 4, credits, link));
    // A tile takes as long as the latencies to the host and back, so that a chip with one credit waits for
    // half of the time.
    assert!((one.idle_share() - 0.5).abs() < 0.01, "{}", one.idle_share());
    // A second credit hides the latency but for each chip's last tile.
    assert!(two.idle_share() < 0.05, "{}", two.idle_share());
    assert!(four.idle_share() <= two.idle_share() + ROUNDING);
}

/// With eight tiles for two cards, one tile waits behind the long one if a card has more than one credit.
#[test]
fn few_tiles_wait_behind_a_long_one() {
    let mut costs = [1.0; 8];
    costs[0] = 10.0;
    let makespan = |credits| balance(&costs, TileOrder::Picture, 2, credits, NO_LINK).makespan_seconds;
    assert_eq!([makespan(1), makespan(4), makespan(8)], [10.0, 11.0, 11.0]);
}

/// Chips with credits for four tiles are hardly more idle than chips that get one tile at a time.
#[test]
fn credits_leave_many_chips_busy() {
    let costs: Vec<f64> = (0..1024).map(|tile| 1.0 + f64::from(hash(tile) % 100) / 50.0).collect();
    for chips in [8, 64, 256] {
        let idle = |credits| balance(&costs, TileOrder::Picture, chips, credits, NO_LINK).idle_share();
        assert!(idle(4) < idle(1) + 0.03, "{chips} chips: {} {}", idle(4), idle(1));
    }
}

#[test]
fn a_busy_host_bounds_the_speed_of_many_chips() {
    let costs = [1.0; 2000];
    let link = LinkModel { command_seconds: 0.001, result_seconds: 0.009, latency_seconds: 0.0 };
    let many = balance(&costs, TileOrder::Picture, 1000, 2, link);
    assert!(many.makespan_seconds >= 20.0 && many.speedup() <= 100.0, "{}", many.speedup());
    assert!(many.host_seconds <= many.makespan_seconds);
}

#[test]
fn longest_first_order_shortens_the_end() {
    let mut costs = [1.0; 9];
    costs[8] = 3.0;
    let makespan = |order| balance(&costs, order, 3, 1, NO_LINK).makespan_seconds;
    assert_eq!(makespan(TileOrder::Picture), 5.0);
    assert_eq!(makespan(TileOrder::LongestFirst), 4.0);
}

#[test]
fn equal_tiles_on_a_divisor_of_chips_leave_none_idle() {
    for chips in [1, 2, 8, 64, 1024] {
        let even = balance(&[0.25; 1024], TileOrder::Picture, chips, 1, NO_LINK);
        assert_eq!([even.speedup(), even.efficiency(), even.idle_share()], [chips as f64, 1.0, 0.0]);
        assert!(even.chip_seconds.iter().all(|&seconds| seconds == even.chip_seconds[0]));
    }
}

#[test]
fn impossible_simulations_are_refused() {
    let simulate = |costs: &[f64], chips, credits, link| {
        simulate(costs, TileOrder::Picture, &Setup { chips, credits, link })
    };
    assert_eq!(simulate(&[], 1, 1, NO_LINK), Err(LoadBalanceError::NoTiles));
    for (chips, credits) in [(0, 1), (1, 0)] {
        assert_eq!(
            simulate(&[1.0], chips, credits, NO_LINK),
            Err(LoadBalanceError::NoChips { chips, credits })
        );
    }
    for time in [-1.0, f64::NAN, f64::INFINITY, 2.0 * MAX_SECONDS] {
        assert!(matches!(simulate(&[time], 1, 1, NO_LINK), Err(LoadBalanceError::Time(_))));
        let link = LinkModel { latency_seconds: time, ..NO_LINK };
        assert!(matches!(simulate(&[1.0], 1, 1, link), Err(LoadBalanceError::Time(_))));
    }
    assert!(simulate(&[MAX_SECONDS; 1000], 1, 1, NO_LINK).is_ok());
}

proptest! {
    #[test]
    fn one_chip_without_links_takes_the_sum_of_the_costs(
        costs in costs(), order in orders(), credits in 1..8_usize,
    ) {
        let one = balance(&costs, order, 1, credits, NO_LINK);
        prop_assert!((one.makespan_seconds - costs.iter().sum::<f64>()).abs() < ROUNDING);
        prop_assert_eq!(one.speedup(), 1.0);
    }

    /// No schedule is faster than the longest tile, nor than an even share of the work.
    #[test]
    fn no_schedule_is_faster_than_the_work_allows(
        costs in costs(), order in orders(), chips in 1..40_usize, credits in 1..8_usize, latency in 0.0..0.5_f64,
    ) {
        let link = LinkModel { command_seconds: 0.001, result_seconds: 0.002, latency_seconds: latency };
        let dealt = balance(&costs, order, chips, credits, link);
        let share = dealt.work_seconds / chips as f64;
        prop_assert!(dealt.makespan_seconds >= longest(&costs).max(share) - ROUNDING);
        prop_assert!(dealt.chip_seconds.iter().all(|&seconds| seconds <= dealt.makespan_seconds));
        prop_assert!((0.0..=1.0).contains(&dealt.idle_share()));
        prop_assert!(dealt.most_in_flight <= (chips * credits).min(costs.len()));
    }

    /// Graham 1966: no chip is idle while a tile waits, so that the last tile starts before an even share of
    /// the remaining work is done. The bound requires links without cost and one credit: with more credits, a
    /// tile that waits for one chip is not available to other chips.
    #[test]
    fn one_credit_without_links_keeps_grahams_bound(
        costs in costs(), order in orders(), chips in 1..40_usize,
    ) {
        let dealt = balance(&costs, order, chips, 1, NO_LINK);
        let chips = chips as f64;
        let bound = dealt.work_seconds / chips + (1.0 - 1.0 / chips) * longest(&costs);
        prop_assert!(dealt.makespan_seconds <= bound + ROUNDING);
    }

    /// Graham 1969: descending cost takes at most `4/3 - 1/(3 chips)` of the optimal time.
    #[test]
    fn longest_first_order_is_within_a_third_of_the_optimum(
        costs in proptest::collection::vec((0..1000_u32).prop_map(|cost| cost as f64 / 1000.0), 1..8),
        chips in 1..4_usize,
    ) {
        let dealt = balance(&costs, TileOrder::LongestFirst, chips, 1, NO_LINK);
        let bound = (4.0 / 3.0 - 1.0 / (3 * chips) as f64) * best_makespan(&costs, chips);
        prop_assert!(dealt.makespan_seconds <= bound + ROUNDING);
    }

    #[test]
    fn every_tile_is_rendered_once_and_simulations_are_reproducible(
        costs in costs(), order in orders(), chips in 1..40_usize, credits in 1..8_usize, latency in 0.0..0.5_f64,
    ) {
        let link = LinkModel { command_seconds: 0.001, result_seconds: 0.002, latency_seconds: latency };
        let dealt = balance(&costs, order, chips, credits, link);
        prop_assert_eq!(dealt.chip_of_tile.len(), costs.len());
        let mut work = vec![0.0; chips];
        for (cost, &chip) in costs.iter().zip(&dealt.chip_of_tile) {
            work[chip] += cost;
        }
        prop_assert!(work.iter().zip(&dealt.chip_seconds).all(|(work, done)| *work <= done + ROUNDING));
        prop_assert!((dealt.host_seconds - 0.003 * costs.len() as f64).abs() < ROUNDING);
        prop_assert_eq!(&dealt, &balance(&costs, order, chips, credits, link));
    }
}
