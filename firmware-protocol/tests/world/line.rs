//! Serial line in virtual time, with transmission times and lost, altered or duplicated bytes.

use std::collections::VecDeque;

/// Small random generator, so that a seed determines a run.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns the next number of splitmix64.
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number from 0 to `bound` - 1.
    pub fn below(&mut self, bound: u64) -> u64 {
        ((u128::from(self.next()) * u128::from(bound)) >> 64) as u64
    }

    /// Returns `true` once in `one_in` calls on average; never for 0.
    pub fn once_in(&mut self, one_in: u64) -> bool {
        one_in != 0 && self.below(one_in) == 0
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len() as u64) as usize]
    }
}

/// Fault rates of a line, each as the mean number of units per fault; 0 for never.
#[derive(Debug, Clone, Copy, Default)]
pub struct Faults {
    pub byte_lost_one_in: u64,
    pub byte_changed_one_in: u64,
    pub byte_doubled_one_in: u64,
    /// Frame delivered a second time, later.
    pub frame_doubled_one_in: u64,
    /// Loss of a whole frame.
    pub frame_lost_one_in: u64,
    /// Maximum delay of late copies and stalls, us.
    pub delay_max_us: u64,
    /// Pause of the transmission.
    pub stall_one_in: u64,
}

/// Single direction of a line.
#[derive(Debug)]
pub struct Line {
    byte_ns: u64,
    faults: Faults,
    random: Random,
    /// Bytes in transit, with arrival time in ns, in order.
    bytes: VecDeque<(u64, u8)>,
    /// Late copies of frames, with arrival time in ns.
    late: Vec<(u64, Vec<u8>)>,
    free_at_ns: u64,
    frame: Vec<u8>,
    pub carried: u64,
}

impl Line {
    pub fn new(baud: u64, faults: Faults, random: Random) -> Self {
        Self {
            byte_ns: 10_000_000_000 / baud,
            faults,
            random,
            bytes: VecDeque::new(),
            late: Vec::new(),
            free_at_ns: 0,
            frame: Vec::new(),
            carried: 0,
        }
    }

    /// Time at which the sender may transmit the next byte, ns.
    pub fn free_at(&self) -> u64 {
        self.free_at_ns
    }

    /// Transmits bytes from `now_ns` on, after those in transit.
    pub fn send(&mut self, now_ns: u64, bytes: &[u8]) {
        for &byte in bytes {
            self.carried += 1;
            let start = self.free_at_ns.max(now_ns);
            self.free_at_ns = start + self.byte_ns;
            if self.random.once_in(self.faults.stall_one_in) {
                self.free_at_ns += 1_000 * self.random.below(self.faults.delay_max_us + 1);
            }
            self.frame.push(byte);
            if byte == 0 {
                self.end_frame();
            }
        }
    }

    fn end_frame(&mut self) {
        let frame = std::mem::take(&mut self.frame);
        if self.random.once_in(self.faults.frame_doubled_one_in) {
            let later = 1_000 * self.random.below(self.faults.delay_max_us + 1);
            self.late.push((self.free_at_ns + later, frame.clone()));
        }
        if self.random.once_in(self.faults.frame_lost_one_in) {
            return;
        }
        // The bytes arrive back to back, the last one at the end of its transmission.
        let begin = self.free_at_ns - self.byte_ns * (frame.len() as u64 - 1);
        for (index, byte) in frame.into_iter().enumerate() {
            let at = begin + index as u64 * self.byte_ns;
            self.inject_faults(at, byte);
        }
    }

    fn inject_faults(&mut self, at: u64, byte: u8) {
        let faults = self.faults;
        if self.random.once_in(faults.byte_lost_one_in) {
            return;
        }
        let flips = if self.random.once_in(faults.byte_changed_one_in) {
            1 + self.random.below(255) as u8
        } else {
            0
        };
        self.bytes.push_back((at, byte ^ flips));
        if self.random.once_in(faults.byte_doubled_one_in) {
            self.bytes.push_back((at, byte ^ flips));
        }
    }

    /// Arrival time of the next byte, ns.
    pub fn next_arrival(&self) -> Option<u64> {
        let late = self.late.iter().map(|(at, _)| *at).min();
        let next = self.bytes.front().map(|(at, _)| *at);
        [late, next].into_iter().flatten().min()
    }

    /// Returns the bytes that have arrived by `now_ns`. Late copies are inserted between other
    /// bytes and may split a frame.
    pub fn arrived(&mut self, now_ns: u64) -> Vec<u8> {
        let mut out = Vec::new();
        while let Some(&(at, byte)) = self.bytes.front()
            && at <= now_ns
        {
            self.bytes.pop_front();
            out.push(byte);
        }
        let between = out.last().is_none_or(|&byte| byte == 0);
        let (due, later): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.late).into_iter().partition(|(at, _)| *at <= now_ns);
        self.late = later;
        for (_, frame) in due {
            if !between {
                out.push(0);
            }
            out.extend(frame);
        }
        out
    }

    /// Cuts the line: bytes in transit are lost.
    pub fn cut(&mut self) {
        self.bytes.clear();
        self.late.clear();
        self.frame.clear();
    }
}
