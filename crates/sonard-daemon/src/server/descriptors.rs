//! Budget of file descriptors: clients leave enough for port, log and everything else that measuring needs.

use std::fs;

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use super::slots::Shares;

/// Descriptors kept for the serial port, the log with its rotation, folders that are searched, thermometer, name
/// resolution, broker, and reading of logs for clients.
const RESERVED: usize = 14;
/// Descriptors that are enough for all purposes of one daemon.
const ENOUGH: u64 = 65_536;
/// Connections over their limit that are answered at a time, if there are enough descriptors.
const MAX_REJECTING: usize = 16;

/// Raises this process's limit of descriptors as far as it may, and returns it.
fn raise_limit() -> u64 {
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let wanted = maximum.unwrap_or(ENOUGH).min(ENOUGH);
    let current = current.unwrap_or(ENOUGH);
    if current >= wanted {
        return current;
    }
    match setrlimit(Resource::Nofile, Rlimit { current: Some(wanted), maximum }) {
        Ok(()) => wanted,
        Err(_) => current,
    }
}

/// Descriptors that are open now.
fn count_open() -> usize {
    fs::read_dir("/proc/self/fd").map_or(0, Iterator::count)
}

/// Connections that each way in may have, and connections over these that may be answered at a time: `max_clients` for
/// each, or fewer where this process's limit of descriptors does not allow as many. `others` are descriptors that the
/// configuration needs beside the usual ones.
pub(super) fn connection_shares(
    max_clients: usize,
    has_tcp: bool,
    others: usize,
) -> (Shares, usize) {
    let (limit, open) = (raise_limit(), count_open());
    let limit = usize::try_from(limit).unwrap_or(usize::MAX);
    let free = limit.saturating_sub(open + others + RESERVED);
    let (shares, rejecting) = divide(free, max_clients, has_tcp);
    if shares.socket < max_clients {
        tracing::warn!(
            "the limit of {limit} file descriptors allows {} clients instead of {max_clients}: raise it (`ulimit -n`, \
             LimitNOFILE=)",
            shares.socket
        );
    }
    (shares, rejecting)
}

/// Divides free descriptors: one in eight for rejections, half of the others for the owner's socket, the rest for TCP.
/// Each way in has one at least.
fn divide(free: usize, max_clients: usize, has_tcp: bool) -> (Shares, usize) {
    let rejecting = (free / 8).clamp(1, MAX_REJECTING);
    let free = free.saturating_sub(rejecting);
    let share = |descriptors: usize| descriptors.clamp(1, max_clients.max(1));
    let shares = if has_tcp {
        let tcp = share(free / 4);
        Shares { socket: share(free - free / 2), loopback: tcp, network: tcp }
    } else {
        Shares { socket: share(free), loopback: 1, network: 1 }
    };
    (shares, rejecting)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn enough_descriptors_give_all_clients() {
        let all = Shares { socket: 32, loopback: 32, network: 32 };
        assert_eq!(divide(1000, 32, true), (all, MAX_REJECTING));
    }

    proptest! {
        #[test]
        fn shares_fit_the_free_descriptors(free in 6_usize..5000, max in 1_usize..300, tcp: bool) {
            let (shares, rejecting) = divide(free, max, tcp);
            let tcp_descriptors = if tcp { shares.loopback + shares.network } else { 0 };
            prop_assert!(shares.socket + tcp_descriptors + rejecting <= free);
            prop_assert!(shares.socket >= shares.loopback && shares.loopback >= 1);
        }
    }
}
