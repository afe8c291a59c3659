from enum import IntEnum


class Status(IntEnum):
    """Outcome of a firing: the values of the field ``status`` of readings.

    ``ECHO``: an echo passed the threshold after blanking.
    ``NO_ECHO``: the listening window ended without an echo.
    ``MIN_RANGE``: an echo was present at the end of the blanking; the target is closer than the minimum range.
    ``LINK_LOST``: the reading never arrived from the device.
    ``STEP_UNCERTAIN``: measured, but the position of the motor is uncertain.
    ``MODULE_FAULT``: the module could not be fired; its ECHO line was stuck.

    The model predicts the first three; the others occur in measured logs only.
    """

    ECHO = 0
    NO_ECHO = 1
    MIN_RANGE = 2
    LINK_LOST = 3
    STEP_UNCERTAIN = 4
    MODULE_FAULT = 5
