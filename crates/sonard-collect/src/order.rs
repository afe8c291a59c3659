//! Order of the scans of a collection. Pure.

use rand::{SeedableRng as _, seq::SliceRandom as _};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::keys::Order;

/// Scan of a collection, identified by pose and repeat, both counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Slot {
    /// Number of the pose.
    pub pose: u32,
    /// Number of the repeat at that pose.
    pub repeat: u32,
}

/// Lists all scans of `poses` with `repeats` scans each, in measuring order.
///
/// The order depends only on the arguments, so a resumed collection keeps its order.
#[must_use]
pub fn slots(poses: &[u32], repeats: u32, order: Order, seed: u64) -> Vec<Slot> {
    let at = |pose: u32| (1..=repeats).map(move |repeat| Slot { pose, repeat });
    let by_pose = || poses.iter().copied().flat_map(at).collect::<Vec<_>>();
    match order {
        Order::ByPose => by_pose(),
        Order::Rounds => {
            let round = |repeat| poses.iter().map(move |&pose| Slot { pose, repeat });
            (1..=repeats).flat_map(round).collect()
        }
        Order::Random => {
            let mut slots = by_pose();
            slots.shuffle(&mut Pcg64::seed_from_u64(seed));
            slots
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(slots: &[Slot]) -> String {
        let words: Vec<_> = slots.iter().map(|s| format!("{}.{}", s.pose, s.repeat)).collect();
        words.join(" ")
    }

    #[test]
    fn by_pose_and_in_rounds() {
        assert_eq!(text(&slots(&[1, 2], 2, Order::ByPose, 1)), "1.1 1.2 2.1 2.2");
        assert_eq!(text(&slots(&[1, 4], 2, Order::Rounds, 1)), "1.1 4.1 1.2 4.2");
    }

    #[test]
    fn random_order_by_seed() {
        let shuffled = |seed| slots(&[1, 2, 3, 5], 25, Order::Random, seed);
        let mut sorted = shuffled(7);
        sorted.sort_unstable();
        assert_eq!(sorted, slots(&[1, 2, 3, 5], 25, Order::ByPose, 7));
        assert_eq!(shuffled(7), shuffled(7));
        assert_ne!(shuffled(7), shuffled(8));
        assert_ne!(shuffled(7), sorted);
    }
}
