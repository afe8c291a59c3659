//! The networks that it is told by.

use std::net::{IpAddr, Ipv4Addr};

/// An interface of this computer with its addresses.
type Interface = (String, Vec<Ipv4Addr>);

/// The interfaces that there are.
pub(super) fn interfaces() -> Vec<Interface> {
    let interfaces = netdev::get_interfaces().into_iter();
    interfaces
        .map(|interface| {
            let addresses = interface.ipv4.iter().map(|network| network.addr()).collect();
            (interface.name, addresses)
        })
        .collect()
}

/// The addresses that are meant by addresses and names of interfaces.
///
/// # Errors
/// The first one that is not there.
pub(super) fn addresses(named: &[String], there: &[Interface]) -> Result<Vec<IpAddr>, String> {
    let mut addresses: Vec<IpAddr> = Vec::new();
    for name in named {
        let asked: Option<Ipv4Addr> = name.parse().ok();
        let meant: Vec<Ipv4Addr> = match asked {
            Some(asked) => {
                there.iter().flat_map(|(_, all)| all).copied().filter(|one| *one == asked).collect()
            }
            None => {
                let of_name = there.iter().filter(|(interface, _)| interface == name);
                of_name.flat_map(|(_, all)| all).copied().collect()
            }
        };
        if meant.is_empty() {
            let there: Vec<String> = there
                .iter()
                .flat_map(|(name, all)| all.iter().map(move |one| format!("{one} ({name})")))
                .collect();
            let there = if there.is_empty() { "none to be seen".into() } else { there.join(", ") };
            return Err(format!("ros.networks has {name}, which this computer has not: {there}"));
        }
        for address in meant.into_iter().map(IpAddr::V4) {
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
    fn addresses_and_names_of_interfaces_are_found_and_what_is_not_there_is_told() {
        let ip = |last| Ipv4Addr::new(192, 168, 1, last);
        let there = [
            ("lo".to_owned(), vec![Ipv4Addr::LOCALHOST]),
            ("eth0".to_owned(), vec![ip(7), ip(8)]),
            ("wlan0".to_owned(), Vec::new()),
        ];
        let find = |named: &[&str]| {
            addresses(&named.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>(), &there)
        };
        assert_eq!(find(&["127.0.0.1"]), Ok(vec![Ipv4Addr::LOCALHOST.into()]));
        assert_eq!(find(&["192.168.1.8", "eth0"]), Ok(vec![ip(8).into(), ip(7).into()]));
        for missing in ["wlan0", "10.0.0.1", "eth1", ""] {
            let told = find(&["lo", missing]).expect_err("not there");
            assert!(told.contains(missing) && told.contains("192.168.1.7 (eth0)"), "{told}");
        }
        let told = addresses(&["lo".to_owned()], &[]).expect_err("nothing there");
        assert!(told.ends_with("none to be seen"), "{told}");
    }

    #[test]
    fn this_computer_has_a_loopback() {
        let found = addresses(&["127.0.0.1".to_owned()], &interfaces());
        assert_eq!(found, Ok(vec![Ipv4Addr::LOCALHOST.into()]));
    }
}
