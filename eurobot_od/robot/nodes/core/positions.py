"""The positions of all robots, which the core asks for periodically.

A drive that has booted answers "unknown", and once it is configured its start place. So `place`, where the drive was
last really seen, is kept apart from the sightings; while it `is_astray` its answers do not replace that place.
"""

from __future__ import annotations

from collections import defaultdict
from functools import partial

from eurobot_od.device.bound import seconds
from eurobot_od.pdo.kinds import Message, OutOfRange
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Place
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes.core.distrust import Distrust, jumps
from eurobot_od.robot.nodes.core.losses import Losses
from eurobot_od.robot.nodes.core.settings import CoreSettings
from eurobot_od.robot.nodes.core.stops import Stops
from eurobot_od.robot.nodes.estimate import DriveAnswer, SecondDriveDetector, Sighting, Track

OFFSETS = {
    each: seconds(f"Position polling.{each.record.replace('position', 'offset')}") for each in messages.POSITIONS
}
"""The setting with the offset of each position's requests."""


class Positions:
    """The last known positions of robots, and the periodic requests for them.

    `sightings` are the last ones by response type, `tracks` the tracks made from them. `place` is where the drive was
    last seen, at the time `seen_at`. It `has_jumped` if it reported a place that it cannot have driven to.
    """

    def __init__(self, core: CoreSettings, stops: Stops, losses: Losses, distrust: Distrust) -> None:
        self._core = core
        self._stops = stops
        self._losses = losses
        self._distrust = distrust
        self.sightings: dict[type[messages.PositionResponse], Sighting] = {}
        self.tracks: defaultdict[Source | OutOfRange, Track] = defaultdict(Track)
        self.place: Place | None = None
        self.seen_at: float | None = None
        self.is_astray = self.has_jumped = False
        self._second_drive = SecondDriveDetector()
        self._series = 0

    # Asking

    def ask_from(self, begin: float, configuration: messages.StartConfigurationSet) -> None:
        """Ask periodically for the positions of all robots that a start configuration names."""
        self._series += 1  # an earlier series of requests ends by itself
        # With the 2014 robot's offsets, so that not all answers come at once.
        for position, offset in OFFSETS.items():
            if configuration.includes(position.source):
                request = partial(self._ask, position.request, self._series)
                self._core.at(begin + offset.read(self._core.setting), request)

    def _ask(self, request: Message, series: int, due: float) -> None:
        if series != self._series:
            return
        self._core.offer(request)
        self._losses.look_for_navigation()
        # From when it was due, so that delays do not add up. A counter that wrapped around made 655 ms of the 2014
        # robot's 600.
        again = due + self._core.polling_period
        self._core.at(again, partial(self._ask, request, series))

    # Receiving

    def heard(self, position: messages.PositionResponse) -> None:
        """Process a received position."""
        if isinstance(position, messages.KalmanPositionResponse):
            self._look_for_jump(position)
        sighting = self.sightings[type(position)] = Sighting(position, self._core.now)
        self.tracks[position.source].saw(sighting)
        if isinstance(position, messages.KalmanPositionResponse):
            self._look_for_second_drive(position)
            # While the drive is astray its answer may be its start place, which must not replace where it was really
            # seen.
            if position.x is not None and not self.is_astray and not self.has_jumped:
                self.place = position[:3]
                self.seen_at = self._core.now
        else:
            self._losses.heard_navigation()

    def heard_state(self, state: messages.GotoStateResponse) -> None:
        """Process the drive's report on its goto."""
        self._look_for_second_drive(state)

    def _look_for_second_drive(self, answer: DriveAnswer) -> None:
        if two := self._second_drive.heard(answer, self._core.now):
            self._core.alarm(f"two drives answer, and differ; switch one of them off: {two}")

    def _look_for_jump(self, position: messages.KalmanPositionResponse) -> None:
        """Stop if the drive reports a place that it cannot have driven to."""
        before = self.sightings.get(messages.KalmanPositionResponse)
        if before is None or self.is_astray or not self._stops.is_commanding:
            return
        if jumps(before.position[:3], position[:3], self._core.now - before.time):
            self.has_jumped = True
            self._distrust.stop(f"the drive's place has jumped from {before.position[:2]} to {position[:2]}")
