//! Generates bindings to libsimavr, and states the commit.

use std::error::Error;

#[cfg(feature = "simavr")]
const FUNCTIONS: &str = "avr_(make_mcu_by_name|init|load_firmware|run|terminate|reset|ioctl|\
io_getirq|raise_irq|irq_register_notify|cycle_timer_register|cycle_timer_cancel)|elf_read_firmware";

#[cfg(feature = "simavr")]
fn main() -> Result<(), Box<dyn Error>> {
    use std::{env, path::PathBuf};

    sonard_build::emit(sonard_build::Package { folder: "emulator/", features: &["simavr"] });
    println!("cargo:rerun-if-changed=wrapper.h");
    let simavr = pkg_config::Config::new().atleast_version("1.6").probe("simavr").map_err(|error| {
        format!("libsimavr is missing (apt-get install libsimavr-dev libelf-dev libclang-dev): {error}")
    })?;
    // simavr depends on libelf without declaring it.
    println!("cargo:rustc-link-lib=elf");
    let include = simavr.include_paths.iter().map(|path| format!("-I{}", path.display()));
    bindgen::Builder::default()
        .header("wrapper.h")
        .clang_args(include)
        .allowlist_function(FUNCTIONS)
        .allowlist_type("avr_t|elf_firmware_t|avr_irq_t|avr_eeprom_desc_t")
        .generate_comments(false)
        .layout_tests(false)
        .generate()?
        .write_to_file(PathBuf::from(env::var("OUT_DIR")?).join("simavr.rs"))?;
    Ok(())
}

#[cfg(not(feature = "simavr"))]
fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    Ok(())
}
