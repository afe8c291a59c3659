//! Order statistics.

/// Sample quantile at probability `p` (0 to 1), interpolated linearly between order statistics
/// (Hyndman and Fan 1996, definition 7); `None` without values.
#[must_use]
pub fn quantile(mut values: Vec<f64>, p: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    values.sort_unstable_by(f64::total_cmp);
    let position = p.clamp(0.0, 1.0) * last as f64;
    let (below, fraction) = (position.floor() as usize, position.fract());
    let above = (below + 1).min(last);
    Some(values[below] + fraction * (values[above] - values[below]))
}

/// Decimates by two, keeping the first element; for collections with a bounded size.
pub fn keep_every_second<T>(kept: &mut Vec<T>) {
    let mut index = 0;
    kept.retain(|_| {
        index += 1;
        index % 2 == 1
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_second_is_kept() {
        for (count, expected) in [(0, vec![]), (1, vec![0]), (5, vec![0, 2, 4]), (6, vec![0, 2, 4])]
        {
            let mut kept: Vec<usize> = (0..count).collect();
            keep_every_second(&mut kept);
            assert_eq!(kept, expected);
        }
    }
}
