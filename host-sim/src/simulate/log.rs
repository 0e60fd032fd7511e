//! The log of a run: MCAP, which Foxglove opens, or CSV.
//!
//! Every row is handed to the operating system as soon as it is there, so that a run that is killed loses none. An
//! MCAP file is not compressed and not divided into chunks for the same reason; without its end, which a killed run
//! does not write, readers go through it from the start (`mcap recover` gives it an end).
//!
//! | topic | schema | |
//! |---|---|---|
//! | `/platform` | `foxglove.PoseInFrame` | where the platform truly is |
//! | `/commanded` | `foxglove.PoseInFrame` | where the last certified command holds it |
//! | `/run` | `cdpr.Run` | everything else: the columns of the CSV under the same names, lists of six in place of `_1` to `_6` |
//! | `/events` | `foxglove.Log` | what happened, at once |

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

use cdpr_core::CABLES;
use cdpr_core::controller::Stance;
use mcap::records::MessageHeader;
use serde::Serialize;
use serde_json::json;

use super::{PoseError, Sample};

/// A log that is being written.
pub enum Log {
    /// For spreadsheets and scripts.
    Csv {
        /// To the file.
        writer: Box<csv::Writer<File>>,
        /// Whether the names of the columns are written.
        has_names: bool,
    },
    /// For Foxglove.
    Mcap(Box<Mcap>),
}

/// What a row holds besides the poses, in the order of the columns.
#[derive(Serialize)]
struct Run {
    trajectory_s: Option<f64>,
    mode: String,
    is_halted: bool,
    brakes_released: bool,
    speed_m_s: f64,
    total_error_m: Option<f64>,
    total_error_rad: Option<f64>,
    static_error_m: Option<f64>,
    model_error_m: Option<f64>,
    winches_error_m: Option<f64>,
    dynamic_error_m: Option<f64>,
    contraction: f64,
    distance: f64,
    length_m: [f64; CABLES],
    commanded_length_m: [f64; CABLES],
    tension_n: [f64; CABLES],
    commanded_tension_n: [f64; CABLES],
    /// Units of 2^-32 turn; nothing while the motors are to stand still.
    motor_angle: [Option<i64>; CABLES],
    motor_speed_rad_s: [Option<f64>; CABLES],
}

impl Run {
    fn of(sample: &Sample, error: Option<&PoseError>) -> Self {
        let decision = &sample.decision;
        let motor = |i: usize| decision.motors.as_ref().map(|motors| motors[i]);
        Self {
            trajectory_s: sample.trajectory_s,
            mode: format!("{:?}", decision.mode).to_lowercase(),
            is_halted: decision.is_halted,
            brakes_released: decision.brakes_released,
            speed_m_s: sample.velocity_m_s.norm(),
            total_error_m: error.map(|e| e.total_m),
            total_error_rad: error.map(|e| e.total_rad),
            static_error_m: error.map(|e| e.static_m),
            model_error_m: error.map(|e| e.model_m),
            winches_error_m: error.map(|e| e.winches_m),
            dynamic_error_m: error.map(|e| e.dynamic_m),
            contraction: decision.contraction,
            distance: decision.distance,
            length_m: sample.lengths_m,
            commanded_length_m: decision.rest_lengths_m,
            tension_n: sample.tensions_n,
            commanded_tension_n: decision.tensions_n,
            motor_angle: std::array::from_fn(|i| motor(i).map(|motor| motor.angle)),
            motor_speed_rad_s: std::array::from_fn(|i| motor(i).map(|motor| motor.speed_rad_s)),
        }
    }

    /// Names and texts of the columns.
    fn columns(&self) -> Vec<(String, String)> {
        let serde_json::Value::Object(fields) = serde_json::to_value(self).unwrap_or_default()
        else {
            return Vec::new();
        };
        let text = |value: &serde_json::Value| match value {
            serde_json::Value::Null => String::new(),
            serde_json::Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let columns = fields.iter().flat_map(|(name, value)| match value {
            serde_json::Value::Array(six) => {
                (1..).zip(six).map(|(i, value)| (format!("{name}_{i}"), text(value))).collect()
            }
            one => vec![(name.clone(), text(one))],
        });
        columns.collect()
    }
}

impl Log {
    /// A new file, CSV if its name ends so, else MCAP.
    ///
    /// # Errors
    /// As the system says.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = File::create(path)?;
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
            let writer = Box::new(csv::Writer::from_writer(file));
            return Ok(Self::Csv { writer, has_names: false });
        }
        Ok(Self::Mcap(Box::new(Mcap::new(file).map_err(io::Error::other)?)))
    }

    /// Writes a period.
    ///
    /// # Errors
    /// As the system says.
    pub fn write(&mut self, sample: &Sample, error: Option<&PoseError>) -> io::Result<()> {
        let run = Run::of(sample, error);
        match self {
            Self::Mcap(mcap) => mcap.write(sample, &run).map_err(io::Error::other),
            Self::Csv { writer, has_names } => {
                let mut columns = vec![("time_s".to_owned(), sample.time_s.to_string())];
                for (prefix, place) in [("", &sample.place), ("commanded_", &sample.commanded)] {
                    let (p, q) = (&place.position_m, place.orientation.as_ref());
                    let numbers = [
                        ("x_m", p.x),
                        ("y_m", p.y),
                        ("z_m", p.z),
                        ("qw", q.w),
                        ("qx", q.i),
                        ("qy", q.j),
                        ("qz", q.k),
                    ];
                    columns.extend(
                        numbers
                            .map(|(name, number)| (format!("{prefix}{name}"), number.to_string())),
                    );
                }
                columns.extend(run.columns());
                columns.push(("note".to_owned(), sample.decision.note.to_string()));
                if !std::mem::replace(has_names, true) {
                    writer.write_record(columns.iter().map(|(name, _)| name))?;
                }
                writer.write_record(columns.iter().map(|(_, text)| text))?;
                writer.flush()
            }
        }
    }

    /// Writes the end.
    ///
    /// # Errors
    /// As the system says.
    pub fn finish(self) -> io::Result<()> {
        match self {
            Self::Csv { mut writer, .. } => writer.flush(),
            Self::Mcap(mut mcap) => {
                mcap.writer.finish().map_err(io::Error::other)?;
                mcap.writer.into_inner().flush()
            }
        }
    }
}

/// An MCAP file that is being written.
pub struct Mcap {
    writer: mcap::Writer<BufWriter<File>>,
    platform: u16,
    commanded: u16,
    run: u16,
    events: u16,
    sequence: u32,
}

impl Mcap {
    fn new(file: File) -> mcap::McapResult<Self> {
        let options = mcap::WriteOptions::new().use_chunks(false).compression(None);
        let mut writer = options.create(BufWriter::new(file))?;
        let mut channel = |topic: &str, name: &str, schema: serde_json::Value| {
            let schema = writer.add_schema(name, "jsonschema", schema.to_string().as_bytes())?;
            writer.add_channel(schema, topic, "json", &BTreeMap::new())
        };
        let platform = channel("/platform", "foxglove.PoseInFrame", pose_schema())?;
        let commanded = channel("/commanded", "foxglove.PoseInFrame", pose_schema())?;
        let run = channel("/run", "cdpr.Run", run_schema())?;
        let events = channel("/events", "foxglove.Log", log_schema())?;
        writer.flush()?;
        Ok(Self { writer, platform, commanded, run, events, sequence: 0 })
    }

    fn write(&mut self, sample: &Sample, run: &Run) -> mcap::McapResult<()> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and 584 years fit"
        )]
        let time_ns = (sample.time_s * 1e9).round() as u64;
        let timestamp = json!({ "sec": time_ns / 1_000_000_000, "nsec": time_ns % 1_000_000_000 });
        let pose = |place: &Stance<f64>| {
            let (p, q) = (&place.position_m, place.orientation.as_ref());
            json!({
                "timestamp": timestamp,
                "frame_id": "world",
                "pose": {
                    "position": { "x": p.x, "y": p.y, "z": p.z },
                    "orientation": { "x": q.i, "y": q.j, "z": q.k, "w": q.w },
                },
            })
        };
        let mut messages = vec![
            (self.platform, pose(&sample.place)),
            (self.commanded, pose(&sample.commanded)),
            (self.run, serde_json::to_value(run).unwrap_or_default()),
        ];
        if !sample.decision.note.is_empty() {
            let level = if sample.decision.mode == cdpr_link::Mode::Fault { 4 } else { 2 }; // error, info
            let text = sample.decision.note.as_str();
            let event = json!({ "timestamp": timestamp, "level": level, "message": text, "name": "controller", "file": "", "line": 0 });
            messages.push((self.events, event));
        }
        for (channel_id, message) in messages {
            let header = MessageHeader {
                channel_id,
                sequence: self.sequence,
                log_time: time_ns,
                publish_time: time_ns,
            };
            self.writer.write_to_known_channel(&header, message.to_string().as_bytes())?;
        }
        self.sequence += 1;
        self.writer.flush()
    }
}

fn time_schema() -> serde_json::Value {
    json!({ "type": "object", "title": "time", "properties": { "sec": { "type": "integer" }, "nsec": { "type": "integer" } } })
}

fn pose_schema() -> serde_json::Value {
    let number = json!({ "type": "number" });
    let vector =
        json!({ "type": "object", "properties": { "x": number, "y": number, "z": number } });
    let quaternion = json!({ "type": "object", "properties": { "x": number, "y": number, "z": number, "w": number } });
    let pose = json!({ "type": "object", "properties": { "position": vector, "orientation": quaternion } });
    json!({
        "title": "foxglove.PoseInFrame",
        "type": "object",
        "properties": { "timestamp": time_schema(), "frame_id": { "type": "string" }, "pose": pose },
    })
}

fn log_schema() -> serde_json::Value {
    let (text, integer) = (json!({ "type": "string" }), json!({ "type": "integer" }));
    json!({
        "title": "foxglove.Log",
        "type": "object",
        "properties": {
            "timestamp": time_schema(), "level": integer, "message": text, "name": text, "file": text, "line": integer,
        },
    })
}

fn run_schema() -> serde_json::Value {
    let number = |about: &str| json!({ "type": ["number", "null"], "description": about });
    let six = |about: &str| json!({ "type": "array", "items": { "type": ["number", "null"] }, "description": about });
    let flag = |about: &str| json!({ "type": "boolean", "description": about });
    json!({
        "title": "cdpr.Run",
        "type": "object",
        "properties": {
            "trajectory_s": number("time since the trajectory set out, s"),
            "mode": { "type": "string", "enum": ["disarmed", "aligning", "holding", "tracking", "fault"] },
            "is_halted": flag("it came to rest before its time, and waits"),
            "brakes_released": flag("the brakes are to be open"),
            "speed_m_s": number("speed of the centre of mass, m/s"),
            "total_error_m": number("true less commanded position, m"),
            "total_error_rad": number("the same of the orientation, rad"),
            "static_error_m": number("of it, what is left when the platform rests on what is paid out, m"),
            "model_error_m": number("of that, what the controller believes of cables and load, m"),
            "winches_error_m": number("of that, what the winches do not follow, m"),
            "dynamic_error_m": number("what swings, m"),
            "contraction": number("of the certificate; below 0.44"),
            "distance": number("distance to a singularity"),
            "length_m": six("rest lengths paid out, m"),
            "commanded_length_m": six("rest lengths of the last certified command, m"),
            "tension_n": six("true tensions at the anchors, N"),
            "commanded_tension_n": six("tensions at the anchors of the last certified command, N"),
            "motor_angle": six("commanded, units of 2^-32 turn"),
            "motor_speed_rad_s": six("commanded, rad/s"),
        },
    })
}
