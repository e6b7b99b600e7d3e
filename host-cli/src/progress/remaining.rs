//! Estimate of the remaining time of a phase.

use std::collections::VecDeque;

/// Estimates the remaining time of pieces of work that `workers` process in parallel.
///
/// Each worker processes one piece after another. The last completion times of all workers therefore sum to
/// the time spent on finished pieces. Let `n` be the number of pieces finished since the start, `N` the sum
/// of `n` and the number of pieces left, and `t` the mean of the last `min(n, workers)` completion times. The
/// work ends at about `t N / max(n, workers)`. Between completions the estimate counts down, until a piece
/// takes longer than the mean.
pub(crate) struct Remaining {
    workers: usize,
    /// Number of pieces finished before the start.
    before: u64,
    done: u64,
    /// Maximum of `done`, which may decrease when finished pieces are revoked.
    most_done: u64,
    total: u64,
    /// Last completion times, seconds since the start; at most one per worker.
    completions: VecDeque<f64>,
}

impl Remaining {
    /// Creates the estimate at the start, when `before` pieces are finished.
    pub(crate) fn new(workers: usize, before: u64) -> Self {
        let workers = workers.max(1);
        Self { workers, before, done: before, most_done: before, total: before, completions: VecDeque::new() }
    }

    /// Reports `done` of `total` pieces as finished, `now` seconds after the start.
    pub(crate) fn report(&mut self, done: u64, total: u64, now: f64) {
        let new = done.saturating_sub(self.most_done).min(self.workers as u64);
        self.completions.extend((0..new).map(|_| now));
        while self.completions.len() > self.workers {
            self.completions.pop_front();
        }
        (self.done, self.most_done, self.total) = (done, self.most_done.max(done), total);
    }

    /// Remaining seconds at `now` seconds after the start; `None` before the first piece is finished.
    pub(crate) fn seconds(&self, now: f64) -> Option<f64> {
        let finished = self.most_done - self.before;
        if finished == 0 {
            return None;
        }
        let left = self.total.saturating_sub(self.done);
        if left == 0 {
            return Some(0.0);
        }
        let end = |mean: f64, finished: u64, left: u64| {
            mean * (finished + left) as f64 / finished.max(self.workers as u64) as f64
        };
        let known = mean(self.completions.iter().copied());
        // `overdue` is the mean with one more piece, as if it were finished at `now`. This piece replaces the
        // oldest completion if each worker has one.
        let skipped = (self.completions.len() + 1).saturating_sub(self.workers);
        let overdue = mean(self.completions.iter().copied().skip(skipped).chain([now]));
        let expected = end(known, finished, left).max(end(overdue, finished + 1, left - 1));
        Some((expected - now).max(0.0))
    }
}

fn mean(times: impl Iterator<Item = f64> + Clone) -> f64 {
    times.clone().sum::<f64>() / times.count().max(1) as f64
}

#[cfg(test)]
mod tests {
    use photoncard_driver::film::Window;
    use photoncard_driver::scheduler::{GatherOrder, spread, tiles};

    use super::*;

    /// Simulates `workers` that render tiles with these `costs`, seconds: the first free worker takes the
    /// next tile. Returns (time, estimate, true remaining time) at ten times between each two completions.
    fn estimates(costs: &[f64], workers: usize, before: u64) -> Vec<(f64, Option<f64>, f64)> {
        let mut free = vec![0.0_f64; workers];
        let mut ends: Vec<f64> = Vec::new();
        for cost in costs {
            let first = (0..workers).min_by(|a, b| free[*a].total_cmp(&free[*b])).unwrap();
            free[first] += cost;
            ends.push(free[first]);
        }
        ends.sort_by(f64::total_cmp);
        let (end, total) = (ends[ends.len() - 1], before + costs.len() as u64);
        let mut remaining = Remaining::new(workers, before);
        let mut found = Vec::new();
        let mut last = 0.0;
        for (done, &next) in (before..).zip(&ends) {
            for step in 0..10 {
                let now = last + (next - last) * f64::from(step) / 10.0;
                remaining.report(done, total, now);
                found.push((now, remaining.seconds(now), end - now));
            }
            last = next;
        }
        remaining.report(total, total, end);
        assert_eq!(remaining.seconds(end), Some(0.0));
        found
    }

    /// Returns `count` costs from `low` to `high` seconds, varied by the golden ratio's additive recurrence.
    fn varied(count: usize, low: f64, high: f64) -> Vec<f64> {
        (0..count).map(|index| low + (high - low) * (0.618_034 * (index + 1) as f64).fract()).collect()
    }

    /// Checks all estimates from a fifth of the time to `tail` seconds before the end. Each must have a
    /// relative error of at most `share`. Its relative difference from the previous estimate, less the time
    /// since then, must also be at most `share`.
    fn check_steady(estimates: &[(f64, Option<f64>, f64)], share: f64, tail: f64) {
        let end = estimates[0].2;
        let mut previous: Option<(f64, f64)> = None;
        for &(now, found, left) in estimates.iter().filter(|(now, _, left)| *now > 0.2 * end && *left > tail)
        {
            let found = found.expect("an estimate after a fifth of the time");
            assert!((found - left).abs() <= share * left, "{found} s instead of {left} s after {now} s");
            if let Some((before, estimate)) = previous {
                let counted = estimate - (now - before);
                assert!((found - counted).abs() <= share * estimate, "from {estimate} s to {found} s");
            }
            previous = Some((now, found));
        }
    }

    #[test]
    fn there_is_no_estimate_before_the_first_piece() {
        let mut remaining = Remaining::new(2, 5);
        for now in [0.0, 10.0] {
            remaining.report(5, 20, now);
            assert_eq!(remaining.seconds(now), None);
        }
        remaining.report(6, 20, 10.0);
        assert_eq!(remaining.seconds(10.0), Some(65.0));
    }

    #[test]
    fn equal_pieces_are_estimated_exactly_from_the_first_one_on() {
        for workers in [1, 2, 7, 64] {
            for (now, found, left) in estimates(&vec![30.0; 64 * 7], workers, 0) {
                if let Some(found) = found {
                    // The error is up to the 30 s of one piece at the end, where some workers have no piece
                    // left.
                    assert!((found - left).abs() < 30.0 + 1e-6, "{workers}: {found} for {left} after {now}");
                }
            }
        }
    }

    #[test]
    fn a_slow_card_counts_down_evenly() {
        check_steady(&estimates(&varied(60, 80.0, 160.0), 1, 0), 0.33, 160.0);
    }

    #[test]
    fn pieces_of_unequal_cost_are_right_within_a_third_after_a_fifth() {
        for workers in [1, 2, 8] {
            check_steady(&estimates(&varied(256, 0.1, 4.0), workers, 0), 0.33, 8.0);
        }
    }

    /// A fourth of the tiles cost ten times as much as the others; the order of tiles is that of a render.
    #[test]
    fn a_heavy_region_is_right_within_a_third_after_a_fifth() {
        for first_heavy in [0, 8, 20, 24] {
            let tiles = tiles(Window::full(32, 32), 1, GatherOrder::Sort);
            let cost = |row: u32| if (first_heavy..first_heavy + 8).contains(&row) { 10.0 } else { 1.0 };
            let costs: Vec<f64> = spread(tiles).iter().map(|tile| cost(tile.y)).collect();
            // At the end of a render, some of many cards have no tile left.
            for (workers, end) in [(1, 0.1), (4, 0.1), (16, 0.3)] {
                let tail = end * costs.iter().sum::<f64>() / workers as f64;
                check_steady(&estimates(&costs, workers, 0), 0.33, tail);
            }
        }
    }

    #[test]
    fn pieces_of_an_earlier_render_do_not_count_for_the_speed() {
        let costs = varied(100, 1.0, 2.0);
        let [fresh, resumed] = [0, 900].map(|before| estimates(&costs, 2, before));
        assert_eq!(fresh, resumed);
    }

    #[test]
    fn an_overdue_piece_raises_the_estimate() {
        let mut remaining = Remaining::new(1, 0);
        remaining.report(1, 11, 1.0);
        assert_eq!(remaining.seconds(1.0), Some(10.0));
        assert_eq!(remaining.seconds(2.0), Some(9.0));
        // The second piece has taken 9 s and may end at once: nine more take 45 s at the mean of 1 s and 9 s.
        assert!((remaining.seconds(10.0).unwrap() - 45.0).abs() < 1e-9);
    }

    #[test]
    fn revoked_pieces_count_as_remaining() {
        let mut remaining = Remaining::new(1, 0);
        remaining.report(5, 10, 5.0);
        assert_eq!(remaining.seconds(5.0), Some(5.0));
        remaining.report(2, 10, 5.0);
        assert_eq!(remaining.seconds(5.0), Some(8.0));
        remaining.report(10, 10, 13.0);
        assert_eq!(remaining.seconds(13.0), Some(0.0));
    }
}
