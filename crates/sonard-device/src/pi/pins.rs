//! Interface between a board and its pins.

/// Output lines of the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoardOutput {
    /// Fires the module while high.
    Init,
    /// Ends the module's blanking.
    Binh,
    /// Blanks the module again, after an echo.
    Blnk,
    /// Advances the motor by a step on each rise.
    Step,
    /// Direction of the motor: high for forward.
    Dir,
    /// Coil current of the motor: low to hold.
    Enable,
}

/// Pins and a clock. Times are ticks of 0.5 us since any fixed moment.
pub trait Pins {
    /// Present time of the clock.
    fn now(&mut self) -> u64;

    /// Sets the level of an output.
    fn set(&mut self, output: BoardOutput, high: bool);

    /// Raises INIT and returns the time of the rise.
    fn raise_init(&mut self) -> u64;

    /// Emits a pulse of at least 2 us on STEP.
    fn pulse(&mut self);

    /// Returns the level of ECHO.
    fn echo(&mut self) -> bool;

    /// Takes the time of the oldest unread rise of ECHO.
    fn next_echo(&mut self) -> Option<u64>;

    /// Discards all unread rises of ECHO.
    fn discard_echoes(&mut self) {
        while self.next_echo().is_some() {}
    }

    /// State of the index sensor; `None` if not fitted.
    fn at_index(&mut self) -> Option<bool>;

    /// `Some(true)` if the emergency stop is pressed or its wire broken; `None` if not fitted.
    fn emergency(&mut self) -> Option<bool>;
}
