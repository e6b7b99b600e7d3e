//! Options of tiles, of the order of the work, and of parts.

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::parts::Part;
use photoncard_driver::render::Schedule;
use photoncard_driver::scheduler::GatherOrder;

use super::choice::choice;

#[derive(Args)]
#[command(next_help_heading = "Order of the work")]
pub(crate) struct ScheduleOptions {
    /// Side of a tile, pixels [default: the greatest that all cards can hold; with several cards it is halved
    /// until each card has four tiles, but not below 16]
    #[arg(long, allow_negative_numbers = true, hide_short_help = true)]
    tile: Option<u32>,
    /// Order of the photon gathers; it never changes the picture
    #[arg(long, default_value = Schedule::default().order.name(), value_parser = choice::<GatherOrder>(), hide_short_help = true)]
    pub(super) order: GatherOrder,
    /// Number of direction bins of the gather rays, for orders with bins [default: 99; 8 with --order
    /// buckets]
    #[arg(long, hide_short_help = true)]
    bins: Option<u32>,
    /// Maximum number of gathers that wait on a chip, for orders with a queue [default: the chip's capacity]
    #[arg(long, hide_short_help = true)]
    queue: Option<u32>,
    /// Maximum number of tiles in flight on a chip, whose gathers wait together in the queue [default: the
    /// chip's capacity]
    #[arg(long, allow_negative_numbers = true, hide_short_help = true)]
    in_flight: Option<u32>,
}

#[derive(Args)]
#[command(next_help_heading = "Order of the work")]
pub(crate) struct PartOptions {
    /// Render only the K-th of N parts of the picture, to -o OUT.part; photoncard merge makes the picture
    /// from all parts
    ///
    /// All parts take about the same work, and may be rendered by any machines and cards, in any order. The
    /// merged picture is bit for bit that of one render.
    #[arg(long, value_name = "K/N", conflicts_with_all = ["time", "noise", "keep_samples"])]
    pub(crate) part: Option<Part>,
}

impl ScheduleOptions {
    /// Reports useless options: calls `add(is_useless, name, reason)` for each option that can be useless.
    pub(super) fn without_effect(&self, add: &mut impl FnMut(bool, &str, &str)) {
        let Self { order, bins, queue, in_flight, tile: _ } = self;
        let no_bins = format!("with --order {}, which has no direction bins", order.name());
        let no_queue = format!("with --order {}, by which no gathers wait on a chip", order.name());
        add(bins.is_some() && !order.has_bins(), "--bins", &no_bins);
        add(queue.is_some() && !order.has_queue(), "--queue", &no_queue);
        add(in_flight.is_some() && !order.has_queue(), "--in-flight", &no_queue);
        let in_memory = "with --order buckets, by which as many tiles wait as card memory has room for";
        add(in_flight.is_some() && *order == GatherOrder::Buckets, "--in-flight", in_memory);
    }

    pub(super) fn settings(&self) -> Schedule {
        Schedule {
            tile: self.tile,
            order: self.order,
            bins: self.bins,
            queue: self.queue,
            in_flight: self.in_flight,
            ..Schedule::default()
        }
    }
}
