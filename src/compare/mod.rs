//! Measured against predicted: residuals and verdicts.
