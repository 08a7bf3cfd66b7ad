"""A drive of CiA 402 from the master's side: enabled, homed and moved over SDO.

Theory of operation. Everything is written once, in `DriveAtNode`, as steps that blocking programs run to their end and
event loops await. Every wait polls the drive. A wait that is interrupted, by Ctrl-C or a cancelled task, halts the
drive first: nobody is watching any more where it goes. Every way to stop it is a stop of `motion`: repeated until the
drive is seen to stand, and with its targets at rest, so that it does not turn when it is enabled the next time.
Positions, velocities and accelerations are in the drive's own units.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from functools import partial
from math import inf
from typing import NamedTuple, TypeAlias

from eurobot_od.client.master import RemoteNode, blocking, finished, seconds
from eurobot_od.client.motion import (
    BEGINS,
    FOLLOWING,
    GIVE_UP,
    NOISE,
    OFFSETS,
    REPEAT,
    RESTING,
    AxisAddress,
    AxisObjects,
    AxisStop,
    Held,
    StopKind,
)
from eurobot_od.client.streams import Closed
from eurobot_od.errors import BusError, DriveError, LocalError, NodeRefused, UnknownName, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import METHODS, DriveCommand, Mode, State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import DEVICE_TYPE
from eurobot_od.od.values import DataType
from eurobot_od.sdo.wire import AbortCode

POLL = 0.01
"""Interval between two polls of a drive, in s."""

STATES = {each.words.upper(): each for each in State} | {"DISABLE VOLTAGE": State.DISABLED}
"""The states by the words of canopen, which also has a command among them."""

ENABLE_WAIT = 2.0
"""Timeout of one state transition, in s; some drives switch a brake or charge a capacitor."""

MOTION_WAIT = 60.0
"""Default timeout of a motion, in s."""

CHECK = 0.2
"""Interval between two looks at whether another program has taken the drive, in s."""

AT_LIMIT = 1.0
"""Time after which a move that stands at an internal limit has ended there, in s."""

IsOurs: TypeAlias = Callable[[], Awaitable[None]]
"""Raises DriveError where another program has taken the drive."""

NO_WINDOW = 0xFFFFFFFF
"""Value of the position window that switches it off."""

ENABLE = "enable"

KNOWN_METHODS = "1..14, 17..30, 33..35, 37, and a maker's below 0"
"""The homing methods, for an error."""

DRIVE_PROFILES = (cia402.PROFILE, 0xFFFF)
"""Low words of 0x1000 that a drive may have: CiA 402, or several profiles (CiA 301, 7.5.2.1)."""

FAULTY = (State.FAULT, State.FAULT_REACTION)
"""States of a drive with a fault."""

NEXT: Mapping[State, DriveCommand] = {
    State.DISABLED: DriveCommand.SHUTDOWN,
    State.READY: DriveCommand.SWITCH_ON,
    State.SWITCHED_ON: DriveCommand.ENABLE,
    State.QUICK_STOP: DriveCommand.DISABLE_VOLTAGE,
}
"""Command for the next step to Operation enabled; a drive leaves other states without a command."""


def commands_to(target: State) -> Mapping[State, DriveCommand]:
    """Return the command in each state for the next step to `target`; raises LocalError if none leads there."""
    if target in (State.NOT_READY, *FAULTY):
        raise LocalError(f"no command brings a drive to {target.words}")
    # The transition from quick stop back to enabled is optional (see TRANSITIONS).
    arrows = (each for each in reversed(cia402.TRANSITIONS) if each.after is target is not State.ENABLED)
    return {**NEXT, **{each.before: each.command for each in arrows if each.command}}


class DriveStatus(NamedTuple):
    """Status of a drive; `state` is None if the statusword belongs to no state, `limit` what stops it, in words."""

    state: State | None
    statusword: int
    mode: int
    position: int
    velocity: int
    error_code: int
    limit: str = ""


class DriveAtNode(Closed):
    """One axis of a drive; `axis` counts from 1."""

    def __init__(self, node: RemoteNode, dictionary: Dictionary | None, axis: int = 1) -> None:
        if not 1 <= axis <= cia402.MOST_AXES:
            raise LocalError(f"axis {axis} is not in 1..{cia402.MOST_AXES}")
        self._dictionary = dictionary
        self._address = AxisAddress(node.node_id, axis)
        self._offset = self._address.offset
        self.kick: Callable[[], object] = lambda: None
        """Called with each request and answer, as a sign that the program is alive."""
        self._name = f"the drive of node {node.node_id}" if axis == 1 else f"axis {axis} of node {node.node_id}"
        self._node = node

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._name}>"

    # Objects

    @property
    def _objects(self) -> AxisObjects:
        return AxisObjects(self._address, self._node.master.sdo_server(self._node.node_id), self._dictionary)

    def _type(self, index: int) -> DataType:
        return self._objects.type_of(index)

    async def _read(self, index: int) -> int:
        self.kick()
        try:
            data = await self._node.upload.steps((index + self._offset, 0))
        except NodeRefused as refused:
            if index != cia402.STATUSWORD or refused.code != AbortCode.NO_OBJECT:
                raise
            lacks = "is no drive of CiA 402"
            if self._address.number > 1:
                await type(self)(self._node, self._dictionary)._state()  # raises unless the node is a drive
                lacks = f"has no axis {self._address.number}, only axis 1 answers"
            raise DriveError(f"node {self._node.node_id} {lacks}: {refused.request} is refused") from None
        # An expedited answer may leave out its size, and then has four bytes, whatever the type (CiA 301, 7.2.4.3.6).
        value = self._type(index).read(data[: self._type(index).size])
        assert isinstance(value, int)
        return value

    async def _write(self, index: int, value: int) -> None:
        type_ = self._type(index)
        if not type_.low <= value <= type_.high:
            raise LocalError(f"{value} does not fit 0x{index + self._offset:04X}: {type_.low}..{type_.high}")
        self.kick()
        if index == cia402.CONTROLWORD:  # noted before it is sent, as its answer may be lost
            self._node.master.controlwords[self._address] = value
        await self._node.download.steps((index + self._offset, 0), type_.write(value))

    # State

    async def _state(self) -> State | None:
        return cia402.state_of(await self._read(cia402.STATUSWORD))

    async def _status(self) -> DriveStatus:
        word = await self._read(cia402.STATUSWORD)
        state = cia402.state_of(word)
        shown = (cia402.MODE_DISPLAY, cia402.POSITION, cia402.VELOCITY)
        mode, position, velocity = [await self._read(each) for each in shown]
        code = await self._read(cia402.ERROR_CODE) if state in FAULTY else 0
        return DriveStatus(state, word, mode, position, velocity, code, await self._limit(word))

    async def _limit(self, word: int) -> str:
        """Return in words what limits the drive, by its statusword and its switches; nothing if nothing does."""
        if not word & cia402.INTERNAL_LIMIT:
            return ""
        inputs = await self._read_optional(cia402.DIGITAL_INPUTS) or 0
        switches = [words for bit, words in cia402.INPUT_BITS.items() if inputs & cia402.LIMIT_INPUTS & 1 << bit]
        return ": ".join(filter(None, ["internal limit active (bit 11)", ", ".join(switches)]))

    async def _said(self, word: int) -> str:
        """Return the state of a statusword in words, and what limits the drive."""
        state = cia402.state_of(word)
        said = f"it is in {state.words if state else 'an unknown state'} (statusword 0x{word:04X})"
        return ", ".join(filter(None, [said, await self._limit(word)]))

    async def _poll(
        self, within: float, done: Callable[[int], bool], index: int = cia402.STATUSWORD
    ) -> tuple[int, bool]:
        """Wait until the statusword (or another object) is `done`; return its last value and whether it is done."""
        clock = self._node.master.clock
        end = clock() + seconds(within)
        while not done(word := await self._read(index)):
            if clock() >= end:
                return word, False
            await self._node.master.pump.steps(POLL)
        return word, True

    async def _until(
        self,
        what: str,
        within: float,
        done: Callable[[int], bool],
        is_ours: IsOurs | None = None,
    ) -> int:
        """Wait for a statusword that is `done` and return it; raises DriveError on a fault or timeout.

        `is_ours` is given for a motion, and called again and again. A motion also ends when the drive leaves Operation
        enabled.
        """
        moves, clock = is_ours is not None, self._node.master.clock
        end, ended = clock() + seconds(within), False

        def ends(word: int) -> bool:
            state = cia402.state_of(word)
            return done(word) or state in FAULTY or (moves and state is not State.ENABLED)

        while not ended:
            word, ended = await self._poll(min(CHECK, end - clock()) if is_ours else within, ends)
            if ended:
                await self._check_state(what, word, moves)
            if is_ours:
                await is_ours()
            if not ended and clock() >= end:
                why = await self._hindrance(word) if what == ENABLE else ""
                raise DriveError(f"{self._name}: {what}: not within {within:g} s; {await self._said(word)}{why}")
        return word

    async def _check_state(self, what: str, word: int, moves: bool = True) -> None:
        """Check that a drive has no fault, and while it `moves` that it is enabled; raises DriveError."""
        state = cia402.state_of(word)
        if state in FAULTY:
            raise await self._fault(what)
        if moves and state is not State.ENABLED:
            # A stop is then a quick stop, as a halt is "enable operation" and could give it its torque back.
            self._node.master.controlwords.pop(self._address, None)
            taken = "another program, or an input of the drive, has taken it out of Operation enabled"
            raise DriveError(f"{self._name}: {what}: {await self._said(word)}: {taken}")

    async def _check_command(self, what: str, mode: Mode, index: int | None = None, value: int = 0) -> None:
        """Check that no other program has changed the mode of operation or the target; raises DriveError."""
        shown = await self._read_optional(cia402.MODE_DISPLAY)
        if shown not in (None, mode):
            said = cia402.MODE_WORDS.get(shown or 0, f"mode {shown}")
            raise DriveError(f"{self._name}: {what}: another program has put it into {said}")
        kept = await self._read_optional(index) if index else None
        if index and kept not in (None, value):
            place = f"0x{index + self._offset:04X}"
            raise DriveError(
                f"{self._name}: {what}: another program has written the target {kept}, not {value}, {place}"
            )

    async def _hindrance(self, word: int) -> str:
        """Return why a drive may ignore its controlword, judging by its objects."""
        commanded = NEXT.get(cia402.state_of(word) or State.NOT_READY)
        kept, mode = await self._read_optional(cia402.CONTROLWORD), await self._read_optional(cia402.MODE_DISPLAY)
        profile = int.from_bytes((await self._node.upload.steps(DEVICE_TYPE))[:2], "little")
        reasons = {
            f"its 0x1000 says profile {profile}, not {cia402.PROFILE}": profile not in DRIVE_PROFILES,
            "its power stage has no voltage (bit 4)": not word & cia402.VOLTAGE,
            "it takes no commands from the bus (bit 9)": not word & cia402.REMOTE,
            f"its controlword is 0x{kept or 0:04X}: somebody else writes it": commanded
            and kept not in (None, commanded.bits),
            "no mode of operation is chosen (0x6060)": mode == Mode.NONE,
        }
        return f": {next((reason for reason, is_so in reasons.items() if is_so), 'it ignores the controlword')}"

    async def _read_optional(self, index: int) -> int | None:
        """Read an object that a drive need not have; return None without it."""
        with suppress(NodeRefused):
            return await self._read(index)
        return None

    async def _fault(self, what: str) -> DriveError:
        code = await self._read(cia402.ERROR_CODE)
        return DriveError(f"{self._name}: {what}: it has a fault, error code 0x{code:04X}")

    async def _command(self, command: DriveCommand, bits: int = 0) -> None:
        await self._write(cia402.CONTROLWORD, command.bits | bits)

    async def _enable(self, within: float = ENABLE_WAIT) -> None:
        """Enable the drive at rest; each state on the way may take `within` seconds.

        The targets are written to rest first: 0, and the actual position in a mode that follows its target. If the
        drive does not let them be written, it is enabled with halt, which stays set until a motion is commanded. One
        that is enabled already stays as it is.
        """
        await self._bring_to(State.ENABLED, within)

    async def _bring_to(self, state: State | str, within: float = ENABLE_WAIT) -> None:
        """Bring it to a state that commands lead to, each arrow within `within` seconds; raises LocalError.

        Operation enabled begins at rest, as `enable` says. A state may be given in words, such as `SWITCHED ON`; raises
        UnknownName.
        """
        if isinstance(state, str):
            state = look_up("state of a drive", state.upper(), STATES)
        what, halt = ENABLE if state is State.ENABLED else state.words.lower(), 0
        present = await self._state()
        if state is State.ENABLED and present not in (state, State.FAULT):
            halt = 0 if await self._rest() else cia402.HALT
        while present is not state:
            if present is State.FAULT:
                raise await self._fault(what)
            # Without a command, the drive leaves this state by itself, or the wait below times out.
            command = commands_to(state).get(present) if present else None
            if command is not None:
                await self._command(command, halt if command is DriveCommand.ENABLE else 0)
            await self._until(what, within, partial(_has_left, present))
            present = await self._state()

    async def _rest(self) -> bool:
        """Write the targets to rest; return whether the drive accepted all that it has."""
        mode = await self._read_optional(cia402.MODE_DISPLAY)
        targets = [*RESTING, *([OFFSETS[mode]] if mode in OFFSETS else [])]
        taken = [await self._rests(each, 0) for each in targets if self._objects.has(each)]
        if mode in FOLLOWING:
            taken.append(await self._rests(cia402.TARGET_POSITION, await self._read(cia402.POSITION)))
        return all(taken)

    async def _rests(self, index: int, value: int) -> bool:
        try:
            await self._write(index, value)
        except NodeRefused as refused:
            return refused.code == AbortCode.NO_OBJECT  # an object that it does not have cannot move it
        return True

    # Stops end when the drive is seen to stand.

    async def _stop(self, kind: StopKind) -> None:
        """Stop the drive until it stands, without waiting for other requests; raises DriveError on a timeout."""
        master = self._node.master
        known = master.controlwords.get(self._address)
        stop = AxisStop(self._objects, master.clock(), kind, known)
        heard: list[BusError] = []

        def send(frames: list[Frame]) -> None:
            try:
                for frame in frames:
                    master.send(*frame)
            except BusError as error:  # the next one may go out
                heard.append(error)

        def hear(cob_id: int, data: bytes, _: float) -> None:
            send(stop.receive(Frame(cob_id, data), master.clock()) or [])

        with master.observed(hear):
            end = stop.since + GIVE_UP + REPEAT
            while not stop.done and (now := master.clock()) < end:
                self.kick()
                send(stop.due(now))
                await master.pump.steps(max(min(stop.next, end) - master.clock(), 0.001), lambda: stop.done)
        master.controlwords[self._address] = stop.word
        if not stop.done:
            lost = f" ({heard[-1]})" if heard else ""
            raise DriveError(f"{self._name}: is not known to stand: {stop.text(master.clock())}{lost}")

    async def _disable(self, within: float = ENABLE_WAIT) -> None:
        """Switch the torque off, and write the targets to rest."""
        if await self._state() in FAULTY:
            return
        await self._stop(StopKind.DISABLE)
        await self._until("disable", within, lambda word: cia402.state_of(word) is State.DISABLED)

    async def _quick_stop(self) -> None:
        """Stop as the quick stop option code says, until the drive stands; raises DriveError on a timeout."""
        await self._stop(StopKind.QUICK_STOP)

    async def _halt(self) -> None:
        """Stop as the halt option code says, keeping the torque, until the drive stands.

        It becomes a quick stop after 0.5 s without effect, and disable voltage with NMT stop after 1 s; after 2 s
        DriveError says what is known. If we have not enabled it, it is a quick stop from the start.
        """
        await self._stop(StopKind.HALT)

    async def _fault_reset(self, within: float = ENABLE_WAIT) -> None:
        """Reset the fault, if there is one, and write the targets to rest."""
        if await self._state() not in FAULTY:
            return
        await self._rest()
        # A reset has no effect in Fault reaction active, that is until the motor stands.
        await self._poll(within, lambda word: cia402.state_of(word) is not State.FAULT_REACTION)
        await self._command(DriveCommand.DISABLE_VOLTAGE)  # the reset is a rising edge
        await self._command(DriveCommand.FAULT_RESET)
        _, is_reset = await self._poll(within, lambda word: cia402.state_of(word) not in FAULTY)
        if not is_reset:
            raise await self._fault("fault reset")
        await self._command(DriveCommand.DISABLE_VOLTAGE)  # clears the bit: the next reset is an edge again

    # Motion

    @asynccontextmanager
    async def _watched(self) -> AsyncIterator[None]:
        """Halt the drive if the wait for its motion ends early."""
        try:
            yield
        # Also Ctrl-C and a cancelled task: nobody watches the motor then.
        except BaseException:
            await self._halt()
            raise

    async def _enter(self, mode: Mode, within: float = ENABLE_WAIT) -> None:
        """Choose a mode of operation and enable at rest; a halt stays set until a motion is commanded."""
        await self._choose(mode, within)
        await self._enable(within)

    async def _choose(self, mode: Mode, within: float = ENABLE_WAIT) -> None:
        """Choose a mode of operation, and wait until the drive shows it."""
        if not isinstance(mode, int):
            raise UnknownName("mode of operation", mode, [f"Mode.{each.name}" for each in Mode])
        if await self._read(cia402.MODE_DISPLAY) != mode:
            await self._write(cia402.MODE, mode)
            shown, is_chosen = await self._poll(within, lambda shown: shown == mode, cia402.MODE_DISPLAY)
            if not is_chosen:
                is_ = cia402.MODE_WORDS.get(shown, f"mode {shown}")
                raise DriveError(f"{self._name}: {cia402.MODE_WORDS[mode]}: it stays in {is_}")

    async def _begin_home(self, method: int | None = None) -> None:
        """Enable the drive and start homing as `home` does, without waiting for the end."""
        if not (method is None or method in METHODS or (isinstance(method, int) and method <= 0)):
            raise LocalError(f"{method!r} is not a homing method of CiA 402; known: {KNOWN_METHODS}")
        if method is not None:
            await self._write(cia402.HOMING_METHOD, method)
        await self._enter(Mode.HOMING)
        await self._command(DriveCommand.ENABLE)  # the start is a rising edge
        await self._command(DriveCommand.ENABLE, cia402.HOMING_START)

    async def _home(self, method: int | None = None, within: float = MOTION_WAIT) -> None:
        """Enable the drive and home it by a method of CiA 402 or a negative one of its maker (None: the set one)."""
        async with self._watched():
            await self._begin_home(method)
            # Both bits, as with bit 12 alone the axis is still moving (CiA 402-2, clause 11).
            done = cia402.BIT_12 | cia402.TARGET_REACHED
            is_ours = partial(self._check_command, "home", Mode.HOMING)
            word = await self._until(
                "home", within, lambda word: word & done == done or bool(word & cia402.BIT_13), is_ours
            )
        if word & cia402.BIT_13:
            raise DriveError(f"{self._name}: home: homing error (statusword 0x{word:04X})")
        await self._command(DriveCommand.ENABLE)

    async def _begin_move(
        self, position: int, velocity: int | None = None, *, relative: bool = False, within: float = ENABLE_WAIT
    ) -> int | None:
        """Enable the drive and start a move; it has `within` seconds to accept the set-point.

        Returns:
            The position at its end; None if only the drive knows it, as of a distance from its last set-point.
        """
        if relative and await self._state() is State.ENABLED:
            # The drive itself would count from its last set-point, which a halted move has not reached.
            position = await self._read(cia402.POSITION) + position
            relative = False
        await self._enter(Mode.PROFILE_POSITION)
        # Halted until the new set-point is there, as an interrupted move would go on to the former one.
        await self._command(DriveCommand.ENABLE, cia402.HALT)
        if velocity is not None:
            await self._write(cia402.PROFILE_VELOCITY, velocity)
        await self._write(cia402.TARGET_POSITION, position)
        # At once, without first reaching a set-point that an interrupted program left.
        bits = cia402.NEW_SET_POINT | cia402.AT_ONCE | cia402.RELATIVE * relative
        await self._command(DriveCommand.ENABLE, bits)
        is_ours = partial(self._check_command, "move", Mode.PROFILE_POSITION)
        await self._until("move", within, lambda word: bool(word & cia402.BIT_12), is_ours)
        await self._command(DriveCommand.ENABLE)
        return None if relative else position

    async def _move(
        self, position: int, velocity: int | None = None, *, relative: bool = False, within: float = MOTION_WAIT
    ) -> None:
        """Enable the drive, move to a position, or by a distance if `relative`, and wait for the end.

        The distance counts from where it is. Raises DriveError if it does not end at its target: it stands at a limit,
        or another program moves the drive.
        """
        if not isinstance(position, int):  # before the drive is enabled
            raise LocalError(f"a position is a whole number, not {position!r}")
        async with self._watched():
            begin = await self._read(cia402.POSITION)
            target = await self._begin_move(position, velocity, relative=relative, within=within)
            await self._until_reached(position if target is None else target, within)
            if target is not None:
                await self._check_arrival(begin, target)

    async def _until_reached(self, target: int, within: float) -> None:
        """Wait until the drive reports its target reached; raises DriveError, also if it stands at a limit."""
        clock = self._node.master.clock
        end, place, unmoved = clock() + seconds(within), inf, Held()
        is_ours = partial(self._check_command, "move", Mode.PROFILE_POSITION, cia402.TARGET_POSITION, target)
        while not _has_reached(word := await self._until("move", within, _has_reached_or_is_limited, is_ours)):
            position = await self._read(cia402.POSITION)
            is_same = abs(position - place) <= NOISE
            unmoved.take(is_same, clock())
            place = place if is_same else position
            if unmoved.span >= AT_LIMIT or clock() >= end:
                raise DriveError(f"{self._name}: move: it stands at {position}; {await self._said(word)}")
            await self._node.master.pump.steps(POLL)

    async def _check_arrival(self, begin: int, target: int) -> None:
        """Check that the drive is where it was sent; raises DriveError.

        It may be off by its position window, or else by a hundredth of the way.
        """
        window = await self._read_optional(cia402.POSITION_WINDOW) or 0
        allowed = max(NOISE, window if window < NO_WINDOW else 0, abs(target - begin) // 100)
        round_ = await self._positions()

        def is_there(position: int) -> bool:
            off = abs(position - target)
            return min(off, abs(round_ - off)) <= allowed

        position, arrived = await self._poll(BEGINS, is_there, cia402.POSITION)
        if not arrived:
            said = await self._said(await self._read(cia402.STATUSWORD))
            raise DriveError(f"{self._name}: move: it stands at {position}, not at {target}; {said}")

    async def _positions(self) -> int:
        """Return the number of positions of an axis that counts round (0x607B), 0 for any other."""
        try:
            ends = [await self._node.upload.steps((cia402.POSITION_RANGE + self._offset, sub)) for sub in (1, 2)]
        except NodeRefused:
            return 0
        low, high = [int.from_bytes(each[:4], "little", signed=True) for each in ends]
        return high - low + 1 if low < high else 0

    async def _check_turning(self, velocity: int) -> None:
        """Check that the drive still turns as it was told to by `velocity`; raises DriveError."""
        await self._check_state("turn", await self._read(cia402.STATUSWORD))
        await self._check_command("turn", Mode.PROFILE_VELOCITY, cia402.TARGET_VELOCITY, velocity)

    async def _turn(self, velocity: int) -> None:
        """Enable the drive and turn it at a velocity, in profile velocity mode."""
        if not isinstance(velocity, int):
            raise LocalError(f"a velocity is a whole number, not {velocity!r}")
        await self._begin(cia402.TARGET_VELOCITY, velocity, Mode.PROFILE_VELOCITY)

    async def _begin_torque(self, torque: int) -> None:
        """Enable the drive with a target torque in thousandths of the rated one (CiA 402-2, clause 15)."""
        await self._begin(cia402.TARGET_TORQUE, torque, Mode.PROFILE_TORQUE)

    async def _begin(self, target: int, value: int, mode: Mode) -> None:
        async with self._watched():
            if await self._state() is State.ENABLED:
                # Before the mode, as the drive would start with the old value.
                await self._write(target, value)
                await self._choose(mode)
            else:
                await self._enter(mode)
                await self._write(target, value)
            # Clears bits 4 to 6 and 8, which the former mode may have set.
            await self._command(DriveCommand.ENABLE)


def _has_reached(word: int) -> bool:
    # While bit 12 is set, "target reached" may belong to the set-point before.
    return word & (cia402.TARGET_REACHED | cia402.BIT_12) == cia402.TARGET_REACHED


def _has_reached_or_is_limited(word: int) -> bool:
    return _has_reached(word) or bool(word & cia402.INTERNAL_LIMIT)


def _has_left(state: State | None, word: int) -> bool:
    return cia402.state_of(word) is not state


class Drive402(DriveAtNode):
    """A drive on a `Network`: `device.drive402`.

        drive = network[5].drive402
        drive.enable()
        drive.home(method=35)
        drive.move_to(20_000, velocity=500)

    Positions and velocities are in the drive's units, `within` is in seconds. Calls that wait raise DriveError if the
    drive has a fault or takes too long, and NodeRefused, NoAnswer or BusError. A motion that is given up, as by Ctrl-C,
    is halted.
    """

    @property
    def state(self) -> State | None:
        """The state of the drive; None for a statusword that does not belong to any state."""
        return finished(self._state())

    @property
    def status(self) -> DriveStatus:
        """What the drive reports about itself."""
        return finished(self._status())

    @property
    def position(self) -> int:
        """The position of the drive (0x6064)."""
        return finished(self._read(cia402.POSITION))

    @property
    def velocity(self) -> int:
        """The velocity (0x606C); setting it enables the drive and turns it at that velocity (profile velocity mode)."""
        return finished(self._read(cia402.VELOCITY))

    @velocity.setter
    def velocity(self, velocity: int) -> None:
        finished(self._turn(velocity))

    enable, disable = blocking(DriveAtNode._enable), blocking(DriveAtNode._disable)
    bring_to, choose = blocking(DriveAtNode._bring_to), blocking(DriveAtNode._choose)
    quick_stop, halt = blocking(DriveAtNode._quick_stop), blocking(DriveAtNode._halt)
    fault_reset = blocking(DriveAtNode._fault_reset)
    home, move_to = blocking(DriveAtNode._home), blocking(DriveAtNode._move)
    begin_home, begin_move = blocking(DriveAtNode._begin_home), blocking(DriveAtNode._begin_move)
    begin_torque = blocking(DriveAtNode._begin_torque)
    check_turning = blocking(DriveAtNode._check_turning)


class AsyncDrive402(DriveAtNode):
    """A drive on an `AsyncNetwork`: what Drive402 has, awaited; `await drive.turn(500)` sets its velocity."""

    @property
    async def state(self) -> State | None:
        """The state of the drive; None for a statusword that does not belong to any state."""
        return await self._state()

    @property
    async def status(self) -> DriveStatus:
        """What the drive reports about itself."""
        return await self._status()

    @property
    async def position(self) -> int:
        """The position of the drive (0x6064)."""
        return await self._read(cia402.POSITION)

    @property
    async def velocity(self) -> int:
        """The velocity of the drive (0x606C)."""
        return await self._read(cia402.VELOCITY)

    enable, disable = DriveAtNode._enable, DriveAtNode._disable
    bring_to, choose = DriveAtNode._bring_to, DriveAtNode._choose
    quick_stop, halt = DriveAtNode._quick_stop, DriveAtNode._halt
    fault_reset, turn = DriveAtNode._fault_reset, DriveAtNode._turn
    home, move_to, check_turning = DriveAtNode._home, DriveAtNode._move, DriveAtNode._check_turning
