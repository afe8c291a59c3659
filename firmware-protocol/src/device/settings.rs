//! Validation of settings, positions and plans.

use crate::messages::limits::{
    ACCELERATION_MAX, HOLD_S_MAX, INTERVAL_TICKS_MAX, LEASE_MS_MIN, MAX_ECHOES, POSITION_MAX,
    SETTLE_TICKS_MAX, SHORT_BLANKING_TICKS_MAX, SHORT_BLANKING_TICKS_MIN, SPEED_MAX,
    WINDOW_TICKS_MAX, WINDOW_TICKS_MIN,
};
use crate::messages::{Blanking, Capabilities, NakReason, Settings, Sweep};

/// Checks settings against the limits and the capabilities of the board.
#[inline(never)]
pub(super) fn check_settings(
    settings: &Settings,
    capabilities: Capabilities,
) -> Result<(), NakReason> {
    let max_echoes = if capabilities.has(Capabilities::MULTIPLE_ECHOES) { MAX_ECHOES } else { 1 };
    // Individual comparisons: as a table this code is too large for a microcontroller.
    if settings.window_ticks < WINDOW_TICKS_MIN || settings.window_ticks > WINDOW_TICKS_MAX {
        return Err(NakReason::WindowOutOfRange);
    }
    if settings.min_interval_ticks > INTERVAL_TICKS_MAX {
        return Err(NakReason::IntervalOutOfRange);
    }
    if settings.settle_ticks > SETTLE_TICKS_MAX {
        return Err(NakReason::SettleOutOfRange);
    }
    if settings.max_echoes == 0 || settings.max_echoes > max_echoes {
        return Err(NakReason::EchoesOutOfRange);
    }
    if !is_blanking_valid(settings, capabilities) {
        return Err(NakReason::BlankingOutOfRange);
    }
    if settings.speed == 0 || settings.speed > SPEED_MAX {
        return Err(NakReason::SpeedOutOfRange);
    }
    if settings.acceleration == 0 || settings.acceleration > ACCELERATION_MAX {
        return Err(NakReason::AccelerationOutOfRange);
    }
    if settings.hold_s > HOLD_S_MAX {
        return Err(NakReason::HoldOutOfRange);
    }
    Ok(())
}

fn is_blanking_valid(settings: &Settings, capabilities: Capabilities) -> bool {
    match settings.blanking {
        Blanking::Internal => true,
        Blanking::Short { ticks } => {
            capabilities.has(Capabilities::SHORT_BLANKING)
                && (SHORT_BLANKING_TICKS_MIN..=SHORT_BLANKING_TICKS_MAX).contains(&ticks)
                && u32::from(ticks) < settings.window_ticks
        }
    }
}

/// Checks a position against [`POSITION_MAX`].
#[inline(never)]
pub(super) fn check_step(step: i32) -> Result<(), NakReason> {
    if (-POSITION_MAX..=POSITION_MAX).contains(&step) {
        Ok(())
    } else {
        Err(NakReason::PositionOutOfRange)
    }
}

/// Checks a plan and returns its number of beams.
#[inline(never)]
pub(super) fn check_plan(plan: &Sweep) -> Result<u16, NakReason> {
    let beams = plan.beams().filter(|_| plan.sweep != 0).ok_or(NakReason::SweepOutOfRange)?;
    if plan.lease_ms < LEASE_MS_MIN {
        return Err(NakReason::LeaseOutOfRange);
    }
    check_step(plan.first_step)?;
    let last = plan.step_of(beams.wrapping_sub(1)).ok_or(NakReason::PositionOutOfRange)?;
    check_step(last)?;
    Ok(beams)
}
