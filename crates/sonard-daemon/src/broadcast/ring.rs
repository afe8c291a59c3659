//! Ring buffer bounded by count and bytes.

use std::collections::VecDeque;

/// Ring buffer of the newest items, numbered from 0, bounded by their count and their bytes.
#[derive(Debug)]
pub(crate) struct Ring<T> {
    items: VecDeque<(usize, T)>,
    /// Number of the oldest item, or of the next one if the buffer is empty.
    first: u64,
    bytes: usize,
    max_items: usize,
    max_bytes: usize,
}

impl<T> Ring<T> {
    pub(crate) const fn new(max_items: usize, max_bytes: usize) -> Self {
        Self { items: VecDeque::new(), first: 0, bytes: 0, max_items, max_bytes }
    }

    /// Appends an item of the given size in bytes. Returns the items that are evicted; the newest
    /// item is kept whatever its size.
    pub(crate) fn push(&mut self, bytes: usize, item: T) -> Vec<T> {
        let mut evicted = Vec::new();
        let bytes = bytes + size_of::<(usize, T)>();
        self.bytes += bytes;
        self.items.push_back((bytes, item));
        while self.items.len() > 1
            && (self.items.len() > self.max_items || self.bytes > self.max_bytes)
        {
            if let Some((bytes, item)) = self.items.pop_front() {
                self.bytes -= bytes;
                evicted.push(item);
            }
            self.first += 1;
        }
        evicted
    }

    /// Returns the item with the given number, if it is buffered.
    pub(crate) fn get(&self, number: u64) -> Option<&T> {
        let at = usize::try_from(number.checked_sub(self.first)?).ok()?;
        self.items.get(at).map(|(_, item)| item)
    }

    /// Number of the oldest item.
    pub(crate) const fn first(&self) -> u64 {
        self.first
    }

    /// Number of the next item to be appended.
    pub(crate) fn end(&self) -> u64 {
        self.first + self.items.len() as u64
    }

    /// Removes all items; the numbering continues.
    pub(super) fn clear(&mut self) {
        (self.first, self.bytes) = (self.end(), 0);
        self.items = VecDeque::new();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evicts_by_count_and_bytes() {
        let cost = |bytes: usize| bytes - size_of::<(usize, u8)>();
        let mut ring = Ring::new(3, 1000);
        let evicted: Vec<u8> = (0..5_u8).flat_map(|item| ring.push(cost(100), item)).collect();
        assert_eq!(evicted, [0, 1]);
        assert_eq!((ring.first(), ring.end()), (2, 5));
        assert_eq!((ring.get(1), ring.get(2), ring.get(5)), (None, Some(&2), None));
        assert_eq!(ring.push(cost(850), 5), [2, 3]);
        assert_eq!((ring.first(), ring.bytes), (4, 950));
        ring.push(5000, 6);
        assert_eq!(
            (ring.first(), ring.get(6)),
            (6, Some(&6)),
            "the newest item is kept whatever its size"
        );
        ring.clear();
        assert_eq!((ring.first(), ring.end(), ring.bytes), (7, 7, 0));
    }
}
