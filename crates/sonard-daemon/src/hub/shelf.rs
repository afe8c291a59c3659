//! The newest of a sequence, within bounds.

use std::collections::VecDeque;

/// The newest items that were put on it, numbered from 0, up to a number and a sum of bytes.
#[derive(Debug)]
pub(crate) struct Shelf<T> {
    items: VecDeque<(usize, T)>,
    /// Number of the oldest one that is there, or of the next one.
    first: u64,
    bytes: usize,
    most: usize,
    most_bytes: usize,
}

impl<T> Shelf<T> {
    pub(crate) const fn new(most: usize, most_bytes: usize) -> Self {
        Self { items: VecDeque::new(), first: 0, bytes: 0, most, most_bytes }
    }

    /// Puts one on it that costs so many bytes, and gives back those that fall off. The newest stays whatever it costs.
    pub(crate) fn put(&mut self, bytes: usize, item: T) -> Vec<T> {
        let mut fallen = Vec::new();
        let bytes = bytes + size_of::<(usize, T)>();
        self.bytes += bytes;
        self.items.push_back((bytes, item));
        while self.items.len() > 1 && (self.items.len() > self.most || self.bytes > self.most_bytes)
        {
            if let Some((bytes, item)) = self.items.pop_front() {
                self.bytes -= bytes;
                fallen.push(item);
            }
            self.first += 1;
        }
        fallen
    }

    /// One by its number, if it is there.
    pub(crate) fn get(&self, number: u64) -> Option<&T> {
        let at = usize::try_from(number.checked_sub(self.first)?).ok()?;
        self.items.get(at).map(|(_, item)| item)
    }

    /// Number of the oldest one.
    pub(crate) const fn first(&self) -> u64 {
        self.first
    }

    /// Number of the next one that will be put on it.
    pub(crate) fn end(&self) -> u64 {
        self.first + self.items.len() as u64
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        (self.first, self.bytes) = (self.end(), 0);
        self.items = VecDeque::new();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_newest_stay_by_number_and_by_bytes() {
        let cost = |bytes: usize| bytes - size_of::<(usize, u8)>();
        let mut shelf = Shelf::new(3, 1000);
        let fallen: Vec<u8> = (0..5_u8).flat_map(|item| shelf.put(cost(100), item)).collect();
        assert_eq!(fallen, [0, 1]);
        assert_eq!((shelf.first(), shelf.end()), (2, 5));
        assert_eq!((shelf.get(1), shelf.get(2), shelf.get(5)), (None, Some(&2), None));
        assert_eq!(shelf.put(cost(850), 5), [2, 3]);
        assert_eq!((shelf.first(), shelf.bytes), (4, 950));
        shelf.put(5000, 6);
        assert_eq!((shelf.first(), shelf.get(6)), (6, Some(&6)), "the newest is there in any case");
        shelf.clear();
        assert_eq!((shelf.first(), shelf.end(), shelf.bytes), (7, 7, 0));
    }
}
