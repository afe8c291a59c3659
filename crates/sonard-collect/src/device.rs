//! Interface of the devices that take a collection's scans.

use std::{path::Path, time::Duration};

use super::{CollectError, CollectionPlan, SavedSettings, record_scan::RecordedScan};
use sonard_api::AirOrder;
use sonard_device::ranger::PreparedScan;
use sonard_model::geometry::Pose;
use sonard_records::{CollectionRef, Provenance, ScanAir, ScanPlan};

/// Scanning device of a collection: a locally driven ranger, or a daemon with a ranger.
pub trait ScanDevice {
    /// Returns `true` for a locally driven ranger. Its scans are predicted in this process, and a
    /// simulated one can be moved.
    fn is_local(&self) -> bool;

    /// Prepares a local ranger for the first pose without sending it a request.
    ///
    /// # Errors
    /// Returns an error if the ranger cannot be set up.
    fn prepare(&mut self, plan: &CollectionPlan, first: &PreparedScan) -> Result<(), CollectError>;

    /// Connects to the ranger and identifies it; a failure is final.
    ///
    /// # Errors
    /// Returns an error if no ranger responds, or a different one than before.
    fn connect(&mut self) -> impl Future<Output = Result<ConnectedDevice, CollectError>>;

    /// Moves a simulated ranger to the pose of the scan.
    ///
    /// # Errors
    /// Returns an error if the ranger cannot be moved.
    fn move_to(&mut self, to: &PreparedScan) -> Result<(), CollectError>;

    /// Restores the state of an earlier run and sets the time allowed for an absent ranger to
    /// return.
    fn resume(&mut self, patience: Duration, borrowed: Option<SavedSettings>);

    /// Returns the device settings about to be changed, unless all of them are saved already.
    ///
    /// # Errors
    /// Returns an error if the device does not respond.
    fn settings_to_save(
        &self,
        air: Option<&AirOrder>,
    ) -> impl Future<Output = Result<Option<SavedSettings>, CollectError>>;

    /// Applies the collection's settings, after the previous ones in `before` were journaled.
    ///
    /// # Errors
    /// Returns an error if the device rejects them.
    fn apply_settings(
        &mut self,
        before: Option<SavedSettings>,
        air: Option<&AirOrder>,
    ) -> impl Future<Output = Result<(), CollectError>>;

    /// Restores the saved settings; returns `true` if there were any.
    ///
    /// # Errors
    /// Returns an error if the device rejects them.
    fn restore_settings(&mut self) -> impl Future<Output = Result<bool, CollectError>>;

    /// Returns the measured air temperature of the device, degrees Celsius, if there is one.
    fn temperature_c(&self) -> impl Future<Output = Option<f64>>;

    /// Records a scan into a file and calls `beam` after each recorded beam.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written or the device cannot measure.
    fn record_scan(
        &mut self,
        scan: ScanTask<'_>,
        beam: &(dyn Fn() + Sync),
    ) -> impl Future<Output = Result<RecordedScan, CollectError>>;

    /// Releases the ranger.
    fn close(self) -> impl Future<Output = ()>;
}

/// Request for one scan.
pub struct ScanTask<'a> {
    /// Azimuths of the beams.
    pub plan: ScanPlan,
    /// Pose of the ranger.
    pub pose: Pose,
    /// Scan setup with predictions, for a local ranger.
    pub prepared: Option<&'a PreparedScan>,
    /// Measured air, if any.
    pub air: Option<ScanAir>,
    /// Reference to the collection, written into the session record.
    pub collection: CollectionRef,
    /// Path of the scan's log.
    pub path: &'a Path,
}

/// Identified ranger.
#[derive(Debug, Clone)]
pub struct ConnectedDevice {
    /// Identity as written into records.
    pub device: sonard_records::Device,
    /// Origin of the readings: hardware, mock or simulation.
    pub provenance: Provenance,
}
