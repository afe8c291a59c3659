//! Helpers of all tests.

pub(crate) use sonard_test_support::*;
