//! The device machine runs where nobody could read a panic message: it must not be able to.
#![cfg(all(target_os = "linux", target_env = "gnu"))]

use std::path::Path;
use std::process::Command;

#[test]
fn the_device_machine_links_without_a_panic_handler() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("no-panic");
    let output = Command::new("sh")
        .arg(folder.join("check.sh"))
        .env("CARGO_TARGET_DIR", Path::new(env!("CARGO_TARGET_TMPDIR")).join("no-panic"))
        // The flags of the program under test are its own.
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .output()
        .expect("sh runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
}
