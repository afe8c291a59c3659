//! Pictures of explorations and reliability diagrams.

mod exploration;
mod reliability;

pub use exploration::{draw_exploration, draw_explorations};
pub use reliability::draw_reliability;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Reliability, ReliabilityBin};

    #[test]
    fn every_filled_bin_has_a_mark() {
        let mut bins = [ReliabilityBin::default(); 10];
        bins[0] = ReliabilityBin { count: 90, mean_predicted: 0.02, observed: 0.03 };
        bins[9] = ReliabilityBin { count: 10, mean_predicted: 0.97, observed: 0.9 };
        let reliability = Reliability { bins, expected_error: 0.016, brier: 0.03 };
        let svg = draw_reliability("reliability", &[], &reliability).to_svg();
        assert_eq!(svg.matches("mean predicted probability 0.").count(), 2, "{svg}");
    }
}
