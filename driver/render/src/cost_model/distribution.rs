//! Distribution of data from the host to all chips, such as changed lines of the photon map.

use super::{Machine, Symbols};

/// Method by which data get from the host to all chips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// The host sends the data to each chip separately. The data pass the host's link once per chip.
    Separate,
    /// The data pass a tree of switches between host and chips (dissertation, figure 7.1), and the host's
    /// link only once. Each switch forwards a frame to all its links as soon as it has received the whole
    /// frame, at the speed of the host's link.
    Tree,
}

impl Distribution {
    /// Number of levels of switches between the host and `N = chips` chips: `ceil(log_f N)` with the fan-out
    /// `f`; 0 for one chip.
    pub fn levels(chips: u64, symbols: &Symbols) -> u32 {
        let mut reached = 1.0;
        let mut levels = 0;
        while reached < chips as f64 {
            reached *= symbols.fan_out;
            levels += 1;
        }
        levels
    }

    /// Seconds until all `N = chips` chips have received `I = bytes` bytes over a link of `B` bytes/s. It is
    /// `N I / B` separately, and `I / B + ceil(log_f N) S_F / B` by a tree; 0 without data.
    pub fn seconds(self, bytes: f64, chips: u64, symbols: &Symbols, machine: &Machine) -> f64 {
        match self {
            _ if bytes <= 0.0 => 0.0,
            Self::Separate => chips as f64 * bytes / machine.link,
            Self::Tree => (bytes + Self::delayed(chips, symbols)) / machine.link,
        }
    }

    /// Maximum number of bytes that every chip can receive in the given time.
    pub fn bytes_within(self, seconds: f64, chips: u64, symbols: &Symbols, machine: &Machine) -> f64 {
        let carried = seconds * machine.link;
        match self {
            Self::Separate => carried / chips.max(1) as f64,
            Self::Tree => (carried - Self::delayed(chips, symbols)).max(0.0),
        }
    }

    /// Delay by all levels of switches, as the number of bytes that the host's link transfers meanwhile.
    fn delayed(chips: u64, symbols: &Symbols) -> f64 {
        f64::from(Self::levels(chips, symbols)) * symbols.frame_bytes
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::Distribution::{Separate, Tree};
    use super::*;

    const MACHINE: Machine = Machine { link: 1000.0, ..Machine::NOMINAL };

    fn symbols(fan_out: f64) -> Symbols {
        Symbols { fan_out, frame_bytes: 50.0, ..Symbols::NOMINAL }
    }

    #[test]
    fn a_tree_has_as_many_levels_as_its_fan_out_needs() {
        let levels = |chips, fan_out| Distribution::levels(chips, &symbols(fan_out));
        assert_eq!([1, 2, 3, 4, 5, 8, 9].map(|chips| levels(chips, 2.0)), [0, 1, 2, 2, 3, 3, 4]);
        assert_eq!([1, 8, 9, 64, 65].map(|chips| levels(chips, 8.0)), [0, 1, 2, 2, 3]);
    }

    #[test]
    fn times_have_a_closed_form() {
        let seconds =
            |distribution: Distribution, chips| distribution.seconds(3000.0, chips, &symbols(4.0), &MACHINE);
        assert_eq!([1, 2, 16].map(|chips| seconds(Separate, chips)), [3.0, 6.0, 48.0]);
        assert_eq!([1, 4, 16].map(|chips| seconds(Tree, chips)), [3.0, 3.05, 3.1]);
        assert_eq!([Separate, Tree].map(|way| way.seconds(0.0, 9, &symbols(4.0), &MACHINE)), [0.0; 2]);
    }

    #[test]
    fn an_upload_takes_the_time_computed_by_hand() {
        // 12.75 MB to each of 3 cards, 30 times a second: 1.15 GB/s.
        let seconds = Separate.seconds(12.75e6, 3, &Symbols::NOMINAL, &Machine::NOMINAL);
        let rate = 30.0 * seconds * Machine::NOMINAL.link;
        assert!((rate / 1.1475e9 - 1.0).abs() < 1e-12, "{rate}");
    }

    proptest! {
        #[test]
        fn bytes_within_a_time_take_that_time(
            seconds in 0.01..10.0_f64, chips in 1..500_u64, fan_out in 2..20_u32,
        ) {
            let symbols = symbols(f64::from(fan_out));
            for way in [Separate, Tree] {
                let bytes = way.bytes_within(seconds, chips, &symbols, &MACHINE);
                if bytes > 0.0 {
                    let found = way.seconds(bytes, chips, &symbols, &MACHINE);
                    prop_assert!((found / seconds - 1.0).abs() < 1e-9, "{way:?}: {found}");
                }
            }
        }

        #[test]
        fn a_tree_is_slower_than_separate_sends_only_below_its_delay(
            bytes in 1.0..1e9_f64, chips in 1..500_u64, fan_out in 2..20_u32,
        ) {
            let symbols = symbols(f64::from(fan_out));
            let [separate, tree] = [Separate, Tree].map(|way| way.seconds(bytes, chips, &symbols, &MACHINE));
            let delayed = f64::from(Distribution::levels(chips, &symbols)) * symbols.frame_bytes;
            prop_assert_eq!(tree <= separate * (1.0 + 1e-12), delayed <= (chips - 1) as f64 * bytes * (1.0 + 1e-12));
        }
    }
}
