//! Densities of quantization errors, with and without noise.

use std::f64::consts::{PI, SQRT_2};

use smallvec::SmallVec;

/// Maximum number of uniform terms in a sum.
const MAX_TERMS: usize = 4;

/// Sum of independent errors: uniform ones of given widths, each centred on 0, and a Gaussian one.
///
/// Two widths of one step yield the error of the extent, Bozma and Kuc's density (19); four of
/// half a step yield that of `beta`, density (23). The paper neglects noise; the Gaussian term is
/// the generalization that its section IX calls for, and other widths serve borders with missing
/// beams.
#[derive(Debug, Clone, PartialEq)]
pub struct UniformSum {
    widths: SmallVec<[f64; MAX_TERMS]>,
    sigma: f64,
}

impl UniformSum {
    /// Sum of at most four uniform errors of these widths and a Gaussian one of standard
    /// deviation `sigma`, all in one unit. Widths of 0 or less are ignored, as is everything
    /// after the fourth.
    #[must_use]
    pub fn new(widths: &[f64], sigma: f64) -> Self {
        let widths = widths.iter().copied().filter(|width| *width > 0.0).take(MAX_TERMS).collect();
        Self { widths, sigma: sigma.max(0.0) }
    }

    /// Error of an angular extent whose two borders lie in gaps of these widths between beams;
    /// `sigma` is the standard deviation of each border (19).
    #[must_use]
    pub fn for_extent(gaps: [f64; 2], sigma: f64) -> Self {
        Self::new(&gaps, SQRT_2 * sigma)
    }

    /// Error of `beta` from the gaps at the borders of both regions; `sigmas` are the standard
    /// deviations of each border in the two scans, `heading` that of the turn between them (23).
    #[must_use]
    pub fn for_beta(gaps: [[f64; 2]; 2], sigmas: [f64; 2], heading: f64) -> Self {
        let [[a, b], [c, d]] = gaps.map(|pair| pair.map(|gap| gap / 2.0));
        let borders: f64 = sigmas.iter().map(|sigma| sigma.powi(2) / 2.0).sum();
        Self::new(&[a, b, c, d], (borders + heading.powi(2)).sqrt())
    }

    /// Largest possible error without noise, plus `z` standard deviations.
    #[must_use]
    pub fn reach(&self, z: f64) -> f64 {
        self.widths.iter().sum::<f64>() / 2.0 + z * self.sigma
    }

    /// Probability density at an error; infinite at 0 if there is neither quantization nor noise.
    #[must_use]
    pub fn density(&self, error: f64) -> f64 {
        let Some(order) = self.widths.len().checked_sub(1) else { return self.normal(error) };
        if self.sigma == 0.0 && error.abs() >= self.reach(0.0) {
            return 0.0;
        }
        (self.spline(error, order) / factorial(order)).max(0.0)
    }

    /// Probability of an error of at most this.
    #[must_use]
    pub fn cumulative(&self, error: f64) -> f64 {
        let order = self.widths.len();
        if self.sigma == 0.0 && error.abs() >= self.reach(0.0) {
            return if error >= 0.0 { 1.0 } else { 0.0 };
        }
        (self.spline(error, order) / factorial(order)).clamp(0.0, 1.0)
    }

    /// Finite difference, over both ends of every term, of the integrated power of a step function;
    /// the Gaussian smooths that power.
    fn spline(&self, error: f64, order: usize) -> f64 {
        let terms = self.widths.len();
        let product: f64 = self.widths.iter().product();
        let sum: f64 = (0..1_u32 << terms)
            .map(|ends| {
                let (mut at, mut sign) = (error, 1.0);
                for (bit, width) in self.widths.iter().enumerate() {
                    if ends >> bit & 1 == 1 {
                        at -= width / 2.0;
                        sign = -sign;
                    } else {
                        at += width / 2.0;
                    }
                }
                sign * smooth_power(at, order, self.sigma)
            })
            .sum();
        sum / product
    }

    fn normal(&self, error: f64) -> f64 {
        if self.sigma == 0.0 {
            return if error == 0.0 { f64::INFINITY } else { 0.0 };
        }
        normal_density(error / self.sigma) / self.sigma
    }
}

/// Mean of `max(0, x + sigma Z)^n` for a standard normal `Z`: by parts,
/// `G_n = x G_(n-1) + (n-1) sigma^2 G_(n-2)`, from `G_0 = Phi` and `G_1 = x Phi + sigma phi`.
fn smooth_power(x: f64, n: usize, sigma: f64) -> f64 {
    if sigma == 0.0 {
        return if x > 0.0 { x.powi(n as i32) } else { 0.0 };
    }
    let below = 0.5 * libm::erfc(-x / sigma / SQRT_2);
    let (mut previous, mut this) = (below, x * below + sigma * normal_density(x / sigma));
    if n == 0 {
        return previous;
    }
    for order in 2..=n {
        (previous, this) = (this, x * this + (order - 1) as f64 * sigma * sigma * previous);
    }
    this
}

fn normal_density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|i| i as f64).product()
}
