//! Compares times with closed forms, and with bounds that hold for any frame.

use proptest::prelude::*;

use super::*;

const LINE: f64 = 128.0;
/// Machine on which a line takes 2 ns on the bus, and 100 FLOPs take 1 ns.
const MACHINE: Machine =
    Machine { bandwidth: 64e9, flops: 100e9, latency: 100e-9, tasks: 1, ..Machine::NOMINAL };
const NANOSECOND: f64 = 1e-9;

/// Shares that give each unit all of the chip's arithmetic.
const WHOLE: Shares = Shares { ray_caster: 1.0, controller: 1.0, gather_unit: 1.0 };

fn chip(tasks: u32, queue: u64, policy: Policy) -> TimedChip {
    TimedChip { machine: Machine { tasks, ..MACHINE }, queue, policy }
}

/// Load of `tasks` tasks with `steps` steps each. A step takes `flops` FLOPs, and misses the cache with the
/// frequency `misses`.
fn load(tasks: f64, steps: f64, misses: f64, flops: f64) -> Load {
    let requests = tasks * steps;
    Load { tasks, requests, dram_bytes: requests * misses * LINE, flops: requests * flops }
}

fn frame(rays: Load, gathers: Load) -> FrameLoad {
    FrameLoad { rays, controller_flops: 0.0, gathers }
}

fn seconds(frame: &FrameLoad, chip: &TimedChip) -> f64 {
    frame.times(chip, LINE).seconds
}

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found / expected - 1.0).abs() < tolerance, "{found:e} instead of {expected:e}");
}

#[test]
fn one_task_waits_for_everything_in_turn() {
    for steps in [1.0, 2.5, 40.0] {
        for (misses, nanoseconds) in [(0.0, 5.0), (0.25, 30.5), (1.0, 107.0)] {
            let rays = frame(load(1e5, steps, misses, 500.0), Load::default());
            let found = seconds(&rays, &chip(1, 64, Policy::Alternate)) / (1e5 * steps);
            assert_near(found, nanoseconds * NANOSECOND, 1e-3);
        }
    }
}

#[test]
fn tasks_hide_latency_until_a_resource_is_busy() {
    // If every step misses, the queues are deterministic. A step then takes max(arithmetic, bus, (arithmetic
    // + bus + latency) / tasks).
    for (tasks, flops, nanoseconds) in
        [(4, 500.0, 26.75), (16, 500.0, 6.6875), (64, 500.0, 5.0), (500, 100.0, 2.0)]
    {
        for steps in [1.0, 4.0, 40.0] {
            let rays = frame(load(1e5, steps, 1.0, flops), Load::default());
            let found = seconds(&rays, &chip(tasks, 16_384, Policy::Alternate)) / (1e5 * steps);
            assert_near(found, nanoseconds * NANOSECOND, 0.01);
        }
    }
}

#[test]
fn alternating_units_take_the_sum_of_both_times() {
    let (rays, gathers) = (load(2e6, 3.0, 0.2, 400.0), load(1e6, 6.0, 0.5, 900.0));
    let chip = chip(32, 10_000, Policy::Alternate);
    let alone = |frame| seconds(&frame, &chip);
    let apart = [frame(rays, Load::default()), frame(Load::default(), gathers)].map(alone);
    let times = frame(rays, gathers).times(&chip, LINE);
    assert_near(times.seconds, apart[0] + apart[1], 0.01);
    assert_near(times.draining, apart[1], 0.01);
}

#[test]
fn overlapped_units_take_the_longer_time_and_one_fill_or_drain_of_a_half() {
    // No task reads. Half of the queue has 50 entries, and is filled 100 times. A ray takes 4 or 8 ns, a
    // gather 6 ns.
    for (ray, longer, rest) in [(400.0, 6.0, 4.0), (800.0, 8.0, 6.0)] {
        let both = frame(load(5000.0, 1.0, 0.0, ray), load(5000.0, 1.0, 0.0, 600.0));
        let found = seconds(&both, &chip(16, 100, Policy::Overlapped(WHOLE)));
        assert_near(found, (100.0 * longer + rest) * 50.0 * NANOSECOND, 1e-9);
    }
}

#[test]
fn a_queue_of_one_entry_is_serial() {
    // Every second ray hits. With any number of tasks in flight, 2 rays take 100 + 2 + 3 ns each, and a
    // gather of 2 steps takes 100 + 2 + 7 ns a step.
    let both = frame(load(2e5, 1.0, 1.0, 300.0), load(1e5, 2.0, 1.0, 700.0));
    for policy in [Policy::Alternate, Policy::Overlapped(WHOLE)] {
        assert_near(
            seconds(&both, &chip(1, 1, policy)),
            1e5 * (2.0 * 105.0 + 2.0 * 109.0) * NANOSECOND,
            1e-4,
        );
        // A ray is cast when its place in the queue is free, so that 64 places for tasks do not help.
        let every = FrameLoad { rays: load(1e5, 1.0, 1.0, 300.0), ..both };
        assert_near(seconds(&every, &chip(64, 1, policy)), 1e5 * (105.0 + 2.0 * 109.0) * NANOSECOND, 1e-4);
    }
}

#[test]
fn a_bus_that_both_units_fill_takes_the_sum_of_their_bytes() {
    let both = frame(load(1e6, 4.0, 1.0, 10.0), load(1e6, 2.0, 1.0, 10.0));
    for policy in [Policy::Alternate, Policy::Overlapped(WHOLE)] {
        let times = both.times(&chip(256, 16_384, policy), LINE);
        assert_near(times.seconds, 6e6 * 2.0 * NANOSECOND, 0.02);
        assert_near(times.dram, 6e6 * 2.0 * NANOSECOND, 1e-3);
    }
}

#[test]
fn units_with_shares_of_the_arithmetic_take_as_long_as_the_slowest() {
    // If shares are in proportion to work, each unit takes as long as the whole chip would take for all work.
    // If shares are equal, the gather unit is the slowest.
    let work = FrameLoad {
        rays: load(1e6, 1.0, 0.0, 200.0),
        controller_flops: 1e6 * 100.0,
        gathers: load(1e6, 1.0, 0.0, 700.0),
    };
    let of = |[ray_caster, controller, gather_unit]: [f64; 3]| {
        Policy::Overlapped(Shares { ray_caster, controller, gather_unit })
    };
    for (shares, nanoseconds) in [([0.2, 0.1, 0.7], 10.0), ([1.0 / 3.0; 3], 21.0)] {
        let times = work.times(&chip(16, 2000, of(shares)), LINE);
        assert_near(times.seconds, 1e6 * nanoseconds * NANOSECOND, 2e-3);
        assert_near(times.ray_caster.busy, 1e6 * 2.0 / shares[0] * NANOSECOND, 1e-3);
        assert_near(times.controller, 1e6 * 1.0 / shares[1] * NANOSECOND, 1e-3);
        assert_near(times.gather_unit.busy, 1e6 * 7.0 / shares[2] * NANOSECOND, 1e-3);
    }
}

#[test]
fn the_faster_unit_waits_for_the_queue() {
    let [little, much] = [load(1e6, 1.0, 0.0, 200.0), load(1e6, 1.0, 0.0, 800.0)];
    let chip = chip(16, 1000, Policy::Overlapped(WHOLE));
    let slow_gathers = frame(little, much).times(&chip, LINE);
    assert_near(slow_gathers.ray_caster.queue, 1e6 * 6.0 * NANOSECOND, 0.01);
    assert!(slow_gathers.gather_unit.queue < 0.001 * slow_gathers.seconds);
    let slow_rays = frame(much, little).times(&chip, LINE);
    assert_near(slow_rays.gather_unit.queue, 1e6 * 6.0 * NANOSECOND, 0.01);
    assert!(slow_rays.ray_caster.queue < 0.001 * slow_rays.seconds);
}

#[test]
fn a_unit_whose_tasks_all_read_waits_for_memory() {
    let rays = frame(load(1e5, 1.0, 1.0, 500.0), Load::default());
    let times = rays.times(&chip(1, 100, Policy::Alternate), LINE);
    assert_near(times.ray_caster.memory, 1e5 * 102.0 * NANOSECOND, 1e-3);
    assert_near(times.ray_caster.busy, 1e5 * 5.0 * NANOSECOND, 1e-3);
}

#[test]
fn a_sample_of_drains_extrapolates_to_all() {
    let of = |count: f64| frame(load(2.0 * count, 3.0, 0.3, 300.0), load(count, 2.0, 0.4, 500.0));
    for policy in [Policy::Alternate, Policy::Overlapped(WHOLE)] {
        let chip = chip(16, 1000, policy);
        // All drains of the first frame are simulated, and a few hundredths of those of the second.
        let [few, many] = [4e3, 1e6].map(|count| seconds(&of(count), &chip) / count);
        assert_near(many, few, if policy == Policy::Alternate { 1e-3 } else { 0.15 });
        let whole = run(&of(3e5).plan(&chip, 6e5, LINE), 600_000);
        let sampled = of(3e5).times(&chip, LINE);
        assert_near(sampled.seconds, whole.seconds, 1e-3);
        assert_near(sampled.ray_caster.memory, whole.ray_caster.memory, 0.01);
    }
}

#[test]
fn twice_the_tasks_take_half_the_time_while_no_resource_is_busy() {
    // A step that misses takes 104 ns: 2 on the bus, 100 of latency, 2 of arithmetic.
    let missing = frame(load(1e5, 8.0, 1.0, 200.0), load(1e5, 8.0, 1.0, 200.0));
    for policy in [Policy::Alternate, Policy::Overlapped(WHOLE)] {
        let [few, more] = [4, 8].map(|tasks| seconds(&missing, &chip(tasks, 10_000, policy)));
        assert_near(more, few / 2.0, 0.02);
    }
}

#[test]
fn a_frame_without_work_takes_no_time() {
    for policy in [Policy::Alternate, Policy::Overlapped(Shares::of(&Cost::default()))] {
        assert_eq!(FrameLoad::default().times(&chip(8, 8, policy), LINE), FrameTimes::default());
        let free = frame(load(1e3, 2.0, 0.0, 0.0), load(1e3, 2.0, 0.0, 0.0));
        assert_eq!(seconds(&free, &chip(8, 8, policy)), 0.0);
    }
}

/// Seconds of a frame if all of its work is done in series.
fn in_series(frame: &FrameLoad, shares: &Shares) -> f64 {
    let reads = |load: &Load| load.dram_bytes / MACHINE.bandwidth + load.dram_bytes / LINE * MACHINE.latency;
    let arithmetic = frame.rays.flops / shares.ray_caster
        + frame.controller_flops / shares.controller
        + frame.gathers.flops / shares.gather_unit;
    reads(&frame.rays) + reads(&frame.gathers) + arithmetic / MACHINE.flops
}

fn loads() -> impl Strategy<Value = Load> {
    (1e3..2e4_f64, 1.0..30.0_f64, 0.0..1.0_f64, 1.0..3000.0_f64)
        .prop_map(|(tasks, steps, misses, flops)| load(tasks, steps, misses, flops))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn time_lies_between_the_busiest_resource_and_everything_in_series(
        rays in loads(), gathers in loads(), controller_flops in 0.0..1e8_f64,
        tasks in 1..200_u32, queue in 1..5000_u64, overlaps: bool, share in 0.1..0.8_f64,
    ) {
        let frame = FrameLoad { rays, controller_flops, gathers };
        let shares = Shares { ray_caster: share, controller: 0.1, gather_unit: 0.9 - share };
        let (policy, shares) = if overlaps { (Policy::Overlapped(shares), shares) } else { (Policy::Alternate, WHOLE) };
        let times = frame.times(&chip(tasks, queue, policy), LINE);
        let busiest = [
            rays.flops / shares.ray_caster / MACHINE.flops,
            controller_flops / shares.controller / MACHINE.flops,
            gathers.flops / shares.gather_unit / MACHINE.flops,
            frame.bound(&MACHINE),
        ];
        let least = busiest.into_iter().fold(0.0, f64::max);
        prop_assert!(times.seconds >= 0.995 * least, "{times:?} {least}");
        prop_assert!(times.seconds <= 1.005 * in_series(&frame, &shares), "{times:?}");
        for unit in [times.ray_caster, times.gather_unit] {
            prop_assert!(unit.busy + unit.memory + unit.queue <= 1.005 * times.seconds, "{times:?}");
        }
        prop_assert!(times.dram <= 1.005 * times.seconds && times.draining <= times.seconds);
        prop_assert_eq!(times, frame.times(&chip(tasks, queue, policy), LINE));
    }
}
