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
    /// Side of a tile, pixels [default: the widest that all cards have room for, for several cards halved
    /// until each has four tiles, down to 16]
    #[arg(long, allow_negative_numbers = true, hide_short_help = true)]
    tile: Option<u32>,
    /// Order of the photon gathers; it never changes the picture
    #[arg(long, default_value = Schedule::default().order.name(), value_parser = choice::<GatherOrder>(), hide_short_help = true)]
    pub(super) order: GatherOrder,
    /// Direction bins of the gather rays, for orders with bins [default: 99]
    #[arg(long, hide_short_help = true)]
    bins: Option<u32>,
    /// Gathers that may wait on a chip, for orders with a queue [default: the chip's capacity]
    #[arg(long, hide_short_help = true)]
    queue: Option<u32>,
    /// Tiles in flight on a chip, whose gathers may wait in the queue together [default: the chip's capacity]
    #[arg(long, allow_negative_numbers = true, hide_short_help = true)]
    in_flight: Option<u32>,
}

#[derive(Args)]
#[command(next_help_heading = "Order of the work")]
pub(crate) struct PartOptions {
    /// Render the K-th of N parts of the picture alone, to -o OUT.part; photoncard merge makes the picture of
    /// all
    ///
    /// Parts cost about alike, and may be rendered by any machines and cards, in any order. The picture is,
    /// to the bit, that of one render.
    #[arg(long, value_name = "K/N", conflicts_with_all = ["time", "noise", "keep_samples"])]
    pub(crate) part: Option<Part>,
}

impl ScheduleOptions {
    /// Calls `add` for options that others may make useless, with: true if it is so, option, reason.
    pub(super) fn without_effect(&self, add: &mut impl FnMut(bool, &str, &str)) {
        let Self { order, bins, queue, in_flight, tile: _ } = self;
        let no_bins = format!("with --order {}, which has no direction bins", order.name());
        let no_queue = format!("with --order {}, by which no gathers wait on a chip", order.name());
        add(bins.is_some() && !order.has_bins(), "--bins", &no_bins);
        add(queue.is_some() && !order.has_queue(), "--queue", &no_queue);
        add(in_flight.is_some() && !order.has_queue(), "--in-flight", &no_queue);
    }

    /// Settings of these options.
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
