//! Positions of echoes in place of the robot's.

/// Evidence that positions in the file are those of echoes: they are then an affine function of
/// range times (cos, sin) of the direction, which covers axes exchanged, mirrored, scaled and
/// turned for plotting.
#[derive(Debug, Default)]
pub(super) struct EchoPositions {
    count: u64,
    own: Extent,
    /// Extent of the unit vectors of the directions.
    directions: Extent,
    /// Extent of the difference for the usual plotting conventions, for few readings.
    offsets: [Extent; 8],
    fit: AffineFit,
}

#[derive(Debug, Clone, Copy)]
struct Extent {
    low: [f64; 2],
    high: [f64; 2],
}

impl Default for Extent {
    fn default() -> Self {
        Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] }
    }
}

impl Extent {
    fn add(&mut self, [x, y]: [f64; 2]) {
        self.low = [self.low[0].min(x), self.low[1].min(y)];
        self.high = [self.high[0].max(x), self.high[1].max(y)];
    }

    fn size(&self) -> f64 {
        (self.high[0] - self.low[0]).max(self.high[1] - self.low[1])
    }
}

impl EchoPositions {
    pub(super) fn add(&mut self, [x, y]: [f64; 2], range_m: f64, direction_deg: f64) {
        self.count += 1;
        self.own.add([x, y]);
        let (sin, cos) = direction_deg.to_radians().sin_cos();
        self.directions.add([cos, sin]);
        let (a, b) = (range_m * cos, range_m * sin);
        let signs = [(a, b), (a, -b), (-a, b), (-a, -b)];
        let axes = signs.into_iter().flat_map(|(u, v)| [[u, v], [v, u]]);
        for (offset, [u, v]) in self.offsets.iter_mut().zip(axes) {
            offset.add([x - u, y - v]);
        }
        self.fit.add([a, b], [x, y]);
    }

    pub(super) fn follow_readings(&self) -> bool {
        let (size_m, spread) = (self.own.size(), self.directions.size());
        // Without a turn, a robot that approaches a wall moves as its range falls.
        if self.count < 4 || size_m <= 0.05 || spread < 0.1 {
            return false;
        }
        self.offsets.iter().any(|offset| offset.size() < 0.05 * size_m)
            || (self.count >= 8
                && spread > 0.8
                && self.fit.residual().is_some_and(|residual_m| residual_m < 0.004 * size_m))
    }
}

/// Least-squares fit of positions by an affine function of two numbers.
#[derive(Debug, Default)]
struct AffineFit {
    /// Sums of the products of (1, a, b).
    normal: [[f64; 3]; 3],
    /// Sums of (1, a, b) times x and y, and of the squares of x and y, from the first position.
    products: [[f64; 3]; 2],
    squares: [f64; 2],
    first: Option<[f64; 2]>,
}

impl AffineFit {
    fn add(&mut self, [a, b]: [f64; 2], place: [f64; 2]) {
        let first = *self.first.get_or_insert(place);
        let row = [1.0, a, b];
        for (sums, u) in self.normal.iter_mut().zip(row) {
            for (sum, v) in sums.iter_mut().zip(row) {
                *sum += u * v;
            }
        }
        for axis in 0..2 {
            let coordinate = place[axis] - first[axis];
            self.squares[axis] += coordinate * coordinate;
            for (sum, u) in self.products[axis].iter_mut().zip(row) {
                *sum += u * coordinate;
            }
        }
    }

    /// Root of the mean squared residual of the worse axis; `None` if the directions or ranges do
    /// not determine the function.
    fn residual(&self) -> Option<f64> {
        let [p, q, r] = self.normal;
        let determinant = |p: [f64; 3], q: [f64; 3], r: [f64; 3]| {
            p[0] * (q[1] * r[2] - q[2] * r[1]) - p[1] * (q[0] * r[2] - q[2] * r[0])
                + p[2] * (q[0] * r[1] - q[1] * r[0])
        };
        let whole = determinant(p, q, r);
        if whole <= 1e-9 * p[0] * q[1] * r[2] {
            return None;
        }
        let squared = (0..2).map(|axis| {
            // The matrix is symmetric, so rows replace columns.
            let right = self.products[axis];
            let factors = [
                determinant(right, q, r) / whole,
                determinant(p, right, r) / whole,
                determinant(p, q, right) / whole,
            ];
            let explained: f64 = factors.iter().zip(right).map(|(factor, sum)| factor * sum).sum();
            ((self.squares[axis] - explained) / p[0]).max(0.0)
        });
        squared.reduce(f64::max).map(f64::sqrt)
    }
}
