//! SensComp 6500 ranging module, modelled at its pins.

use crate::HZ;

/// Internal blanking of the module, cycles: 2.38 ms unless BINH ends it.
const INTERNAL_BLANKING: u64 = HZ / 100_000 * 238;
/// Duration of an echo, cycles: the 16 periods of 49.4 kHz that were transmitted.
const PULSE: u64 = HZ * 16 / 49_400;

/// Ranging module with inputs INIT, BINH and BLNK, and output ECHO. Times are cycles of the chip.
#[derive(Debug, Clone, Default)]
pub struct Module {
    fired_at: Option<u64>,
    arrivals: Vec<u64>,
    unblanked_at: u64,
    blanked_again: bool,
    echo: bool,
}

impl Module {
    /// Handles the rise of INIT; `echoes` are arrival times in cycles after it.
    pub fn fire(&mut self, now: u64, echoes: &[u64]) {
        self.arrivals = echoes.iter().map(|after| now + after).collect();
        self.unblanked_at = now + INTERNAL_BLANKING;
        self.fired_at = Some(now);
        self.echo = false;
    }

    /// Handles the fall of INIT: resets the module, and ECHO is low.
    pub fn reset(&mut self) {
        *self = Self { blanked_again: self.blanked_again, ..Self::default() };
    }

    /// Handles the rise of BINH, which ends the blanking.
    pub fn end_blanking(&mut self, now: u64) {
        self.unblanked_at = self.unblanked_at.min(now);
        self.update(now);
    }

    /// Handles a change of BLNK; while high it keeps ECHO low.
    pub fn blank(&mut self, now: u64, blanked: bool) {
        self.blanked_again = blanked;
        if blanked {
            self.echo = false;
        }
        self.update(now);
    }

    /// Advances the time. ECHO is latched if an echo is present and the receiver is not blanked.
    pub fn update(&mut self, now: u64) {
        let enabled = self.fired_at.is_some() && !self.blanked_again && now >= self.unblanked_at;
        let present = self.arrivals.iter().any(|&at| (at..at + PULSE).contains(&now));
        self.echo |= enabled && present;
    }

    /// Level of ECHO.
    #[must_use]
    pub const fn echo(&self) -> bool {
        self.echo
    }

    /// Time of the next possible change of ECHO, cycles.
    #[must_use]
    pub fn next_update(&self, now: u64) -> Option<u64> {
        self.fired_at?;
        let blanking = std::iter::once(self.unblanked_at);
        self.arrivals.iter().copied().chain(blanking).filter(|&at| at > now).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = HZ / 1000;

    fn at(module: &mut Module, now: u64) -> bool {
        module.update(now);
        module.echo()
    }

    #[test]
    fn blanks_then_latches() {
        let mut module = Module::default();
        module.fire(0, &[MS, 5 * MS]);
        assert!(!at(&mut module, MS), "blanked");
        assert!(!at(&mut module, 3 * MS), "the echo has passed");
        assert!(!at(&mut module, 5 * MS - 1));
        assert!(at(&mut module, 5 * MS));
        assert!(at(&mut module, 50 * MS), "latched");
        module.reset();
        assert!(!module.echo());
        assert_eq!(module.next_update(0), None);
    }

    #[test]
    fn binh_ends_blanking() {
        let mut module = Module::default();
        module.fire(0, &[MS]);
        module.end_blanking(MS + PULSE / 2);
        assert!(module.echo());
        let mut module = Module::default();
        module.fire(0, &[MS]);
        module.end_blanking(MS + PULSE);
        assert!(!module.echo(), "the echo has passed");
    }

    #[test]
    fn blnk_re_arms() {
        let mut module = Module::default();
        module.fire(0, &[5 * MS, 6 * MS, 7 * MS]);
        assert!(at(&mut module, 5 * MS));
        module.blank(5 * MS + 100, true);
        assert!(!module.echo());
        assert!(!at(&mut module, 6 * MS), "blanked during the second echo");
        module.blank(6 * MS + PULSE, false);
        assert!(!module.echo());
        assert!(at(&mut module, 7 * MS));
    }
}
