"""CiA 402 as tables: states, commands, transitions, modes of operation, bits of the words, option codes (CiA 402-2).

Indices are those of a device's first axis; each further axis has its objects `AXIS_STEP` higher (CiA 402-2, clause
6.2).
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from enum import Enum, IntEnum
from functools import lru_cache
from typing import NamedTuple, Self

PROFILE = 402
"""Low word of 0x1000 of a drive."""

FIRST_AXIS = range(0x6000, 0x6800)
"""Indices of the first axis."""

AXIS_STEP, MOST_AXES = 0x800, 8
"""Distance from one axis to the next, and the largest number of axes."""


def on_first_axis(index: int) -> int:
    """Return the index on the first axis for an object of any axis; other indices are returned unchanged."""
    is_of_axis = FIRST_AXIS.start <= index < FIRST_AXIS.start + MOST_AXES * AXIS_STEP
    return FIRST_AXIS.start + (index - FIRST_AXIS.start) % AXIS_STEP if is_of_axis else index


# Objects

ABORT_CONNECTION, ERROR_CODE = 0x6007, 0x603F
CONTROLWORD, STATUSWORD = 0x6040, 0x6041
QUICK_STOP_OPTION, SHUTDOWN_OPTION, DISABLE_OPTION, HALT_OPTION, FAULT_OPTION = range(0x605A, 0x605F)
MODE, MODE_DISPLAY = 0x6060, 0x6061
POSITION_DEMAND, POSITION_INTERNAL, POSITION = 0x6062, 0x6063, 0x6064
FOLLOWING_WINDOW, FOLLOWING_TIME = 0x6065, 0x6066
POSITION_WINDOW, POSITION_WINDOW_TIME = 0x6067, 0x6068
VELOCITY_SENSOR, VELOCITY_DEMAND, VELOCITY = 0x6069, 0x606B, 0x606C
VELOCITY_WINDOW, VELOCITY_WINDOW_TIME, VELOCITY_THRESHOLD = 0x606D, 0x606E, 0x606F
TARGET_VL_VELOCITY, VL_VELOCITY_DEMAND, VL_VELOCITY = 0x6042, 0x6043, 0x6044
TARGET_TORQUE, MAX_TORQUE, TORQUE_DEMAND, TORQUE, CURRENT = 0x6071, 0x6072, 0x6074, 0x6077, 0x6078
TARGET_POSITION = 0x607A
POSITION_RANGE, HOME_OFFSET, SOFTWARE_LIMIT = 0x607B, 0x607C, 0x607D
MAX_PROFILE_VELOCITY, MAX_MOTOR_SPEED, PROFILE_VELOCITY, END_VELOCITY = 0x607F, 0x6080, 0x6081, 0x6082
PROFILE_ACCELERATION, PROFILE_DECELERATION, QUICK_STOP_DECELERATION = 0x6083, 0x6084, 0x6085
TORQUE_SLOPE = 0x6087
ENCODER_RESOLUTION, GEAR_RATIO, FEED_CONSTANT, VELOCITY_FACTOR = 0x608F, 0x6091, 0x6092, 0x6096
HOMING_METHOD, HOMING_SPEEDS, HOMING_ACCELERATION = 0x6098, 0x6099, 0x609A
SI_POSITION, SI_VELOCITY = 0x60A8, 0x60A9
POSITION_OFFSET, VELOCITY_OFFSET, TORQUE_OFFSET = 0x60B0, 0x60B1, 0x60B2
INTERPOLATION_DATA, INTERPOLATION_TIME = 0x60C1, 0x60C2
MAX_ACCELERATION = 0x60C5
FOLLOWING_ERROR, POSITION_DEMAND_INTERNAL = 0x60F4, 0x60FC
DIGITAL_INPUTS, DIGITAL_OUTPUTS = 0x60FD, 0x60FE
TARGET_VELOCITY = 0x60FF
SUPPORTED_MODES = 0x6502

PROCESS_DATA: Mapping[int, Container[int]] = {
    **dict.fromkeys(
        (CONTROLWORD, TARGET_VL_VELOCITY, TARGET_TORQUE, TARGET_POSITION, TARGET_VELOCITY,
         POSITION_OFFSET, VELOCITY_OFFSET, TORQUE_OFFSET), (0,),
    ),
    INTERPOLATION_DATA: range(1, 255),
    DIGITAL_OUTPUTS: (1,),
    **dict.fromkeys(
        (ERROR_CODE, STATUSWORD, MODE_DISPLAY, VL_VELOCITY_DEMAND, VL_VELOCITY, POSITION_DEMAND, POSITION_INTERNAL,
         POSITION, VELOCITY_SENSOR, VELOCITY_DEMAND, VELOCITY, TORQUE_DEMAND, TORQUE, CURRENT, FOLLOWING_ERROR,
         POSITION_DEMAND_INTERNAL, DIGITAL_INPUTS), (0,),
    ),
}  # fmt: skip
"""Sub-indices of commands, targets and actual values by index, whether a PDO carries them or not."""

# The state machine (CiA 402-2, clause 8)


class BitPattern(Enum):
    """A meaning of some bits of a drive's word: its name, the mask, and the values of the bits."""

    def __init__(self, words: str, mask: int, bits: int) -> None:
        self.words, self.mask, self.bits = words, mask, bits

    @classmethod
    @lru_cache
    def of(cls, word: int) -> Self | None:
        """Return the meaning of a word, or None."""
        return next((each for each in cls if word & each.mask == each.bits), None)


class State(BitPattern):
    """State of the drive in the statusword."""

    NOT_READY = "Not ready to switch on", 0x4F, 0x00
    DISABLED = "Switch on disabled", 0x4F, 0x40
    READY = "Ready to switch on", 0x6F, 0x21
    SWITCHED_ON = "Switched on", 0x6F, 0x23
    ENABLED = "Operation enabled", 0x6F, 0x27
    QUICK_STOP = "Quick stop active", 0x6F, 0x07
    FAULT_REACTION = "Fault reaction active", 0x4F, 0x0F
    FAULT = "Fault", 0x4F, 0x08


class DriveCommand(BitPattern):
    """Command in the controlword.

    `FAULT_RESET` is a rising edge of its bit. `SWITCH_ON` disables operation if it is enabled.
    """

    SHUTDOWN = "Shutdown", 0x87, 0x06
    SWITCH_ON = "Switch on", 0x8F, 0x07
    ENABLE = "Enable operation", 0x8F, 0x0F
    DISABLE_VOLTAGE = "Disable voltage", 0x82, 0x00
    QUICK_STOP = "Quick stop", 0x86, 0x02
    FAULT_RESET = "Fault reset", 0x80, 0x80


class Transition(NamedTuple):
    """A transition of the state machine, with its number in CiA 402.

    `command` is None if the drive makes it by itself.
    """

    number: int
    before: State
    command: DriveCommand | None
    after: State


TRANSITIONS = (
    Transition(1, State.NOT_READY, None, State.DISABLED),
    Transition(2, State.DISABLED, DriveCommand.SHUTDOWN, State.READY),
    Transition(3, State.READY, DriveCommand.SWITCH_ON, State.SWITCHED_ON),
    Transition(4, State.SWITCHED_ON, DriveCommand.ENABLE, State.ENABLED),
    Transition(5, State.ENABLED, DriveCommand.SWITCH_ON, State.SWITCHED_ON),
    Transition(6, State.SWITCHED_ON, DriveCommand.SHUTDOWN, State.READY),
    Transition(7, State.READY, DriveCommand.DISABLE_VOLTAGE, State.DISABLED),
    Transition(7, State.READY, DriveCommand.QUICK_STOP, State.DISABLED),
    Transition(8, State.ENABLED, DriveCommand.SHUTDOWN, State.READY),
    Transition(9, State.ENABLED, DriveCommand.DISABLE_VOLTAGE, State.DISABLED),
    Transition(10, State.SWITCHED_ON, DriveCommand.DISABLE_VOLTAGE, State.DISABLED),
    Transition(10, State.SWITCHED_ON, DriveCommand.QUICK_STOP, State.DISABLED),
    Transition(11, State.ENABLED, DriveCommand.QUICK_STOP, State.QUICK_STOP),
    Transition(12, State.QUICK_STOP, DriveCommand.DISABLE_VOLTAGE, State.DISABLED),
    Transition(14, State.FAULT_REACTION, None, State.FAULT),
    Transition(15, State.FAULT, DriveCommand.FAULT_RESET, State.DISABLED),
    Transition(16, State.QUICK_STOP, DriveCommand.ENABLE, State.ENABLED),
)
"""All transitions but 0, power-on, and 13, from any state to `FAULT_REACTION`.

Transition 16 exists only if the quick stop option code makes the drive stay in `QUICK_STOP`; otherwise the drive makes
transition 12 by itself once it stands.
"""

ARROWS = {(each.before, each.command): each for each in TRANSITIONS}
"""Transitions by state and command."""

POWERED = (State.ENABLED, State.QUICK_STOP, State.FAULT_REACTION)
"""States in which the motor has torque (CiA 402-2, clause 8.2)."""

state_of, command_of = State.of, DriveCommand.of
"""Functions from a statusword to its state, and from a controlword to its command."""

# Modes of operation (CiA 402-2, clause 9)


class Mode(IntEnum):
    """A mode of operation."""

    NONE = 0
    PROFILE_POSITION = 1
    VELOCITY = 2
    PROFILE_VELOCITY = 3
    PROFILE_TORQUE = 4
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_POSITION = 8
    CYCLIC_VELOCITY = 9
    CYCLIC_TORQUE = 10


MODE_WORDS: Mapping[int, str] = {
    **{each: each.name.lower().replace("_", " ").replace("cyclic", "cyclic synchronous") for each in Mode},
    Mode.NONE: "no mode",
}


def supported(modes: int) -> tuple[Mode, ...]:
    """Return the modes of operation whose bits are set in a value of 0x6502."""
    return tuple(each for each in Mode if each and modes >> each - 1 & 1)


# Bits of the two words. Those in MODE_... apply to one mode of operation.

READY, SWITCHED_ON, ENABLED, FAULT, VOLTAGE, NO_QUICK_STOP, DISABLED, WARNING = (1 << bit for bit in range(8))
REMOTE, TARGET_REACHED, INTERNAL_LIMIT = 1 << 9, 1 << 10, 1 << 11
BIT_12, BIT_13 = 1 << 12, 1 << 13
"""Bits of the statusword."""

NEW_SET_POINT, AT_ONCE, RELATIVE, HALT, CHANGE_ON_SET_POINT = 1 << 4, 1 << 5, 1 << 6, 1 << 8, 1 << 9
HOMING_START = 1 << 4
FAULT_RESET = 1 << 7
"""Bits of the controlword."""

STATUS_BITS: Mapping[int, str] = {7: "warning", 10: "target reached", 11: "internal limit active"}
"""Names of the bits of a statusword that are shown beside the state."""

MODE_STATUS_BITS: Mapping[Mode, Mapping[int, str]] = {
    Mode.PROFILE_POSITION: {12: "set-point acknowledged", 13: "following error"},
    Mode.PROFILE_VELOCITY: {12: "speed is 0", 13: "maximum slippage"},
    Mode.HOMING: {12: "homing attained", 13: "homing error"},
    Mode.INTERPOLATED_POSITION: {12: "interpolation active"},
    Mode.CYCLIC_POSITION: {12: "follows the command", 13: "following error"},
    Mode.CYCLIC_VELOCITY: {12: "follows the command"},
    Mode.CYCLIC_TORQUE: {12: "follows the command"},
}

CONTROL_BITS: Mapping[int, str] = {8: "halt"}

MODE_CONTROL_BITS: Mapping[Mode, Mapping[int, str]] = {
    Mode.PROFILE_POSITION: {4: "new set-point", 5: "at once", 6: "relative", 9: "change on set-point"},
    Mode.VELOCITY: {4: "ramp enabled", 5: "ramp unlocked", 6: "reference ramp"},
    Mode.HOMING: {4: "start homing"},
    Mode.INTERPOLATED_POSITION: {4: "interpolation"},
}

INPUT_BITS = dict(enumerate(("negative limit switch", "positive limit switch", "home switch", "interlock")))
OUTPUT_BITS: Mapping[int, str] = {0: "set brake"}
MODE_BITS: Mapping[int, str] = {mode - 1: MODE_WORDS[mode] for mode in Mode if mode}
POLARITY_BITS: Mapping[int, str] = {6: "velocity inverted", 7: "position inverted"}
"""Bits of 0x60FD, 0x60FE:1, 0x6502 and 0x607E."""

# Option codes


class Ramp(Enum):
    """The way in which an option code stops the drive."""

    FREE = "drive function disabled"
    SLOW_DOWN = "slow down ramp"
    QUICK_STOP = "quick stop ramp"
    CURRENT_LIMIT = "current limit"
    VOLTAGE_LIMIT = "voltage limit"


_RAMPS: Mapping[int, Ramp] = dict(enumerate(Ramp))

OPTIONS: Mapping[int, Mapping[int, Ramp]] = {
    QUICK_STOP_OPTION: {**_RAMPS, **{code + 4: _RAMPS[code] for code in range(1, 5)}},
    SHUTDOWN_OPTION: {code: _RAMPS[code] for code in (0, 1)},
    DISABLE_OPTION: {code: _RAMPS[code] for code in (0, 1)},
    HALT_OPTION: {code: _RAMPS[code] for code in range(1, 5)},
    FAULT_OPTION: _RAMPS,
}
"""Ramps by object and option code (CiA 402-2, clauses 8.4.5 to 8.4.9)."""

DEFAULT_OPTION = {QUICK_STOP_OPTION: 2, SHUTDOWN_OPTION: 0, DISABLE_OPTION: 1, HALT_OPTION: 1, FAULT_OPTION: 2}
"""Option codes of a device without the object."""

STAYING = range(5, 9)
"""Quick stop option codes with which the drive stays in `QUICK_STOP`."""

OPTION_WORDS: Mapping[int, Mapping[int, str]] = {
    index: {
        code: f"{ramp.value}, stays in Quick stop active"
        if index == QUICK_STOP_OPTION and code in STAYING
        else ramp.value
        for code, ramp in codes.items()
    }
    for index, codes in OPTIONS.items()
}


# Homing


POSITIVE, NEGATIVE = 1, -1
SIDES = {POSITIVE: "positive", NEGATIVE: "negative"}


class Switch(IntEnum):
    """Switches by their bits in 0x60FD."""

    NEGATIVE_LIMIT = 1 << 0
    POSITIVE_LIMIT = 1 << 1
    HOME = 1 << 2


LIMITS: Mapping[int, Switch] = {NEGATIVE: Switch.NEGATIVE_LIMIT, POSITIVE: Switch.POSITIVE_LIMIT}
"""The limit switch at the end of each direction."""

LIMIT_INPUTS = Switch.NEGATIVE_LIMIT | Switch.POSITIVE_LIMIT
"""Bits of 0x60FD that are limit switches."""


class Speed(Enum):
    """The two homing speeds; the value is the sub-index of 0x6099."""

    SWITCH = 1
    ZERO = 2


class Seek(NamedTuple):
    """Motion in `direction` until `switch` is `active` or inactive; without a switch, until the index pulse.

    With `turns`, the axis reverses at a limit switch, because the home switch may be behind it.
    """

    direction: int
    switch: Switch | None
    active: bool = True
    speed: Speed = Speed.ZERO
    turns: bool = False


class Method(NamedTuple):
    """Name of a homing method and its steps; without steps, the present position is home."""

    words: str
    steps: tuple[Seek, ...] = ()


def _edge(initial: int, edge: int, inside: bool) -> Method:
    """Return the homing method whose home is an edge of the home switch.

    The axis searches the switch in the direction `initial` and leaves it at the side `edge`. With `inside`, home is
    where it re-enters the switch.
    """
    found = Seek(initial, Switch.HOME, True, Speed.SWITCH, turns=True)
    # A fast axis may have passed the switch before it stops.
    back = Seek(-initial, Switch.HOME, True, turns=True)
    left = Seek(edge, Switch.HOME, False)
    steps = (found, back, left, Seek(-edge, Switch.HOME)) if inside else (found, back, left)
    return Method(f"{SIDES[edge]} edge of the home switch, {'inside' if inside else 'outside'}", steps)


def _limit(direction: int) -> Method:
    """Return the homing method whose home is where the axis leaves a limit switch."""
    switch = LIMITS[direction]
    steps = Seek(direction, switch, True, Speed.SWITCH), Seek(-direction, switch, False)
    return Method(f"{SIDES[direction]} limit switch", steps)


_WITHOUT_INDEX: Mapping[int, Method] = {
    17: _limit(NEGATIVE),
    18: _limit(POSITIVE),
    # 19 to 22 start on a known side of the switch; 23 to 26 start in positive and 27 to 30 in negative direction, and
    # reverse at a limit switch.
    19: _edge(POSITIVE, NEGATIVE, False),
    20: _edge(POSITIVE, NEGATIVE, True),
    21: _edge(NEGATIVE, POSITIVE, False),
    22: _edge(NEGATIVE, POSITIVE, True),
    23: _edge(POSITIVE, NEGATIVE, False),
    24: _edge(POSITIVE, NEGATIVE, True),
    25: _edge(POSITIVE, POSITIVE, True),
    26: _edge(POSITIVE, POSITIVE, False),
    27: _edge(NEGATIVE, POSITIVE, False),
    28: _edge(NEGATIVE, POSITIVE, True),
    29: _edge(NEGATIVE, NEGATIVE, True),
    30: _edge(NEGATIVE, NEGATIVE, False),
}


INDEX_OFFSET = 16
"""Methods 1 to 14 are 17 to 30 followed by the index pulse."""

METHODS: Mapping[int, Method] = {
    # The axis continues to the next index pulse in the direction of its last step.
    **{
        number - INDEX_OFFSET: Method(f"{words}, and index pulse", (*steps, Seek(steps[-1].direction, None)))
        for number, (words, steps) in _WITHOUT_INDEX.items()
    },
    **_WITHOUT_INDEX,
    # 15, 16, 31 and 32 are reserved.
    33: Method("next index pulse in negative direction", (Seek(NEGATIVE, None),)),
    34: Method("next index pulse in positive direction", (Seek(POSITIVE, None),)),
    35: Method("present position, obsolete number"),
    37: Method("present position"),
}
"""Every method that CiA 402 defines, by its number in 0x6098."""

METHOD_WORDS: Mapping[int, str] = {0: "no homing", **{number: method.words for number, method in METHODS.items()}}
