//! Disjoint sets of numbered elements.

/// Partition of the numbers 0, 1, ... into sets (union-find with path halving).
pub(super) struct UnionFind(Vec<u32>);

impl UnionFind {
    pub(super) fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// Representative of an element's set.
    pub(super) fn root(&mut self, mut at: u32) -> u32 {
        while self.0[at as usize] != at {
            self.0[at as usize] = self.0[self.0[at as usize] as usize];
            at = self.0[at as usize];
        }
        at
    }

    pub(super) fn union(&mut self, a: u32, b: u32) {
        let [a, b] = [a, b].map(|at| self.root(at));
        self.0[a as usize] = b;
    }
}
