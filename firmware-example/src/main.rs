//! A winch controller around `cdpr-core`: 10 s of it at 1 kHz, in QEMU.
//!
//! ```text
//! cargo firmware         # Cortex-M4F, f32
//! cargo firmware-m7      # Cortex-M7, f64
//! ```
//!
//! `SysTick` interrupts 1000 times a second; the control law runs there, on data that nothing else can
//! reach. What is worth telling goes through a queue without locks to the main loop, which logs it: the
//! log never delays the law by more than the few instructions in which it writes a frame.
//!
//! On any other target this is an empty program.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod image {
    use core::cell::Cell;
    use core::sync::atomic::{AtomicU32, Ordering};

    use cdpr_core::controller::{Event, EventKind, Refusal};
    use cdpr_core::{CABLES, Table};
    use cdpr_firmware_example::board::{self, Counter};
    use cdpr_firmware_example::control::{
        Control, Request, Summary, WayPoints, Winches, start_controller,
    };
    use cdpr_firmware_example::rehearsal::{Rehearsal, TICKS};
    use cdpr_firmware_example::{Float, path, robot, stack};
    use cortex_m::peripheral::SCB;
    use cortex_m::{Peripherals, singleton};
    use cortex_m_rt::exception;
    use critical_section::Mutex;
    use defmt::{Debug2Format, Display2Format, error, info, warn};
    use heapless::spsc::{Consumer, Producer, Queue};

    /// Reports that may wait for the main loop; more than it ever falls behind.
    const WAITING: usize = 32;

    /// A report of the rest lengths after so many ticks.
    const PROGRESS_TICKS: u32 = 1_000;

    /// What is worth telling, with the tick it happened at where the log's own time would be late.
    #[derive(Clone, Copy)]
    enum Report {
        Progress { rest_lengths_m: [Float; CABLES] },
        Event(Event<Float>),
        Refused { tick: u32, refusal: Refusal<Float> },
        Recovered { tick: u32, cost: u32 },
        Finished { summary: Summary<Float>, cost: Cost },
    }

    /// What the ticks have cost.
    #[derive(Clone, Copy)]
    struct Cost {
        /// All together, in the board's unit.
        total: u64,
        /// The dearest.
        worst: u32,
        /// Ticks that were not done when the next was due, for another reason than a recovery.
        overruns: u32,
        /// Reports that found the queue full.
        dropped: u32,
    }

    /// All that the interrupt works on.
    struct Law {
        rehearsal: Rehearsal<'static, Float>,
        control: Control<'static, Float>,
        summary: Summary<Float>,
        counter: Counter,
        cost: Cost,
        /// A recovery has taken longer than a tick, and what was due since is not done yet.
        is_late: bool,
        reports: Producer<'static, Report>,
    }

    /// On its way from `main` to the interrupt.
    static HANDOVER: Mutex<Cell<Option<&'static mut Law>>> = Mutex::new(Cell::new(None));

    /// Ticks so far: the time of the log.
    static TICK: AtomicU32 = AtomicU32::new(0);

    defmt::timestamp!("{=u32:ms}", TICK.load(Ordering::Relaxed));

    #[exception]
    fn SysTick() {
        static mut LAW: Option<&'static mut Law> = None;
        if LAW.is_none() {
            *LAW = critical_section::with(|cs| HANDOVER.borrow(cs).take());
        }
        if let Some(law) = LAW {
            law.tick();
        }
    }

    impl Law {
        fn tick(&mut self) {
            if self.summary.ticks == TICKS {
                return;
            }
            // A real controller reads buttons and encoders here, and an interrupt of its fieldbus fills
            // the queue of way-points.
            let inputs = self.rehearsal.inputs(&self.control.state());
            let (outcome, cost) = self.counter.count(|| self.control.tick(&inputs));

            self.summary.add_tick(&self.control, &outcome.outputs);
            let tick = self.summary.ticks;
            TICK.store(tick, Ordering::Relaxed);
            while let Some(event) = self.control.take_event() {
                self.summary.add_event(&event);
                self.report(Report::Event(event));
            }
            let is_recovery = inputs.request == Some(Request::Recover);
            if let Some(refusal) = outcome.refusal {
                self.report(Report::Refused { tick, refusal });
            } else if is_recovery {
                self.report(Report::Recovered { tick, cost });
            }
            if tick.is_multiple_of(PROGRESS_TICKS) {
                let command = self.control.controller().tracker().command();
                let rest_lengths_m = command.cables.map(|cable| cable.rest_length_m);
                self.report(Report::Progress { rest_lengths_m });
            }

            self.cost.total += u64::from(cost);
            // A recovery takes longer than a tick and may, and what follows is then late until it has caught up: the brakes
            // are closed, nothing waits for it.
            let is_next_due = SCB::is_pendst_pending();
            self.is_late = is_next_due && (is_recovery || self.is_late);
            self.cost.overruns += u32::from(is_next_due && !self.is_late);
            if !is_recovery {
                self.cost.worst = self.cost.worst.max(cost);
            }
            if tick == TICKS {
                let (summary, cost) = (self.summary, self.cost);
                self.report(Report::Finished { summary, cost });
            }
        }

        fn report(&mut self, report: Report) {
            self.cost.dropped += u32::from(self.reports.enqueue(report).is_err());
        }
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        stack::paint();
        let Some((mut peripherals, mut reports)) = start() else { board::exit(false) };
        info!("stack to start with: {=usize} bytes", stack::deepest_bytes());
        stack::paint();
        board::start_ticking(&mut peripherals.SYST);
        loop {
            tell(&mut reports);
            cortex_m::asm::wfi();
        }
    }

    /// Hands the control law to the interrupt, which is not enabled yet. In a frame of its own, as it
    /// takes more stack than all that follows.
    #[inline(never)]
    fn start() -> Option<(Peripherals, Consumer<'static, Report>)> {
        let peripherals = Peripherals::take()?;
        let table = table()?;
        let controller = start_controller(&path::TAUT, &table)
            .inspect_err(|fault| error!("no start: {}", Display2Format(fault)))
            .ok()?;
        let winches = Winches::start(&path::TAUT)
            .inspect_err(|fault| error!("no start: {}", Display2Format(fault)))
            .ok()?;
        let (sender, receiver) = singleton!(: WayPoints<Float> = WayPoints::new())?.split();
        let (reports, to_tell) = singleton!(: Queue<Report, WAITING> = Queue::new())?.split();
        let law = singleton!(: Law = Law {
            rehearsal: Rehearsal::new(path::TAUT, sender),
            control: Control::new(controller, table, receiver, winches),
            summary: Summary::new(),
            counter: Counter::start(),
            cost: Cost { total: 0, worst: 0, overruns: 0, dropped: 0 },
            is_late: false,
            reports,
        })?;
        critical_section::with(|cs| HANDOVER.borrow(cs).set(Some(law)));
        Some((peripherals, to_tell))
    }

    /// The warm-start table, once it has shown that it is not taken for that of another robot.
    fn table() -> Option<Table<'static>> {
        let table = Table::open(robot::TABLE)
            .inspect_err(|fault| error!("no start: warm-start table: {}", Display2Format(fault)))
            .ok()?;
        let crane = robot::crane::<Float>()
            .inspect_err(|fault| error!("no start: {}", Display2Format(fault)))
            .ok()?;
        let Err(fault) = table.check(&crane, &robot::load(&robot::EMPTY)) else {
            error!("no start: the table is taken for a bare platform");
            return None;
        };
        info!("table refused for a bare platform: {}", Display2Format(&fault));
        Some(table)
    }

    /// Logs what has come; ends the run after the last.
    fn tell(reports: &mut Consumer<'static, Report>) {
        while let Some(report) = reports.dequeue() {
            match report {
                Report::Progress { rest_lengths_m } => info!("rest lengths, m: {}", rest_lengths_m),
                Report::Event(Event { tick, kind: EventKind::Entered(state) }) => {
                    info!("tick {=u32}: {}", tick, Display2Format(&state));
                }
                Report::Event(Event { tick, kind: EventKind::Refused(fault) }) => {
                    warn!("tick {=u32}: way-point refused: {}", tick, Display2Format(&fault));
                }
                Report::Event(Event { tick, kind }) => {
                    warn!("tick {=u32}: {}", tick, Debug2Format(&kind));
                }
                Report::Refused { tick, refusal } => {
                    warn!("tick {=u32}: request refused: {}", tick, Display2Format(&refusal));
                }
                Report::Recovered { tick, cost } => {
                    info!(
                        "tick {=u32}: recovered by the table: {=u32} {=str}",
                        tick,
                        cost,
                        board::COST_UNIT
                    );
                }
                Report::Finished { summary, cost } => {
                    let mean = cost.total / u64::from(summary.ticks);
                    info!("ticks: {=u32}", summary.ticks);
                    info!("certified: {=u32}", summary.certified);
                    info!("states: {=u32}", summary.states);
                    info!("events: {=u32}", summary.events);
                    info!("faults: {=u32}", summary.faults);
                    info!("largest closure: {} m", summary.largest_closure_m);
                    info!("worst tick: {=u32} {=str}", cost.worst, board::COST_UNIT);
                    info!("mean tick: {=u64} {=str}", mean, board::COST_UNIT);
                    info!("overruns: {=u32}", cost.overruns);
                    info!("reports dropped: {=u32}", cost.dropped);
                    info!("stack: {=usize} bytes", stack::deepest_bytes());
                    info!("checksum: {=u64:#018x}", summary.checksum.value());
                    board::exit(cost.overruns == 0 && cost.dropped == 0);
                }
            }
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
