use cdpr_core::{CableModel, IrvineCatenary};
use cdpr_host_sim::cases;
use cdpr_host_sim::cases::Overrides;
use cdpr_host_sim::complete::complete;
use cdpr_host_sim::enumerate::ModelKind;
use cdpr_host_sim::robot_file::RobotDescription;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let robot = RobotDescription::marionet_crane();
    let requests =
        cases::read(std::path::Path::new(&path), &robot, Overrides::default(), ModelKind::Irvine)
            .unwrap();
    let mut total = 0.0;
    let mut boxes = 0;
    let mut times = vec![];
    for (n, request) in requests.iter().enumerate() {
        let problem = request.problem::<IrvineCatenary<f64>>().unwrap();
        let start = std::time::Instant::now();
        let answer = complete(&problem);
        let t = start.elapsed().as_secs_f64();
        total += t;
        times.push(t);
        let count = request.enumerate(false).unwrap().solutions.len();
        match answer {
            Ok(a) => {
                boxes += a.boxes;
                if a.solutions.len() != count || !a.undecided.is_empty() || n < 6 || a.boxes > 3000
                {
                    println!(
                        "{n}: {} (continuation {count}) outside {} undecided {} boxes {} pieces {} {:.3} ms, {:.0} ns/box",
                        a.solutions.len(),
                        a.outside.len(),
                        a.undecided.len(),
                        a.boxes,
                        a.pieces,
                        t * 1e3,
                        t * 1e9 / a.boxes as f64
                    );
                    for p in &a.solutions {
                        let e = p.enclosure();
                        println!(
                            "   {:?} radius {:e}",
                            p.states().map(|s| s.rest_length_m),
                            e.iter()
                                .map(|s| s.rest_length_m.radius() / s.rest_length_m.middle())
                                .fold(0.0, f64::max)
                        );
                    }
                }
            }
            Err(e) => println!("{n}: refused {e}"),
        }
    }
    times.sort_by(f64::total_cmp);
    println!(
        "mean {:.3} ms median {:.3} p99 {:.3}, boxes {}",
        total / requests.len() as f64 * 1e3,
        times[times.len() / 2] * 1e3,
        times[times.len() * 99 / 100] * 1e3,
        boxes / requests.len()
    );
}
