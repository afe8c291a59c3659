from enum import IntEnum


class Status(IntEnum):
    """What became of a firing: the values of the field ``status`` of readings.

    ``ECHO``: an echo passed the threshold after blanking.
    ``NO_ECHO``: the listening window ended without one.
    ``MIN_RANGE``: sound was already there when blanking ended; something is closer than can be measured.
    ``LINK_LOST``: the reading never arrived from the device.
    ``STEP_DOUBTFUL``: measured, but the motor may not have been where the step says.
    ``MODULE_FAULT``: the module could not be fired; its ECHO line was stuck.

    The model predicts the first three; the others are of measured logs.
    """

    ECHO = 0
    NO_ECHO = 1
    MIN_RANGE = 2
    LINK_LOST = 3
    STEP_DOUBTFUL = 4
    MODULE_FAULT = 5
