//! Who takes the scans of a collection.

use std::{path::Path, time::Duration};

use super::{Borrowed, Halt, Plan, taking::Taken};
use sonard_api::AirOrder;
use sonard_device::ranger::PreparedScan;
use sonard_model::geometry::Pose;
use sonard_records::{CollectionRef, Provenance, ScanAir, ScanPlan};

/// A device that takes the scans of a collection: a ranger that is driven from here, or a daemon that has one.
pub trait Device {
    /// Whether the ranger is driven from here: its scans are predicted here, and it may be carried.
    fn is_local(&self) -> bool;

    /// Gets a local ranger ready at the first pose; nothing is asked of it yet.
    ///
    /// # Errors
    /// When there can be none.
    fn prepare(&mut self, plan: &Plan, first: &PreparedScan) -> Result<(), Halt>;

    /// Meets the ranger; a failure is final.
    ///
    /// # Errors
    /// When none answers, or another one than before.
    fn meet(&mut self) -> impl Future<Output = Result<Connected, Halt>>;

    /// Lets a ranger that is no real one stand where the scan says.
    ///
    /// # Errors
    /// When it can't be carried.
    fn carry_to(&mut self, to: &PreparedScan) -> Result<(), Halt>;

    /// Goes on where an earlier run left it, and waits so long for a ranger that is not there.
    fn go_on(&mut self, patience: Duration, borrowed: Option<Borrowed>);

    /// What is about to be changed of what it does by itself, beyond what is known already.
    ///
    /// # Errors
    /// When it does not answer.
    fn to_borrow(
        &self,
        air: Option<&AirOrder>,
    ) -> impl Future<Output = Result<Option<Borrowed>, Halt>>;

    /// Changes that.
    ///
    /// # Errors
    /// When it refuses.
    fn borrow(
        &mut self,
        before: Option<Borrowed>,
        air: Option<&AirOrder>,
    ) -> impl Future<Output = Result<(), Halt>>;

    /// Leaves it as it was found; whether there was anything to give back.
    ///
    /// # Errors
    /// When it refuses.
    fn give_back(&mut self) -> impl Future<Output = Result<bool, Halt>>;

    /// The temperature that somebody measured for it, degrees Celsius.
    fn temperature_c(&self) -> impl Future<Output = Option<f64>>;

    /// Takes a scan into a file; a beam that is in is told.
    ///
    /// # Errors
    /// When the file can't be written, or nothing can be measured at all.
    fn take(
        &mut self,
        scan: ScanOrder<'_>,
        beam: &(dyn Fn() + Sync),
    ) -> impl Future<Output = Result<Taken, Halt>>;

    /// Lets go of the ranger.
    fn close(self) -> impl Future<Output = ()>;
}

/// A scan to be taken.
pub struct ScanOrder<'a> {
    /// Which azimuths.
    pub plan: ScanPlan,
    /// Where the ranger stands.
    pub pose: Pose,
    /// The same with predictions, for a local ranger.
    pub prepared: Option<&'a PreparedScan>,
    /// The air as it was measured, if it was.
    pub air: Option<ScanAir>,
    /// Which one of the collection it is.
    pub of: CollectionRef,
    /// Where it goes.
    pub path: &'a Path,
}

/// A ranger that told who it is.
#[derive(Debug, Clone)]
pub struct Connected {
    /// What it said.
    pub device: sonard_records::Device,
    /// Whether it is hardware.
    pub provenance: Provenance,
}
