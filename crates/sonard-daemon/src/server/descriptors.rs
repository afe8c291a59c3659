//! File descriptor budget: clients leave enough for the serial port, the log and all other needs of
//! the measurement.

use std::fs;

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use super::limits::Shares;

/// Descriptors reserved for the serial port, the log with its rotation, folder listings,
/// thermometer, name resolution, broker, and reading of logs for clients.
const RESERVED: usize = 14;
/// Descriptors sufficient for one daemon.
const ENOUGH: u64 = 65_536;
/// Maximum number of over-limit connections that are answered 503 concurrently, if there are enough
/// descriptors; further ones are closed.
const MAX_REJECTING: usize = 16;

/// Raises this process's soft limit of descriptors as far as permitted, and returns it.
fn raise_limit() -> u64 {
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let target = maximum.unwrap_or(ENOUGH).min(ENOUGH);
    let current = current.unwrap_or(ENOUGH);
    if current >= target {
        return current;
    }
    match setrlimit(Resource::Nofile, Rlimit { current: Some(target), maximum }) {
        Ok(()) => target,
        Err(_) => current,
    }
}

/// Descriptors that are open now.
fn count_open() -> usize {
    fs::read_dir("/proc/self/fd").map_or(0, Iterator::count)
}

/// Returns the maximum number of connections per kind of peer, and of concurrent rejections. Each
/// kind of peer may have `max_clients`, or fewer if this process's limit of descriptors is lower.
/// `others` are descriptors that the configuration needs in addition to the usual ones.
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
            "the limit of {limit} file descriptors allows {} clients instead of {max_clients}: raise the limit (`ulimit -n`, \
             LimitNOFILE=)",
            shares.socket
        );
    }
    (shares, rejecting)
}

/// Divides free descriptors: one in eight for rejections, half of the others for the unix socket,
/// the rest for TCP. Each kind of peer has at least one.
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
    fn many_descriptors() {
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
