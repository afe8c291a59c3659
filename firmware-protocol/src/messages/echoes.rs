//! List of echo times with a fixed capacity.

use core::fmt;
use core::ops::Deref;

use serde::de::{Error, SeqAccess, Visitor};
use serde::ser::SerializeSeq;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::limits::{MAX_ECHOES, WINDOW_TICKS_MAX};
use super::wire::{Reader, Wire, Writer};

/// Up to [`MAX_ECHOES`] echo times, ticks after firing, each at most [`WINDOW_TICKS_MAX`].
///
/// Dereferences to a slice. On the wire: the number of echoes, then each as a varint.
#[derive(Clone, Copy, Default)]
pub struct Echoes {
    len: u8,
    ticks: [u32; MAX_ECHOES as usize],
}

impl Echoes {
    /// Creates an empty list.
    #[must_use]
    pub const fn new() -> Self {
        Self { len: 0, ticks: [0; MAX_ECHOES as usize] }
    }

    /// Creates a list of the first [`MAX_ECHOES`] of `ticks` that are within range.
    #[must_use]
    pub fn from_ticks(ticks: &[u32]) -> Self {
        let mut echoes = Self::new();
        for &tick in ticks {
            // Echoes beyond the capacity are dropped on purpose.
            let _ = echoes.push(tick);
        }
        echoes
    }

    /// Adds an echo, in ticks after firing.
    ///
    /// # Errors
    ///
    /// Returns `ticks` if the list is full or the time exceeds [`WINDOW_TICKS_MAX`].
    pub fn push(&mut self, ticks: u32) -> Result<(), u32> {
        match self.ticks.get_mut(usize::from(self.len)) {
            Some(slot) if ticks <= WINDOW_TICKS_MAX => {
                *slot = ticks;
                self.len = self.len.wrapping_add(1);
                Ok(())
            }
            _ => Err(ticks),
        }
    }

    /// Keeps the first `count` echoes.
    pub fn truncate(&mut self, count: u8) {
        self.len = self.len.min(count);
    }
}

impl Deref for Echoes {
    type Target = [u32];

    fn deref(&self) -> &[u32] {
        self.ticks.get(..usize::from(self.len)).unwrap_or_default()
    }
}

impl PartialEq for Echoes {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl Eq for Echoes {}

impl fmt::Debug for Echoes {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_list().entries(self.iter()).finish()
    }
}

impl Wire for Echoes {
    const BLANK: Self = Self::new();

    fn put(&self, out: &mut Writer<'_>) {
        out.byte(self.len);
        for ticks in self.iter() {
            ticks.put(out);
        }
    }

    fn read(&mut self, input: &mut Reader<'_>) {
        *self = Self::new();
        for _ in 0..input.code() {
            let mut ticks = 0;
            ticks.read(input);
            if !input.is_valid() || self.push(ticks).is_err() {
                return input.fail();
            }
        }
    }
}

impl Serialize for Echoes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(Some(self.len()))?;
        for tick in self.iter() {
            list.serialize_element(tick)?;
        }
        list.end()
    }
}

impl<'de> Deserialize<'de> for Echoes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(EchoesVisitor)
    }
}

struct EchoesVisitor;

impl<'de> Visitor<'de> for EchoesVisitor {
    type Value = Echoes;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a short list of echo times")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Echoes, A::Error> {
        let mut echoes = Echoes::new();
        while let Some(ticks) = list.next_element()? {
            echoes.push(ticks).map_err(|_| A::Error::custom("too many echoes, or too late"))?;
        }
        Ok(echoes)
    }
}
