//! Partition of a set among processes.

use std::{fmt, str::FromStr};

use thiserror::Error;

/// Part of a set for one of several processes, counted from 1: `3/20`.
///
/// Part I of N consists of the shards I, I + N, I + 2 N, ..., so a set may have more shards than
/// there are processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SetPart {
    index: u32,
    of: u32,
}

/// Error of parsing or creating a part.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SetPartError {
    /// Text that is not two numbers.
    #[error("`{0}` is not I/N: give two whole numbers, as in 3/20")]
    Form(String),
    /// Index outside of 1 to the number of parts.
    #[error("there is no part {index} of {of}: parts count from 1/{of} to {of}/{of}")]
    Range {
        /// Requested index of the part.
        index: u32,
        /// Number of parts of the set.
        of: u32,
    },
}

impl SetPart {
    /// The whole set as a single part.
    pub const WHOLE: Self = Self { index: 1, of: 1 };

    /// Creates part `index` of `of`, from 1.
    ///
    /// # Errors
    /// Returns an error unless `index` is in 1 to `of`.
    pub const fn new(index: u32, of: u32) -> Result<Self, SetPartError> {
        match index >= 1 && index <= of {
            true => Ok(Self { index, of }),
            false => Err(SetPartError::Range { index, of }),
        }
    }

    /// Returns the shard numbers of this part, from 1, in a set of `of_set` shards.
    pub fn shards(self, of_set: u32) -> impl Iterator<Item = u32> {
        (self.index..=of_set).step_by(self.of as usize)
    }
}

impl FromStr for SetPart {
    type Err = SetPartError;

    fn from_str(text: &str) -> Result<Self, SetPartError> {
        let numbers = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.trim().parse().ok()?, of.trim().parse().ok()?)));
        let (index, of) = numbers.ok_or_else(|| SetPartError::Form(text.to_owned()))?;
        Self::new(index, of)
    }
}

impl fmt::Display for SetPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_the_set_once() {
        for shards in [1, 5, 12] {
            for of in [1, 2, 5, 20] {
                let parts = (1..=of).map(|index| SetPart::new(index, of).expect("a part"));
                let mut all: Vec<u32> = parts.flat_map(|part| part.shards(shards)).collect();
                all.sort_unstable();
                assert_eq!(all, (1..=shards).collect::<Vec<_>>(), "{of} parts");
            }
        }
    }

    #[test]
    fn rejects_invalid_parts() {
        assert_eq!("3/20".parse(), SetPart::new(3, 20));
        for (text, part) in
            [("3", "as in 3/20"), ("a/b", "as in 3/20"), ("0/4", "from 1/4"), ("5/4", "to 4/4")]
        {
            let error = text.parse::<SetPart>().expect_err(text).to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
