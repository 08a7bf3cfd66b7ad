"""The scripts of the core's flows: startup, goto, stop (document 2.1 to 2.3, 4.2.2, 5.1), and recovery.

Confirms of the start configuration have one identifier and may merge on the wire, so a single confirm may come from
either node. That is why a configuration ends with a second check of both nodes.

A node is driven only if it reads frames as the core does (see `agreement`).

After a loss of a node, of the core's own memory, or of the drive's, the robot's place is found. Rule of this part: ask
before telling. The drive has the start configuration, the place and the match clock, and nothing is sent that could
make it forget them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import suppress
from math import dist, inf
from typing import NamedTuple

from eurobot_od.device.timers import START, Ask, Pause, Script
from eurobot_od.errors import DictionaryError, NoAnswer, RemoteError, StateError
from eurobot_od.od.standard import REVISION
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Place, Point, is_near
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import FAULT_OUTCOME, GotoFault, Outcome, Passage
from eurobot_od.robot.nodes.core.agreement import SdoClientParameter, compare, number_in
from eurobot_od.robot.nodes.core.settings import CoreSettings
from eurobot_od.robot.nodes.node import (
    KEEP_PLACE,
    NO_MATCH,
    PLACE_AGE,
    START_STATE,
    TIME_LEFT,
    UNKNOWN,
    Component,
    KeepPlace,
    StartState,
)

# The startup


CONFIRMING = 0.01
"""Time between two checks whether a team's own node has confirmed, in s."""

CONFIGURED = ("Team colour", "Enemies", "Confederates", "Enemy 1 diameter", "Enemy 2 diameter")
"""The sub-indices of the object `Start configuration`, in the order of the message's fields."""


def check_nodes(core: CoreSettings, without: Collection[str] = ()) -> Script[dict[str, float]]:
    """Check the nodes, except those in `without`; return the seconds that each took to answer.

    Raises NoAnswer, NodeMismatch.
    """
    took = {}
    # Before anything is asked: a node that does not answer now must not count as checked from before.
    core.readiness.checked.clear()
    yield START
    for node, part in core.parts.items():
        if node in without:
            continue
        # Answers are told apart by their identifiers: in 2014 either node's answer satisfied either check.
        asked = core.now
        yield _check_of(core, node, part)
        took[node] = core.now - asked
        yield from compare(core, node)
        core.readiness.checked.add(node)
    return took


def _check_of(core: CoreSettings, node: str, part: Component) -> Ask:
    if part.check is None or part.answer is None:
        channel = channel_to(core, node)
        return Ask(channel.ask(REVISION), channel.answer, core.check_wait, core.check_attempts)
    return Ask(part.check, part.answer, core.check_wait, core.check_attempts)


def channel_to(core: CoreSettings, node: str) -> SdoClientParameter:
    """Return the identifiers by which the core reaches a node by SDO; raises StateError if its EDS has none."""
    channel = SdoClientParameter.to(node, core.device)
    if channel is None:
        raise StateError(f"the core cannot ask the {node} by SDO: name it in `asks` of the core in the protocol table")
    return channel


def configure(core: CoreSettings, configuration: messages.StartConfigurationSet) -> Script[float]:
    """Set the start configuration, and check both nodes again; return the time of its confirm.

    Raises NoAnswer, NodeMismatch.
    """
    yield START
    # Until the confirm it is unknown which configuration the nodes use.
    core.readiness.configured = False
    core.readiness.confirms.clear()
    wait, transmissions = core.configuration_wait, core.configuration_transmissions
    yield Ask(configuration, messages.StartConfigurationConfirm, wait, transmissions)
    confirmed = core.now
    for node, confirm in core.confirming():
        end = core.now + wait
        while confirm not in core.readiness.confirms and core.now < end:
            yield Pause(CONFIRMING)
        if confirm not in core.readiness.confirms:
            # By SDO, as a second Start Configuration Set would have the drive start over once more.
            yield from tell(core, node, configuration)
    # A confirm may come from either node, and two equal ones merge on the wire, so both nodes are checked once more.
    yield from check_nodes(core, core.without)
    core.readiness.configured = True
    return confirmed


def take_back(core: CoreSettings, node: str, configuration: messages.StartConfigurationSet) -> Script[None]:
    """Ask a lost node until it answers, and configure it, while the drive keeps driving; raises NodeMismatch."""
    yield START
    while True:
        with suppress(NoAnswer):
            yield _check_of(core, node, core.parts[node])
            break
    yield from compare(core, node)
    # No SDO, or a file that has the configuration in other pieces.
    with suppress(NoAnswer, StateError, DictionaryError):
        yield from tell(core, node, configuration)
    core.readiness.checked.add(node)


def tell_others(core: CoreSettings, configuration: messages.StartConfigurationSet) -> Script[None]:
    """Configure all nodes that take a start configuration, except the drive."""
    if "navigation" not in core.without:
        # No SDO, or a file that has the configuration in other pieces.
        with suppress(NoAnswer, StateError, DictionaryError):
            yield from tell(core, "navigation", configuration)
    for node, _ in core.confirming():
        yield from tell(core, node, configuration)


def tell(core: CoreSettings, node: str, configuration: messages.StartConfigurationSet) -> Script[None]:
    """Configure one node alone; raises NoAnswer, and StateError if the core cannot reach it by SDO.

    A Start Configuration Set would reset the drive's estimate to its start place, so each sub-index is written.
    """
    channel = channel_to(core, node)
    protocol = core.device.protocol
    _, raw = protocol.unpack(*protocol.encode(configuration))
    for name, field in zip(CONFIGURED, configuration._fields):
        order = channel.order(core.device.dictionary, f"Start configuration.{name}", raw[field])
        yield Ask(order, channel.answer, core.identity_wait, 1)


class GotoReport(NamedTuple):
    """The result of a goto, and `why` if the outcome does not explain it.

    Times are in seconds from its first transmission; `confirmed` is None if it was never confirmed. `deviation` is how
    well a drive that has arrived knows its place, as a standard deviation in mm; None if it does not report that.
    """

    goto: messages.GotoXY
    outcome: Outcome
    confirmed: float | None
    ended: float
    why: str = ""
    deviation: int | None = None


class End(NamedTuple):
    """The outcome of a goto, and the reason if the outcome does not explain it."""

    outcome: Outcome
    why: str = ""


def until_ended(core: CoreSettings, goto: messages.GotoXY) -> Script[End]:
    """Ask for the state of a confirmed goto until it has ended; raises NoAnswer.

    It has arrived when the drive reports so and is at the goto's place. A few answers in a row that there is no goto,
    or that another one has arrived, are accepted: the drive may have received a request before its goto.
    """
    yield Pause(core.first_state_request)
    odd: list[str] = []
    while len(odd) < core.lost_after:
        state = yield core.ask_drive(messages.GotoStateRequest(), messages.GotoStateResponse)
        if state.time in FAULT_OUTCOME:
            is_refused = state.time is GotoFault.NOT_POSSIBLE
            return End(FAULT_OUTCOME[state.time], why_not_possible(core.facts, goto) if is_refused else "")
        if state.time == 0:
            # The 0 may belong to an earlier goto: the place has to agree.
            place = yield from drive_position(core)
            if is_near(goto[:3], place[:3], core.arrival_distance, core.arrival_angle):
                return End(Outcome.ARRIVED)
            odd.append(f"the drive has arrived at ({place.x}, {place.y}) {place.angle} deg")
        elif state.time is None:
            odd.append("the drive knows of no goto")
        else:
            # In a row: a single odd answer between good ones has come out of turn.
            odd.clear()
        yield Pause(core.state_request_period)
    return End(Outcome.LOST, odd[-1])


def why_not_possible(facts: Facts, goto: messages.GotoXY) -> str:
    """Return the probable reason of a drive that refuses a goto: its answer has one code for all reasons."""
    goal = Point(goto.x, goto.y)
    field = facts.field
    if not goto.speed:
        return "at speed 0 no place is reached"
    if not field.contains(goal):
        return f"({goto.x}, {goto.y}) is outside the field of {field.width:g} x {field.height:g} mm"
    for barrier, passage in facts.flagged(goto.barriers):
        if passage is Passage.FORCED and dist(barrier.point, goal) < barrier.kind.radius:
            return f"({goto.x}, {goto.y}) is inside {barrier.name}, which is forced"
    return "no way there keeps clear of border and forced barriers, or the drive is unsure of its place"


def drive_position(core: CoreSettings) -> Script[messages.KalmanPositionResponse]:
    """Ask the drive for the filtered position of our robot; raises NoAnswer."""
    answer: messages.KalmanPositionResponse = yield core.ask_drive(
        messages.KalmanPositionRequest(), messages.KalmanPositionResponse
    )
    return answer


# Stops that are seen to work


class Standstill(NamedTuple):
    """Where the robot was seen to stand, and how many seconds after the stop."""

    position: messages.KalmanPositionResponse
    seconds: float


class NotStanding(RemoteError):
    """The robot was not seen to stand, whatever was sent; `seconds` is how long the core has tried."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        text = "the robot was told to stop and was not seen to stand"
        super().__init__(f"{text} within {seconds:.1f} s; Emergency Shutdown is being sent")


def is_driving(state: messages.GotoStateResponse) -> bool:
    """Return whether the answer to a state request reports a goto under way."""
    return isinstance(state.time, int) and not isinstance(state.time, GotoFault) and state.time > 0


def until_standing(
    core: CoreSettings, stop: Callable[[], messages.StopMessage], patience: float = inf
) -> Script[Standstill | None]:
    """Send the latest stop again and again until the robot is seen to stand; None after `patience` seconds."""
    began: float = yield START
    while True:
        position = yield from _standing_place(core)
        if position is not None:
            return Standstill(position, core.now - began)
        if core.now - began >= patience:
            return None
        # If only this kind of stop does not get through, another one may.
        for each in dict.fromkeys((stop(), messages.StopDrive())):
            core.offer(each)


def _standing_place(core: CoreSettings) -> Script[messages.KalmanPositionResponse | None]:
    """Watch the drive for two stop periods; return where it stands, None if it moves or does not answer."""
    period = core.stop_period
    ask_position = Ask(messages.KalmanPositionRequest(), messages.KalmanPositionResponse, period, 1)
    yield Pause(period)
    try:
        state = yield Ask(messages.GotoStateRequest(), messages.GotoStateResponse, period, 1)
        # The place twice, a period apart: a drive that is still rolling to a stop says "no goto" as well.
        before = yield ask_position
        yield Pause(period)
        after = yield ask_position
    except NoAnswer:
        return None
    moved = not is_near(before[:3], after[:3], core.standstill_distance, core.standstill_turn)
    return None if moved or is_driving(state) else after


class Memory(NamedTuple):
    """What the drive remembers for a core that has begun again.

    `place` is where the drive is, mm and degrees; `time_left` is the time to the end of the match in s, None if no
    match was started; `shut_down` tells whether the drive holds its safe state.
    """

    configuration: messages.StartConfigurationSet
    place: Place
    time_left: float | None
    shut_down: bool


NOTHING_TO_GO_BACK_TO = "there is nothing to go back to: call check_nodes() and configure_start()"
"""The drive knows no place from which the robot could go on."""


def recall(core: CoreSettings) -> Script[Memory | None]:
    """Ask the drive what it remembers; None if it was not configured since it booted, or has no SDO.

    Raises NoAnswer if it does not answer at all.
    """
    yield START
    for _ in range(2):
        try:
            return (yield from _memory(core))
        except NoAnswer:  # twice from a drive without SDO, and once from one that hung meanwhile
            yield from drive_position(core)
    return None


def _memory(core: CoreSettings) -> Script[Memory | None]:
    state = yield from _asked_drive(core, START_STATE)
    if state is None or state == StartState.UNCONFIGURED:
        return None
    raw = {}
    for name, field in zip(CONFIGURED, messages.StartConfigurationSet._fields):
        raw[field] = (yield from _asked_drive(core, f"Start configuration.{name}")) or 0
    left = yield from _asked_drive(core, TIME_LEFT)
    here = yield from drive_position(core)
    if here.x is None:
        return None
    binding = core.device.protocol.binding(messages.StartConfigurationSet)
    configuration = binding.decode(binding.pack(raw))
    assert isinstance(configuration, messages.StartConfigurationSet)
    time_left = None if left is None or left == NO_MATCH else left / 1000
    return Memory(configuration, here[:3], time_left, state == StartState.SHUT_DOWN)


def _asked_drive(core: CoreSettings, name: str) -> Script[int | None]:
    """Ask the drive for an object; None if the core has no channel or the drive no such object. Raises NoAnswer."""
    channel = SdoClientParameter.to("drive", core.device)
    if channel is None:
        return None
    address = core.device.dictionary.address(name)
    # A drive that may have no SDO, by a setting, is asked only once.
    attempts = 1 if core.trusts_without_sdo else core.transmissions
    answer = yield Ask(channel.ask(address), channel.answer, core.identity_wait, attempts)
    return number_in(answer, address)


def tell_drive(core: CoreSettings, name: str, value: int, attempts: int) -> Script[bool]:
    """Write an object of the drive; return whether the drive has answered."""
    yield START
    channel = SdoClientParameter.to("drive", core.device)
    if channel is None:
        return False
    order = channel.order(core.device.dictionary, name, value)
    with suppress(NoAnswer):
        yield Ask(order, channel.answer, core.identity_wait, attempts)
        return True
    return False


ANY_ANGLE = 180.0
"""Largest angle between two headings, in degrees."""

AT_START = 50.0
"""A configured drive this near to its start place, in mm, may not have been seen by the navigation yet."""

LOOKS = 3
"""How often the navigation is asked for the place of a drive that has booted: the drive believes it when two positions
agree, and one of them may be unknown or wrong.
"""

LOST_PLACE = "the drive has lost its place"


def keep_place(core: CoreSettings) -> Script[None]:
    """Make the drive keep its known place at the next configuration; one without SDO will start over.

    So will any other one if the core's setting `Keep place` is 0.

    Raises NoAnswer if the drive does not answer at all: configured now, it might forget its place.
    """
    yield START
    what = KeepPlace.KEEP if core.keeps_place else KeepPlace.START_OVER
    if not (yield from tell_drive(core, KEEP_PLACE, what, core.transmissions)):
        yield from drive_position(core)  # raises NoAnswer: a missing drive is not a drive without SDO


def _is_confirmed(core: CoreSettings, since: float) -> Script[bool]:
    """Return whether drive and navigation have agreed on the place since a time in s."""
    with suppress(NoAnswer):
        age = yield from _asked_drive(core, PLACE_AGE)
        return age is not None and age != UNKNOWN and age / 1000 <= core.now - since
    return False  # a drive without SDO


class PlaceLost(StateError):
    """The drive is not where it was last seen, and the navigation sees it somewhere else than it reports."""


def find_place(
    core: CoreSettings,
    there: Place | None,
    start: Place,
    displacement: float,
) -> Script[messages.KalmanPositionResponse]:
    """Ask the navigation for the drive's place, and check that it is where it was last seen (`there`), if it was.

    Raises NoAnswer; PlaceLost if the drive is farther than the `displacement` in mm away, or so near its `start` place
    that it may just have begun there, and no position of the navigation has agreed with it since.
    """
    began = core.now
    for _ in range(LOOKS):
        core.offer(messages.NaviPositionRequest())
        # The drive receives the answers itself (document 4.2.2 Navigation), so none is awaited here.
        yield Pause(core.state_request_period)
    here = yield from drive_position(core)
    if there is None:
        return here
    moved = not is_near(there, here[:3], displacement, ANY_ANGLE)
    unseen = is_near(start, here[:3], AT_START, ANY_ANGLE) and not is_near(start, there, AT_START, ANY_ANGLE)
    if (moved or unseen) and not (yield from _is_confirmed(core, began)):
        text = f"it was last seen at {there[:2]}, says {here[:2]} now, and the navigation does not see it there"
        raise PlaceLost(
            f"{LOST_PLACE}: {text}; whoever has put the robot at its start place says so: configure_start()"
        )
    return here
