//! Random numbers that follow from specification and place alone.

use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use sha2::{Digest as _, Sha256};

/// Raised when the same specification would draw something else: a shard of before is then another one.
pub(crate) const DRAWING: u32 = 1;

/// What is random about one thing in a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Of {
    /// What stands in a scene, its air, sensor and poses; by its number in the set, from 1.
    Scene(u64),
    /// The noise of the readings at a pose, by the scene's number and its own within it, from 1.
    Pose(u64, u32),
}

/// The generator of one thing. No two things share one, so that none hangs on what was drawn before it.
pub(crate) fn rng(spec_sha256: &str, of: Of) -> Pcg64 {
    let (kind, scene, pose) = match of {
        Of::Scene(scene) => ("scene", scene, 0),
        Of::Pose(scene, pose) => ("pose", scene, pose),
    };
    let words = format!("sonard generate {DRAWING}: {spec_sha256} {kind} {scene} {pose}");
    Pcg64::from_seed(Sha256::digest(words).into())
}

/// A SHA-256 in hexadecimal digits.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
