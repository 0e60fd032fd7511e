//! The core from C: the header is that of the sources, and a C program computes on a host and on an
//! emulated Cortex-M4F, bit for bit, what Rust does.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use cdpr_core::{
    CABLES, Cable, CableLimits, CableState, IrvineCatenary, Load, Pose, Robot, SetPoint, Tracker,
    TrackerSettings, Twist,
};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use tempfile::TempDir;

const TARGET: &str = "thumbv7em-none-eabihf";

/// What a user is told to compile with, and all that compilers have to say against it.
const C99: [&str; 6] = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror"];

#[test]
fn header_is_that_of_the_sources() {
    let config = cbindgen::Config::from_file(c_crate("cbindgen.toml")).unwrap();
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in ["src/lib.rs", "src/status.rs", "src/types.rs"] {
        builder = builder.with_src(c_crate(source));
    }
    let mut expected = Vec::new();
    builder.generate().unwrap().write(&mut expected);
    let expected = String::from_utf8(expected).unwrap();

    let path = c_crate("include/cdpr.h");
    if std::env::var_os("CDPR_WRITE_HEADER").is_some() {
        fs::write(&path, &expected).unwrap();
    }
    let same = fs::read_to_string(&path).unwrap() == expected;
    assert!(same, "{} is old: run this test with CDPR_WRITE_HEADER=1", path.display());
}

#[test]
fn header_is_cpp_too() {
    if Command::new("g++").arg("--version").output().is_err() {
        eprintln!("not tested: there is no g++ here");
        return;
    }
    let dir = TempDir::new().unwrap();
    let source = dir.path().join("user.cpp");
    let text = "#include \"cdpr.h\"\n\
        bool ok(cdpr_f64_status status) { return status.code == CDPR_CODE_OK; }\n\
        const char *text(cdpr_f32_status status) { return cdpr_text(status.code); }\n";
    fs::write(&source, text).unwrap();
    run(Command::new("g++")
        .args(["-std=c++11", "-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Werror"])
        .arg(include_path())
        .arg(&source));
}

#[test]
fn readme_compiles() {
    let readme = fs::read_to_string(c_crate("README.md")).unwrap();
    let (_, code) = readme.split_once("```c\n").unwrap();
    let (code, _) = code.split_once("```").unwrap();
    let dir = TempDir::new().unwrap();
    let source = dir.path().join("readme.c");
    fs::write(&source, code).unwrap();
    run(Command::new("cc").args(C99).arg("-fsyntax-only").arg(include_path()).arg(source));
}

#[test]
fn host_computes_what_rust_does() {
    let library = build(&[]).join("debug/libcdpr_core_c.a");
    let dir = TempDir::new().unwrap();
    let program = dir.path().join("tick");
    run(Command::new("cc")
        .args(C99)
        .arg(include_path())
        .args([c_crate("examples/tick.c"), c_crate("examples/host.c"), library])
        .args(["-lgcc_s", "-lpthread", "-ldl", "-lm", "-o"]) // of Rust's std
        .arg(&program));
    check(&run(&mut Command::new(program)));
}

#[test]
fn firmware_computes_what_rust_does() {
    let library =
        build(&["--release", "--target", TARGET]).join(TARGET).join("release/libcdpr_core_c.a");
    // The proof: the panic handler calls this function, and the optimizer has removed both from all
    // that the library exports, not only from what the example links.
    let name = b"cdpr_core_c_can_panic";
    let archive = fs::read(&library).unwrap();
    assert!(!archive.windows(name.len()).any(|bytes| bytes == name), "something can panic");

    let dir = TempDir::new().unwrap();
    let image = dir.path().join("tick.elf");
    run(Command::new("arm-none-eabi-gcc")
        .args(["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"])
        .args(C99)
        .args(["-ffreestanding", "-nostdlib", "-Wl,--gc-sections,-z,noexecstack,--fatal-warnings"])
        .arg(include_path())
        .arg("-T")
        .args([
            c_crate("examples/mps2_an386.ld"),
            c_crate("examples/tick.c"),
            c_crate("examples/mps2_an386.c"),
            library,
        ])
        .args(["-lgcc", "-o"])
        .arg(&image));
    check(&run(Command::new("timeout")
        .args(["60", "qemu-system-arm", "-machine", "mps2-an386"])
        .args(["-display", "none", "-monitor", "none", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(image)));
}

/// Compares what the example has printed with the same in Rust.
fn check(printed: &str) {
    let lines: Vec<&str> = printed.lines().collect();
    let expected = ticks();
    assert_eq!(lines.len(), expected.len() + 3, "{printed}");
    for (tick, (line, expected)) in lines.iter().zip(&expected).enumerate() {
        // Nine decimals tell every f32 above 1 apart.
        assert_eq!(lengths_m(line).map(f32::to_bits), expected.map(f32::to_bits), "tick {tick}");
    }
    assert_eq!(lines[100], "the pose is not finite or its quaternion not a rotation");
    assert_eq!(lines[101], "remedy: stand still until a good set-point comes");
    // The restart from lengths that were 4 mm off: the same solution, but for rounding. A solved rest
    // length is good to 4 units (found on the image of the firmware), and there are two of them.
    for (found, expected) in lengths_m(lines[102]).iter().zip(&expected[99]) {
        assert!((found - expected).abs() <= 8.0 * f32::EPSILON * expected, "{found} {expected}");
    }
}

fn lengths_m(line: &str) -> [f32; CABLES] {
    let numbers: Vec<f32> = line.split(' ').map(|number| number.parse().unwrap()).collect();
    numbers.try_into().unwrap()
}

/// The rest lengths of the hundred ticks of `examples/tick.c`, with its numbers.
fn ticks() -> Vec<[f32; CABLES]> {
    let model = IrvineCatenary { weight_n_m: 0.079 * 9.81, compliance_per_n: 1.0 / 1.256_637_1e6 };
    let cables = [
        ([-3.259, -0.475, 8.826], [-0.10, -0.93, -0.03]),
        ([9.421, -3.482, 11.555], [0.10, -0.93, -0.03]),
        ([9.538, 3.797, 11.533], [0.27, 0.50, -0.07]),
        ([5.570, 20.414, 8.704], [0.27, 0.50, -0.07]),
        ([-2.505, 16.810, 8.649], [-0.27, 0.50, -0.07]),
        ([-3.342, 9.421, 8.788], [-0.27, 0.50, -0.07]),
    ]
    .map(|(anchor_m, attachment_m): ([f32; 3], [f32; 3])| Cable {
        anchor_m: anchor_m.into(),
        attachment_m: attachment_m.into(),
        model,
    });
    let load = Load {
        mass_kg: 69.0,
        center_of_mass_m: Vector3::zeros(),
        gravity_m_s2: 9.81,
        force_n: Vector3::zeros(),
        moment_nm: Vector3::zeros(),
    };
    let winch = CableLimits {
        shortest_m: 1.0,
        longest_m: 50.0,
        fastest_m_s: 2.0,
        lowest_tension_n: 5.0,
        highest_tension_n: 2000.0,
    };
    let settings = TrackerSettings {
        period_s: 0.001,
        largest_move_m: 0.01,
        least_distance: 1e-4,
        fold_horizon_s: 0.1,
        largest_error_n: 1.0,
        cables: [winch; CABLES],
    };
    let states = [
        (155.414_69, -114.487_35, 10.479_832),
        (179.357_76, -129.583_59, 15.077_343),
        (131.308_53, -141.830_1, 12.221_567),
        (166.606_8, -72.739_22, 14.731_523),
        (129.781_62, -74.298_386, 11.970_178),
        (125.545_906, -143.951_37, 8.355_886),
    ]
    .map(|(fx, fz, rest_length_m)| CableState { force_n: Vector2::new(fx, fz), rest_length_m });
    let path = |tick: u16| SetPoint {
        pose: Pose::new(
            Vector3::new(f32::from(2000 + tick) / 1000.0, 7.0, 2.5),
            UnitQuaternion::identity(),
        )
        .unwrap(),
        twist: Twist { linear_m_s: Vector3::new(1.0, 0.0, 0.0), angular_rad_s: Vector3::zeros() },
    };
    let robot = Robot::new(cables).unwrap();
    let mut tracker = Tracker::start(robot, load, settings, &path(0), &states).unwrap();
    (1..=100)
        .map(|tick| tracker.tick(&path(tick)).unwrap().cables.map(|cable| cable.rest_length_m))
        .collect()
}

/// Builds the library, next to what the tests were built into, and says where.
fn build(arguments: &[&str]) -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap();
    run(Command::new(env!("CARGO"))
        .args(["build", "--locked", "--package", "cdpr-core-c", "--target-dir"])
        .arg(target)
        .args(arguments)
        .current_dir(c_crate("")));
    target.to_owned()
}

/// Runs a program that has to succeed; what it prints (semihosting prints on the standard error).
fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&text).into_owned();
    assert!(output.status.success(), "{command:?}: {}\n{text}", output.status);
    text
}

fn include_path() -> impl AsRef<OsStr> {
    format!("-I{}", c_crate("include").display())
}

fn c_crate(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../core/c").join(path)
}
