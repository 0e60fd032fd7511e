//! Trajectories: set-points of a CSV file, and the smooth curve through them.
//!
//! Between two set-points position and quaternion are cubic polynomials whose rates at the set-points are those of
//! the parabola through three neighbours, or as given; it begins and ends at rest.

use std::path::Path;

use super::operator::Clock;
use crate::input_file::{self, InputFileError};
use cdpr_core::Twist;
use cdpr_core::controller::{self, Motion, MotionLimits, Stance};
use cdpr_link::{Pace, Target};
use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector4};

/// Columns of the file by their names: those of position and time are needed, of the orientation either all of one
/// kind or none (level).
const TIME: &str = "time_s";
const POSITION: [&str; 3] = ["x_m", "y_m", "z_m"];
const ROTATION_VECTOR: [&str; 3] = ["rx_rad", "ry_rad", "rz_rad"];
const QUATERNION: [&str; 4] = ["qw", "qx", "qy", "qz"];
/// How far from 1 the length of a quaternion may be: what four decimals leave.
const ROUGH: f64 = 1e-3;

/// Why a trajectory is refused.
#[derive(Debug, thiserror::Error)]
pub enum TrajectoryError {
    /// The file is not valid.
    #[error(transparent)]
    File(#[from] InputFileError),
    /// The controller would refuse a motion.
    #[error("{path}: {from_s} to {to_s} s: {fault}")]
    Motion {
        /// The file.
        path: String,
        /// Where the motion begins, s.
        from_s: f64,
        /// Where it ends, s.
        to_s: f64,
        /// Why.
        fault: controller::MotionFault<f64>,
    },
}

/// A pose at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Knot {
    time_s: f64,
    position_m: Vector3<f64>,
    /// `w, x, y, z`, of unit length, on the same side as its neighbours.
    quaternion: Vector4<f64>,
    position_rate: Vector3<f64>,
    quaternion_rate: Vector4<f64>,
}

/// A smooth curve of poses over time, from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    path: String,
    /// Two at least, time rising.
    knots: Vec<Knot>,
}

/// A place on the way, and the motion there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where.
    pub stance: Stance<f64>,
    /// How fast.
    pub twist: Twist<f64>,
}

impl Trajectory {
    /// Reads a file.
    ///
    /// # Errors
    /// [`TrajectoryError`], naming file, line and column.
    pub fn read(path: &Path) -> Result<Self, TrajectoryError> {
        let (text, name) = input_file::read(path)?;
        Ok(Self::parse(&text, &name)?)
    }

    /// Reads it from its text: a line of column names, then set-points; separated by commas, semicolons or tabs; lines
    /// that begin with `#` are comments. `path` is only for messages.
    ///
    /// # Errors
    /// [`InputFileError::Content`].
    pub fn parse(text: &str, path: &str) -> Result<Self, InputFileError> {
        let refuse = |line: u64, field: &str, message: &str| InputFileError::Content {
            path: path.to_owned(),
            line: usize::try_from(line).unwrap_or(usize::MAX),
            field: field.to_owned(),
            message: message.to_owned(),
        };
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let header = text
            .lines()
            .find(|line| !line.trim().is_empty() && !line.starts_with('#'))
            .unwrap_or_default();
        let delimiter = [b',', b';', b'\t']
            .into_iter()
            .max_by_key(|d| header.bytes().filter(|b| b == d).count());
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter.unwrap_or(b','))
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let unreadable = |error: &csv::Error| {
            let line = error.position().map_or(1, csv::Position::line);
            let message = match error.kind() {
                csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                    format!("{len} columns, but the first line names {expected_len}")
                }
                _ => error.to_string(),
            };
            refuse(line, "columns", &message)
        };
        let header = reader.headers().map_err(|error| unreadable(&error))?;
        let header_line = header.position().map_or(1, csv::Position::line);
        let columns = Columns::of(header)
            .map_err(|(field, message)| refuse(header_line, &field, &message))?;
        let mut knots: Vec<Knot> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|error| unreadable(&error))?;
            let line = record.position().map_or(0, csv::Position::line);
            let knot =
                columns.knot(&record).map_err(|(field, message)| refuse(line, field, &message))?;
            if let Some(last) = knots.last()
                && last.time_s >= knot.time_s
            {
                return Err(refuse(line, TIME, "it does not come after the one before"));
            }
            knots.push(knot);
        }
        if knots.len() < 2 {
            return Err(refuse(header_line, TIME, "two set-points are needed at least"));
        }
        // Time begins at 0, and a quaternion and its negative are the same orientation.
        let begin_s = knots[0].time_s;
        let mut last = knots[0].quaternion;
        for knot in &mut knots {
            knot.time_s -= begin_s;
            if knot.quaternion.dot(&last) < 0.0 {
                knot.quaternion = -knot.quaternion;
            }
            last = knot.quaternion;
        }
        for i in 1..knots.len() - 1 {
            let (before, here, after) = (knots[i - 1], knots[i], knots[i + 1]);
            let (past_s, coming_s) = (here.time_s - before.time_s, after.time_s - here.time_s);
            let (share_past, share_coming) =
                (coming_s / (past_s + coming_s), past_s / (past_s + coming_s));
            knots[i].position_rate = (here.position_m - before.position_m) * (share_past / past_s)
                + (after.position_m - here.position_m) * (share_coming / coming_s);
            let rate = (here.quaternion - before.quaternion) * (share_past / past_s)
                + (after.quaternion - here.quaternion) * (share_coming / coming_s);
            knots[i].quaternion_rate = rate - here.quaternion * rate.dot(&here.quaternion);
        }
        Ok(Self { path: path.to_owned(), knots })
    }

    /// How long it takes, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.knots.last().map_or(0.0, |knot| knot.time_s)
    }

    /// Where it is after `time_s`; before and after it, at its ends, at rest.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Point {
        if time_s <= 0.0 || time_s >= self.duration_s() {
            return self.end(time_s > 0.0);
        }
        let next =
            self.knots.partition_point(|knot| knot.time_s <= time_s).clamp(1, self.knots.len() - 1);
        let (a, b) = (&self.knots[next - 1], &self.knots[next]);
        let span_s = b.time_s - a.time_s;
        let u = (time_s - a.time_s) / span_s;
        let (position_m, velocity) = cubic(
            &a.position_m,
            &b.position_m,
            &(a.position_rate * span_s),
            &(b.position_rate * span_s),
            u,
        );
        let (q, q_rate) = cubic(
            &a.quaternion,
            &b.quaternion,
            &(a.quaternion_rate * span_s),
            &(b.quaternion_rate * span_s),
            u,
        );
        // Angular velocity 2 Im(q' q*) / |q|^2.
        let turning =
            (quaternion(&q_rate) * quaternion(&q).conjugate()).imag() * (2.0 / q.norm_squared());
        Point {
            stance: Stance {
                position_m,
                orientation: UnitQuaternion::from_quaternion(quaternion(&q)),
            },
            twist: Twist { linear_m_s: velocity / span_s, angular_rad_s: turning / span_s },
        }
    }

    /// The first pose or the last, at rest to the bit: what moves is waited for.
    fn end(&self, is_last: bool) -> Point {
        let knot = &self.knots[if is_last { self.knots.len() - 1 } else { 0 }];
        let orientation = UnitQuaternion::from_quaternion(quaternion(&knot.quaternion));
        Point { stance: Stance { position_m: knot.position_m, orientation }, twist: Twist::none() }
    }

    /// The way-point at `time_s` for a trajectory whose time goes at `rate` there, to be reached in `duration_s`.
    #[must_use]
    pub fn target(&self, time_s: f64, rate: f64, duration_s: f64) -> Target {
        let Point { stance, twist } = self.at(time_s);
        let q = stance.orientation.as_ref();
        Target {
            position_m: stance.position_m.into(),
            quaternion: [q.w, q.i, q.j, q.k],
            linear_m_s: (twist.linear_m_s * rate).into(),
            angular_rad_s: (twist.angular_rad_s * rate).into(),
            pace: Pace::Duration(duration_s),
        }
    }

    /// Makes sure that the controller takes all way-points, `way_point_s` apart.
    ///
    /// # Errors
    /// [`TrajectoryError::Motion`].
    pub fn check(
        &self,
        way_point_s: f64,
        limits: &MotionLimits<f64>,
        period_s: f64,
    ) -> Result<(), TrajectoryError> {
        let mut clock = Clock::START;
        let mut here = self.at(0.0);
        loop {
            let from_s = clock.time_s;
            let Some(target) = clock.next(self, way_point_s) else { return Ok(()) };
            let way_point = target.way_point();
            Motion::new(&here.stance, &here.twist, &way_point, limits, period_s).map_err(
                |fault| TrajectoryError::Motion {
                    path: self.path.clone(),
                    from_s,
                    to_s: clock.time_s,
                    fault,
                },
            )?;
            here = Point { stance: way_point.stance, twist: way_point.twist };
        }
    }
}

/// Of its components w, x, y, z.
fn quaternion(v: &Vector4<f64>) -> Quaternion<f64> {
    Quaternion::new(v[0], v[1], v[2], v[3])
}

/// A cubic from `a` to `b` with its rates there, over the share `u`: value and rate.
fn cubic<const N: usize>(
    a: &nalgebra::SVector<f64, N>,
    b: &nalgebra::SVector<f64, N>,
    a_rate: &nalgebra::SVector<f64, N>,
    b_rate: &nalgebra::SVector<f64, N>,
    u: f64,
) -> (nalgebra::SVector<f64, N>, nalgebra::SVector<f64, N>) {
    let way = b - a;
    let c2 = way * 3.0 - a_rate * 2.0 - b_rate;
    let c3 = a_rate + b_rate - way * 2.0;
    (a + (a_rate + (c2 + c3 * u) * u) * u, a_rate + (c2 * 2.0 + c3 * (3.0 * u)) * u)
}

/// Where the columns are.
struct Columns {
    time: usize,
    position: [usize; 3],
    orientation: Orientation,
}

enum Orientation {
    Level,
    RotationVector([usize; 3]),
    Quaternion([usize; 4]),
}

impl Columns {
    fn of(header: &csv::StringRecord) -> Result<Self, (String, String)> {
        let place = |name: &str| header.iter().position(|column| column.eq_ignore_ascii_case(name));
        let need = |name: &str| {
            place(name).ok_or_else(|| {
                let given = header.iter().collect::<Vec<_>>().join(", ");
                (name.to_owned(), format!("there is no such column among: {given}"))
            })
        };
        let known = [TIME].into_iter().chain(POSITION).chain(ROTATION_VECTOR).chain(QUATERNION);
        if let Some(unknown) = header
            .iter()
            .find(|column| !known.clone().any(|name| column.eq_ignore_ascii_case(name)))
        {
            let names = known.collect::<Vec<_>>().join(", ");
            return Err((
                unknown.to_owned(),
                format!("no such column is known; they are: {names}"),
            ));
        }
        let any = |names: &[&str]| names.iter().any(|name| place(name).is_some());
        let orientation = match (any(&ROTATION_VECTOR), any(&QUATERNION)) {
            (false, false) => Orientation::Level,
            (true, false) => {
                let [x, y, z] = ROTATION_VECTOR;
                Orientation::RotationVector([need(x)?, need(y)?, need(z)?])
            }
            (false, true) => {
                let [w, x, y, z] = QUATERNION;
                Orientation::Quaternion([need(w)?, need(x)?, need(y)?, need(z)?])
            }
            (true, true) => {
                let message = "there is a quaternion as well: give one of them".to_owned();
                return Err((ROTATION_VECTOR[0].to_owned(), message));
            }
        };
        let [x, y, z] = POSITION;
        Ok(Self { time: need(TIME)?, position: [need(x)?, need(y)?, need(z)?], orientation })
    }

    fn knot(&self, record: &csv::StringRecord) -> Result<Knot, (&'static str, String)> {
        let number = |column: usize, name: &'static str| {
            let text = record.get(column).unwrap_or_default();
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                Ok(_) => Err((name, format!("{text} is not finite"))),
                Err(_) => Err((name, format!("'{text}' is not a number"))),
            }
        };
        let three = |columns: &[usize; 3], names: [&'static str; 3]| {
            let [x, y, z] = names;
            Ok(Vector3::new(number(columns[0], x)?, number(columns[1], y)?, number(columns[2], z)?))
        };
        let orientation = match &self.orientation {
            Orientation::Level => UnitQuaternion::identity(),
            Orientation::RotationVector(columns) => {
                UnitQuaternion::from_scaled_axis(three(columns, ROTATION_VECTOR)?)
            }
            Orientation::Quaternion(columns) => {
                let [w, x, y, z] = QUATERNION;
                let q = Quaternion::new(
                    number(columns[0], w)?,
                    number(columns[1], x)?,
                    number(columns[2], y)?,
                    number(columns[3], z)?,
                );
                if (q.norm() - 1.0).abs() > ROUGH {
                    return Err((w, format!("the quaternion has length {}, not 1", q.norm())));
                }
                UnitQuaternion::from_quaternion(q)
            }
        };
        let q = orientation.as_ref();
        Ok(Knot {
            time_s: number(self.time, TIME)?,
            position_m: three(&self.position, POSITION)?,
            quaternion: Vector4::new(q.w, q.i, q.j, q.k),
            position_rate: Vector3::zeros(),
            quaternion_rate: Vector4::zeros(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;

    #[test]
    fn set_points_are_met_and_rates_are_derivatives() {
        let text = "time_s;x_m;y_m;z_m;rx_rad;ry_rad;rz_rad\n# a comment\n1;0;0;2;0;0;0\n2;1;0;2;0;0;0.2\n4;1;3;2.5;0.1;0;0.2\n5;1;3;2.5;0.1;0;0.2\n";
        let trajectory = Trajectory::parse(text, "t.csv").unwrap();
        assert!((trajectory.duration_s() - 4.0).abs() < 1e-15);
        assert!(
            (trajectory.at(1.0).stance.position_m - Vector3::new(1.0, 0.0, 2.0)).norm() < 1e-15
        );
        let turn = trajectory.at(3.0).stance.orientation.scaled_axis();
        assert!((turn - Vector3::new(0.1, 0.0, 0.2)).norm() < 1e-15);
        for rest in [-1.0, 0.0, 4.0, 9.0] {
            assert!(trajectory.at(rest).twist.linear_m_s.norm() == 0.0);
        }
        let h = 1e-6;
        for time_s in [0.3, 0.999, 1.001, 2.0, 3.7] {
            let (before, here, after) =
                (trajectory.at(time_s - h), trajectory.at(time_s), trajectory.at(time_s + h));
            let rate = (after.stance.position_m - before.stance.position_m) / (2.0 * h);
            assert!((rate - here.twist.linear_m_s).norm() < 1e-5, "{time_s}");
            let turn = after.stance.orientation * before.stance.orientation.inverse();
            assert!(
                (turn.scaled_axis() / (2.0 * h) - here.twist.angular_rad_s).norm() < 1e-5,
                "{time_s}"
            );
        }
    }

    #[test]
    fn a_parabola_is_met_between_its_set_points() {
        let mut text = "time_s,x_m,y_m,z_m\n".to_owned();
        for i in 0..=10 {
            let t = f64::from(i) * 0.1;
            writeln!(text, "{t},{},0,0", t * t).unwrap();
        }
        let trajectory = Trajectory::parse(&text, "t.csv").unwrap();
        // But in the first and last piece, which begin and end at rest.
        for time_s in [0.11, 0.25, 0.5, 0.88] {
            assert!((trajectory.at(time_s).stance.position_m.x - time_s * time_s).abs() < 1e-14);
        }
    }

    #[test]
    fn mistakes_are_named_with_line_and_column() {
        let refused = |text: &str, what: &str| {
            let message = Trajectory::parse(text, "t.csv").unwrap_err().to_string();
            assert!(message.contains(what), "{message}");
        };
        let head = "time_s,x_m,y_m,z_m\n";
        refused("", "t.csv:1: time_s: there is no such column");
        refused(
            "time_s,x_m,y_m\n",
            "t.csv:1: z_m: there is no such column among: time_s, x_m, y_m",
        );
        refused("time_s,x_m,y_m,z_m,speed\n", "speed: no such column is known");
        refused(&format!("{head}0,0,0,1\n"), "two set-points");
        refused(&format!("{head}0,0,0,1\n1,a,0,1\n"), "t.csv:3: x_m: 'a' is not a number");
        refused(&format!("{head}0,0,0,1\n1,NaN,0,1\n"), "t.csv:3: x_m: NaN is not finite");
        refused(&format!("{head}0,0,0,1\n0,1,0,1\n"), "t.csv:3: time_s: it does not come after");
        refused(
            &format!("{head}0,0,0,1\n1,1,0\n"),
            "t.csv:3: columns: 3 columns, but the first line names 4",
        );
        let quaternion = "time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,1,1,0,0,0.2\n1,0,0,1,1,0,0,0\n";
        refused(quaternion, "t.csv:2: qw: the quaternion has length 1.0198");
        refused("time_s,x_m,y_m,z_m,qw\n", "qx: there is no such column");
        refused("time_s,x_m,y_m,z_m,qw,rx_rad\n", "rx_rad: there is a quaternion as well");
        let limits = crate::robot_file::RobotDescription::marionet_crane().motion_limits();
        let fast = Trajectory::parse(&format!("{head}0,0,0,1\n1,5,0,1\n"), "t.csv").unwrap();
        let message = fast.check(0.05, &limits, 1e-3).unwrap_err().to_string();
        assert!(message.starts_with("t.csv: 0 to 0.05 s: beyond the limits"), "{message}");
    }
}
