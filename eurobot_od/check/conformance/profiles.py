"""Suites for devices of a profile: drives by CiA 402, I/O modules by CiA 401.

Rule of this file: only what needs `--motion` gives a motor torque, and keeps to the speed and distance that it says; at
its end the motor stands where it stood before, or where its last step says. Only what needs `--outputs` switches an
output.

A drive is asked for its objects, its state machine as a table, quick stop, a lost heartbeat, moves; a module for its
objects, its settings, and outputs that are written and read back. Over the bus nobody sees a terminal: an output that
never switches answers as one that does, so there is only what objects say. CiA 401 has a clause for each object; steps
are named by the object, as the clauses' numbers differ from version to version.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import NamedTuple, TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import ANSWERS, Chapter, Clause, Need, Subject, Tier, awake, need
from eurobot_od.check.conformance.step import Data, Steps, hexadecimal, title
from eurobot_od.check.conformance.suite import documents
from eurobot_od.device.nmt import NmtState
from eurobot_od.od import cia401, cia402
from eurobot_od.od.cia401 import AnalogueInputs, AnalogueOutputs, DigitalInputs, DigitalOutputs
from eurobot_od.od.cia402 import ARROWS, POWERED, DriveCommand, Mode, State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, DEVICE_TYPE
from eurobot_od.od.values import ERROR_CONTROL_BASE, Address, label
from eurobot_od.sdo.wire import ClientCommand, initiate

# Drives

SOON, MOVED = "2 s", "30 s"
"""How long an arrow of the state machine, and a move, may take."""

WATCHED = 200
"""Milliseconds of the heartbeat that is lost."""

STAYS, LEAVES = 6, 2
"""Quick stop option codes: with the first the drive stays in Quick stop active."""


class MotionBounds(NamedTuple):
    """How far a motor may be moved, and how fast, in the drive's units."""

    distance: int
    velocity: int


NOT_AT_ALL = MotionBounds(0, 0)


@dataclass(frozen=True)
class TestedDrive(Subject):
    """A drive under test; `motion` is how far and how fast its motor may be moved."""

    motion: MotionBounds = NOT_AT_ALL

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of operation that the file says it has."""
        return cia402.supported(self.number((cia402.SUPPORTED_MODES, 0)))

    def raw(self, index: int, value: int) -> int | str:
        """Return how a step writes a raw value of an object."""
        variable = self.dictionary.variable((index, 0))
        return value if variable is None else step.raw(variable, value)


DRIVE: Chapter[TestedDrive] = Chapter("cia402", "drive", standard=402)
"""The suite, in the order of this file: what gives no torque comes first."""


def _digits(mask: int, bits: int) -> str:
    """Return the pattern of a byte that has these bits."""
    # Patterns compare digits: of each four bits of the mask come the digits that it lets through.
    digits = ""
    for m, b in ((mask >> 4, bits >> 4), (mask & 15, bits & 15)):
        allowed = "".join(f"{n:X}" for n in range(16) if n & m == b)
        digits += "?" if len(allowed) == 16 else allowed if len(allowed) == 1 else f"[{allowed}]"
    return digits


def _until(drive: TestedDrive, name: str, mask: int, bits: int, within: str = SOON) -> Data:
    """Ask for the statusword until it has these bits."""
    ask = drive.request(initiate(ClientCommand.UPLOAD << 5, (cia402.STATUSWORD, 0)))
    # 4B is an expedited answer of 2 bytes (CiA 301, 7.2.4.3); the other two bytes may be anything.
    head = f"4B{cia402.STATUSWORD & 0xFF:02X}{cia402.STATUSWORD >> 8:02X}00"
    word = _digits(mask & 0xFF, bits & 0xFF) + _digits(mask >> 8, bits >> 8)
    poll = {**ask, "every": "20 ms"}
    return {"name": name, "poll": poll, "until": drive.answer(f"{head}{word}????"), "within": within}


def _state(drive: TestedDrive, state: State) -> Data:
    return _until(drive, f"it is in {state.words}", state.mask, state.bits)


def _command(word: int, name: str) -> Data:
    return step.write(f"{name} ({hexadecimal(word)})", (cia402.CONTROLWORD, 0), value=word)


def _commanded(command: DriveCommand) -> Data:
    return _command(command.bits, command.words)


WAY = DriveCommand.SHUTDOWN, DriveCommand.SWITCH_ON, DriveCommand.ENABLE, DriveCommand.QUICK_STOP
"""The commands that bring a drive from Switch on disabled into one state after the other."""


def _into(drive: TestedDrive, state: State) -> Steps:
    """Bring the drive into a state of that way, each arrow seen."""
    yield _commanded(DriveCommand.DISABLE_VOLTAGE)
    present, commands = State.DISABLED, iter(WAY)
    yield _state(drive, present)
    while present is not state:
        command = next(commands)
        present = ARROWS[present, command].after
        yield _commanded(command)
        yield _state(drive, present)


def _off(drive: TestedDrive) -> Steps:
    return _into(drive, State.DISABLED)


@Clause(DRIVE, "6.2", "Objects")
def _objects(drive: TestedDrive) -> Steps:
    for index in (cia402.CONTROLWORD, cia402.STATUSWORD):  # mandatory: a drive without them is red
        variable = drive.find((index, 0))
        yield step.read(title(variable) if variable else hexadecimal(index), (index, 0))
    for index in (cia402.MODE_DISPLAY, cia402.SUPPORTED_MODES, cia402.ERROR_CODE):
        variable, lack = drive.readable((index, 0)), f"the file has no {hexadecimal(index)} that can be read"
        yield step.read(title(variable), (index, 0)) if variable else step.skip(hexadecimal(index), lack)


LEADS_TO: Mapping[tuple[State, DriveCommand | None], State] = {
    **{pair: arrow.after for pair, arrow in ARROWS.items()},
    (State.READY, DriveCommand.ENABLE): State.ENABLED,  # two arrows with one command (CiA 402-2, table of commands)
}
"""The state after a command, by the state before; a command that is not here leaves the state as it is."""


def _table(drive: TestedDrive, powered: bool) -> Steps:
    """Give the rows of the state machine: each command in each state, those with torque or those without."""
    for before in (State.DISABLED, State.READY, State.SWITCHED_ON, State.ENABLED):
        for command in DriveCommand:
            after = LEADS_TO.get((before, command), before)
            # In states with torque "no command", which precedes a fault reset, is Disable voltage.
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
def _quick_stop(drive: TestedDrive) -> Steps:
    option = cia402.QUICK_STOP_OPTION, 0
    stopped = _commanded(DriveCommand.QUICK_STOP)
    if not drive.may_be(option, STAYS):
        # Where its option code leads is the maker's matter; all that can be asked is that it is not a fault.
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
def _lost_heartbeat(drive: TestedDrive) -> Steps:
    """Lose a heartbeat that the drive watches: it has a fault, which a rising edge resets."""
    watched, option, another = (CONSUMED_HEARTBEATS, 1), (cia402.ABORT_CONNECTION, 0), drive.another
    entry = another << 16 | WATCHED
    settable = drive.may_be(watched, entry) and drive.may_be(option, 1)
    need(settable, "the file has no 0x1016:1 and 0x6007 that can be written")
    beat = f"{ERROR_CONTROL_BASE + another:03X}#{NmtState.OPERATIONAL:02X}"
    yield step.write("abort connection: a fault", option, value=1)
    yield from _into(drive, State.ENABLED)
    yield step.write(f"watch node {another}", watched, value=entry)
    yield {"name": "its heartbeat, and no second one", "send": {"raw": beat}}
    yield _state(drive, State.FAULT)
    # No command leaves a fault but the reset, and that only with a rising edge (CiA 402-2, transition 15).
    yield _command(DriveCommand.ENABLE.bits, "Enable operation")
    yield _state(drive, State.FAULT)
    yield step.write("watch nobody", watched, value=0)
    yield _command(0, "no command")
    yield _commanded(DriveCommand.FAULT_RESET)
    yield _state(drive, State.DISABLED)
    yield step.write("abort connection as before", option, value=drive.number(option))


def _mode(drive: TestedDrive, mode: Mode) -> Steps:
    """Choose a mode of operation, and enable."""
    yield step.write(f"mode {cia402.MODE_WORDS[mode]}", (cia402.MODE, 0), value=int(mode))
    yield step.read("it is the mode", (cia402.MODE_DISPLAY, 0), expect=int(mode))
    yield from _into(drive, State.ENABLED)


def _has(mode: Mode, *indices: int) -> Need[TestedDrive]:
    """Need a drive with a mode, and the objects by which it is commanded."""

    def has(drive: TestedDrive) -> None:
        need(mode in drive.modes, f"the file has no mode {cia402.MODE_WORDS[mode]} (0x6502)")
        lacks = [hexadecimal(index) for index in (cia402.MODE, *indices) if drive.find((index, 0)) is None]
        need(not lacks, f"the file has no {', '.join(lacks)}")

    return has


HOME_IS_HERE = 37
"""The homing method that does not move."""

HOMES = [_has(Mode.HOMING, cia402.HOMING_METHOD, cia402.POSITION)]


@Clause(DRIVE, "11.1", "Homing", Tier.MOTION, group="present position is home", needs=HOMES)
def _homing(drive: TestedDrive) -> Steps:
    done = cia402.BIT_12 | cia402.TARGET_REACHED
    yield step.write(f"method {HOME_IS_HERE}", (cia402.HOMING_METHOD, 0), value=HOME_IS_HERE)
    yield from _mode(drive, Mode.HOMING)
    # Bits 13, 12 and 10: no error, not attained, target reached (CiA 402-2, clause 11).
    yield _until(drive, "not started", 0x3400, cia402.TARGET_REACHED)
    yield _command(DriveCommand.ENABLE.bits | cia402.HOMING_START, "start homing")
    yield _until(drive, "homing attained", done | cia402.BIT_13, done, MOVED)
    yield from _off(drive)


MOVES = [_has(Mode.PROFILE_POSITION, cia402.TARGET_POSITION, cia402.PROFILE_VELOCITY, cia402.POSITION)]


@Clause(DRIVE, "10.1", "Profile position", Tier.MOTION, group="there and back", needs=MOVES)
def _position(drive: TestedDrive) -> Steps:
    """Move by the distance that is allowed, and back."""
    distance, velocity = drive.motion
    window = drive.number((cia402.POSITION_WINDOW, 0)) & 0xFFFFFFFF
    # A window of all bits is switched off (CiA 402-2, clause 12.3.4), and one as wide as the way would see nothing.
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


def _moved(drive: TestedDrive, distance: int) -> Steps:
    enable, reached = DriveCommand.ENABLE.bits, cia402.TARGET_REACHED | cia402.BIT_12
    bits = enable | cia402.NEW_SET_POINT | cia402.AT_ONCE | cia402.RELATIVE
    yield step.write(f"by {distance}", (cia402.TARGET_POSITION, 0), value=drive.raw(cia402.TARGET_POSITION, distance))
    yield _command(bits, "new set-point, relative")
    yield _until(drive, "set-point acknowledged", cia402.BIT_12, cia402.BIT_12)
    yield _command(enable, "no new set-point")
    arrived = cia402.TARGET_REACHED | State.ENABLED.bits
    yield _until(drive, "target reached", reached | State.ENABLED.mask, arrived, MOVED)


TURNS = [_has(Mode.PROFILE_VELOCITY, cia402.TARGET_VELOCITY, cia402.VELOCITY)]


@Clause(DRIVE, "14.1", "Profile velocity", Tier.MOTION, group="up, and quick stop", needs=TURNS)
def _velocity(drive: TestedDrive) -> Steps:
    velocity, target = drive.motion.velocity, (cia402.TARGET_VELOCITY, 0)
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
    """Return the suite of a drive; `reversible` writes its controlword, `motion` gives it torque within its limits."""
    tier = Tier.MOTION if motion else Tier.REVERSIBLE if reversible else Tier.READING
    drive = TestedDrive(dictionary, tier, motion=motion or NOT_AT_ALL)
    reset = [_command(0, "no command"), _commanded(DriveCommand.FAULT_RESET), _command(0, "no command")]
    off = {**_commanded(DriveCommand.DISABLE_VOLTAGE), "name": "8.1 States: no torque [reversible]"}
    is_written = tier.allows(Tier.REVERSIBLE)
    healthy = [step.group("8.1 States: any fault is reset [reversible]", *reset)] * is_written
    return documents([DRIVE.suite(drive, "profile", [awake(drive, ANSWERS), *healthy], [off] * is_written)])


# I/O modules

Kind: TypeAlias = "DigitalInputs | DigitalOutputs | AnalogueInputs | AnalogueOutputs"


@dataclass(frozen=True)
class TestedModule(Subject):
    """A module under test."""

    def blocks(self, kinds: Sequence[Kind]) -> Iterator[tuple[Kind, ODVariable]]:
        """Yield the blocks and channels of some kinds that the file has."""
        subs = ((kind, (kind.value, sub)) for kind in kinds for sub in self.dictionary.members.get(kind.value, ()))
        return ((kind, found) for kind, at in subs if 0 < at[1] < 0xFF and (found := self.find(at)))

    def settings(self, *indices: int) -> list[ODVariable]:
        """Return the settings that the file has, and that can be written and put back."""
        members = self.dictionary.members
        subs = ((index, sub) for index in indices for sub in members.get(index, ()) if sub or len(members[index]) == 1)
        return [*filter(None, map(self.settable, subs))]


_INPUTS: tuple[Kind, ...] = (*cia401.DIGITAL_INPUTS, *cia401.ANALOGUE_INPUTS)
_OUTPUTS: tuple[Kind, ...] = (*cia401.DIGITAL_OUTPUTS, *cia401.ANALOGUE_OUTPUTS)

MODULE: Chapter[TestedModule] = Chapter("cia401", "I/O module", standard=401)
"""The suite, in the order of this file: what switches nothing comes first."""


def _every(bits: int, byte: int = 0xFF) -> int:
    """Return a block that repeats the same byte."""
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
"""What a bit of 0x1000 says that there is, and the object where it usually is."""


@Clause(MODULE, "0x1000", "Device type")
def _device_type(module: TestedModule) -> Steps:
    says = module.number(DEVICE_TYPE)
    yield step.read("an I/O module", DEVICE_TYPE, expect=says)
    for bit, (kinds, usual) in FUNCTIONS.items():
        words, found = cia401.FUNCTION_BITS[bit], [address_of(each) for _, each in module.blocks(kinds)]
        if says >> bit & 1:  # what is usual is asked for where the file has none: it is not there, and the step is red
            yield step.read(words, found[0] if found else (usual, 1), data="any")
        else:
            yield step.skip(words, f"0x1000 says that it has no {words}")


@Clause(MODULE, "0x6000", "Inputs")
def _inputs(module: TestedModule) -> Steps:
    return [step.read(title(each), address_of(each), data="any") for _, each in module.blocks(_INPUTS)]


@Clause(MODULE, "0x6002", "Polarity of inputs", Tier.REVERSIBLE)
def _input_polarity(module: TestedModule) -> Steps:
    """Invert one bit after the other; the inputs have to be at rest."""
    for kind, each in module.blocks(cia401.DIGITAL_INPUTS):
        assert isinstance(kind, DigitalInputs)
        at, polarity = address_of(each), (kind.polarity, each.subindex)
        inverted = module.settable(polarity) if module.may_be(polarity, _every(kind.bits)) else None
        if inverted is None:
            yield _without(title(each), kind.polarity)
            continue
        steps = [step.save(each, "input")]
        for bit in range(kind.bits):
            steps.append(_set(polarity, 1 << bit))
            # It differs, and by the value of this bit: so it is this one, and no other.
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
"""Settings that only count with an event or an error: their objects, and values that are written and read back."""


def _settings(module: TestedModule, indices: tuple[int, ...], values: tuple[int, ...]) -> Steps:
    found = [each for each in module.settings(*indices) if module.may_be(address_of(each), *values)]
    return [_written_and_read(each, values) for each in found] or [_without("written and read back", indices[0])]


for _topic, (_indices, _values) in SETTINGS.items():
    _made = partial(_settings, indices=_indices, values=_values)
    Clause(MODULE, hexadecimal(_indices[0]), _topic, Tier.REVERSIBLE)(_made)


SWITCHED = 0x55, 0xAA, 0xFF, 0x00
"""Each bit both ways, next to bits that differ from it and to bits that do not; off at the end."""


@Clause(MODULE, "0x6200", "Outputs", Tier.OUTPUTS)
def _outputs(module: TestedModule) -> Steps:
    for kind, each in module.blocks(_OUTPUTS):
        values = [_every(kind.bits, byte) for byte in SWITCHED] if isinstance(kind, DigitalOutputs) else [1, 100, 0]
        usable = [value for value in values if module.may_be(address_of(each), value)]
        yield _written_and_read(each, usable) if usable else _without(title(each), each.index)


def module_text(dictionary: Dictionary, reversible: bool = False, outputs: bool = False) -> str:
    """Return the suite of a module; `reversible` writes settings, `outputs` switches."""
    module = TestedModule(dictionary, Tier.OUTPUTS if outputs else Tier.REVERSIBLE if reversible else Tier.READING)
    settable = [each for _, each in module.blocks(_OUTPUTS) if module.settable(address_of(each))] if outputs else []
    off = [
        step.write(f"0x6200 Outputs: {label(at)} as after power-on [outputs]", at, value=module.number(at))
        for at in map(address_of, settable)
    ]
    stop = {**step.nmt("pre-operational"), "name": "7.2.8.2.1 NMT: to PRE-OPERATIONAL [outputs]"}
    return documents([MODULE.suite(module, "profile", [awake(module, ANSWERS)], [*off, stop] if outputs else [])])
