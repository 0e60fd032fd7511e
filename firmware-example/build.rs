//! Linker arguments of the images; nothing for a host, where they are empty programs.

use std::{env, fs, io, path::PathBuf};

/// The warm-start table of the firmware.
const TABLE: &str = "tables/marionet-crane.cdpr";

/// The images that log.
const LOGGING: [&str; 3] = ["cdpr-firmware-example", "in_the_loop", "measure"];

fn main() -> io::Result<()> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory");
    if env::var_os("CARGO_CFG_TARGET_OS").is_none_or(|os| os != "none") {
        return Ok(());
    }
    // Another one may be measured.
    println!("cargo:rerun-if-env-changed=CDPR_TABLE");
    let table = env::var_os("CDPR_TABLE").map_or_else(|| PathBuf::from(TABLE), PathBuf::from);
    println!("cargo:rustc-env=CDPR_TABLE={}", fs::canonicalize(table)?.display());
    let nucleo = env::var_os("CARGO_FEATURE_BOARD_NUCLEO_F446RE").is_some();
    let memory = if nucleo { "memory/nucleo-f446re.x" } else { "memory/mps2.x" };
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or(io::ErrorKind::NotFound)?);
    // link.x of cortex-m-rt includes memory.x, which it looks for on the search path.
    fs::copy(memory, out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    // Sections need no page alignment where there are no pages.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    for image in LOGGING {
        println!("cargo:rustc-link-arg-bin={image}=-Tdefmt.x");
    }
    Ok(())
}
