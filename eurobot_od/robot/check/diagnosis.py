"""This robot's rules of `diagnose`; its network file says that a goto needs a confirm (`answers`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import hypot

from eurobot_od.lint.findings import Severity
from eurobot_od.pdo.kinds import Message, OutOfRange
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.values import GotoFault, Source
from eurobot_od.traffic.diagnosis.incidents import IncidentRule, ObservedBus, Occurrences, RuleRow, Take, Watcher
from eurobot_od.traffic.meaning import Meaning

STANDS_WITHIN = 0.5
"""Maximum braking time of the drive after a stop, in s."""

HEARS_WITHIN = 0.05
"""For this long after a stop, in s, the drive may still report that the goto goes on."""

STANDS = 20
"""Maximum distance between two measured positions of a standing robot, in mm."""


class EurobotRule(IncidentRule):
    """Rules for the robot of 2014."""

    STOP_NOT_OBEYED = RuleRow(
        Severity.ERROR,
        "The robot drives on after a stop",
        cause="the drive did not hear the stop, does not brake, or is pushed",
        remedy="hit the mushroom; then look whether the drive is OPERATIONAL, and at its errors",
        clause="document, Table 5: Stop Drive",
    )
    POSITION_SOURCE = RuleRow(
        Severity.ERROR,
        "A position has another source than its message",
        cause="two nodes answer the same request, or the sender takes one position for another",
        remedy="look who sends under this identifier: unplug the drive or the navigation",
        clause="document, Table 2: source",
    )

    @property
    def stage(self) -> int:
        return 1


class EurobotWatcher(Watcher):
    """Watches stops, and the sources of positions."""

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._stop: tuple[float, str, Occurrences] | None = None
        self._stands: tuple[int, int] | None = None

    def listener(self, cob_id: int, meaning: Meaning) -> Take | None:
        binding = self.bus.decoder.binding(cob_id)
        kinds = (each for each in TAKES if binding and issubclass(binding.type, each))
        return partial(TAKES[kind], self) if (kind := next(kinds, None)) else None

    def _stopped(self, time: float, meaning: Meaning) -> None:
        if self._stop is None and meaning.message is not None:
            self._stop = (time, meaning.name, Occurrences.once(self.bus.at()))
            self._stands = None

    def _sent_on(self, _: float, meaning: Meaning) -> None:
        if meaning.message is not None:
            self._stop = None

    def _goes_on(self, time: float, meaning: Meaning) -> None:
        left = getattr(meaning.message, "time", None)
        is_under_way = bool(left) and not isinstance(left, GotoFault | OutOfRange)
        if self._stop and is_under_way and time - self._stop[0] > HEARS_WITHIN:
            self._not_obeyed(time, meaning, f"says that {left} ms of its goto remain")

    def _position(self, time: float, meaning: Meaning) -> None:
        message = meaning.message
        if not isinstance(message, messages.PositionResponse):
            return
        x, y, _, source = message
        wanted = messages.SOURCES[type(message)]
        if source is not wanted and isinstance(source, Source):
            text = f"{meaning.name} comes from {source.name.lower()}, not from {wanted.name.lower()}".replace("_", " ")
            self.bus.found(EurobotRule.POSITION_SOURCE, meaning.sender, text, meaning.name)
        is_ours = isinstance(message, messages.KalmanPositionResponse)
        if self._stop is None or not is_ours or x is None or y is None or time - self._stop[0] < STANDS_WITHIN:
            return
        if self._stands is None:
            self._stands = x, y
        elif (way := hypot(x - self._stands[0], y - self._stands[1])) > STANDS:
            self._not_obeyed(time, meaning, f"drives {way:.0f} mm")

    def _not_obeyed(self, time: float, meaning: Meaning, what: str) -> None:
        assert self._stop is not None
        since, stop, seen = self._stop
        self.bus.found(
            EurobotRule.STOP_NOT_OBEYED, meaning.sender, f"{what} {time - since:.1f} s after {stop}", seen=seen
        )
        self._stop = None


TAKES: Mapping[type[Message], Callable[[EurobotWatcher, float, Meaning], None]] = {
    messages.StopDrive: EurobotWatcher._stopped,
    messages.EmergencyStop: EurobotWatcher._stopped,
    messages.EmergencyShutdown: EurobotWatcher._stopped,
    messages.GotoXY: EurobotWatcher._sent_on,
    messages.GotoStateResponse: EurobotWatcher._goes_on,
    messages.PositionResponse: EurobotWatcher._position,
}
"""Handlers of the watched messages, by class."""
