"""CiA 401 as tables: objects of inputs and outputs of an I/O module, and of their settings (CiA 401-1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

PROFILE = 401
"""Low word of 0x1000 of an I/O module."""


class DigitalInputs(NamedTuple):
    """Indices of the digital inputs of one width, and of their settings; sub-index n is block n.

    `change`, `rising` and `falling` are the objects that enable TPDOs for any change, rising and falling edges.
    """

    value: int
    polarity: int
    filter: int
    change: int
    rising: int
    falling: int
    bits: int


class DigitalOutputs(NamedTuple):
    """Indices of the digital outputs of one width, and of their settings; sub-index n is block n."""

    value: int
    polarity: int
    filter: int
    error_mode: int
    error_value: int
    bits: int


class AnalogueOutputs(NamedTuple):
    """Indices of the analogue outputs of one width, and of their settings; sub-index n is channel n."""

    value: int
    error_mode: int
    error_value: int
    offset: int
    scaling: int


class AnalogueInputs(NamedTuple):
    """Indices of the analogue inputs of one width, and of their settings."""

    value: int
    bits: int
    offset: int
    scaling: int


INTERRUPT_ENABLE = 0x6005
"""Global enable of TPDOs for digital inputs."""

DIGITAL_INPUTS = (
    DigitalInputs(0x6000, 0x6002, 0x6003, 0x6006, 0x6007, 0x6008, 8),
    DigitalInputs(0x6100, 0x6102, 0x6103, 0x6106, 0x6107, 0x6108, 16),
    DigitalInputs(0x6120, 0x6122, 0x6123, 0x6126, 0x6127, 0x6128, 32),
)

DIGITAL_OUTPUTS = (
    DigitalOutputs(0x6200, 0x6202, 0x6208, 0x6206, 0x6207, 8),
    DigitalOutputs(0x6300, 0x6302, 0x6308, 0x6306, 0x6307, 16),
    DigitalOutputs(0x6320, 0x6322, 0x6328, 0x6326, 0x6327, 32),
)

ANALOGUE_INPUTS = (
    AnalogueInputs(0x6400, 8, 0x6431, 0x6432),
    AnalogueInputs(0x6401, 16, 0x6431, 0x6432),
    AnalogueInputs(0x6402, 32, 0x6431, 0x6432),
)

ANALOGUE_OUTPUTS = (
    AnalogueOutputs(0x6410, 0x6443, 0x6444, 0x6446, 0x6447),
    AnalogueOutputs(0x6411, 0x6443, 0x6444, 0x6446, 0x6447),
    AnalogueOutputs(0x6412, 0x6443, 0x6444, 0x6446, 0x6447),
)

FIRST, MODULE_STEP = 0x6000, 0x800
"""First index of the first module, and the distance to the next module."""

OUTPUTS = frozenset(
    (
        *(index for each in DIGITAL_OUTPUTS for index in (each.value, each.polarity)),
        *range(0x6220, 0x6228),  # single bits
        *range(0x6410, 0x6415),
    )
)
"""Objects that change an output."""

PROCESS_DATA: Mapping[int, range] = {
    each.value: range(1, 255) for each in (*DIGITAL_INPUTS, *DIGITAL_OUTPUTS, *ANALOGUE_INPUTS, *ANALOGUE_OUTPUTS)
}
"""Sub-indices of inputs and outputs, by index."""

ANALOGUE_INTERRUPT_ENABLE = 0x6423
"""Global enable of TPDOs for analogue inputs; off by default (CiA 401-1)."""

ANALOGUE_TRIGGER, ANALOGUE_UPPER, ANALOGUE_LOWER, ANALOGUE_DELTA = 0x6421, 0x6424, 0x6425, 0x6426
ANALOGUE_FALL, ANALOGUE_RISE = 0x6427, 0x6428
"""Conditions of an analogue input for a TPDO, and their limits."""

ERROR_MODE_WORDS: Mapping[int, str] = {0: "keeps its value", 1: "takes its error value"}
"""Behaviour of an analogue output on an error."""

TRIGGER_BITS: Mapping[int, str] = {
    0: "upper limit exceeded",
    1: "below the lower limit",
    2: "changed by more than delta",
    3: "reduced by more than delta",
    4: "increased by more than delta",
}

SWITCHED_ON = "on"
"""Word for a digital input or output whose bit is set."""

BIT_BLOCKS: Mapping[int, int] = {each.value: each.bits for each in (*DIGITAL_INPUTS, *DIGITAL_OUTPUTS)}
"""Bits of a block by object, for objects whose bits are inputs or outputs."""

FUNCTION_BITS = {16: "digital inputs", 17: "digital outputs", 18: "analogue inputs", 19: "analogue outputs"}
"""Bits of 0x1000 for the functions of the module."""
