//! Distributions of numbers, as written in a specification.

use std::fmt;

use rand::{Rng, RngExt as _};
use rand_distr::{Distribution as _, StandardNormal};
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{Error, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer},
};

/// Distribution of a number.
#[derive(Debug, Clone, PartialEq)]
pub enum NumberDistribution {
    /// Constant: `0.5`.
    Fixed(f64),
    /// Uniform distribution: `[0.3, 0.7]`.
    Uniform([f64; 2]),
    /// Truncated normal distribution: `{ mean = 20, sigma = 3, min = 10, max = 30 }`.
    Normal {
        /// Mean before truncation.
        mean: f64,
        /// Standard deviation before truncation.
        sigma: f64,
        /// Lower bound of the number.
        min: f64,
        /// Upper bound of the number.
        max: f64,
    },
    /// Uniform choice: `{ any_of = [0.02, 0.05] }`.
    AnyOf(Vec<f64>),
}

/// Maximum number of draws of a truncated normal distribution, after which the mean is clamped to
/// the bounds.
const MAX_DRAWS: usize = 1000;

impl NumberDistribution {
    /// Returns the minimum of the distribution.
    #[must_use]
    pub fn min(&self) -> f64 {
        match self {
            Self::Fixed(number) => *number,
            Self::Uniform([min, _]) | Self::Normal { min, .. } => *min,
            Self::AnyOf(numbers) => numbers.iter().copied().fold(f64::INFINITY, f64::min),
        }
    }

    /// Returns the maximum of the distribution.
    #[must_use]
    pub fn max(&self) -> f64 {
        match self {
            Self::Fixed(number) => *number,
            Self::Uniform([_, max]) | Self::Normal { max, .. } => *max,
            Self::AnyOf(numbers) => numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// Draws a number from the distribution.
    pub fn draw(&self, rng: &mut impl Rng) -> f64 {
        match self {
            Self::Fixed(number) => *number,
            Self::Uniform([min, max]) if min < max => rng.random_range(*min..*max),
            Self::Uniform([min, _]) => *min,
            Self::Normal { mean, sigma, min, max } => {
                let mut draw = || {
                    let unit: f64 = StandardNormal.sample(rng);
                    mean + sigma * unit
                };
                let fits = |number: &f64| (*min..=*max).contains(number);
                (0..MAX_DRAWS).map(|_| draw()).find(fits).unwrap_or(mean.clamp(*min, *max))
            }
            Self::AnyOf(numbers) => numbers[rng.random_range(0..numbers.len())],
        }
    }

    /// Draws a count: for `[2, 4]` 2, 3 or 4, for other distributions rounded to a whole number.
    pub fn count(&self, rng: &mut impl Rng) -> usize {
        match self {
            Self::Uniform([min, max]) => rng.random_range(*min as usize..=*max as usize),
            other => other.draw(rng).round() as usize,
        }
    }

    /// Checks bounds and parameters.
    fn check(self) -> Result<Self, &'static str> {
        let (min, max) = (self.min(), self.max());
        if !(min.is_finite() && max.is_finite()) {
            return Err("a distribution needs finite numbers, and any_of at least one");
        }
        if min > max {
            return Err("the minimum comes first, then the maximum");
        }
        match self {
            Self::Normal { mean, sigma, .. } if !(mean.is_finite() && sigma >= 0.0) => {
                Err("mean must be finite and sigma must not be negative")
            }
            valid => Ok(valid),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DistributionKeys {
    mean: Option<f64>,
    sigma: Option<f64>,
    min: Option<f64>,
    max: Option<f64>,
    any_of: Option<Vec<f64>>,
}

impl DistributionKeys {
    fn spread(self) -> Result<NumberDistribution, &'static str> {
        match self {
            Self { mean: None, sigma: None, min: None, max: None, any_of: Some(numbers) } => {
                Ok(NumberDistribution::AnyOf(numbers))
            }
            Self { mean: Some(mean), sigma: Some(sigma), min, max, any_of: None } => {
                // Truncated at six sigma, which one number in 10^9 exceeds.
                let min = min.unwrap_or(mean - 6.0 * sigma);
                Ok(NumberDistribution::Normal {
                    mean,
                    sigma,
                    min,
                    max: max.unwrap_or(mean + 6.0 * sigma),
                })
            }
            _ => Err("give mean and sigma (optionally min and max), or only any_of"),
        }
    }
}

impl<'de> Deserialize<'de> for NumberDistribution {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct DistributionVisitor;
        impl<'de> Visitor<'de> for DistributionVisitor {
            type Value = NumberDistribution;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, [min, max], { mean = , sigma = } or { any_of = [ , ] }")
            }

            fn visit_f64<E>(self, number: f64) -> Result<NumberDistribution, E> {
                Ok(NumberDistribution::Fixed(number))
            }

            fn visit_i64<E>(self, number: i64) -> Result<NumberDistribution, E> {
                Ok(NumberDistribution::Fixed(number as f64))
            }

            fn visit_u64<E>(self, number: u64) -> Result<NumberDistribution, E> {
                Ok(NumberDistribution::Fixed(number as f64))
            }

            fn visit_seq<A: SeqAccess<'de>>(
                self,
                mut list: A,
            ) -> Result<NumberDistribution, A::Error> {
                let mut next = || list.next_element::<f64>();
                match (next()?, next()?, next()?) {
                    (Some(min), Some(max), None) => Ok(NumberDistribution::Uniform([min, max])),
                    _ => Err(A::Error::custom("a list is [min, max]; for a choice use any_of")),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<NumberDistribution, A::Error> {
                let keys = DistributionKeys::deserialize(MapAccessDeserializer::new(map))?;
                keys.spread().map_err(A::Error::custom)
            }
        }
        deserializer.deserialize_any(DistributionVisitor)?.check().map_err(D::Error::custom)
    }
}

impl Serialize for NumberDistribution {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct NormalKeys {
            mean: f64,
            sigma: f64,
            min: f64,
            max: f64,
        }
        #[derive(Serialize)]
        struct ChoiceKeys<'a> {
            any_of: &'a [f64],
        }
        match self {
            Self::Fixed(number) => number.serialize(serializer),
            Self::Uniform(ends) => ends.serialize(serializer),
            Self::Normal { mean, sigma, min, max } => {
                let (mean, sigma, min, max) = (*mean, *sigma, *min, *max);
                NormalKeys { mean, sigma, min, max }.serialize(serializer)
            }
            Self::AnyOf(any_of) => ChoiceKeys { any_of }.serialize(serializer),
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng as _;
    use rand_pcg::Pcg64;

    use super::*;

    fn read(text: &str) -> Result<NumberDistribution, String> {
        serde_json::from_str(text).map_err(|error| error.to_string())
    }

    #[test]
    fn draws_reach_their_bounds() {
        let mut rng = Pcg64::seed_from_u64(1);
        for text in [
            "3",
            "[-1, 2.5]",
            "[2, 2]",
            r#"{"mean": 1, "sigma": 3, "min": 0, "max": 2}"#,
            r#"{"mean": 1, "sigma": 0}"#,
            r#"{"any_of": [4, 1, 2.5]}"#,
        ] {
            let spread = read(text).expect(text);
            let numbers: Vec<f64> = (0..2000).map(|_| spread.draw(&mut rng)).collect();
            let (min, max) = (spread.min(), spread.max());
            assert!(numbers.iter().all(|number| (min..=max).contains(number)), "{text}");
            let near = 0.02 * (max - min);
            assert!(numbers.iter().any(|number| *number <= min + near), "{text}");
            assert!(numbers.iter().any(|number| *number >= max - near), "{text}");
            let again = serde_json::to_string(&spread).expect("JSON");
            assert_eq!(read(&again), Ok(spread), "{text}");
        }
    }

    #[test]
    fn counts_are_uniform() {
        let mut rng = Pcg64::seed_from_u64(1);
        let spread = NumberDistribution::Uniform([2.0, 4.0]);
        let mut seen = [0; 6];
        for _ in 0..3000 {
            seen[spread.count(&mut rng)] += 1;
        }
        assert_eq!([seen[0], seen[1], seen[5]], [0, 0, 0]);
        assert!(seen[2..5].iter().all(|times| (800..1200).contains(times)), "{seen:?}");
    }

    #[test]
    fn rejects_invalid_distributions() {
        for (text, part) in [
            ("\"wide\"", "expected a number, [min, max]"),
            ("[1]", "[min, max]"),
            ("[1, 2, 3]", "any_of"),
            ("[2, 1]", "comes first"),
            (r#"{"any_of": []}"#, "at least one"),
            (r#"{"mean": 1}"#, "give mean and sigma"),
            (r#"{"mean": 1, "sigma": -1}"#, "comes first"),
            (r#"{"mean": 1, "sigma": 1, "min": 3, "max": 2}"#, "comes first"),
            (r#"{"median": 1}"#, "unknown field `median`"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
