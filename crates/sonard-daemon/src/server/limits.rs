//! Slots for connections and live streams, separate for each kind of client.

use std::{
    collections::HashMap,
    net::IpAddr,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::access::{Peer, Principal};

/// Number of connections per address.
type Counts = Arc<Mutex<HashMap<IpAddr, usize>>>;

/// Connection slots, separate for each kind of peer.
#[derive(Debug)]
pub(super) struct Slots {
    socket: Arc<Semaphore>,
    loopback: Arc<Semaphore>,
    network: Arc<Semaphore>,
    /// Slots for live streams of guests, which could otherwise occupy every slot indefinitely.
    guest_streams: Arc<Semaphore>,
    /// Number of connections per network address, and its maximum.
    by_address: Counts,
    max_per_address: usize,
}

/// Slot of a connection, released when dropped.
#[derive(Debug)]
pub(super) struct ConnectionSlot {
    _permit: OwnedSemaphorePermit,
    address: Option<(IpAddr, Counts)>,
}

/// Maximum number of connections per kind of peer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shares {
    pub(super) socket: usize,
    pub(super) loopback: usize,
    pub(super) network: usize,
}

impl Slots {
    /// Creates the slots. One network address, and all guest streams together, may use half of the
    /// network's slots.
    pub(super) fn new(shares: Shares) -> Self {
        let slots = |count: usize| Arc::new(Semaphore::new(count));
        let half = shares.network.div_ceil(2);
        Self {
            socket: slots(shares.socket),
            loopback: slots(shares.loopback),
            network: slots(shares.network),
            guest_streams: slots(half),
            by_address: Arc::default(),
            max_per_address: half,
        }
    }

    /// Takes a slot for a connection, if one is free.
    pub(super) fn take(&self, peer: Peer, address: Option<IpAddr>) -> Option<ConnectionSlot> {
        let semaphore = match peer {
            Peer::Unix => &self.socket,
            Peer::Loopback => &self.loopback,
            Peer::Network => &self.network,
        };
        let permit = Arc::clone(semaphore).try_acquire_owned().ok()?;
        let address = address.filter(|_| peer == Peer::Network);
        if let Some(address) = address {
            let mut by_address = lock(&self.by_address);
            let count = by_address.entry(address).or_default();
            if *count >= self.max_per_address {
                return None;
            }
            *count += 1;
        }
        let address = address.map(|address| (address, Arc::clone(&self.by_address)));
        Some(ConnectionSlot { _permit: permit, address })
    }

    /// Takes a slot for a live stream, which only guests need. `None` if all guest slots are in
    /// use.
    pub(super) fn take_stream(&self, principal: Principal) -> Option<Option<OwnedSemaphorePermit>> {
        match principal {
            Principal::Socket | Principal::Token => Some(None),
            Principal::Guest => Arc::clone(&self.guest_streams).try_acquire_owned().ok().map(Some),
        }
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        let Some((address, by_address)) = &self.address else { return };
        let mut by_address = lock(by_address);
        if let Some(count) = by_address.get_mut(address) {
            *count -= 1;
            if *count == 0 {
                by_address.remove(address);
            }
        }
    }
}

/// Locks `mutex`. Nothing under this lock can panic, so a poisoned lock holds valid data.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_separate_per_peer() {
        let slots = Slots::new(Shares { socket: 4, loopback: 4, network: 4 });
        let [first, second] = [1, 2].map(|last| IpAddr::from([192, 168, 1, last]));
        let mut taken = Vec::new();
        for (peer, address, free) in [
            (Peer::Loopback, None, 4),
            (Peer::Network, Some(first), 2),
            (Peer::Network, Some(second), 2),
            (Peer::Unix, None, 4),
        ] {
            let before = taken.len();
            taken.extend((0..10).filter_map(|_| slots.take(peer, address)));
            assert_eq!(taken.len() - before, free, "{peer:?}");
        }
        drop(taken);
        assert!(slots.take(Peer::Network, Some(first)).is_some());
        assert!(lock(&slots.by_address).is_empty(), "no count remains");
    }

    #[test]
    fn guest_streams_are_limited() {
        let slots = Slots::new(Shares { socket: 5, loopback: 5, network: 5 });
        let guests: Vec<_> = (0..10).filter_map(|_| slots.take_stream(Principal::Guest)).collect();
        assert_eq!(guests.len(), 3);
        assert!(slots.take_stream(Principal::Token).is_some());
        assert!(slots.take_stream(Principal::Socket).is_some());
    }
}
