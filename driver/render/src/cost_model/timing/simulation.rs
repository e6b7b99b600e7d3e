//! Discrete-event simulation of a frame. Events are the ends of reads, of arithmetic, and of the controller's
//! work on a ray.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::super::Machine;
use super::quantities::{FrameTimes, Load, UnitTimes};

/// Number of ticks of the simulation per second.
const TICKS: f64 = 1e14;
/// Maximum number of simulated steps of a task. If a task has more steps, each simulated step has the
/// arithmetic, bus time and latencies of several steps, so that the task's total times do not change.
const MAX_STEPS: f64 = 4.0;

/// Sequence of integers with a given real mean, as even as possible.
#[derive(Clone, Copy)]
pub(super) struct Spread {
    each: u64,
    owed: u64,
}

impl Spread {
    const ONE: u64 = 1_000_000_000;

    fn new(mean: f64) -> Self {
        Self { each: (mean * Self::ONE as f64).round() as u64, owed: 0 }
    }

    /// Mean of the sequence.
    pub(super) fn mean(&self) -> f64 {
        self.each as f64 / Self::ONE as f64
    }

    fn next(&mut self) -> u64 {
        self.owed += self.each;
        let whole = self.owed / Self::ONE;
        self.owed %= Self::ONE;
        whole
    }
}

/// Steps of each task of a unit: their number, and their durations in ticks.
#[derive(Clone, Copy)]
pub(super) struct Task {
    /// Number of steps of a task.
    pub(super) steps: Spread,
    /// Number of cache misses of a step.
    misses: Spread,
    /// Time of the arithmetic of a step.
    pub(super) arithmetic: u64,
    /// Time on the DRAM's bus per miss.
    bus: u64,
    /// Latency per miss.
    latency: u64,
}

fn ticks(seconds: f64) -> u64 {
    (seconds * TICKS).round() as u64
}

fn seconds(ticks: u64) -> f64 {
    ticks as f64 / TICKS
}

/// Ratio `amount / by`; 0 if the amount is 0.
fn ratio(amount: f64, by: f64) -> f64 {
    if amount > 0.0 { amount / by } else { 0.0 }
}

impl Task {
    /// Tasks of a load in a unit that has the fraction `share` of the arithmetic of the machine.
    pub(super) fn new(load: &Load, machine: &Machine, share: f64, line_bytes: f64) -> Self {
        let tasks = load.tasks.max(1.0);
        let requests = load.requests.max(tasks);
        let steps = (requests / tasks).min(MAX_STEPS);
        let misses = (load.dram_bytes / line_bytes).min(requests);
        Self {
            steps: Spread::new(steps),
            misses: Spread::new(misses / (tasks * steps)),
            arithmetic: ticks(ratio(load.flops / (tasks * steps), share * machine.flops)),
            bus: ticks(ratio(load.dram_bytes, misses) / machine.bandwidth),
            latency: ticks(machine.latency),
        }
    }
}

/// Parameters of the simulation of a frame on a chip; times in ticks.
pub(super) struct Plan {
    pub(super) rays: Task,
    /// Time of the controller's arithmetic per ray.
    pub(super) controller: u64,
    pub(super) gathers: Task,
    /// Fraction of the rays that lead to a gather.
    pub(super) hits: f64,
    /// Maximum number of tasks in flight per unit.
    pub(super) in_flight: u64,
    /// Number of entries of the queue.
    pub(super) queue: u64,
    /// True if all units share one arithmetic unit, and no rays are cast while the queue is drained.
    pub(super) is_shared: bool,
}

impl Plan {
    fn alternates(&self) -> bool {
        self.is_shared || self.queue < 2
    }

    /// Number of filled queue entries at which a drain begins.
    pub(super) fn entries(&self) -> u64 {
        if self.alternates() { self.queue } else { self.queue / 2 }
    }

    /// Number of queue entries that rays may fill or reserve. It is smaller while the queue is drained.
    fn room(&self, is_draining: bool) -> u64 {
        match (self.alternates(), is_draining) {
            (true, true) => 0,
            (true, false) | (false, true) => self.entries(),
            (false, false) => 2 * self.entries(),
        }
    }
}

/// Resource that serves one request at a time, in the order of arrival.
#[derive(Clone, Copy, Default)]
struct Server {
    is_free: u64,
    busy: u64,
}

impl Server {
    /// Serves a request that takes `time` ticks. Returns the time at which it ends. A request of 0 ticks does
    /// not wait.
    fn serve(&mut self, now: u64, time: u64) -> u64 {
        if time == 0 {
            return now;
        }
        self.busy += time;
        self.is_free = now.max(self.is_free) + time;
        self.is_free
    }
}

/// A unit that has tasks.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Unit {
    RayCaster,
    GatherUnit,
}

/// Event at which a task continues.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    /// The data have arrived. The number counts the remaining steps, including this one.
    Read(Unit, u64),
    /// The arithmetic is done. The number counts the remaining steps, excluding this one.
    Computed(Unit, u64),
    /// The controller has finished a ray.
    Controlled,
}

/// Numbers of tasks of a unit in each state, and the times in which the unit computes or waits.
struct UnitState {
    task: Task,
    busy: u64,
    /// Number of tasks that wait for reads. `computing` is the number of tasks that compute or wait for the
    /// arithmetic unit.
    reading: u64,
    computing: u64,
    memory_wait: u64,
    queue_wait: u64,
}

impl UnitState {
    fn new(task: Task) -> Self {
        Self { task, busy: 0, reading: 0, computing: 0, memory_wait: 0, queue_wait: 0 }
    }

    /// Adds the time span `time`, in which no event occurs, to the time of waiting for memory or for the
    /// queue, if no task computes.
    fn pass(&mut self, time: u64, waits_for_queue: bool) {
        if self.computing > 0 {
            return;
        }
        if self.reading > 0 {
            self.memory_wait += time;
        } else if waits_for_queue {
            self.queue_wait += time;
        }
    }

    fn times(&self) -> UnitTimes {
        UnitTimes {
            busy: seconds(self.busy),
            memory: seconds(self.memory_wait),
            queue: seconds(self.queue_wait),
        }
    }
}

struct Simulation<'a> {
    plan: &'a Plan,
    now: u64,
    /// Events in the order of time, then in the order in which they were scheduled.
    events: BinaryHeap<Reverse<(u64, u64, Event)>>,
    foreseen: u64,
    /// Arithmetic units of ray caster, gather unit and controller. If they share one unit, it is the first.
    arithmetic: [Server; 3],
    bus: Server,
    units: [UnitState; 2],
    controller_busy: u64,
    hits: Spread,
    /// Number of rays that have not begun.
    rays: u64,
    /// Number of rays in flight. Each has a reserved queue entry.
    casting: u64,
    /// Number of gathers in the half of the queue that is being filled.
    filling: u64,
    /// Number of gathers of the current drain that have not begun. `draining` counts those that have not
    /// ended.
    ready: u64,
    draining: u64,
    drain_time: u64,
}

/// Simulates `rays` rays and the gathers that they lead to. Returns the times of the frame and its units.
pub(super) fn run(plan: &Plan, rays: u64) -> FrameTimes {
    let mut simulation = Simulation::new(plan, rays);
    simulation.begin_tasks();
    while let Some(Reverse((time, _, event))) = simulation.events.pop() {
        simulation.pass_to(time);
        simulation.end(event);
        simulation.begin_tasks();
    }
    simulation.times()
}

impl<'a> Simulation<'a> {
    fn new(plan: &'a Plan, rays: u64) -> Self {
        Self {
            plan,
            now: 0,
            events: BinaryHeap::new(),
            foreseen: 0,
            arithmetic: [Server::default(); 3],
            bus: Server::default(),
            units: [UnitState::new(plan.rays), UnitState::new(plan.gathers)],
            controller_busy: 0,
            hits: Spread::new(plan.hits),
            rays,
            casting: 0,
            filling: 0,
            ready: 0,
            draining: 0,
            drain_time: 0,
        }
    }

    fn times(&self) -> FrameTimes {
        let [ray_caster, gather_unit] = [0, 1].map(|unit: usize| self.units[unit].times());
        FrameTimes {
            seconds: seconds(self.now),
            draining: seconds(self.drain_time),
            ray_caster,
            controller: seconds(self.controller_busy),
            gather_unit,
            dram: seconds(self.bus.busy),
        }
    }

    fn pass_to(&mut self, time: u64) {
        let passed = time - self.now;
        self.now = time;
        if self.draining > 0 {
            self.drain_time += passed;
        }
        let has_rays = self.rays > 0;
        let waits_for_rays = self.draining == 0 && (has_rays || self.casting > 0 || self.filling > 0);
        self.units[0].pass(passed, has_rays && self.casting == 0);
        self.units[1].pass(passed, waits_for_rays);
    }

    fn foresee(&mut self, time: u64, event: Event) {
        self.foreseen += 1;
        self.events.push(Reverse((time, self.foreseen, event)));
    }

    /// Begins a drain of the queue if one is due, and as many tasks as may be in flight.
    fn begin_tasks(&mut self) {
        let is_full = self.filling >= self.plan.entries();
        let is_last = self.rays == 0 && self.casting == 0;
        if self.draining == 0 && self.filling > 0 && (is_full || is_last) {
            self.ready = self.filling;
            self.draining = self.filling;
            self.filling = 0;
        }
        let room = self.plan.room(self.draining > 0);
        while self.rays > 0 && self.casting < self.plan.in_flight && self.casting + self.filling < room {
            self.rays -= 1;
            self.casting += 1;
            self.begin(Unit::RayCaster);
        }
        while self.ready > 0 && self.draining - self.ready < self.plan.in_flight {
            self.ready -= 1;
            self.begin(Unit::GatherUnit);
        }
    }

    fn begin(&mut self, unit: Unit) {
        let steps = self.units[unit as usize].task.steps.next();
        self.read(unit, steps);
    }

    fn read(&mut self, unit: Unit, steps: u64) {
        let state = &mut self.units[unit as usize];
        let misses = state.task.misses.next();
        if misses == 0 {
            return self.compute(unit, steps);
        }
        state.reading += 1;
        let latency = misses * state.task.latency;
        let arrival = self.bus.serve(self.now, misses * state.task.bus) + latency;
        self.foresee(arrival, Event::Read(unit, steps));
    }

    fn compute(&mut self, unit: Unit, steps: u64) {
        let state = &mut self.units[unit as usize];
        state.computing += 1;
        let time = state.task.arithmetic;
        state.busy += time;
        let end = self.serve(unit as usize, time);
        self.foresee(end, Event::Computed(unit, steps - 1));
    }

    /// Schedules `time` ticks of arithmetic of the unit with index `unit`; index 2 is the controller. Returns
    /// the time at which the arithmetic ends.
    fn serve(&mut self, unit: usize, time: u64) -> u64 {
        let server = if self.plan.is_shared { 0 } else { unit };
        self.arithmetic[server].serve(self.now, time)
    }

    fn end(&mut self, event: Event) {
        match event {
            Event::Read(unit, steps) => {
                self.units[unit as usize].reading -= 1;
                self.compute(unit, steps);
            }
            Event::Computed(unit, steps) => {
                self.units[unit as usize].computing -= 1;
                match unit {
                    _ if steps > 0 => self.read(unit, steps),
                    Unit::RayCaster => {
                        let time = self.plan.controller;
                        self.controller_busy += time;
                        let end = self.serve(self.units.len(), time);
                        self.foresee(end, Event::Controlled);
                    }
                    Unit::GatherUnit => self.draining -= 1,
                }
            }
            Event::Controlled => {
                self.casting -= 1;
                self.filling += self.hits.next();
            }
        }
    }
}
