//! Load balance of a measured frame, by simulating the assignment of its tiles to chips.

use super::super::load_balance::{Balance, LinkModel, Setup, TileOrder, simulate};
use super::super::report::{Panel, Point, XScale, YScale};
use super::present::{panel, series};

/// A policy of assigning tiles: its name, the order of the tiles, and the maximum number of unanswered tile
/// commands of a chip (its credits).
pub(super) type Dealing = (&'static str, TileOrder, usize);

/// Policies that differ in the credits of a chip. Tiles are in the picture's order.
pub(super) const CREDITS: [Dealing; 3] = [
    ("1 credit", TileOrder::Picture, 1),
    ("2 credits", TileOrder::Picture, 2),
    ("4 credits", TileOrder::Picture, 4),
];
/// Policies that differ in the order of the tiles. A chip has one credit.
pub(super) const ORDERS: [Dealing; 3] = [
    ("picture's order", TileOrder::Picture, 1),
    ("random order", TileOrder::Random(1), 1),
    ("longest first", TileOrder::LongestFirst, 1),
];

/// Powers of two from 1 to `most`.
pub(super) fn chip_counts(most: usize) -> Vec<usize> {
    std::iter::successors(Some(1), |chips| Some(2 * chips)).take_while(|&chips| chips <= most).collect()
}

/// Simulates the assignment of tiles, which take the times `seconds`, to `chips` chips. Links take no time.
/// Returns `None` if there are no tiles.
pub(super) fn deal(seconds: &[f64], chips: usize, (_, order, credits): Dealing) -> Option<Balance> {
    simulate(seconds, order, &Setup { chips, credits, link: LinkModel::default() }).ok()
}

/// Panel of a plot over the number of chips, with one line per policy. The last argument has the label and
/// the scale of the vertical axis, and the function that computes the values to plot.
pub(super) fn curves(
    title: &str,
    seconds: &[f64],
    most_chips: usize,
    dealings: &[Dealing],
    (label, scale, value): (&str, YScale, fn(&Balance) -> f64),
) -> Panel {
    let line = |&dealing: &Dealing| {
        let points = chip_counts(most_chips).into_iter().filter_map(|chips| {
            deal(seconds, chips, dealing).map(|balance| Point::new(chips as f64, value(&balance)))
        });
        series(dealing.0, points.collect())
    };
    panel(title, ("chips", "", XScale::Log2), (label, "", scale), dealings.iter().map(line).collect())
}
