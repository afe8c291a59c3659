//! Order statistics.

/// The value below which a share `p` (0 to 1) of the values lies, interpolated linearly between
/// the two nearest (Hyndman and Fan 1996, definition 7); `None` without values.
#[must_use]
pub fn quantile(mut values: Vec<f64>, p: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    values.sort_unstable_by(f64::total_cmp);
    let place = p.clamp(0.0, 1.0) * last as f64;
    let (below, part) = (place.floor() as usize, place.fract());
    let above = (below + 1).min(last);
    Some(values[below] + part * (values[above] - values[below]))
}

/// Keeps the first, the third, and so on: for what may not grow without bounds.
pub fn keep_every_second<T>(kept: &mut Vec<T>) {
    let mut place = 0;
    kept.retain(|_| {
        place += 1;
        place % 2 == 1
    });
}
