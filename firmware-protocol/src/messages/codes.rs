//! Reasons, states and kinds: enums encoded in one byte.

use core::fmt;

use super::table::wire_enum;

wire_enum! {
    /// Reason for rejecting a request, or for its failure.
    pub enum NakReason {
        /// Another operation is in progress; only Stop, Identify, KeepAlive, Resend and Status are
        /// served.
        0 Busy,
        /// The header has another boot nonce: the device has restarted since, or is another device.
        1 WrongBoot,
        /// The sequence number was already used by another request: send it with a new one.
        2 SequenceReused,
        /// The CRC is valid, but this version has no such request.
        3 UnknownRequest,
        /// Configure is required first.
        4 NotConfigured,
        /// Homing is required first.
        5 NotHomed,
        /// The position is out of range.
        6 PositionOutOfRange,
        /// The listening window is out of range.
        7 WindowOutOfRange,
        /// The minimum interval between firings is out of range.
        8 IntervalOutOfRange,
        /// The settling time is out of range.
        9 SettleOutOfRange,
        /// The number of echoes is out of range, or above one on a board that reports only the
        /// first.
        10 EchoesOutOfRange,
        /// The blanking is out of range or longer than the window, or the board cannot set it.
        11 BlankingOutOfRange,
        /// The speed is out of range.
        12 SpeedOutOfRange,
        /// The acceleration is out of range.
        13 AccelerationOutOfRange,
        /// The holding time is out of range.
        14 HoldOutOfRange,
        /// The sweep has number 0, no beams, or more than the maximum.
        15 SweepOutOfRange,
        /// The lease is too short.
        16 LeaseOutOfRange,
        /// The index sensor was not found during the search.
        17 IndexNotFound,
        /// Stopped before completion.
        18 Stopped,
        /// The emergency stop was pressed.
        19 EmergencyStop,
        /// The motor did not reach the position.
        20 MotionFault,
    }
}

wire_enum! {
    /// Reason for a stop by the device itself. The coils are released and the position is unknown.
    pub enum FaultKind {
        /// The host sent nothing for longer than the sweep's lease.
        0 LeaseExpired,
        /// The emergency stop was pressed.
        1 EmergencyStop,
        /// The motor did not reach the position.
        2 MotionFault,
        /// The host sent nothing for longer than idle coils may be held.
        3 HoldExpired,
    }
}

wire_enum! {
    /// State of the device's latest sweep.
    pub enum SweepState {
        /// No sweep since boot.
        0 None,
        /// In progress.
        1 Running,
        /// In progress, waiting for the host to acknowledge readings.
        2 Holding,
        /// Every beam was fired.
        3 Complete,
        /// Ended by a Stop.
        4 Stopped,
        /// Ended because the host sent nothing for longer than the lease.
        5 LeaseExpired,
        /// Ended by the emergency stop.
        6 EmergencyStop,
        /// Ended because the motor did not reach a stop.
        7 MotionFault,
    }
}

wire_enum! {
    /// State of the device.
    pub enum DeviceState {
        /// No operation in progress.
        0 Idle,
        /// Searching for the index.
        1 Homing,
        /// Turning to a position.
        2 Moving,
        /// Braking to rest after a Stop.
        3 Stopping,
        /// Serving a Ping.
        4 Pinging,
        /// Running a sweep.
        5 Sweeping,
    }
}

wire_enum! {
    /// Outcome of one firing.
    pub enum ReadingStatus {
        /// At least one echo.
        0 Echo,
        /// No echo within the window.
        1 NoEcho,
        /// The ECHO line was high before firing, so the module was not fired.
        2 ModuleFault,
        /// Echoes as measured, but the position is uncertain.
        3 StepUncertain,
    }
}

wire_enum! {
    /// Cause of the last reset.
    pub enum ResetCause {
        /// The board cannot determine the cause.
        0 Unknown,
        /// Power was switched on.
        1 PowerOn,
        /// The reset pin: a button, or a host that opened the port.
        2 External,
        /// The supply voltage dropped.
        3 BrownOut,
        /// The watchdog expired: the firmware was stuck.
        4 Watchdog,
        /// Reset was requested by the host.
        5 Requested,
    }
}

impl SweepState {
    /// Returns `true` while the sweep is in progress.
    #[must_use]
    pub const fn is_running(self) -> bool {
        matches!(self, Self::Running | Self::Holding)
    }
}

impl fmt::Display for NakReason {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Busy => "the device is busy",
            Self::WrongBoot => "the device has restarted",
            Self::SequenceReused => "the sequence number is already in use",
            Self::UnknownRequest => "the device does not know this request",
            Self::NotConfigured => "the device is not configured",
            Self::NotHomed => "the device is not homed",
            Self::PositionOutOfRange => "the position is more than 1000000 steps from home",
            Self::WindowOutOfRange => "the listening window must be 1 ms to 1048 ms",
            Self::IntervalOutOfRange => "the minimum interval must be at most 8388 ms",
            Self::SettleOutOfRange => "the settling time must be at most 8388 ms",
            Self::EchoesOutOfRange => {
                "the number of echoes must be 1 to 8, and 1 on a board that reports only the first echo"
            }
            Self::BlankingOutOfRange => {
                "short blanking must be 0.5 ms to 2.38 ms, shorter than the window, and is not supported by every board"
            }
            Self::SpeedOutOfRange => "the speed must be 1 to 10000 steps/s",
            Self::AccelerationOutOfRange => "the acceleration must be 1 to 200000 steps/s^2",
            Self::HoldOutOfRange => "the holding time must be at most 900 s",
            Self::SweepOutOfRange => "a sweep must have a number and 1 to 65535 beams",
            Self::LeaseOutOfRange => "the lease must be at least 100 ms",
            Self::IndexNotFound => "the index sensor was not found",
            Self::Stopped => "the operation was stopped",
            Self::EmergencyStop => "the emergency stop was pressed",
            Self::MotionFault => "the motor did not reach the position",
        })
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::LeaseExpired => "the host sent nothing for longer than the sweep's lease",
            Self::EmergencyStop => "the emergency stop was pressed",
            Self::MotionFault => "the motor did not reach the position",
            Self::HoldExpired => "the host sent nothing for longer than idle coils may be held",
        })
    }
}
