//! Segments fitted to points by split and merge.

use sonard_model::geometry::DVec2;

/// Settings of the segment fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitSettings {
    /// Maximum distance of a point from its segment, metres.
    pub tolerance_m: f64,
    /// Minimum number of points of a segment.
    pub min_points: usize,
    /// Minimum length of a segment, metres.
    pub min_length_m: f64,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self { tolerance_m: 0.03, min_points: 3, min_length_m: 0.05 }
    }
}

/// Segment fitted to points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedSegment {
    /// End points, in the order of the points.
    pub ends: [DVec2; 2],
    /// Confidence from 0 to 1: `(1 - rms / tolerance) (1 - 2 / n)` for n points with deviation
    /// `rms`. The paper's own measure is in a report that it only cites.
    pub confidence: f64,
    /// Index of the first supporting point, counted among the finite ones.
    pub from: usize,
    /// Number of supporting points.
    pub points: usize,
}

/// Fits segments to points in their order along the walls (the order of a scan).
///
/// Split: a run is cut at the point farthest from the line through its ends, if that deviates by
/// more than the tolerance. Merge: neighbouring runs that fit a common line are joined.
#[must_use]
pub fn fit(points: &[DVec2], settings: &FitSettings) -> Vec<FittedSegment> {
    let points: Vec<DVec2> = points.iter().copied().filter(|point| point.is_finite()).collect();
    let mut cuts = Vec::new();
    split(&points, 0, settings, &mut cuts);
    let runs = join(&points, &cuts, settings);
    runs.into_iter()
        .filter(|(from, to)| to - from >= settings.min_points.max(2))
        .filter_map(|(from, to)| segment(&points[from..to], from, settings))
        .collect()
}

/// Collects the start indices of runs, in ascending order.
fn split(points: &[DVec2], from: usize, settings: &FitSettings, cuts: &mut Vec<usize>) {
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else { return };
    let along = (last - first).normalize_or_zero();
    let off = |point: &DVec2| match along {
        DVec2::ZERO => point.distance(first),
        _ => along.perp_dot(*point - first).abs(),
    };
    let farthest = (1..points.len().saturating_sub(1))
        .max_by(|a, b| off(&points[*a]).total_cmp(&off(&points[*b])));
    match farthest.filter(|at| off(&points[*at]) > settings.tolerance_m) {
        Some(at) => {
            split(&points[..at], from, settings, cuts);
            split(&points[at..], from + at, settings, cuts);
        }
        None => cuts.push(from),
    }
}

/// Runs between the cuts; neighbours that fit a common line are joined.
fn join(points: &[DVec2], cuts: &[usize], settings: &FitSettings) -> Vec<(usize, usize)> {
    let ends = cuts.iter().skip(1).copied().chain([points.len()]);
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for (from, to) in cuts.iter().copied().zip(ends) {
        match runs.last_mut() {
            Some(last) if fits(&points[last.0..to], settings.tolerance_m) => last.1 = to,
            _ => runs.push((from, to)),
        }
    }
    runs
}

fn fits(points: &[DVec2], tolerance_m: f64) -> bool {
    let (middle, along) = line(points);
    points.iter().all(|point| along.perp_dot(*point - middle).abs() <= tolerance_m)
}

fn segment(points: &[DVec2], from: usize, settings: &FitSettings) -> Option<FittedSegment> {
    let (middle, along) = line(points);
    let place = |point: &DVec2| along.dot(*point - middle);
    let (low, high) = points
        .iter()
        .map(place)
        .fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at), high.max(at)));
    let forward = points.first().zip(points.last()).is_none_or(|(a, b)| place(a) <= place(b));
    let ends = [middle + low * along, middle + high * along];
    let count = points.len() as f64;
    let square: f64 = points.iter().map(|point| along.perp_dot(*point - middle).powi(2)).sum();
    let rms_m = (square / count).sqrt();
    let confidence = (1.0 - rms_m / settings.tolerance_m).clamp(0.0, 1.0) * (1.0 - 2.0 / count);
    (high - low >= settings.min_length_m).then_some(FittedSegment {
        ends: if forward { ends } else { [ends[1], ends[0]] },
        confidence,
        from,
        points: points.len(),
    })
}

/// Total-least-squares line: centroid and direction.
fn line(points: &[DVec2]) -> (DVec2, DVec2) {
    let count = points.len().max(1) as f64;
    let middle = points.iter().sum::<DVec2>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in points {
        let off = *point - middle;
        xx += off.x * off.x;
        xy += off.x * off.y;
        yy += off.y * off.y;
    }
    // The principal axis is at half the angle of the second moment.
    (middle, DVec2::from_angle((2.0 * xy).atan2(xx - yy) / 2.0))
}
