"""The core node: checks the nodes, configures the start, polls positions, sends the drive to places, stops it.

Theory of operation. What takes time is a flow (see `device.timers`): `check_nodes`, `configure_start`, `goto`,
`position` and the stops each begin one and return its call at once. The flow takes its first step in the next `tick`,
and every further one when its answer comes or its wait ends. So any number of flows run at the same time without
threads of their own: a strategy may ask for the position while its goto is under way. There is only one goto, one start
configuration and one watched stop at a time, though; a newer one ends the older one with an error thrown into its flow.

The robot stands whenever nobody can command it. A goto is left alone only if it arrived, was replaced, or was given up
by the drive itself. If anything else ends it (no answer, a caller who has gone, a lost node), Stop Drive is sent. A
stop leaves at once, ends the goto, and is repeated by a flow of its own until the robot is seen to stand (see `goto`);
if it is not, Emergency Shutdown is sent until it is. Only a goto or a start configuration ends that watch: a goto when
it is really sent, and a configuration that fails resumes it.

A node that was lost may have forgotten everything. So the next goto begins with its recovery: checks, a configuration
if the drive has forgotten its own, and a look at whether the drive is where it was last seen. `_place` is that place.
It is kept apart from the sightings, as a drive that has booted says "unknown", and once it is configured its start
place; `_astray` tells that it does.

In a match the robot does without the navigation as long as it can: the drive goes by its wheels, and stops by itself
when its place is too uncertain. Meanwhile a flow asks for the navigation, and takes it back when it answers.

The distance sensor is read while a goto is under way, as nobody reports when something comes into sight, and the robot
stops for what it drives into, as the document demands (4.2.2 Obstacle). This is in the core and not in the strategy: a
strategy that hangs, or was written in a hurry, must not drive into anybody.

A stop has a lower identifier, so it overtakes a goto that still waits in a mailbox: the drive then hears the stop first
and the goto after it. And a drive that was away may take up a goto that was given up long ago. That is why a confirm,
or the state of a goto under way, is answered with a stop when there is no goto any more, and the confirm of a start
configuration after a shutdown with the shutdown.

Calls come from any thread. Under the node's guard nothing is received and no other call begins, so a test and what
follows from it must be under the guard together. Otherwise an Emergency Shutdown from another thread could come in
between, and the goto would drive after it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from typing import Any, ClassVar, NamedTuple

from eurobot_od.device.bound import Application, BoundObject, seconds
from eurobot_od.device.objects import Store
from eurobot_od.device.timers import START, Ask, Call, Flow, Pause, Script, Timer, shielded
from eurobot_od.errors import NoAnswer, RemoteError, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message, MessageT, OutOfRange
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Place
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import Barriers, Direction, Obstacle, Outcome, RobotError, Route, Source, TeamColour
from eurobot_od.robot.nodes import flows, recovery
from eurobot_od.robot.nodes.agreement import NodeMismatch, SdoClientParameter, number_in
from eurobot_od.robot.nodes.doubts import GotoConfirms, jumps
from eurobot_od.robot.nodes.estimate import DriveAnswer, Seen, Sighting, Track, Twins
from eurobot_od.robot.nodes.flows import GotoReport, Standstill
from eurobot_od.robot.nodes.node import (
    DEVIATION,
    KEEP_PLACE,
    LEAVING,
    PLACE_AGE,
    START_STATE,
    TIME_LEFT,
    UNKNOWN,
    Actuators,
    Approach,
    CallingNode,
    CoreSettings,
    Detection,
    DistanceSensor,
    Handlers,
    KeepPlace,
    Loss,
    Objects,
    Readiness,
    StartState,
    age,
    milliseconds_until,
)
from eurobot_od.support.texts import one_line

OFFSETS = {
    each: seconds(f"Position polling.{each.record.replace('position', 'offset')}") for each in messages.POSITIONS
}
"""The setting with the offset at which each position is asked for, again and again."""

SILENCE, QUESTIONS = 2.0, 3
"""In a match, after SILENCE seconds without a word the navigation is asked QUESTIONS times whether it is there: even if
it hangs it may still send heartbeats."""

MATCH_OVER = "the match is over"

CALLS: Mapping[type[Message], str] = {
    messages.GotoXY: "goto",
    messages.StartConfigurationSet: "configure_start",
    messages.StopDrive: "stop",
    messages.EmergencyStop: "emergency_stop",
    messages.EmergencyShutdown: "emergency_shutdown",
}
"""The messages that are sent by a call, which sees to their results."""

ANSWER_WAIT = 0.5
"""Seconds to answer a message of a team's own, by default."""


class _Lost(NamedTuple):
    """A team's own node was lost: what flows hear that wait for it."""

    node: str


class _Ended(Exception):
    """Thrown into a goto's flow to end it; the flow turns it into its report."""

    def __init__(self, outcome: Outcome, why: str = "") -> None:
        self.end = flows.End(outcome, why)


class Core(CallingNode, CoreSettings):
    """The core node (document 2.1 to 2.3, 4.2.2, 5).

    `positions` are the last sightings by response type; `configuration` is the start configuration, None before the
    first was confirmed; `readiness` says what a goto still needs. `shut_down` is True after an Emergency Shutdown until
    a new start configuration, `match_over` from the end of a match until the next one is started. `is_commanding` tells
    whether a goto is under way. `sensor` and `actuators` are the robot's equipment besides the bus, None if it has
    none. `observe` is called with each goto and each task, and its call, when it begins; `at_match_end` when a match is
    over and a stop has gone out; each of `told` with what the strategy says.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        sensor: DistanceSensor | None = None,
        actuators: Actuators | None = None,
        *,
        store: Store | None = None,
        facts: Facts | None = None,
    ) -> None:
        super().__init__(dictionary, store=store, facts=facts)
        self.sensor, self.actuators = sensor, actuators
        self.observe: Callable[[messages.GotoXY | str, Call[Any]], None] = lambda _what, _call: None
        self.at_match_end: Callable[[], object] = lambda: None
        self.told: list[Callable[[str], object]] = []
        self._has_begun = False
        self._forget()
        for _, confirm in self.confirming():
            self.on(confirm, lambda heard: self.readiness.confirms.add(type(heard)))

    def _forget(self) -> None:
        self.configuration: messages.StartConfigurationSet | None = None
        self.positions: dict[type[messages.PositionResponse], Sighting] = {}
        self._tracks: defaultdict[Source | OutOfRange, Track] = defaultdict(Track)
        self.shut_down = self.match_over = False
        self._driving: Flow[GotoReport] | None = None
        self._configuring: Flow[Any] | None = None
        self._standing: Flow[Standstill] | None = None
        self._keeping_on: Flow[Standstill] | None = None
        self._acting: Flow[int] | None = None
        self._missing: Flow[None] | None = None
        self._looking: Timer | None = None
        self._stopped: messages.StopMessage | None = None
        self.readiness, self._absent = Readiness(self.parts), {}
        self._lost = ""
        self._twins = Twins()
        self._place: Place | None = None
        self._place_seen: float | None = None
        self._deviation: int | None = None
        self._tells_deviation = True
        self._telling: Flow[Any] | None = None
        self._recalling: Flow[Any] | None = None
        self._confirms: GotoConfirms | None = None
        self._asked_until = 0.0
        self._has_jumped = self._is_shutdown_ours = self._is_recovering = False
        self._warned: set[str] = set()
        self._astray = False
        self._match: Timer | None = None
        self._match_end: float | None = None
        self._polling = 0
        self._heard = 0.0

    def reset(self) -> None:
        """Give up whatever is going on and forget everything, as after power-on; a goto under way is stopped.

        After an NMT reset the drive is asked for what it remembers of the match; the next goto begins with a recovery.
        """
        driving = self.is_commanding
        super().reset()
        self._forget()
        if driving:
            self._halt(messages.StopDrive())
        if self._has_begun:  # by NMT, and not by power-on: nobody is going to start this core up
            self._recalling = self.begin(self._recall())
        self._has_begun = True

    @property
    def is_commanding(self) -> bool:
        """Whether a goto of this core is under way."""
        return self._driving is not None

    def last_seen(self, whom: Source) -> Seen | None:
        """Return where a robot was last seen; None if it never was.

        Unlike `positions` it leaves out unknown places, and those that the robot cannot have driven to (see
        `sightings`).
        """
        return self._tracks[whom].last

    @property
    def open_calls(self) -> int:
        """The number of calls that have not ended, without the flows that nobody has called for."""
        return super().open_calls - len(self._absent)

    # Calls

    def check_nodes(self) -> Call[dict[str, float]]:
        """Check the drive, then the navigation; the result is the seconds that each took to answer (document 2.3).

        NoAnswer names the node check that nobody answered: the start is then blocked (document 5.1). NodeMismatch
        names a node that does not read frames as the core does. A team's own nodes come after the two.
        """
        return self.begin(flows.check_nodes(self)).call

    def configure_start(
        self,
        team_colour: TeamColour,
        enemies: int = 0,
        confederates: int = 0,
        enemy_1_diameter: int = 0,
        enemy_2_diameter: int = 0,
    ) -> Call[float]:
        """Set the start configuration; the result is the seconds until its confirm (document 2.3).

        Diameters are in cm, 0..50, and 0 for an enemy that is not there. The confirms of drive and navigation have the
        same identifier: one of them is enough, and both nodes are then checked once more. The drive starts over from
        the team's start place, so a goto under way is stopped. Position polling starts after the `Start delay` setting.
        Raises FieldError, NoAnswer; StateError if a newer start configuration or an Emergency Shutdown comes before the
        confirm, or the core is being switched off.
        """
        configuration = messages.StartConfigurationSet(
            team_colour, enemies, confederates, enemy_1_diameter, enemy_2_diameter
        )
        with self.guard:
            self.check_present()
            self.device.transmit(configuration)  # raises if anything is wrong with it, and sends nothing yet
            if wrong := configuration.contradiction():
                raise wrong
            # The older one first: as it fails, it goes back to stopping.
            self.end(self._configuring, StateError("replaced by a newer start configuration"))
            if self.is_commanding:
                self._stop(messages.StopDrive(), Outcome.STOPPED, "a new start configuration")
            self._configuring = self.begin(self._configure_start(configuration, self._no_longer_watched()))
            return self._configuring.call

    def recall(self) -> Call[recovery.Memory | None]:
        """Ask the drive what it remembers of a match; None if it was not configured since it booted, or has no SDO.

        A core that has begun again asks this before it configures anything. Raises NoAnswer.
        """
        with self.guard:
            self.check_present()
            return self.begin(recovery.recall(self)).call

    def recover(self) -> Call[messages.KalmanPositionResponse]:
        """Let the robot go on after an Emergency Shutdown, or after this core has begun again; return where it is.

        A core that remembers nothing asks the drive for the start configuration, the place and the match clock. Then
        the nodes are checked and configured. A drive that knows its place is told to keep it (object 0x210A); any other
        one begins at its start place, until the navigation has seen it twice. The match ends at its time.

        Raises the errors of `check_nodes` and `configure_start`; StateError if neither core nor drive remember a start
        configuration, or if the drive is not where it was last seen and the navigation does not see it there.
        """
        with self.guard:
            self.check_present()
            self.end(self._configuring, StateError("replaced by a recovery"))
            flow = self._configuring = self.begin(self._recover_all(self._no_longer_watched()))
            return flow.call

    def _no_longer_watched(self) -> bool:
        """End the watch over a stop because of a new configuration; return whether there was one."""
        watched = self._standing is not None
        self.end(self._standing, StateError("a new start configuration came before the robot was seen to stand"))
        self.end(self._keeping_on, StateError("a new start configuration"))
        self.positions.clear()
        return watched

    def goto(
        self,
        x: int,
        y: int,
        angle: int,
        speed: int,
        barriers: Barriers = Barriers(0),  # noqa: B008 (immutable)
        direction: Direction = Direction.FORWARD,
        route: Route = Route.PLANNED,
        timeout: float | None = None,
    ) -> Call[GotoReport]:
        """Send the drive to x, y (mm) and angle (degrees) at `speed` percent, and wait for the end (document 2.1).

        It ends as TIMED_OUT at the latest `timeout` seconds after its first transmission (None: the setting
        `Time-out`). A goto that is under way ends as REPLACED. The drive is stopped unless the goto arrived, was
        replaced, or was given up by the drive; also if the call is cancelled.

        If a node has been lost since the last goto, the drive is stopped, and both nodes are checked and configured
        again first. That takes until they answer, at most all attempts of the checks and the configuration. Raises
        FieldError before anything is sent; StateError before both nodes are checked and a start configuration is
        confirmed, after an Emergency Shutdown, after the match, when the core is being switched off, and if the drive
        has lost its place; NoAnswer if the drive does not confirm or report its state, or a lost node does not answer
        its check; NotStanding if the robot does not stand before lost nodes are configured.
        """
        goto = messages.GotoXY(x, y, angle, speed, barriers, direction, route)
        with self.guard:
            self.check_present()
            self.device.transmit(goto)  # raises if anything is wrong with it, and sends nothing yet
            if self._recalling is None:
                self._check_may_drive()
            if self.match_over:
                # Raised when it is awaited: a strategy that catches it in a loop yields, and can be cancelled.
                late: Call[GotoReport] = Call()
                late.set_exception(StateError("no goto after the match"))
                return late
            if self._has_to_recover and self.is_commanding:
                self._stop(messages.StopDrive(), Outcome.REPLACED)  # nobody looks at the drive meanwhile
            self.end(self._driving, _Ended(Outcome.REPLACED))
            # From now on there is something to stop, even if nobody ever hears of this goto again.
            self._driving, self._stopped = self.begin(self._goto(goto, timeout)), messages.StopDrive()
            call = self._driving.call
        self.observe(goto, call)
        return call

    def _check_may_drive(self) -> None:
        """Raise StateError if a goto must not be sent, and say what is missing."""
        if self.shut_down:
            raise StateError("no goto after an emergency shutdown: `await core.recover()` ends it")
        if not self._has_to_recover and not self.match_over and (missing := self.readiness.missing(self.without)):
            raise StateError(f"no goto yet: {missing}")

    def position(self) -> Call[messages.KalmanPositionResponse]:
        """Ask the drive for the filtered position of our robot (document 4.2.2 Position); raises NoAnswer."""
        return self.begin_ask(self.ask_drive(messages.KalmanPositionRequest(), messages.KalmanPositionResponse))

    def loss(self) -> Call[str]:
        """Wait for the loss of a team's own node, or its reboot; the result is the node's name (see `COMPONENTS`)."""
        with self.guard:
            self.check_present()
            return self.begin(self._await_loss()).call

    def _await_loss(self) -> Script[str]:
        yield START
        lost: _Lost = yield Ask(None, _Lost, inf, 1)
        return lost.node

    def obstacle(self) -> Call[Detection | None]:
        """Read the distance sensor: what it sees ahead; None if it sees nothing, or there is no sensor."""
        return self.begin(self._read_sensor()).call

    def act(self, task: str) -> Call[int]:
        """Do a task where the robot stands; the result is in points, or in pieces of fruit.

        Raises StateError if there is nothing to do it with, and if a newer task, an Emergency Shutdown or the end of
        the match comes before it is done; UnknownName.
        """
        with self.guard:
            self.check_present()
            self.end(self._acting, StateError("replaced by a newer task"))
            self._acting = self.begin(self._act_on(task))
            call = self._acting.call
        self.observe(task, call)
        return call

    def stop(self) -> Call[Standstill]:
        """Brake and forget the goto (document 2.1).

        The stop leaves now, whether or not anybody awaits the call. The result comes once the robot is seen to stand;
        NotStanding if that takes longer than the setting `Standstill wait`: then Emergency Shutdown is sent until it
        does. StateError if a goto or a start configuration comes before. Several stops in a row are watched as one.
        """
        return self._stop(messages.StopDrive())

    def emergency_stop(self, obstacle: Obstacle) -> Call[Standstill]:
        """Brake because of an obstacle (document 4.2.2 Obstacle); result and errors are those of `stop`."""
        return self._stop(messages.EmergencyStop(obstacle))

    def emergency_shutdown(self) -> Call[Standstill]:
        """Bring all nodes into their safe state (document 4.2.2 Emergency mushroom); see `stop`."""
        with self.guard:  # a confirm between the two would end the safe state again
            why = "emergency shutdown before the start configuration was confirmed"
            self.end(self._configuring, StateError(why))
            self.end(self._acting, StateError("emergency shutdown"))
            return self._stop(messages.EmergencyShutdown())

    def send(self, message: Message) -> None:
        """Send a message of the robot's table, such as a team's own, without waiting for anything.

        Raises StateError if the core has no TPDO for it, if it is a message that a call sends and watches, such as a
        goto, or if the core is being switched off; FieldError.
        """
        with self.guard:
            self._check_free(message)
            super().send(message)

    def say(self, words: object) -> None:
        """Say something to whoever watches: a line of the match's timeline, and a caption on its field.

        Nothing of it is on the bus.
        """
        for each in self.told:
            each(one_line(str(words)))

    def ask(self, request: Message, answer: type[MessageT], timeout: float = ANSWER_WAIT) -> Call[MessageT]:
        """Send a message, and wait up to `timeout` seconds for one that answers it.

        Raises the errors of `send`, StateError if the core has no RPDO for the answer; NoAnswer.
        """
        with self.guard:
            self._check_free(request)
            self.device.transmit(request)  # raises if anything is wrong with it, and sends nothing yet
            self.device.check_received(answer)
            return self.begin_ask(Ask(request, answer, timeout, 1))

    def hear(
        self, message: type[MessageT], where: Callable[[MessageT], object] | None = None, timeout: float = ANSWER_WAIT
    ) -> Call[MessageT]:
        """Wait up to `timeout` seconds for the next message of a type, or for the next one of which `where` is true.

        Nothing is sent. Raises StateError if the core has no RPDO for such a message; what `where` raises; NoAnswer.
        """
        with self.guard:
            self.device.check_received(message)
            return self.begin(self._hear(message, where, timeout)).call

    def _hear(
        self, message: type[MessageT], where: Callable[[MessageT], object] | None, timeout: float
    ) -> Script[MessageT]:
        yield START
        end = self.now + timeout
        try:
            while True:
                heard: MessageT = yield Ask(None, message, max(end - self.now, 0.0), 1)
                if where is None or where(heard):
                    return heard
        except NoAnswer:  # its time would be what was left after the last one
            raise NoAnswer("", message.__name__ + " as wanted" * (where is not None), 1, timeout) from None

    def start_match(self, duration: float | None = None) -> None:
        """Start the match: after `duration` seconds the drive is stopped, and gotos are no longer sent.

        None takes the setting `Match duration`.
        """
        seconds = self.match_duration if duration is None else duration
        with self.guard:
            self.match_over, self._heard = False, self.now
            self.soon(lambda now: self._end_match_at(now + seconds))
            self._start_clock()

    def _start_clock(self) -> None:
        """Have the drive keep the time of the match, for a core that begins again."""
        self.end(self._telling, StateError("replaced by a newer clock"))
        self._telling = self.begin(self._tell_time_left())

    def _tell_time_left(self) -> Script[bool]:
        yield START
        left = milliseconds_until(self._match_end, self.now)
        return (yield from recovery.tell_drive(self, TIME_LEFT, left, self.transmissions))

    def leave(self) -> Call[Standstill] | None:
        """Stop the drive before the node is switched off, if it was ever sent anywhere; see `stop`.

        From now on gotos and start configurations are refused: they would end the watch over the stop.
        """
        with self.guard:
            self.is_leaving = True
            self.end(self._configuring, StateError(LEAVING))
            return None if self._stopped is None else self.stop()

    def _check_free(self, message: Message) -> None:
        """Raise StateError for a message that only its own call may send, because it watches the result."""
        self.check_present()
        if call := CALLS.get(type(message)):
            raise StateError(f"{type(message).__name__} is sent by core.{call}(), which sees to what comes of it")

    # Stops

    def _stop(self, stop: messages.StopMessage, outcome: Outcome = Outcome.STOPPED, why: str = "") -> Call[Standstill]:
        """Send a stop, end the goto that is under way, and watch until the robot stands."""
        with self.guard:
            call = self._halt(stop)
            self.end(self._driving, _Ended(outcome, why))
            return call

    def _halt(self, stop: messages.StopMessage) -> Call[Standstill]:
        """Send a stop, and watch until the robot stands."""
        with self.guard:
            # Offered, not sent: even if the stop may not leave now, the watch over it must begin.
            self.offer(stop)
            self.shut_down = self.shut_down or isinstance(stop, messages.EmergencyShutdown)
            # After a shutdown nothing less is repeated: a drive that has missed it would not hold its safe state.
            self._stopped = messages.EmergencyShutdown() if self.shut_down else stop
            self._is_shutdown_ours = self.shut_down
            if self._standing is None:
                self.end(self._keeping_on, StateError("watched anew"))
                self._standing = self.begin(self._see_standing(self.standstill_wait))
            return shielded(self._standing.call)  # a stop is not taken back because nobody waits for it

    def _see_standing(self, patience: float = inf) -> Script[Standstill]:
        """Repeat the latest stop until the robot is seen to stand, or for `patience` seconds."""
        standstill = yield from flows.until_standing(
            # `is None`, as a message without data is false.
            self,
            lambda: messages.StopDrive() if self._stopped is None else self._stopped,
            patience,
        )
        if standstill is None:
            error = flows.NotStanding(patience)
            self.alarm(str(error))
            # From here on it is an emergency: Emergency Shutdown until it stands, and no goto before a recovery.
            self.raise_error(RobotError.NOT_STANDING, Standstill)
            self.shut_down = True
            self._keep_stopping()
            self.end(self._driving, error)  # a goto that waits for lost nodes
            raise error
        self.clear_error(Standstill)
        return standstill

    def _keep_stopping(self) -> None:
        """Send Emergency Shutdown until the robot is seen to stand, however long that takes."""
        self._stopped = messages.EmergencyShutdown()
        self.offer(self._stopped)
        if self._keeping_on is None:
            self._keeping_on = self.begin(self._see_standing())

    # Flows

    def _configure_start(
        self, configuration: messages.StartConfigurationSet, watched: bool, in_place: bool = False
    ) -> Script[float]:
        """Configure the start, `in_place`: where the drive knows that it is.

        If that fails, a stop that was `watched` until then is watched again.
        """
        try:
            if in_place:
                yield from recovery.keep_place(self)
            elif self._is_in_match or "drive" in self.readiness.checked:
                # The caller has put the robot at its start place; in a match the drive would not believe it.
                yield from recovery.tell_drive(self, KEEP_PLACE, KeepPlace.START_OVER, 1)
            seconds = yield from self._configure(configuration)
        except BaseException:  # nothing has changed: what had to be stopped still has to be
            if self.shut_down:
                self._keep_stopping()
            elif watched:
                self._halt(messages.StopDrive())
            raise
        # A caller who configures the start has put the robot at its start place, wherever it was seen before.
        self._place, self._astray, self._has_jumped = None, False, in_place and self._has_jumped
        return seconds

    def _configure(self, configuration: messages.StartConfigurationSet) -> Script[float]:
        asked: float = yield START
        before, self._lost = self._lost, ""  # a node that is lost from here on may not have heard of it
        try:
            confirmed = yield from flows.configure(self, configuration)
        except BaseException:
            self._lost = self._lost or before
            raise
        finally:  # confirms may come late, and two nodes confirm
            self._asked_until = self.now + self.configuration_wait * self.configuration_transmissions
        self.configuration, self.shut_down, self._tells_deviation = configuration, False, True
        # The safe state is over, so a late goto is answered with a plain stop again.
        self._stopped = None if self._stopped is None else messages.StopDrive()
        self.clear_error(Standstill)
        self._polling += 1  # an earlier series of requests ends by itself
        begin = confirmed + self.polling_start_delay
        # With the 2014 robot's offsets, so that not all answers come at once.
        for position, offset in OFFSETS.items():
            if configuration.includes(position.source):
                self.at(begin + offset.read(self.setting), partial(self._poll, position.request, self._polling))
        return confirmed - asked

    def _goto(self, goto: messages.GotoXY, timeout: float | None) -> Script[GotoReport]:
        try:
            yield START
            if self._recalling is not None:
                yield from self._until_recalled()
                self._check_may_drive()
            if self.match_over:  # as the drive remembers
                raise StateError("no goto after the match")
            if self._has_to_recover and self.configuration is not None:
                yield from self._recover(self.configuration)
        except _Ended as ended:
            return GotoReport(goto, ended.end.outcome, None, 0.0, ended.end.why)
        return (yield from self._drive(goto, self.goto_timeout if timeout is None else timeout))

    def _drive(self, goto: messages.GotoXY, timeout: float) -> Script[GotoReport]:
        self.end(self._standing, StateError("a new goto came before the robot was seen to stand"))
        for frame in self.device.first_heartbeat():  # from now on the drive has to miss us
            self.put(frame)
        started, confirmed = self.now, None
        self._deviation, self._confirms = None, GotoConfirms(started, self.confirm_wait, self.transmissions)

        def run_out_of_time(_: float) -> None:
            self._stop(messages.StopDrive(), Outcome.TIMED_OUT)

        limit = self.at(started + timeout, run_out_of_time)
        # From the start, not from the confirm: the drive may be rolling while its confirm is lost.
        self._look_ahead(Approach(), started)
        try:
            yield Ask(goto, messages.GotoConfirm, self.confirm_wait, self.transmissions)
            confirmed = self.now - started
            end = yield from flows.until_ended(self, goto)
            if end.outcome is Outcome.ARRIVED:
                self._deviation = yield from self._ask_deviation()
        except _Ended as ended:  # whoever ended it has dealt with the drive
            end = ended.end
        except BaseException:  # no answer, or nobody waits for the goto any more
            self._halt(messages.StopDrive())
            raise
        else:
            if end.outcome is Outcome.LOST:
                self._lost = end.why
                self._halt(messages.StopDrive())
        finally:
            limit.cancel()
            self._look_away()
        return GotoReport(goto, end.outcome, confirmed, self.now - started, end.why, self._deviation)

    def _ask_deviation(self) -> Script[int | None]:
        """Ask the drive how well it knows its place, mm; None if it does not know, or does not say."""
        channel = SdoClientParameter.to("drive", self.device)
        if channel is None or not self._tells_deviation:
            return None
        address = self.device.dictionary.address(DEVIATION)
        try:
            answer = yield Ask(channel.ask(address), channel.answer, self.identity_wait, 1)
        except NoAnswer:
            self._tells_deviation = False  # a drive without SDO would cost each goto this wait
            return None
        deviation = number_in(answer, address)
        return None if deviation == UNKNOWN else deviation

    @property
    def _has_to_recover(self) -> bool:
        """Whether the nodes have to be checked and configured again before the next goto."""
        return bool(self._lost) and self.configuration is not None

    def _recover(self, configuration: messages.StartConfigurationSet) -> Script[None]:
        """Check the nodes again after one was lost, and make sure that the drive knows where it is."""
        self._astray = self._is_recovering = True
        try:
            yield from self._recover_nodes(configuration)
        finally:
            self._is_recovering = False
        self._lost = ""
        yield from self._find_place(configuration, self._place)
        if self._is_in_match:
            self._start_clock()  # a drive that has booted has forgotten it

    def _recover_nodes(self, configuration: messages.StartConfigurationSet) -> Script[None]:
        yield from flows.check_nodes(self, self.without)
        here = yield from flows.drive_position(self)
        # Once configured, a drive believes in its start place until the navigation says otherwise: one that still knows
        # its place is left alone, or told to keep it.
        if here.x is None:
            yield from self._configure(configuration)
        elif not self.readiness.configured:
            yield from recovery.keep_place(self)
            yield from self._configure(configuration)
        else:
            yield from flows.tell_others(self, configuration)

    def _find_place(
        self, configuration: messages.StartConfigurationSet, there: Place | None
    ) -> Script[messages.KalmanPositionResponse]:
        try:
            here = yield from recovery.find_place(
                self,
                there,
                self.facts.start(configuration.team_colour),
                0.0 if self._has_jumped else float(self.displacement),
            )
        except recovery.PlaceLost:
            self._lost = recovery.LOST_PLACE  # so that the next goto looks again
            raise
        self._astray = self._has_jumped = False
        return here

    def _recover_all(self, watched: bool) -> Script[messages.KalmanPositionResponse]:
        yield from self._until_recalled()
        if self.configuration is None:
            yield from self._recall()
        configuration = self.configuration
        if configuration is None:
            raise StateError(recovery.NOTHING_TO_GO_BACK_TO)
        # Kept, although the configuration forgets it: the robot has not been moved to its start.
        there = self._place
        yield from self._configure_start(configuration, watched, in_place=True)
        self._place, self._astray = there, True
        return (yield from self._find_place(configuration, there))

    def _until_recalled(self) -> Script[None]:
        """Wait for the questions that follow an NMT reset."""
        yield START
        while self._recalling is not None:
            yield Pause(self.state_request_period)

    def _recall(self) -> Script[None]:
        """Take over what the drive remembers of the start and of the match; the next goto begins with a recovery."""
        memory = yield from recovery.recall(self)
        if memory is None:
            return
        self.configuration, self._place, self._lost = memory.configuration, memory.place, "the core has begun again"
        self._stopped = messages.StopDrive()
        if memory.shut_down:
            self.shut_down, self._stopped = True, messages.EmergencyShutdown()
        if memory.time_left is not None:
            self._heard = self.now
            self.match_over = memory.time_left == 0
            self._end_match_at(self.now + memory.time_left)
            if not self.match_over:
                yield from self._miss_navigation()  # a match goes on without one

    def _miss_navigation(self) -> Script[None]:
        """Ask a navigation that has been silent for long during a match whether it is there."""
        yield START
        try:
            yield Ask(messages.CheckNaviRequest(), messages.CheckNaviResponse, self.check_wait, QUESTIONS)
            self._heard = self.now
        except NoAnswer:
            self.readiness.checked.discard("navigation")
            self._do_without("navigation", "it does not answer")

    def _take_back(self, node: str, configuration: messages.StartConfigurationSet) -> Script[None]:
        try:
            yield from flows.take_back(self, node, configuration)
            self._heard = self.now  # a navigation that is back gets its time to be heard
            self.alarm(f"the {node} is back")
        except NodeMismatch as error:
            self.alarm(str(error))
            # A node that maps differently is of no use: the next goto begins with the checks, which say so.
            self._lost = str(error)
        finally:
            self._absent.pop(node, None)

    # Sensor and actuators

    def _look_ahead(self, approach: Approach, now: float) -> None:
        """Read the distance sensor again and again; stop for what the robot drives into."""
        self._look_away()
        distance = self.stop_distance
        if self.sensor is None or not distance:
            return
        # Here and not in the strategy: one that hangs, or was written in a hurry, must not drive into anybody (4.2.2
        # Obstacle).
        detection = self.sensor.look(now)
        if approach.meets(detection, distance) and detection is not None:
            why = f"{detection.obstacle.name.lower()} ahead"
            self._stop(messages.EmergencyStop(detection.obstacle), Outcome.STOPPED, why)
        else:
            self._looking = self.at(now + self.sensing_period, partial(self._look_ahead, approach))

    def _look_away(self) -> None:
        if self._looking is not None:
            self._looking.cancel()

    def _read_sensor(self) -> Script[Detection | None]:
        now: float = yield START
        return None if self.sensor is None else self.sensor.look(now)

    def _act_on(self, task: str) -> Script[int]:
        yield START
        if self.actuators is None:
            raise StateError(f"the robot has nothing to do {task} with")
        if self.match_over:
            raise StateError(MATCH_OVER)
        yield Pause(self.actuators.begin(task))
        return self.actuators.finish(task)

    # Match

    def _start_state(self) -> StartState:
        if self.shut_down:
            return StartState.SHUT_DOWN
        return StartState.UNCONFIGURED if self.configuration is None else StartState.CONFIGURED

    @property
    def time_left(self) -> float:
        """Seconds until the core ends the match, infinite if there is none."""
        return inf if self._match_end is None else max(self._match_end - self.now, 0.0)

    def _end_match_at(self, end: float) -> None:
        if self._match is not None:
            self._match.cancel()
        self._match, self._match_end = self.at(end, self._end_match), end

    def _end_match(self, _: float) -> None:
        self.match_over = True
        if "navigation" in self._absent:  # no longer asked for: the next goto recovers it first
            self._lost = "the navigation is lost"
        for flow in (*self._absent.values(), self._acting):
            self.end(flow, StateError(MATCH_OVER))
        self._stop(messages.StopDrive(), Outcome.STOPPED, MATCH_OVER)
        self.at_match_end()

    # Position polling

    def _poll(self, request: Message, series: int, due: float) -> None:
        if series != self._polling:
            return
        self.offer(request)
        is_silent = self._is_in_match and self.now - self._heard >= SILENCE
        if is_silent and "navigation" not in self._absent and self._missing is None:
            self._missing = self.begin(self._miss_navigation())
        # From when it was due, so that delays do not add up. A counter that wrapped around made 655 ms of the 2014
        # robot's 600.
        again = due + self.polling_period
        self.at(again, partial(self._poll, request, series))

    # The other nodes

    def heartbeat_lost(self, node_id: int) -> None:
        """Stop the drive if it is silent, or if the navigation is silent before the match."""
        why = f"node {node_id} has fallen silent"
        if not self._goes_on_without(node_id, why):
            self._lose(why)

    def booted(self, node_id: int) -> None:
        """Have a node that has booted configured before the next goto; a drive that has booted has lost its goto."""
        why = f"node {node_id} has booted"
        if self._goes_on_without(node_id, why):
            return
        self._lost = why
        # A booting navigation forgets nothing that the drive needs; a drive forgets goto, place and configuration, and
        # a node of a team's what it was told.
        if self.is_commanding and self._node(node_id) not in ("", "navigation"):
            self._lose(why)

    def _node(self, node_id: int) -> str:
        """Return the name of a node that is part of the start; '' for any other."""
        for node in self.parts:
            # Only the EDS says which node has which ID: its SDO client parameters (CiA 301, 7.5.2.34).
            channel = SdoClientParameter.to(node, self.device)
            if channel is not None and channel.node_id == node_id:
                return node
        return ""

    def _goes_on_without(self, node_id: int, why: str) -> bool:
        """Cancel a node's check, and tell who waits for its loss; return whether the robot goes on without it."""
        node = self._node(node_id)
        self.readiness.checked.discard(node)
        if node in self.COMPONENTS:
            self.answered(_Lost(node))
        if not node or not self._is_in_match or self.parts[node].loss is not Loss.GO_ON:
            return False
        self._do_without(node, why)
        return True

    def _lose(self, why: str) -> None:
        """Have the next goto begin with a recovery, and stop a drive that was ever sent anywhere."""
        self._lost = why
        if self._stopped is not None:
            self._stop(messages.StopDrive(), Outcome.LOST, why)

    @property
    def _is_in_match(self) -> bool:
        under_way = self._match_end is not None and not self.match_over and not self.shut_down
        return under_way and self.configuration is not None

    def _do_without(self, node: str, why: str) -> None:
        if node not in self._absent and self.configuration is not None:
            # Stopping would cost the rest of the match; the drive stops by itself when its place is too uncertain.
            how = "by its wheels" if node == "navigation" else "without it"
            self.alarm(f"the {node} is lost, and the robot goes on {how}: {why}")
            self._absent[node] = self.begin(self._take_back(node, self.configuration))

    def halted(self) -> None:
        """Stop the drive when a master takes the node out of OPERATIONAL: it cannot ask for its state any more."""
        if self.is_commanding:
            self._stop(messages.StopDrive(), Outcome.STOPPED, "the core was taken out of OPERATIONAL")

    def cut_off(self) -> None:
        """Stop the drive as soon as the bus is back; the next goto begins with a recovery."""
        self._lose("the bus was lost")

    # What nobody has asked for

    def _application(self, dictionary: Dictionary) -> Application:
        """Return what the application gives the objects; the core listens for others who speak in its name."""
        return super()._application(dictionary)._replace(overheard=self._overheard)

    def _overheard(self, frame: Frame) -> None:
        """Take in a frame that somebody else has sent under an identifier of the core's."""
        try:
            message = self.device.protocol.decode(*frame)
        except RemoteError:  # the heartbeat of a second core, or a message that is damaged
            self._distrust("another node uses the core's identifiers; switch it off")
            return
        if isinstance(message, messages.EmergencyShutdown):
            self._stop(message, Outcome.STOPPED, "somebody else sent Emergency Shutdown")
        elif isinstance(message, messages.StopDrive | messages.EmergencyStop) and self.is_commanding:
            self._stop(messages.StopDrive(), Outcome.STOPPED, f"somebody else sent {self._name_of(message)}")
        elif isinstance(message, messages.GotoXY | messages.StartConfigurationSet):
            self._distrust(f"somebody else sent {self._name_of(message)}")

    def _name_of(self, message: Message) -> str:
        return self.device.protocol.name(type(message))

    def _distrust(self, why: str) -> None:
        """Stop for what the core has not asked for; the next goto begins with a recovery."""
        if why not in self._warned:
            self._warned.add(why)
            self.alarm(why)
        self.readiness.configured = self.readiness.configured and self.configuration is None
        self._lose(why)

    def _confirmed_goto(self) -> None:
        if self._confirms is not None and self.is_commanding and not self._confirms.is_asked_for(self.now):
            self._distrust("the drive has confirmed a goto that the core did not send")
        else:
            self._stop_late_goto()

    def _confirmed_configuration(self) -> messages.EmergencyShutdown | None:
        asked = self._configuring is not None or self.now <= self._asked_until
        if self.shut_down and self._configuring is None and self._is_shutdown_ours:
            # A start configuration from before a shutdown, confirmed after it, has ended the safe state.
            return messages.EmergencyShutdown()
        if self.configuration is not None and not asked and not self._is_recovering:
            self.shut_down = False  # the one before this core's time
            self._distrust("somebody else has configured the start")
        return None

    def _look_for_jump(self, position: messages.KalmanPositionResponse) -> None:
        """Stop if the drive says a place that it cannot have driven to."""
        before = self.positions.get(messages.KalmanPositionResponse)
        if before is None or self._astray or not self.is_commanding:
            return
        if jumps(before.position[:3], position[:3], self.now - before.time):
            self._has_jumped = True
            self._distrust(f"the drive's place has jumped from {before.position[:2]} to {position[:2]}")

    # Messages

    def _look_for_twins(self, answer: DriveAnswer) -> None:
        if two := self._twins.heard(answer, self.now):
            self.alarm(f"two drives answer, and differ; switch one of them off: {two}")

    def _told_state(self, state: messages.GotoStateResponse) -> None:
        self._look_for_twins(state)
        if flows.is_driving(state):
            self._stop_late_goto()

    def _stop_late_goto(self) -> None:
        """Stop again if the drive carries out a goto that has ended: the stop overtook it, or it was given up."""
        if self.is_commanding or self._stopped is None:
            return
        self._halt(self._stopped)

    def _saw(self, position: messages.PositionResponse) -> None:
        if isinstance(position, messages.KalmanPositionResponse):
            self._look_for_jump(position)
        sighting = self.positions[type(position)] = Sighting(position, self.now)
        self._tracks[position.source].saw(sighting)
        if isinstance(position, messages.KalmanPositionResponse):
            self._look_for_twins(position)
            # While the drive is astray its answer may be its start place, which must not replace where it was really
            # seen.
            if position.x is not None and not self._astray and not self._has_jumped:
                self._place, self._place_seen = position[:3], self.now
        else:
            self._heard = self.now

    NOBODYS = ("_keeping_on", "_missing", "_telling", "_recalling")
    ONE_AT_A_TIME = ("_driving", "_configuring", "_standing", "_acting", *NOBODYS)
    FACTS: ClassVar[Mapping[str, Callable[[Facts], int]]] = {"Match.Match duration": lambda facts: facts.duration}
    OBJECTS: ClassVar[Objects] = {
        "Goto state": BoundObject(write=messages.GotoStateResponse),
        **{each.record: BoundObject(write=each.response) for each in messages.POSITIONS},
    }
    MEASURED: ClassVar[Mapping[str, Callable[[Any], int]]] = {
        DEVIATION: lambda core: UNKNOWN if core._deviation is None else core._deviation,
        TIME_LEFT: lambda core: milliseconds_until(core._match_end, core.now),
        START_STATE: lambda core: core._start_state(),
        PLACE_AGE: lambda core: age(core._place_seen, core.now),
    }
    HANDLERS: ClassVar[Handlers] = {
        messages.GotoConfirm: lambda core, _: core._confirmed_goto(),
        messages.GotoStateResponse: _told_state,
        messages.StartConfigurationConfirm: lambda core, _: core._confirmed_configuration(),
        **dict.fromkeys((each.response for each in messages.POSITIONS), _saw),
    }
