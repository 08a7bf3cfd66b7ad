"""Suites for devices of a profile: drives by CiA 402, I/O modules by CiA 401.

Only steps that need `--motion` give a motor torque, within the given speed and distance; at the end the motor is where
it was before, or where the last step says. Only steps that need `--outputs` switch an output.

A drive is tested for its objects, its state machine as a table, quick stop, a lost heartbeat, and moves; a module for
its objects, its settings, and outputs that are written and read back. Terminals cannot be seen over the bus: an output
that never switches answers like one that does. CiA 401 has a clause per object; steps are named by the object, as
clause numbers differ between versions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import NamedTuple, TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import ANSWERS, Chapter, Clause, DeviceUnderTest, Need, Tier, awake, need
from eurobot_od.check.conformance.step import Data, Steps, documents, hexadecimal, title
from eurobot_od.device.nmt import NmtState
from eurobot_od.od import cia401, cia402
from eurobot_od.od.cia401 import AnalogueInputs, AnalogueOutputs, DigitalInputs, DigitalOutputs
from eurobot_od.od.cia402 import ARROWS, POWERED, DriveCommand, Mode, State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of, in_limits
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, DEVICE_TYPE
from eurobot_od.od.values import ERROR_CONTROL_BASE, Address, label
from eurobot_od.sdo.wire import ClientCommand, initiate

# Drives

SOON, MOVED = "2 s", "30 s"
"""Maximum time of a state transition, and of a move."""

WATCHED = 200
"""Consumer heartbeat time for the heartbeat that is lost, in ms."""

STAYS, LEAVES = 6, 2
"""Quick stop option codes: the drive stays in Quick stop active, or leaves it."""


class MotionBounds(NamedTuple):
    """Maximum distance and velocity of a motor, in the drive's units."""

    distance: int
    velocity: int


NOT_AT_ALL = MotionBounds(0, 0)


@dataclass(frozen=True)
class DriveUnderTest(DeviceUnderTest):
    """A drive under test, with the bounds of its `motion`."""

    motion: MotionBounds = NOT_AT_ALL

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of operation in the file."""
        return cia402.supported(self.number((cia402.SUPPORTED_MODES, 0)))

    def raw(self, index: int, value: int) -> int | str:
        """Return a raw value as a step writes it."""
        variable = self.dictionary.variable((index, 0))
        return value if variable is None else step.raw(variable, value)


DRIVE: Chapter[DriveUnderTest] = Chapter("cia402", "drive", standard=402)
"""The suite in the order of this file: steps without torque come first."""


def _digits(mask: int, bits: int) -> str:
    """Return the pattern of a byte that has these bits where the mask has ones."""
    # A pattern lists the possible hexadecimal digits of each half.
    digits = ""
    for m, b in ((mask >> 4, bits >> 4), (mask & 15, bits & 15)):
        allowed = "".join(f"{n:X}" for n in range(16) if n & m == b)
        if len(allowed) == 16:
            digits += "?"
        else:
            digits += allowed if len(allowed) == 1 else f"[{allowed}]"
    return digits


def _until(drive: DriveUnderTest, name: str, mask: int, bits: int, within: str = SOON) -> Data:
    """Return a step that reads the statusword until it has these bits."""
    ask = drive.request(initiate(ClientCommand.UPLOAD << 5, (cia402.STATUSWORD, 0)))
    # 4B is an expedited answer of 2 bytes (CiA 301, 7.2.4.3); the other two bytes may be anything.
    head = f"4B{cia402.STATUSWORD & 0xFF:02X}{cia402.STATUSWORD >> 8:02X}00"
    word = _digits(mask & 0xFF, bits & 0xFF) + _digits(mask >> 8, bits >> 8)
    poll = {**ask, "every": "20 ms"}
    return {"name": name, "poll": poll, "until": drive.answer(f"{head}{word}????"), "within": within}


def _state(drive: DriveUnderTest, state: State) -> Data:
    return _until(drive, f"it is in {state.words}", state.mask, state.bits)


def _command(word: int, name: str) -> Data:
    return step.write(f"{name} ({hexadecimal(word)})", (cia402.CONTROLWORD, 0), value=word)


def _commanded(command: DriveCommand) -> Data:
    return _command(command.bits, command.words)


WAY = DriveCommand.SHUTDOWN, DriveCommand.SWITCH_ON, DriveCommand.ENABLE, DriveCommand.QUICK_STOP
"""Commands from Switch on disabled through each further state."""


def _into(drive: DriveUnderTest, state: State) -> Steps:
    """Command the drive into a state of `WAY`, and check each state on the way."""
    yield _commanded(DriveCommand.DISABLE_VOLTAGE)
    present = State.DISABLED
    commands = iter(WAY)
    yield _state(drive, present)
    while present is not state:
        command = next(commands)
        present = ARROWS[present, command].after
        yield _commanded(command)
        yield _state(drive, present)


def _off(drive: DriveUnderTest) -> Steps:
    return _into(drive, State.DISABLED)


@Clause(DRIVE, "6.2", "Objects")
def _objects(drive: DriveUnderTest) -> Steps:
    for index in (cia402.CONTROLWORD, cia402.STATUSWORD):  # mandatory: a drive without them is red
        variable = drive.find((index, 0))
        yield step.read(title(variable) if variable else hexadecimal(index), (index, 0))
    for index in (cia402.MODE_DISPLAY, cia402.SUPPORTED_MODES, cia402.ERROR_CODE):
        variable = drive.readable((index, 0))
        lack = f"the file has no {hexadecimal(index)} that can be read"
        yield step.read(title(variable), (index, 0)) if variable else step.skip(hexadecimal(index), lack)


LEADS_TO: Mapping[tuple[State, DriveCommand | None], State] = {
    **{pair: arrow.after for pair, arrow in ARROWS.items()},
    (State.READY, DriveCommand.ENABLE): State.ENABLED,  # two arrows with one command (CiA 402-2, table of commands)
}
"""The state after a command, by the state before; other commands do not change the state."""


def _table(drive: DriveUnderTest, powered: bool) -> Steps:
    """Return a group for each command in each state, either those with torque or those without."""
    for before in (State.DISABLED, State.READY, State.SWITCHED_ON, State.ENABLED):
        for command in DriveCommand:
            after = LEADS_TO.get((before, command), before)
            # With torque, the controlword 0 before a fault reset is Disable voltage.
            edge = command is DriveCommand.FAULT_RESET and before is not State.DISABLED
            if edge or powered is not bool({before, after} & {*POWERED}) or after is State.QUICK_STOP:
                continue
            reset = [_command(0, "no command")] * (command is DriveCommand.FAULT_RESET)  # it is a rising edge
            name = f"{command.words} in {before.words}: {'stays' if before is after else after.words}"
            steps = (*_into(drive, before), *reset, _commanded(command), _state(drive, after))
            yield step.group(name, *steps, *_off(drive))


Clause(DRIVE, "8.1", "States", Tier.REVERSIBLE)(partial(_table, powered=False))
Clause(DRIVE, "8.1", "States with torque", Tier.MOTION)(partial(_table, powered=True))


@Clause(DRIVE, "8.4", "Quick stop", Tier.MOTION)
def _quick_stop(drive: DriveUnderTest) -> Steps:
    option = cia402.QUICK_STOP_OPTION, 0
    stopped = _commanded(DriveCommand.QUICK_STOP)
    if not drive.may_be(option, STAYS):
        # Option codes differ between manufacturers, so the step only checks that there is no fault.
        ended = _until(drive, "it stops", State.DISABLED.mask & 0x08, 0)
        yield step.group("from Operation enabled", *_into(drive, State.ENABLED), stopped, ended, *_off(drive))
        return
    stays = step.write(f"option code {STAYS}: it stays", option, value=STAYS)
    leaves = step.write(f"option code {LEAVES}: it leaves", option, value=LEAVES)
    back = step.write("option code as before", option, value=drive.number(option))
    for command, after in ((DriveCommand.ENABLE, State.ENABLED), (DriveCommand.DISABLE_VOLTAGE, State.DISABLED)):
        steps = (stays, *_into(drive, State.QUICK_STOP), _commanded(command), _state(drive, after))
        yield step.group(f"{command.words} in Quick stop active: {after.words}", *steps, *_off(drive), back)
    ended = _state(drive, State.DISABLED)
    yield step.group("ends in Switch on disabled", leaves, *_into(drive, State.ENABLED), stopped, ended, back)


@Clause(DRIVE, "8.4", "Connection", Tier.MOTION, group="a lost heartbeat, and its reset")
def _lost_heartbeat(drive: DriveUnderTest) -> Steps:
    """Lose a heartbeat that the drive monitors: the drive has a fault, which a rising edge resets."""
    watched = (CONSUMED_HEARTBEATS, 1)
    option = (cia402.ABORT_CONNECTION, 0)
    another = drive.another
    entry = another << 16 | WATCHED
    settable = drive.may_be(watched, entry) and drive.may_be(option, 1)
    need(settable, "the file has no 0x1016:1 and 0x6007 that can be written")
    beat = f"{ERROR_CONTROL_BASE + another:03X}#{NmtState.OPERATIONAL:02X}"
    yield step.write("abort connection: a fault", option, value=1)
    yield from _into(drive, State.ENABLED)
    yield step.write(f"watch node {another}", watched, value=entry)
    yield {"name": "its heartbeat, and no second one", "send": {"raw": beat}}
    yield _state(drive, State.FAULT)
    # Only a fault reset leaves the fault, and only by a rising edge (CiA 402-2, transition 15).
    yield _command(DriveCommand.ENABLE.bits, "Enable operation")
    yield _state(drive, State.FAULT)
    yield step.write("watch nobody", watched, value=0)
    yield _command(0, "no command")
    yield _commanded(DriveCommand.FAULT_RESET)
    yield _state(drive, State.DISABLED)
    yield step.write("abort connection as before", option, value=drive.number(option))


def _mode(drive: DriveUnderTest, mode: Mode) -> Steps:
    """Select a mode of operation, and enable."""
    yield step.write(f"mode {cia402.MODE_WORDS[mode]}", (cia402.MODE, 0), value=int(mode))
    yield step.read("it is the mode", (cia402.MODE_DISPLAY, 0), expect=int(mode))
    yield from _into(drive, State.ENABLED)


def _has(mode: Mode, *indices: int) -> Need[DriveUnderTest]:
    """Return a need: the drive has a mode, and the objects that command it."""

    def has(drive: DriveUnderTest) -> None:
        need(mode in drive.modes, f"the file has no mode {cia402.MODE_WORDS[mode]} (0x6502)")
        lacks = [hexadecimal(index) for index in (cia402.MODE, *indices) if drive.find((index, 0)) is None]
        need(not lacks, f"the file has no {', '.join(lacks)}")

    return has


HOME_IS_HERE = (37, 35)
"""Homing methods without a move; the second is the older one (CiA 402-2, clause 11.4)."""


def _homes_here(drive: DriveUnderTest) -> int:
    """Return the homing method without a move that the file allows; raises Lacks."""
    method = drive.find((cia402.HOMING_METHOD, 0))
    allowed = [each for each in HOME_IS_HERE if method and in_limits(method, each)]
    return need(next(iter(allowed), None), f"the limits of 0x6098 allow none of the methods {HOME_IS_HERE}")


HOMES = [_has(Mode.HOMING, cia402.HOMING_METHOD, cia402.POSITION), _homes_here]


@Clause(DRIVE, "11.1", "Homing", Tier.MOTION, group="present position is home", needs=HOMES)
def _homing(drive: DriveUnderTest) -> Steps:
    done = cia402.BIT_12 | cia402.TARGET_REACHED
    method = _homes_here(drive)
    yield step.write(f"method {method}", (cia402.HOMING_METHOD, 0), value=method)
    yield from _mode(drive, Mode.HOMING)
    # No error, and no procedure that runs (CiA 402-2, clause 11). Bit 12 stays set from an earlier homing.
    yield _until(drive, "not running", cia402.BIT_13 | cia402.TARGET_REACHED, cia402.TARGET_REACHED)
    yield _command(DriveCommand.ENABLE.bits | cia402.HOMING_START, "start homing")
    yield _until(drive, "homing attained", done | cia402.BIT_13, done, MOVED)
    yield from _off(drive)


def _allows(index: int, values: Callable[[MotionBounds], Sequence[int]]) -> Need[DriveUnderTest]:
    """Return a need: the file's limits of an object allow what the bounds of the motion ask."""

    def allows(drive: DriveUnderTest) -> None:
        found = drive.find((index, 0))
        for value in values(drive.motion):
            need(found and in_limits(found, value), f"the limits of {hexadecimal(index)} do not allow {value}")

    return allows


MOVES = [
    _has(Mode.PROFILE_POSITION, cia402.TARGET_POSITION, cia402.PROFILE_VELOCITY, cia402.POSITION),
    _allows(cia402.TARGET_POSITION, lambda motion: (motion.distance, -motion.distance)),
    _allows(cia402.PROFILE_VELOCITY, lambda motion: (motion.velocity,)),
]


@Clause(DRIVE, "10.1", "Profile position", Tier.MOTION, group="there and back", needs=MOVES)
def _position(drive: DriveUnderTest) -> Steps:
    """Move by the allowed distance, and back."""
    distance, velocity = drive.motion
    window = drive.number((cia402.POSITION_WINDOW, 0)) & 0xFFFFFFFF
    # A window of all ones is off (CiA 402-2, 12.3.4), and one as wide as the move would accept everything.
    near = max(distance // 50, window if window < distance else 0, 1)
    yield step.read("where it is", (cia402.POSITION, 0), save="start")
    at = cia402.PROFILE_VELOCITY
    yield step.write(f"velocity {velocity}", (at, 0), value=drive.raw(at, velocity))
    yield from _mode(drive, Mode.PROFILE_POSITION)
    yield from _moved(drive, distance)
    yield from _moved(drive, -distance)
    back = f"{{start}} +- {drive.raw(cia402.POSITION, near)}"
    yield step.read("it is back", (cia402.POSITION, 0), expect=back)
    yield from _off(drive)


def _moved(drive: DriveUnderTest, distance: int) -> Steps:
    enable = DriveCommand.ENABLE.bits
    reached = cia402.TARGET_REACHED | cia402.BIT_12
    bits = enable | cia402.NEW_SET_POINT | cia402.AT_ONCE | cia402.RELATIVE
    yield step.write(f"by {distance}", (cia402.TARGET_POSITION, 0), value=drive.raw(cia402.TARGET_POSITION, distance))
    yield _command(bits, "new set-point, relative")
    yield _until(drive, "set-point acknowledged", cia402.BIT_12, cia402.BIT_12)
    yield _command(enable, "no new set-point")
    arrived = cia402.TARGET_REACHED | State.ENABLED.bits
    yield _until(drive, "target reached", reached | State.ENABLED.mask, arrived, MOVED)


TURNS = [
    _has(Mode.PROFILE_VELOCITY, cia402.TARGET_VELOCITY, cia402.VELOCITY),
    _allows(cia402.TARGET_VELOCITY, lambda motion: (0, motion.velocity)),
]


@Clause(DRIVE, "14.1", "Profile velocity", Tier.MOTION, group="up, and quick stop", needs=TURNS)
def _velocity(drive: DriveUnderTest) -> Steps:
    velocity = drive.motion.velocity
    target = (cia402.TARGET_VELOCITY, 0)
    within = drive.raw(cia402.VELOCITY, max(velocity // 20, 1))
    yield step.write("velocity 0", target, value=0)
    yield from _mode(drive, Mode.PROFILE_VELOCITY)
    yield step.write(f"velocity {velocity}", target, value=drive.raw(target[0], velocity))
    yield _until(drive, "target reached", cia402.TARGET_REACHED, cia402.TARGET_REACHED, MOVED)
    yield step.read("it turns", (cia402.VELOCITY, 0), expect=f"{drive.raw(cia402.VELOCITY, velocity)} +- {within}")
    yield _commanded(DriveCommand.QUICK_STOP)
    yield {"name": "it stops", "wait": "1 s"}
    yield step.read("it stands", (cia402.VELOCITY, 0), expect=f"0 +- {within}")
    yield step.write("velocity 0", target, value=0)
    yield from _off(drive)


def drive_text(dictionary: Dictionary, reversible: bool = False, motion: MotionBounds | None = None) -> str:
    """Return the suite of a drive; `reversible` writes its controlword, `motion` allows torque within its bounds."""
    tier = Tier.REVERSIBLE if reversible else Tier.READING
    if motion:
        tier = Tier.MOTION
    drive = DriveUnderTest(dictionary, tier, motion=motion or NOT_AT_ALL)
    reset = [_command(0, "no command"), _commanded(DriveCommand.FAULT_RESET), _command(0, "no command")]
    off = {**_commanded(DriveCommand.DISABLE_VOLTAGE), "name": "8.1 States: no torque [reversible]"}
    is_written = tier.allows(Tier.REVERSIBLE)
    before = [awake(drive, ANSWERS)]
    if is_written:
        before.append(step.group("8.1 States: any fault is reset [reversible]", *reset))
    return documents([DRIVE.suite(drive, "profile", before, [off] if is_written else [])])


# I/O modules

Kind: TypeAlias = "DigitalInputs | DigitalOutputs | AnalogueInputs | AnalogueOutputs"


@dataclass(frozen=True)
class ModuleUnderTest(DeviceUnderTest):
    """A module under test."""

    def blocks(self, kinds: Sequence[Kind]) -> Iterator[tuple[Kind, ODVariable]]:
        """Yield the blocks and channels of these kinds in the file."""
        subs = ((kind, (kind.value, sub)) for kind in kinds for sub in self.dictionary.members.get(kind.value, ()))
        return ((kind, found) for kind, at in subs if 0 < at[1] < 0xFF and (found := self.find(at)))

    def settings(self, *indices: int) -> list[ODVariable]:
        """Return the settings in the file that can be written and restored."""
        members = self.dictionary.members
        subs = ((index, sub) for index in indices for sub in members.get(index, ()) if sub or len(members[index]) == 1)
        return [*filter(None, map(self.settable, subs))]


_INPUTS: tuple[Kind, ...] = (*cia401.DIGITAL_INPUTS, *cia401.ANALOGUE_INPUTS)
_OUTPUTS: tuple[Kind, ...] = (*cia401.DIGITAL_OUTPUTS, *cia401.ANALOGUE_OUTPUTS)

MODULE: Chapter[ModuleUnderTest] = Chapter("cia401", "I/O module", standard=401)
"""The suite in the order of this file: steps that switch nothing come first."""


def _every(bits: int, byte: int = 0xFF) -> int:
    """Return the value of a block whose bytes are all the same."""
    return int.from_bytes(bytes([byte]) * (bits // 8), "little")


def _set(address: Address, value: int) -> Data:
    name = f"{label(address)} = {value:#x}" if value > 9 else f"{label(address)} = {value}"
    return step.write(name, address, value=value)


def _written_and_read(variable: ODVariable, values: Sequence[int]) -> Data:
    at = address_of(variable)
    pairs = ((_set(at, each), step.read(f"it is {each:#x}", at, expect=each)) for each in values)
    return step.keeping(title(variable), variable, *chain.from_iterable(pairs))


def _without(name: str, index: int) -> Data:
    return step.skip(name, f"the file has no {hexadecimal(index)} that can be written")


FUNCTIONS: Mapping[int, tuple[Sequence[Kind], int]] = {
    16: (cia401.DIGITAL_INPUTS, 0x6000),
    17: (cia401.DIGITAL_OUTPUTS, 0x6200),
    18: (cia401.ANALOGUE_INPUTS, 0x6401),
    19: (cia401.ANALOGUE_OUTPUTS, 0x6411),
}
"""What a bit of 0x1000 stands for: the kinds of blocks, and the index where these usually are."""


@Clause(MODULE, "0x1000", "Device type")
def _device_type(module: ModuleUnderTest) -> Steps:
    says = module.number(DEVICE_TYPE)
    yield step.read("an I/O module", DEVICE_TYPE, expect=says)
    for bit, (kinds, usual) in FUNCTIONS.items():
        words = cia401.FUNCTION_BITS[bit]
        found = [address_of(each) for _, each in module.blocks(kinds)]
        if says >> bit & 1:  # without an object in the file, read the usual one, so that the step is red
            yield step.read(words, found[0] if found else (usual, 1), data="any")
        else:
            yield step.skip(words, f"0x1000 says that it has no {words}")


@Clause(MODULE, "0x6000", "Inputs")
def _inputs(module: ModuleUnderTest) -> Steps:
    return [step.read(title(each), address_of(each), data="any") for _, each in module.blocks(_INPUTS)]


@Clause(MODULE, "0x6002", "Polarity of inputs", Tier.REVERSIBLE)
def _input_polarity(module: ModuleUnderTest) -> Steps:
    """Invert one bit after the other; the inputs must not change meanwhile."""
    for kind, each in module.blocks(cia401.DIGITAL_INPUTS):
        assert isinstance(kind, DigitalInputs)
        at = address_of(each)
        polarity = (kind.polarity, each.subindex)
        inverted = module.settable(polarity) if module.may_be(polarity, _every(kind.bits)) else None
        if inverted is None:
            yield _without(title(each), kind.polarity)
            continue
        steps = [step.save(each, "input")]
        for bit in range(kind.bits):
            steps.append(_set(polarity, 1 << bit))
            # The value differs, and by this bit only.
            steps.append(step.read(f"bit {bit} is inverted", at, expect="not {input}"))
            steps.append(step.read(f"no other than bit {bit}", at, expect=f"{{input}} +- {1 << bit}"))
        yield step.keeping(title(each), inverted, *steps)


SETTINGS: Mapping[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "Filter of inputs": ((0x6003, 0x6103, 0x6123), (0x55, 0xAA)),
    "Interrupts of inputs": ((*range(0x6006, 0x6009), *range(0x6106, 0x6109), *range(0x6126, 0x6129)), (0x55, 0xAA)),
    "Global interrupt": ((cia401.INTERRUPT_ENABLE, cia401.ANALOGUE_INTERRUPT_ENABLE), (0, 1)),
    "Analogue interrupts": (tuple(range(cia401.ANALOGUE_UPPER, cia401.ANALOGUE_RISE + 1)), (0, 100)),
    "Scaling of inputs": ((0x6431, 0x6432), (1, 2)),
    "Error mode": ((0x6206, 0x6306, 0x6326), (0x00, 0x55)),
    "Error value": ((0x6207, 0x6307, 0x6327), (0x00, 0x55)),
    "Analogue error mode": ((0x6443,), (0, 1)),
    "Analogue error value": ((0x6444,), (0, 100)),
}
"""Settings that act only at an event or error: their objects, and values to write and read back."""


def _settings(module: ModuleUnderTest, indices: tuple[int, ...], values: tuple[int, ...]) -> Steps:
    found = [each for each in module.settings(*indices) if module.may_be(address_of(each), *values)]
    return [_written_and_read(each, values) for each in found] or [_without("written and read back", indices[0])]


for _topic, (_indices, _values) in SETTINGS.items():
    _made = partial(_settings, indices=_indices, values=_values)
    Clause(MODULE, hexadecimal(_indices[0]), _topic, Tier.REVERSIBLE)(_made)


SWITCHED = 0x55, 0xAA, 0xFF, 0x00
"""Values that switch each bit both ways, with equal and different neighbours; all off at the end."""


@Clause(MODULE, "0x6200", "Outputs", Tier.OUTPUTS)
def _outputs(module: ModuleUnderTest) -> Steps:
    for kind, each in module.blocks(_OUTPUTS):
        values = [_every(kind.bits, byte) for byte in SWITCHED] if isinstance(kind, DigitalOutputs) else [1, 100, 0]
        usable = [value for value in values if module.may_be(address_of(each), value)]
        yield _written_and_read(each, usable) if usable else _without(title(each), each.index)


def module_text(dictionary: Dictionary, reversible: bool = False, outputs: bool = False) -> str:
    """Return the suite of a module; `reversible` writes settings, `outputs` switches outputs."""
    tier = Tier.REVERSIBLE if reversible else Tier.READING
    module = ModuleUnderTest(dictionary, Tier.OUTPUTS if outputs else tier)
    settable = [each for _, each in module.blocks(_OUTPUTS) if module.settable(address_of(each))] if outputs else []
    off = [
        step.write(f"0x6200 Outputs: {label(at)} as after power-on [outputs]", at, value=module.number(at))
        for at in map(address_of, settable)
    ]
    stop = {**step.nmt("pre-operational"), "name": "7.2.8.2.1 NMT: to PRE-OPERATIONAL [outputs]"}
    return documents([MODULE.suite(module, "profile", [awake(module, ANSWERS)], [*off, stop] if outputs else [])])
