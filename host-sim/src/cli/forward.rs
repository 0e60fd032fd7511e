//! `cdpr forward`: where the platform comes to rest.

use std::io::Write;
use std::path::PathBuf;

use cdpr_core::controller::Stance;
use cdpr_core::{CABLES, IrvineCatenary};
use clap::Args;
use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::{CliError, Format, finite, positive, triple, write_pretty};
use crate::cases::Overrides;
use crate::forward::{Rest, at_rest_near};
use crate::robot_file::CableLimits;

#[derive(Debug, Args)]
pub(super) struct Forward {
    /// Robot file (TOML) [default: the paper's MARIONET-CRANE]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Six rest lengths, m
    #[arg(long, value_name = "L1,..,L6", value_parser = six)]
    lengths: [f64; CABLES],
    /// About where the platform is, m
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    position: [f64; 3],
    /// About how it is turned: rotation vector, rad
    #[arg(long, value_name = "RX,RY,RZ", value_parser = triple, allow_hyphen_values = true, default_value = "0,0,0")]
    rotation_vector: [f64; 3],
    /// Look for other places to rest so far around, m (and as far by turning, over the moment arm)
    #[arg(long, value_name = "M", value_parser = positive, default_value_t = 0.5)]
    radius: f64,
    /// From so many places
    #[arg(long, value_name = "N", default_value_t = 200)]
    starts: usize,
    /// Mass of the platform, kg [default: from the robot file]
    #[arg(long, value_name = "KG", value_parser = positive, allow_hyphen_values = true)]
    mass: Option<f64>,
    /// Text or JSON
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

fn six(text: &str) -> Result<[f64; CABLES], String> {
    let numbers = text.split(',').map(finite).collect::<Result<Vec<_>, _>>()?;
    numbers.try_into().map_err(|given: Vec<_>| format!("{} numbers given, six needed", given.len()))
}

/// A place to rest, as JSON has it.
#[derive(Serialize)]
struct Found {
    position_m: [f64; 3],
    rotation_vector_rad: [f64; 3],
    is_stable: bool,
    least_stiffness_n_m: f64,
    tensions_at_platform_n: [f64; CABLES],
    is_within_limits: bool,
}

impl Found {
    fn of(rest: &Rest, limits: &[CableLimits; CABLES]) -> Self {
        let tensions_at_platform_n = rest.forces_n.map(|force| force.norm());
        let within = |(tension_n, limit): (&f64, &CableLimits)| *tension_n <= limit.max_tension_n;
        Self {
            is_within_limits: tensions_at_platform_n.iter().zip(limits).all(within),
            position_m: rest.place.position_m.into(),
            rotation_vector_rad: rest.place.orientation.scaled_axis().into(),
            is_stable: rest.is_stable(),
            least_stiffness_n_m: rest.least_stiffness_n_m,
            tensions_at_platform_n,
        }
    }
}

#[derive(Serialize)]
struct Answer {
    radius_m: f64,
    starts: usize,
    places: Vec<Found>,
}

impl Forward {
    pub(super) fn run(&self, out: &mut impl Write) -> Result<(), CliError> {
        let robot = super::robot(self.robot.as_deref())?;
        let robot = Overrides { mass_kg: self.mass, ..Overrides::default() }.apply(&robot);
        let model = robot.with_model::<IrvineCatenary<f64>>();
        let guess = Stance {
            position_m: Vector3::from(self.position),
            orientation: UnitQuaternion::from_scaled_axis(Vector3::from(self.rotation_vector)),
        };
        let found =
            at_rest_near(&model, &robot.load, &self.lengths, &guess, self.radius, self.starts)?;
        let places: Vec<_> = found.iter().map(|rest| Found::of(rest, &robot.limits)).collect();
        match self.format {
            Format::Json => {
                write_pretty(out, &Answer { radius_m: self.radius, starts: self.starts, places })?;
            }
            Format::Text => {
                for (number, place) in (1..).zip(&places) {
                    let [x, y, z] = place.position_m;
                    let [rx, ry, rz] = place.rotation_vector_rad;
                    let kind = match (place.is_stable, place.is_within_limits) {
                        (true, true) => "stays",
                        (true, false) => "stays, BEYOND THE LIMIT OF TENSION",
                        (false, _) => "does not stay",
                    };
                    writeln!(
                        out,
                        "{number}: ({x:.6}, {y:.6}, {z:.6}) m, rotation vector ({rx:.6}, {ry:.6}, {rz:.6}) rad, \
                         {kind}: least stiffness {:.3} N/m",
                        place.least_stiffness_n_m
                    )?;
                }
                let others = if places.len() == 1 { "No other place" } else { "These places" };
                writeln!(
                    out,
                    "{others} to rest found from {} starts within {} m (a search, not a proof)",
                    self.starts, self.radius
                )?;
            }
        }
        Ok(out.flush()?)
    }
}
