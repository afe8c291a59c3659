//! Who takes the scans of a collection.

use firmware_protocol::messages::Identity;

use super::{daemon::Daemon, own::Own};
use crate::{
    cli::{Failure, scan::setup::Setup},
    ranger::{device_record, provenance},
    scan::{self, Provenance},
};

/// Who takes the scans.
pub(super) enum Device {
    /// The collection itself.
    Own(Box<Own>),
    /// A daemon that is running already.
    Daemon(Box<Daemon>),
}

/// A ranger that told who it is.
pub(super) struct Met {
    pub(super) device: scan::Device,
    pub(super) provenance: Provenance,
}

impl Device {
    /// Meets the ranger; a failure is final.
    pub(super) async fn meet(&mut self) -> Result<Met, Failure> {
        match self {
            Self::Own(own) => own.meet().await.map(|ranger| Met::of(ranger.identity())),
            Self::Daemon(daemon) => daemon.meet().await,
        }
    }

    /// Lets a ranger that is no real one stand where the setup says.
    pub(super) fn carry_to(&mut self, setup: &Setup) -> Result<(), Failure> {
        match self {
            Self::Own(own) => own.carry_to(setup),
            Self::Daemon(_) => Ok(()),
        }
    }
}

impl Met {
    fn of(identity: &Identity) -> Self {
        Self { device: device_record(identity), provenance: provenance(identity) }
    }
}
