//! Order of a view's passes, as a state machine without threads, clock or pixels. It begins with the coarsest
//! picture, and ends with the final picture, which equals that of `photoncard render`.
//!
//! A newer [request](super::wish) stops the running pass of an older one, with two exceptions. After a first
//! pass was stopped, the next first pass runs to its end: pages show pictures however fast requests follow
//! each other. A pass is not stopped while it traces photons that the newest request can use.

use std::time::Duration;

/// Time after the last camera message at which a moving camera counts as resting.
pub(super) const REST: Duration = Duration::from_millis(150);

/// Pause after the first failure of all cards. It doubles with each failure.
const FIRST_PAUSE: Duration = Duration::from_millis(500);
/// Maximum pause after a failure.
const MAX_PAUSE: Duration = Duration::from_secs(8);

/// Side of the squares in the first pass, pixels: one pixel is rendered for each square.
pub(super) const COARSEST: u32 = 8;
/// Maximum expected time of the coarse pass with every pixel for which it directly follows a pass with
/// squares larger than [`FINE`]. Pictures in between would hardly be seen.
const SEEN: Duration = Duration::from_millis(800);
/// Maximum expected time of the coarse pass with every pixel for which it directly follows a pass with
/// squares of at most [`FINE`]. This leaves out the pass with every second column and row, a quarter of the
/// work.
const AWAITED: Duration = Duration::from_secs(4);
/// Maximum side of the squares of a pass, pixels, after which the limit is [`AWAITED`] instead of [`SEEN`].
const FINE: u32 = 4;

/// Pass on the way to the final picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pass {
    /// Picture with cheaper settings: one pixel is rendered for each square with this side, pixels.
    Coarse(u32),
    /// Pilot renders, by which a quality chooses the settings.
    Fit,
    /// Final picture with all its samples, equal to that of `photoncard render`.
    Full,
}

impl Pass {
    /// First pass of each request.
    pub(super) const FIRST: Self = Self::Coarse(COARSEST);
}

/// Pass that follows `pass`, which took `time`; `None` after the last.
fn next_pass(pass: Pass, time: Duration, is_fitted: bool) -> Option<Pass> {
    match pass {
        Pass::Coarse(step) if step > 1 => Some(Pass::Coarse(next_step(step, time))),
        Pass::Coarse(_) if !is_fitted => Some(Pass::Fit),
        Pass::Coarse(_) | Pass::Fit => Some(Pass::Full),
        Pass::Full => None,
    }
}

/// Side of the squares of the pass after one of side `step` that took `time`: 1 if `time * step^2`, the
/// expected time of the pass with every pixel, is within the limit; otherwise `step / 2`.
fn next_step(step: u32, time: Duration) -> u32 {
    let limit = if step > FINE { SEEN } else { AWAITED };
    if time * (step * step) <= limit { 1 } else { step / 2 }
}

/// Pass of the picture that one [`Wish`](super::wish::Wish) requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Work {
    /// Number of the requested picture.
    pub(super) version: u32,
    /// Number of the edition: requests with the same scene and photons have the same edition.
    pub(super) edition: u32,
    pub(super) pass: Pass,
}

/// Result of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The pass is complete.
    Done,
    /// Pilot renders have found settings.
    Fitted {
        /// True if pilot renders have changed the number of photons.
        has_other_photons: bool,
    },
    /// A newer request has stopped the pass.
    Stopped,
    /// No card is left.
    NoCard,
    /// The requested picture cannot be rendered.
    Refused,
}

/// Next action of the rendering thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    Work(Work),
    /// Wait for a change, or until this time.
    Wait(Option<Duration>),
}

/// Progress of the newest requested picture.
#[derive(Debug)]
pub(super) struct Refinement {
    version: u32,
    edition: u32,
    /// Next pass of the newest request; `None` once its final picture is complete.
    pass: Option<Pass>,
    is_fitted: bool,
    is_refused: bool,
    running: Option<Work>,
    /// Time at which the running pass started, or last began or ended its preparation.
    begun: Duration,
    /// True while the running pass traces photons and builds the card image.
    is_preparing: bool,
    /// False after a first pass was stopped, until another one is complete.
    may_stop_first: bool,
    moving_until: Duration,
    retry_at: Duration,
    pause: Duration,
}

impl Refinement {
    /// Creates the state for the first request. `is_fitted` is true if no setting is left to pilot renders.
    pub(super) fn new(is_fitted: bool) -> Self {
        Self {
            version: 1,
            edition: 1,
            pass: Some(Pass::FIRST),
            is_fitted,
            is_refused: false,
            running: None,
            begun: Duration::ZERO,
            is_preparing: false,
            may_stop_first: true,
            moving_until: Duration::ZERO,
            retry_at: Duration::ZERO,
            pause: FIRST_PAUSE,
        }
    }

    /// Number of the newest request, from 1.
    pub(super) fn version(&self) -> u32 {
        self.version
    }

    /// Returns whether the final picture of the newest request is complete.
    pub(super) fn is_settled(&self) -> bool {
        self.pass.is_none()
    }

    /// Returns whether pilot renders have chosen settings, or had none to choose.
    #[cfg(test)]
    pub(super) fn is_fitted(&self) -> bool {
        self.is_fitted
    }

    /// Starts a new request. `is_edit` is true if its scene or photons differ from those of the request
    /// before.
    pub(super) fn wish(&mut self, is_edit: bool) {
        self.version += 1;
        self.edition += u32::from(is_edit);
        self.pass = Some(Pass::FIRST);
        self.is_refused = false;
    }

    /// Has pilot renders choose settings anew, unless `is_fitted`: no setting is left to them.
    pub(super) fn fit_again(&mut self, is_fitted: bool) {
        self.is_fitted = is_fitted;
    }

    /// Records whether the camera is still moving.
    pub(super) fn moves(&mut self, is_moving: bool, now: Duration) {
        self.moving_until = if is_moving { now + REST } else { Duration::ZERO };
    }

    /// Records whether the running pass is preparing: tracing photons and building the card image.
    pub(super) fn prepares(&mut self, is_preparing: bool, now: Duration) {
        (self.is_preparing, self.begun) = (is_preparing, now);
    }

    /// Records that a card is available again.
    pub(super) fn card_returns(&mut self) {
        (self.retry_at, self.pause) = (Duration::ZERO, FIRST_PAUSE);
    }

    /// Returns whether the running pass should stop.
    pub(super) fn must_stop(&self) -> bool {
        let Some(work) = self.running.filter(|work| work.version != self.version) else { return false };
        if work.edition == self.edition && self.is_preparing {
            return false;
        }
        work.pass != Pass::FIRST || self.may_stop_first
    }

    /// Number of the request whose pass is running; `None` if the pass must stop. The request is the newest,
    /// or an older one whose first pass or photons must be completed.
    pub(super) fn spares(&self) -> Option<u32> {
        self.running.filter(|_| !self.must_stop()).map(|work| work.version)
    }

    /// Next action of the rendering thread at time `now`.
    pub(super) fn next(&mut self, now: Duration) -> Next {
        let Some(pass) = self.pass.filter(|_| self.running.is_none() && !self.is_refused) else {
            return Next::Wait(None);
        };
        let is_costly = !matches!(pass, Pass::Coarse(_));
        let begin = if is_costly { self.retry_at.max(self.moving_until) } else { self.retry_at };
        if now < begin {
            return Next::Wait(Some(begin));
        }
        let work = Work { version: self.version, edition: self.edition, pass };
        (self.running, self.begun, self.is_preparing) = (Some(work), now, false);
        Next::Work(work)
    }

    /// Records the end of the running pass.
    pub(super) fn finish(&mut self, outcome: Outcome, now: Duration) {
        let Some(work) = self.running.take() else { return };
        let is_newest = work.version == self.version;
        match outcome {
            Outcome::Done => {
                self.may_stop_first |= work.pass == Pass::FIRST;
                self.card_returns();
                if is_newest {
                    self.pass = next_pass(work.pass, now.saturating_sub(self.begun), self.is_fitted);
                }
            }
            Outcome::Fitted { has_other_photons } => {
                self.is_fitted = true;
                if has_other_photons {
                    self.wish(true);
                } else if is_newest {
                    self.pass = next_pass(work.pass, Duration::ZERO, true);
                }
            }
            Outcome::Stopped => self.may_stop_first &= work.pass != Pass::FIRST,
            Outcome::NoCard => {
                self.retry_at = now + self.pause;
                self.pause = MAX_PAUSE.min(2 * self.pause);
            }
            Outcome::Refused => self.is_refused = is_newest,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Duration = Duration::from_secs(100);

    fn work(refinement: &mut Refinement, now: Duration) -> Work {
        match refinement.next(now) {
            Next::Work(work) => work,
            Next::Wait(until) => panic!("waits until {until:?}"),
        }
    }

    /// Runs all passes until the final picture is complete, and returns them. A coarse pass of side 8 takes
    /// `time`, others in proportion to their pixels.
    fn settle(refinement: &mut Refinement, time: Duration) -> Vec<Pass> {
        let mut passes = Vec::new();
        let mut now = NOW;
        while !refinement.is_settled() {
            let pass = work(refinement, now).pass;
            passes.push(pass);
            let found = Outcome::Fitted { has_other_photons: false };
            if let Pass::Coarse(step) = pass {
                now += time * (COARSEST / step).pow(2);
            }
            refinement.finish(if pass == Pass::Fit { found } else { Outcome::Done }, now);
        }
        passes
    }

    /// Completes the coarse passes in no time.
    fn finish_coarse(refinement: &mut Refinement) {
        for step in [8, 1] {
            assert_eq!(work(refinement, NOW).pass, Pass::Coarse(step));
            refinement.finish(Outcome::Done, NOW);
        }
    }

    #[test]
    fn a_wish_is_refined_from_coarse_to_full() {
        let mut refinement = Refinement::new(false);
        let coarse = [8, 4, 2, 1].map(Pass::Coarse);
        let time = Duration::from_millis(100);
        assert_eq!(settle(&mut refinement, time), [&coarse[..], &[Pass::Fit, Pass::Full]].concat());
        refinement.wish(false);
        assert_eq!(settle(&mut refinement, time), [&coarse[..], &[Pass::Full]].concat());
        assert_eq!(refinement.next(NOW), Next::Wait(None));
    }

    #[test]
    fn coarse_pictures_that_would_hardly_be_seen_are_left_out() {
        for (milliseconds, steps) in
            [(70, &[8, 4, 2, 1][..]), (60, &[8, 4, 1]), (20, &[8, 4, 1]), (10, &[8, 1])]
        {
            let passes = settle(&mut Refinement::new(true), Duration::from_millis(milliseconds));
            let coarse: Vec<_> = steps.iter().map(|&step| Pass::Coarse(step)).collect();
            assert_eq!(passes, [&coarse[..], &[Pass::Full]].concat());
        }
    }

    #[test]
    fn preparation_does_not_count_for_the_time_of_a_pass() {
        let mut refinement = Refinement::new(true);
        work(&mut refinement, NOW);
        refinement.prepares(true, NOW);
        refinement.prepares(false, NOW + Duration::from_secs(3));
        refinement.finish(Outcome::Done, NOW + Duration::from_millis(3010));
        assert_eq!(work(&mut refinement, NOW + Duration::from_secs(4)).pass, Pass::Coarse(1));
    }

    #[test]
    fn a_new_wish_stops_the_running_pass() {
        let mut refinement = Refinement::new(true);
        let first = work(&mut refinement, NOW);
        assert!(!refinement.must_stop());
        refinement.wish(false);
        assert!(refinement.must_stop());
        refinement.finish(Outcome::Stopped, NOW);
        // Another first pass runs to its end: the one before was stopped.
        assert_eq!(work(&mut refinement, NOW), Work { version: first.version + 1, ..first });
        refinement.wish(true);
        assert!(!refinement.must_stop());
        refinement.finish(Outcome::Done, NOW);
        assert_eq!(work(&mut refinement, NOW).version, 3);
    }

    #[test]
    fn photons_of_the_same_scene_are_traced_to_their_end() {
        let mut refinement = Refinement::new(true);
        work(&mut refinement, NOW);
        refinement.prepares(true, NOW);
        refinement.wish(false);
        assert!(!refinement.must_stop());
        refinement.prepares(false, NOW);
        assert!(refinement.must_stop());
        refinement.prepares(true, NOW);
        refinement.wish(true);
        assert!(refinement.must_stop());
    }

    #[test]
    fn costly_passes_wait_until_the_camera_rests() {
        let mut refinement = Refinement::new(true);
        refinement.moves(true, NOW);
        finish_coarse(&mut refinement);
        assert_eq!(refinement.next(NOW), Next::Wait(Some(NOW + REST)));
        assert_eq!(work(&mut refinement, NOW + REST).pass, Pass::Full);
        refinement.finish(Outcome::Stopped, NOW);
        refinement.moves(true, NOW);
        refinement.moves(false, NOW);
        assert_eq!(work(&mut refinement, NOW).pass, Pass::Full);
    }

    #[test]
    fn a_pass_is_retried_later_when_all_cards_fail() {
        let mut refinement = Refinement::new(true);
        let mut pauses = Vec::new();
        let mut now = NOW;
        for _ in 0..8 {
            work(&mut refinement, now);
            refinement.finish(Outcome::NoCard, now);
            let Next::Wait(Some(until)) = refinement.next(now) else { panic!("no pause") };
            pauses.push((until - now).as_millis());
            refinement.wish(false);
            assert_eq!(refinement.next(now), Next::Wait(Some(until)), "a wish brings no card");
            now = until;
        }
        assert_eq!(pauses, [500, 1000, 2000, 4000, 8000, 8000, 8000, 8000]);
        work(&mut refinement, now);
        refinement.finish(Outcome::NoCard, now);
        refinement.card_returns();
        work(&mut refinement, now);
    }

    #[test]
    fn an_impossible_wish_waits_for_another() {
        let mut refinement = Refinement::new(true);
        work(&mut refinement, NOW);
        refinement.finish(Outcome::Refused, NOW);
        assert_eq!(refinement.next(NOW), Next::Wait(None));
        refinement.wish(false);
        settle(&mut refinement, Duration::ZERO);
    }

    #[test]
    fn a_fit_with_other_photons_starts_a_new_edition() {
        let mut refinement = Refinement::new(false);
        finish_coarse(&mut refinement);
        let fit = work(&mut refinement, NOW);
        refinement.finish(Outcome::Fitted { has_other_photons: true }, NOW);
        let work = work(&mut refinement, NOW);
        assert_eq!((work.version, work.edition, work.pass), (fit.version + 1, fit.edition + 1, Pass::FIRST));
        assert!(refinement.is_fitted());
    }
}
