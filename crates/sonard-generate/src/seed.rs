//! Random number generators that depend only on specification and stream.

use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use sha2::{Digest as _, Sha256};

/// Version of the sampling procedure; raised when equal specifications give different sets, as
/// shards of earlier versions then differ.
pub(crate) const DRAWING: u32 = 1;

/// Independent stream of random numbers in a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RandomStream {
    /// Scene contents, air, sensor and poses; by scene number in the set, from 1.
    Scene(u64),
    /// Noise of the readings at a pose; by scene number and pose number within the scene, from 1.
    Pose(u64, u32),
}

/// Returns the generator of a stream. Streams are independent, so no draw depends on the order of
/// generation.
pub(crate) fn rng(spec_sha256: &str, stream: RandomStream) -> Pcg64 {
    let (kind, scene, pose) = match stream {
        RandomStream::Scene(scene) => ("scene", scene, 0),
        RandomStream::Pose(scene, pose) => ("pose", scene, pose),
    };
    let label = format!("sonard generate {DRAWING}: {spec_sha256} {kind} {scene} {pose}");
    Pcg64::from_seed(Sha256::digest(label).into())
}

/// Returns the SHA-256 in hexadecimal digits.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
