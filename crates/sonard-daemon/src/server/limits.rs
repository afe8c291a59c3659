//! Slots for connections and for live streams: who takes all of one kind leaves the others theirs.

use std::{
    collections::HashMap,
    net::IpAddr,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::access::{Peer, Standing};

/// Connections from each address.
type Counts = Arc<Mutex<HashMap<IpAddr, usize>>>;

/// Slots, each way in by itself.
#[derive(Debug)]
pub(super) struct Slots {
    socket: Arc<Semaphore>,
    loopback: Arc<Semaphore>,
    network: Arc<Semaphore>,
    /// Live streams of guests, who could otherwise hold every place for as long as they like.
    guest_streams: Arc<Semaphore>,
    /// Connections from each address of the network, and how many it may have.
    by_address: Counts,
    most_by_address: usize,
}

/// A connection's place, given back when dropped.
#[derive(Debug)]
pub(super) struct Slot {
    _permit: OwnedSemaphorePermit,
    address: Option<(IpAddr, Counts)>,
}

/// Connections that each way in may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shares {
    pub(super) socket: usize,
    pub(super) loopback: usize,
    pub(super) network: usize,
}

impl Slots {
    /// Slots by way in; half of the network's for one address, and as many for streams of guests.
    pub(super) fn new(shares: Shares) -> Self {
        let places = |count: usize| Arc::new(Semaphore::new(count));
        let half = shares.network.div_ceil(2);
        Self {
            socket: places(shares.socket),
            loopback: places(shares.loopback),
            network: places(shares.network),
            guest_streams: places(half),
            by_address: Arc::default(),
            most_by_address: half,
        }
    }

    /// A place for a connection, if one is free.
    pub(super) fn take(&self, peer: Peer, address: Option<IpAddr>) -> Option<Slot> {
        let places = match peer {
            Peer::Unix => &self.socket,
            Peer::Loopback => &self.loopback,
            Peer::Network => &self.network,
        };
        let permit = Arc::clone(places).try_acquire_owned().ok()?;
        let address = address.filter(|_| peer == Peer::Network);
        if let Some(address) = address {
            let mut by_address = held(&self.by_address);
            let count = by_address.entry(address).or_default();
            if *count >= self.most_by_address {
                return None;
            }
            *count += 1;
        }
        let address = address.map(|address| (address, Arc::clone(&self.by_address)));
        Some(Slot { _permit: permit, address })
    }

    /// Leave for a live stream: only guests need any. `None` if too many of them have one.
    pub(super) fn take_stream(&self, standing: Standing) -> Option<Option<OwnedSemaphorePermit>> {
        match standing {
            Standing::Socket | Standing::Token => Some(None),
            Standing::Guest => Arc::clone(&self.guest_streams).try_acquire_owned().ok().map(Some),
        }
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let Some((address, by_address)) = &self.address else { return };
        let mut by_address = held(by_address);
        if let Some(count) = by_address.get_mut(address) {
            *count -= 1;
            if *count == 0 {
                by_address.remove(address);
            }
        }
    }
}

/// Nothing under this lock can panic, so a poisoned one holds what it should.
fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_takes_the_places_of_another_way_in_or_address() {
        let places = Slots::new(Shares { socket: 4, loopback: 4, network: 4 });
        let [one, other] = [1, 2].map(|last| IpAddr::from([192, 168, 1, last]));
        let mut taken = Vec::new();
        for (peer, address, free) in [
            (Peer::Loopback, None, 4),
            (Peer::Network, Some(one), 2),
            (Peer::Network, Some(other), 2),
            (Peer::Unix, None, 4),
        ] {
            let before = taken.len();
            taken.extend((0..10).filter_map(|_| places.take(peer, address)));
            assert_eq!(taken.len() - before, free, "{peer:?}");
        }
        drop(taken);
        assert!(places.take(Peer::Network, Some(one)).is_some());
        assert!(held(&places.by_address).is_empty(), "nothing is kept of who left");
    }

    #[test]
    fn streams_of_guests_leave_half_of_the_places() {
        let places = Slots::new(Shares { socket: 5, loopback: 5, network: 5 });
        let guests: Vec<_> = (0..10).filter_map(|_| places.take_stream(Standing::Guest)).collect();
        assert_eq!(guests.len(), 3);
        assert!(places.take_stream(Standing::Token).is_some());
        assert!(places.take_stream(Standing::Socket).is_some());
    }
}
