//! sonard
fn main(){}
