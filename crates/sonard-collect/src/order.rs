//! Which scans there are to take, and in which order. Pure.

use rand::{SeedableRng as _, seq::SliceRandom as _};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::keys::Order;

/// One scan of a collection: the pose's number and the repeat's, both from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Slot {
    /// Number of the pose.
    pub pose: u32,
    /// Number of the scan at that pose.
    pub repeat: u32,
}

/// Every scan of `poses` with so many repeats each.
///
/// The same poses, repeats and seed always give the same order, so that a collection that is
/// resumed goes on in the order in which it began.
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
    fn orders_are_what_they_say() {
        assert_eq!(text(&slots(&[1, 2], 2, Order::ByPose, 1)), "1.1 1.2 2.1 2.2");
        assert_eq!(text(&slots(&[1, 4], 2, Order::Rounds, 1)), "1.1 4.1 1.2 4.2");
    }

    #[test]
    fn a_random_order_has_every_scan_once_and_repeats_by_seed() {
        let of = |seed| slots(&[1, 2, 3, 5], 25, Order::Random, seed);
        let mut sorted = of(7);
        sorted.sort_unstable();
        assert_eq!(sorted, slots(&[1, 2, 3, 5], 25, Order::ByPose, 7));
        assert_eq!(of(7), of(7));
        assert_ne!(of(7), of(8));
        assert_ne!(of(7), sorted);
    }
}
