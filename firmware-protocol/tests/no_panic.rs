//! The device machine runs where a panic message cannot be read, so it must not be able to panic.
#![cfg(all(target_os = "linux", target_env = "gnu"))]

use std::path::Path;
use std::process::Command;

#[test]
fn links_without_panic_handler() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("no-panic");
    let output = Command::new("sh")
        .arg(folder.join("check.sh"))
        .env("CARGO_TARGET_DIR", Path::new(env!("CARGO_TARGET_TMPDIR")).join("no-panic"))
        // The program under test sets its own flags.
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .output()
        .expect("sh runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
}
