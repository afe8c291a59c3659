//! Selection of network interfaces for DDS.

use std::net::{IpAddr, Ipv4Addr};

/// Network interface of this computer with its addresses.
type Interface = (String, Vec<Ipv4Addr>);

/// Lists the network interfaces of this computer.
pub(super) fn interfaces() -> Vec<Interface> {
    let interfaces = netdev::get_interfaces().into_iter();
    interfaces
        .map(|interface| {
            let addresses = interface.ipv4.iter().map(|network| network.addr()).collect();
            (interface.name, addresses)
        })
        .collect()
}

/// Resolves addresses and interface names to addresses of this computer.
///
/// # Errors
/// If an address or a name does not exist on this computer.
pub(super) fn addresses(named: &[String], present: &[Interface]) -> Result<Vec<IpAddr>, String> {
    let mut addresses: Vec<IpAddr> = Vec::new();
    for name in named {
        let requested: Option<Ipv4Addr> = name.parse().ok();
        let matching: Vec<Ipv4Addr> = match requested {
            Some(requested) => present
                .iter()
                .flat_map(|(_, addresses)| addresses)
                .copied()
                .filter(|address| *address == requested)
                .collect(),
            None => {
                let interfaces = present.iter().filter(|(interface, _)| interface == name);
                interfaces.flat_map(|(_, addresses)| addresses).copied().collect()
            }
        };
        if matching.is_empty() {
            let present: Vec<String> = present
                .iter()
                .flat_map(|(name, addresses)| {
                    addresses.iter().map(move |address| format!("{address} ({name})"))
                })
                .collect();
            let present = if present.is_empty() { "none found".into() } else { present.join(", ") };
            return Err(format!(
                "ros.networks has {name}, which does not exist on this computer; present: {present}"
            ));
        }
        for address in matching.into_iter().map(IpAddr::V4) {
            if !addresses.contains(&address) {
                addresses.push(address);
            }
        }
    }
    Ok(addresses)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_names_are_resolved() {
        let ip = |last| Ipv4Addr::new(192, 168, 1, last);
        let present = [
            ("lo".to_owned(), vec![Ipv4Addr::LOCALHOST]),
            ("eth0".to_owned(), vec![ip(7), ip(8)]),
            ("wlan0".to_owned(), Vec::new()),
        ];
        let find = |named: &[&str]| {
            addresses(&named.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>(), &present)
        };
        assert_eq!(find(&["127.0.0.1"]), Ok(vec![Ipv4Addr::LOCALHOST.into()]));
        assert_eq!(find(&["192.168.1.8", "eth0"]), Ok(vec![ip(8).into(), ip(7).into()]));
        for missing in ["wlan0", "10.0.0.1", "eth1", ""] {
            let error = find(&["lo", missing]).expect_err("missing");
            assert!(error.contains(missing) && error.contains("192.168.1.7 (eth0)"), "{error}");
        }
        let error = addresses(&["lo".to_owned()], &[]).expect_err("no interface");
        assert!(error.ends_with("none found"), "{error}");
    }

    #[test]
    fn this_computer_has_a_loopback() {
        let found = addresses(&["127.0.0.1".to_owned()], &interfaces());
        assert_eq!(found, Ok(vec![Ipv4Addr::LOCALHOST.into()]));
    }
}
