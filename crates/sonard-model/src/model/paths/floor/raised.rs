//! Gain by which floor and ceiling can raise the echoes of upright edges above those in the plan.

use crate::model::paths::settings::PathSettings;

/// Shortest tabulated length, metres: below the distance from a ranger's face to anything.
const SHORTEST_M: f64 = 1e-3;

/// Ratio of consecutive lengths.
const RATIO: f64 = 1.1;

/// Upper bounds, by length, for the ratio of an echo by floor and ceiling to the echo of the plan
/// by upright edges that it is an image of.
///
/// A steep path gains at an edge by its slant (see [`height`](crate::model::paths::height)),
/// possibly more than air, floor and ceiling take from it. Then an image of an echo that is itself
/// too weak is listed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Raised {
    /// Bounds by one edge and by two, from [`SHORTEST_M`] onwards, each [`RATIO`] times longer.
    /// None increases with length.
    by_length: Vec<[f64; 2]>,
}

impl Raised {
    /// Tabulates the bounds of images with these gains and heights above the ranger, metres.
    pub(crate) fn new(images: &[[f64; 2]], settings: &PathSettings) -> Self {
        let longest = (settings.max_path_m / SHORTEST_M).max(1.0);
        let count = longest.log(RATIO) as i32 + 1;
        let bounds = |number: i32| {
            let from_m = SHORTEST_M * RATIO.powi(number);
            let to_m = RATIO * from_m;
            let raised = |&[gain, rise_m]: &[f64; 2]| {
                let slant = from_m.hypot(rise_m) / from_m;
                let gain = gain * settings.air_gain(to_m.hypot(rise_m) - to_m);
                [gain * slant.sqrt(), gain * slant]
            };
            images.iter().map(raised).fold([1.0_f64; 2], pairwise_max)
        };
        let mut by_length: Vec<[f64; 2]> = (0..count).map(bounds).collect();
        for number in (1..by_length.len()).rev() {
            by_length[number - 1] = pairwise_max(by_length[number - 1], by_length[number]);
        }
        let is_needed = by_length.first() != Some(&[1.0; 2]);
        Self { by_length: if is_needed { by_length } else { Vec::new() } }
    }

    /// Bound for an echo of a length by one edge, at least 1.
    pub(crate) fn by_edge(&self, length_m: f64) -> f64 {
        self.at(length_m)[0]
    }

    /// Bound for an echo of a length by two edges, at least 1.
    pub(crate) fn by_edges(&self, length_m: f64) -> f64 {
        self.at(length_m)[1]
    }

    fn at(&self, length_m: f64) -> [f64; 2] {
        if self.by_length.is_empty() {
            return [1.0; 2];
        }
        let number = (length_m / SHORTEST_M).max(1.0).log(RATIO) as usize;
        let last = self.by_length.len().saturating_sub(1);
        self.by_length.get(number.min(last)).copied().unwrap_or([1.0; 2])
    }
}

fn pairwise_max(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].max(b[0]), a[1].max(b[1])]
}
