//! Round numbers for axes and scale bars.

/// Smallest step of 1, 2 or 5 times a power of ten that divides `span` into at most `parts`; 1
/// without a span.
pub fn nice_step(span: f64, parts: f64) -> f64 {
    let raw = span / parts;
    if !raw.is_normal() || raw < 0.0 {
        return 1.0;
    }
    let decade = 10_f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| m * decade)
        .find(|step| *step >= raw * (1.0 - 1e-9))
        .unwrap_or(10.0 * decade);
    if step.is_normal() { step } else { 1.0 }
}

/// Multiples of `step` in `[from, to]`, at most a hundred.
pub fn multiples(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (from / step - 1e-9).ceil();
    (0..100)
        .map(move |i| (first + f64::from(i)) * step)
        .take_while(move |value| *value <= to + 1e-9 * step)
}

/// Formats a multiple of `step` with the decimals that the step needs.
pub fn label(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    // Adding zero turns -0 into 0.
    let text = format!("{:.decimals$}", value + 0.0);
    // The minus sign is as wide as a digit, unlike the hyphen.
    text.replacen('-', "\u{2212}", 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        for (span, parts, step) in
            [(0.93, 5.0, 0.2), (360.0, 8.0, 50.0), (1.0, 10.0, 0.1), (7e6, 4.0, 2e6)]
        {
            let found = nice_step(span, parts);
            assert!((found / step - 1.0).abs() < 1e-9, "{span} in {parts}: {found}");
        }
        for odd in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-320] {
            assert_eq!(nice_step(odd, 5.0), 1.0);
        }
    }

    #[test]
    fn labels_have_the_decimals_of_the_step() {
        let labels: Vec<_> = multiples(-0.2, 0.4, 0.2).map(|v| label(v, 0.2)).collect();
        assert_eq!(labels, ["\u{2212}0.2", "0.0", "0.2", "0.4"]);
        assert_eq!(label(50.0, 50.0), "50");
        assert_eq!(multiples(0.0, 1e12, 1e-3).count(), 100);
    }
}
