"""Finds the robot's place after a loss: of a node, of the core's own memory, or of the drive's (see `flows`).

Rule of this file: ask before telling. The drive has the start configuration, the place and the match clock, and nothing
is sent that could make it forget them.
"""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

from eurobot_od.device.timers import START, Ask, Pause, Script
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Place, is_near
from eurobot_od.robot.nodes.core.agreement import SdoClientParameter, number_in
from eurobot_od.robot.nodes.core.flows import CONFIGURED, drive_position
from eurobot_od.robot.nodes.core.settings import CoreSettings
from eurobot_od.robot.nodes.node import (
    KEEP_PLACE,
    NO_MATCH,
    PLACE_AGE,
    START_STATE,
    TIME_LEFT,
    UNKNOWN,
    KeepPlace,
    StartState,
)


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
