//! Digests of the inputs of long computations, by which their checkpoints are recognized.

use std::fmt::{self, Write as _};

use sha2::{Digest as _, Sha256};

use crate::store::to_hex;

/// SHA-256 of formatted inputs, as hexadecimal text.
///
/// Format with `Debug`: it covers all fields, including future ones, and prints floats with
/// round-trip precision.
pub(super) fn digest(inputs: fmt::Arguments<'_>) -> String {
    let mut digest = DigestWriter(Sha256::new());
    // Writing to a digest never fails.
    let _ = digest.write_fmt(inputs);
    to_hex(&digest.0.finalize())
}

struct DigestWriter(Sha256);

impl fmt::Write for DigestWriter {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text);
        Ok(())
    }
}
