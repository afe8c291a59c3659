//! Several daemons and one that polls them.

use std::{fs, path::Path, process::Output};

use serde_json::Value;
use sonard::mock::Pace;

use crate::{daemon::Daemon, rig::Rig, run, wait_until};

/// A full turn of a hundred beams each few seconds.
pub const SCANNING: [&str; 6] = [
    "--set",
    "scanning.mode=continuous",
    "--set",
    "plan.step_deg=3.6",
    "--set",
    "model.max_range_m=3",
];

/// Three robots, one of them with a removable ranger, and a daemon that polls them.
pub struct Fleet {
    pub rig: Rig,
    /// The one on the rig, and two on mocks.
    pub robots: Vec<Option<Daemon>>,
    pub asking: Daemon,
    pub list: String,
}

impl Fleet {
    pub fn start(folder: &Path) -> Self {
        let own = |name: &str| {
            let folder = folder.join(name);
            fs::create_dir(&folder).expect("it is new");
            folder
        };
        let mut rig = Rig::new(folder, Pace::RealTime);
        rig.plug("", 1);
        let options = rig.options();
        let options: Vec<&str> = options.iter().map(String::as_str).collect();
        let tcp = ["--set", "server.listen=127.0.0.1:0"];
        let named = |name: &str| format!("fleet.robot={name}");
        let kiwi = named("kiwi");
        let options = [&options[..], &SCANNING, &tcp, &["--set", &kiwi]].concat();
        let mut robots = vec![Daemon::start(&own("kiwi"), &options)];
        for name in ["mango", "lime"] {
            let named = named(name);
            let options = [&SCANNING[..], &tcp, &["--set", &named]].concat();
            robots.push(Daemon::start_mock(&own(name), &options));
        }
        for robot in &robots {
            until_it_listens(robot);
        }
        let places = robots.iter().zip(["kiwi", "mango", "lime"]);
        let places: Vec<_> =
            places.map(|(robot, name)| format!("{name}={}", robot.address())).collect();
        let daemons = format!("fleet.daemons={}", places.join(","));
        let asking = Daemon::start_mock(&own("asking"), &[&tcp[..], &["--set", &daemons]].concat());
        until_it_listens(&asking);
        let quoted: Vec<_> = places.iter().map(|place| format!("{place:?}")).collect();
        let list = folder.join("fleet.toml");
        fs::write(&list, format!("[fleet]\ndaemons = [{}]\n", quoted.join(", "))).expect("room");
        Self {
            rig,
            robots: robots.into_iter().map(Some).collect(),
            asking,
            list: list.to_str().expect("plain path").to_owned(),
        }
    }

    pub fn reports(&self) -> Vec<Value> {
        let fleet = self.asking.get("/v1/fleet").json();
        fleet["robots"].as_array().expect("robots").clone()
    }

    pub fn states(&self) -> Vec<String> {
        let state = |robot: &Value| robot["state"].as_str().expect("a state").to_owned();
        self.reports().iter().map(state).collect()
    }

    pub fn status(&self) -> Output {
        run(&["status", "--fleet", &self.list])
    }
}

/// Waits for the TCP address: the socket may answer before the address is read.
pub fn until_it_listens(daemon: &Daemon) {
    wait_until("its address", || daemon.messages().contains("http://"));
}
