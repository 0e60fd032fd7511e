//! A winch controller around `cdpr-core` without a clock of its own: it answers, period by period, what a
//! plant asks over the serial line (`cdpr_link::serial`), as fast as it is asked.
//!
//! ```text
//! cargo in-the-loop      # builds it for a Cortex-M4F, f32
//! cargo in-the-loop-m7   # Cortex-M7, f64
//! ```
//!
//! The host starts the image in QEMU with the line at a socket (`cdpr_qemu::Serving`). On any other target
//! this is an empty program.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[expect(clippy::result_large_err, reason = "words without an allocator")]
mod image {
    use cdpr_firmware_example::board::{self, COST_UNIT, Counter, Line};
    use cdpr_firmware_example::robot::Model;
    use cdpr_firmware_example::{Float, station};
    use cdpr_link::serial::Responder;
    use cortex_m::singleton;
    use defmt::{info, warn};

    /// What ends a frame.
    const END: u8 = 0;

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let responder = singleton!(: Responder<'static, Float, Model<Float>> = Responder::new());
        let Some(responder) = responder else { board::exit(false) };
        let counter = Counter::start();
        let mut line = Line::open();
        let mut worst = 0;
        loop {
            let Some(byte) = line.read() else { continue };
            let mut has_started = false;
            let mut answer = || {
                responder.receive(byte, |at| {
                    has_started = true;
                    station::station(at)
                        .inspect(|_| info!("started"))
                        .inspect_err(|note| warn!("no start: {=str}", note))
                })
            };
            let (reply, cost) = if byte == END { counter.count(answer) } else { (answer(), 0) };
            if cost > worst && !has_started {
                worst = cost;
                info!("worst answer so far: {=u32} {=str}", cost, COST_UNIT);
            }
            for byte in reply.iter().flatten() {
                line.write(*byte);
            }
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
