//! sonard.
