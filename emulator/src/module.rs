//! The SensComp 6500 ranging module, as seen at its pins.

use crate::HZ;

/// Blanking of the module when BINH does not end it: 2.38 ms.
const INTERNAL_BLANKING: u64 = HZ / 100_000 * 238;
/// How long an echo lasts: the 16 cycles at 49.4 kHz that were sent.
const PULSE: u64 = HZ * 16 / 49_400;

/// The module: INIT, BINH and BLNK in, ECHO out. Times are cycles of the chip's clock.
#[derive(Debug, Clone, Default)]
pub struct Module {
    fired_at: Option<u64>,
    arrivals: Vec<u64>,
    unblanked_at: u64,
    blanked_again: bool,
    echo: bool,
}

impl Module {
    /// INIT rose; `echoes` come so many cycles later.
    pub fn fire(&mut self, now: u64, echoes: &[u64]) {
        self.arrivals = echoes.iter().map(|after| now + after).collect();
        self.unblanked_at = now + INTERNAL_BLANKING;
        self.fired_at = Some(now);
        self.echo = false;
    }

    /// INIT fell: everything begins anew, and ECHO is low.
    pub fn rest(&mut self) {
        *self = Self { blanked_again: self.blanked_again, ..Self::default() };
    }

    /// BINH rose: the receiver listens from now on.
    pub fn end_blanking(&mut self, now: u64) {
        self.unblanked_at = self.unblanked_at.min(now);
        self.look(now);
    }

    /// BLNK rose, which lowers ECHO and keeps it low, or fell.
    pub fn blank(&mut self, now: u64, blanked: bool) {
        self.blanked_again = blanked;
        if blanked {
            self.echo = false;
        }
        self.look(now);
    }

    /// Time has passed. ECHO latches when an echo is there and the receiver listens.
    pub fn look(&mut self, now: u64) {
        let listens = self.fired_at.is_some() && !self.blanked_again && now >= self.unblanked_at;
        let heard = self.arrivals.iter().any(|&at| (at..at + PULSE).contains(&now));
        self.echo |= listens && heard;
    }

    /// Level of ECHO.
    #[must_use]
    pub const fn echo(&self) -> bool {
        self.echo
    }

    /// When to look again.
    #[must_use]
    pub fn next_look(&self, now: u64) -> Option<u64> {
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
        module.look(now);
        module.echo()
    }

    #[test]
    fn it_is_deaf_while_blanked_and_latches_until_init_falls() {
        let mut module = Module::default();
        module.fire(0, &[MS, 5 * MS]);
        assert!(!at(&mut module, MS), "blanked");
        assert!(!at(&mut module, 3 * MS), "that echo has passed");
        assert!(!at(&mut module, 5 * MS - 1));
        assert!(at(&mut module, 5 * MS));
        assert!(at(&mut module, 50 * MS), "latched");
        module.rest();
        assert!(!module.echo());
        assert_eq!(module.next_look(0), None);
    }

    #[test]
    fn binh_shortens_blanking_and_an_echo_already_there_is_heard_then() {
        let mut module = Module::default();
        module.fire(0, &[MS]);
        module.end_blanking(MS + PULSE / 2);
        assert!(module.echo());
        let mut module = Module::default();
        module.fire(0, &[MS]);
        module.end_blanking(MS + PULSE);
        assert!(!module.echo(), "too late for it");
    }

    #[test]
    fn blnk_re_arms() {
        let mut module = Module::default();
        module.fire(0, &[5 * MS, 6 * MS, 7 * MS]);
        assert!(at(&mut module, 5 * MS));
        module.blank(5 * MS + 100, true);
        assert!(!module.echo());
        assert!(!at(&mut module, 6 * MS), "held blank over the second");
        module.blank(6 * MS + PULSE, false);
        assert!(!module.echo());
        assert!(at(&mut module, 7 * MS));
    }
}
