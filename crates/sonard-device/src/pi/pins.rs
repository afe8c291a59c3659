//! What a board needs of its pins.

/// The lines that the board drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Output {
    /// Fires the module while it is high.
    Init,
    /// Ends the module's blanking.
    Binh,
    /// Blanks the module again, after an echo.
    Blnk,
    /// One step for each rise.
    Step,
    /// High for forward.
    Dir,
    /// Low holds the motor.
    Enable,
}

/// Pins and a clock. Times are ticks of 0.5 us since any fixed moment.
pub trait Pins {
    /// The clock.
    fn now(&mut self) -> u64;

    /// Switches an output.
    fn set(&mut self, output: Output, high: bool);

    /// Raises INIT, and tells when it rose.
    fn raise_init(&mut self) -> u64;

    /// One pulse on STEP, 2 us at least.
    fn pulse(&mut self);

    /// Level of ECHO.
    fn echo(&mut self) -> bool;

    /// When ECHO rose, oldest first; each rise is told once.
    fn next_echo(&mut self) -> Option<u64>;

    /// Forgets every rise of ECHO so far.
    fn forget_echoes(&mut self) {
        while self.next_echo().is_some() {}
    }

    /// Whether the index sensor is on; `None` without one.
    fn at_index(&mut self) -> Option<bool>;

    /// Whether the emergency stop is pressed, or its wire broken; `None` without one.
    fn emergency(&mut self) -> Option<bool>;
}
