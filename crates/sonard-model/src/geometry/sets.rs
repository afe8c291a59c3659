//! Disjoint sets of things that are numbered.

/// Which of the numbers 0, 1, ... hang together (union-find with path halving).
pub(super) struct Sets(Vec<u32>);

impl Sets {
    pub(super) fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// The number that stands for all of its set.
    pub(super) fn root(&mut self, mut at: u32) -> u32 {
        while self.0[at as usize] != at {
            self.0[at as usize] = self.0[self.0[at as usize] as usize];
            at = self.0[at as usize];
        }
        at
    }

    pub(super) fn join(&mut self, one: u32, other: u32) {
        let [one, other] = [one, other].map(|at| self.root(at));
        self.0[one as usize] = other;
    }
}
