//! A winch controller around `cdpr-core` without a clock of its own: it answers, period by period, what a
//! plant asks over the serial line (`cdpr_link::serial`), as fast as it is asked.
//!
//! ```text
//! cargo in-the-loop      # builds it for a Cortex-M4F, f32
//! cargo in-the-loop-m7   # Cortex-M7, f64
//! ```
//!
//! The host starts the image in QEMU with the line at a socket (`cdpr_qemu::Serving`). What a tick costs is for
//! the image `measure` to tell, which runs where instructions are counted. On any other target this is an empty
//! program.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[expect(clippy::result_large_err, reason = "words without an allocator")]
mod image {
    use cdpr_firmware_example::board::{self, Line};
    use cdpr_firmware_example::robot::Model;
    use cdpr_firmware_example::{Float, station};
    use cdpr_link::serial::Responder;
    use cortex_m::singleton;
    use defmt::{info, warn};

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let responder = singleton!(: Responder<'static, Float, Model<Float>> = Responder::new());
        let Some(responder) = responder else { board::exit(false) };
        let mut line = Line::open();
        loop {
            let Some(byte) = line.read() else { continue };
            let reply = responder.receive(byte, |at| {
                station::station(at)
                    .inspect(|_| info!("started"))
                    .inspect_err(|note| warn!("no start: {=str}", note))
            });
            for byte in reply.iter().flatten() {
                line.write(*byte);
            }
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
