"""The summary of a match: frames by message and bus load, counted on the bus and not by the nodes; and touches."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any, NamedTuple

from eurobot_od.bus import frame_bits
from eurobot_od.device.nmt import NmtState
from eurobot_od.errors import UnknownIdentifier
from eurobot_od.frame import Frame
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot.world.bodies import Touch
from eurobot_od.traffic.services import services


@dataclass(frozen=True)
class Summary:
    """Frames by message name in the order of the protocol, other frames, and what followed from them.

    `load` is the share of the time for which the bus was in use at `bitrate`; `errors` are the position errors at the
    arrivals in mm, `reports` those of the gatekeepers, `points` those of each robot that plays. `touches` counts by
    kind what our robot touched; in `at_fault` of them it drove into the other. `failure` is the end of the traceback if
    a strategy raised.
    """

    seconds: float
    bitrate: int
    frames: dict[str, int]
    others: dict[str, int]
    load: float
    errors: list[float] = field(default_factory=list)
    reports: list[str] = field(default_factory=list)
    points: dict[str, int] = field(default_factory=dict)
    touches: dict[str, int] = field(default_factory=dict)
    at_fault: int = 0
    failure: str | None = None

    @property
    def messages_sent(self) -> int:
        """How many of the protocol's messages were on the bus at least once."""
        return sum(map(bool, self.frames.values()))

    def as_data(self) -> dict[str, Any]:
        """Return everything as plain data."""
        return asdict(self) | {"messages_sent": self.messages_sent}

    def __str__(self) -> str:
        counts = self.frames | self.others
        lines = [f"{'message':<32} {'frames':>7}"]
        lines += [f"{name:<32} {count:>7}" for name, count in (counts | {"total": sum(counts.values())}).items()]
        sent = self.messages_sent
        known = len(self.frames)
        lines += ["", f"{sent} of {known} messages in {self.seconds:.1f} s, bus load {self.load:.2%}"]
        if self.errors:
            reached = len(self.errors)
            mean = sum(self.errors) / len(self.errors)
            places = f"{reached} place{'' if reached == 1 else 's'} reached"
            lines.append(f"{places}, position error {mean:.1f} mm on average, {max(self.errors):.1f} mm at most")
        if self.points:
            points = ", ".join(f"{name} {points}" for name, points in self.points.items())
            kinds = ", ".join(f"{count} x {kind}" for kind, count in self.touches.items())
            touched = f"{kinds}; {self.at_fault} of {sum(self.touches.values())} by our fault" if kinds else "none"
            lines += [f"points: {points}", f"touches: {touched}"]
        return "\n".join(lines + [f"gatekeeper: {report}" for report in self.reports])


class FrameCounter:
    """Counts the frames on a bus."""

    def __init__(self, protocol: Protocol) -> None:
        self._protocol = protocol
        self._counts: Counter[str] = Counter()
        self._others: Counter[str] = Counter()
        self._services = services(())
        self._bits = 0

    def count(self, frame: Frame) -> None:
        """Take in one frame."""
        self._bits += frame_bits(frame)
        try:
            self._counts[self._protocol.binding_of(frame.cob_id).name] += 1
        except UnknownIdentifier:
            service = self._services.get(frame.cob_id)
            name = "Other" if service is None else service.name
            # On the wire a boot-up is a heartbeat of the state Initialising (CiA 301, 7.2.8.3.3).
            boot_up = name == "Heartbeat" and frame.data == bytes([NmtState.INITIALISING])
            self._others["Boot-up" if boot_up else name] += 1

    def summary(self, seconds: float, bitrate: int) -> Summary:
        """Return what was counted in `seconds`."""
        # All of them, with 0 for those that never came: what was missing from a match is worth knowing.
        frames = {name: self._counts[name] for name in self._protocol.names()}
        load = self._bits / bitrate / seconds if seconds else 0.0
        return Summary(seconds, bitrate, frames, dict(self._others), load)


# Touches


class Touched(Enum):
    """The kind of thing that was touched."""

    POOL = "pool"
    FIRE = "fire"
    BORDER = "border"
    ROBOT = "robot"
    OTHER = "other thing"


KINDS = {each.value: each for each in Touched} | dict.fromkeys(("ours", "enemy", "confederate"), Touched.ROBOT)
"""The kinds of things, by the first words of their names."""


class RobotTouch(NamedTuple):
    """A touch from the side of one of the two: when, in seconds, what it touched, who drove into whom.

    `at_fault` tells whether the robot drove into the other body, `driven_into` whether that body drove into the robot;
    both may be true, or neither if one was pushed. `forced` tells whether the robot's goto had flagged it as forced.
    """

    time: float
    thing: str
    at_fault: bool
    driven_into: bool
    forced: bool = False

    @property
    def kind(self) -> Touched:
        """What kind of thing it is, by its name: `fire 2`, `border`, `enemy 1`."""
        return KINDS.get(self.thing.partition(" ")[0], Touched.OTHER)

    @property
    def is_wrong(self) -> bool:
        """Whether the robot should have kept off: it was told to, or the thing cannot have got in its way."""
        return self.forced or (self.at_fault and not self.driven_into and self.kind in AVOIDABLE)


AVOIDABLE = (Touched.POOL, Touched.BORDER, Touched.ROBOT)
"""What a robot can keep off; a fire is light, and often has to be passed closely."""


def touches_of(robot: str, touches: Iterable[Touch]) -> list[RobotTouch]:
    """Return the touches of a robot, in order."""
    own = ((each, each.thing if each.robot == robot else each.robot) for each in touches if robot in each[1:3])
    return [RobotTouch(each.time, other, each.is_fault_of(robot), each.is_fault_of(other)) for each, other in own]


def counts(touches: Iterable[RobotTouch]) -> dict[str, int]:
    """Count touches by kind; a kind that was not touched is left out."""
    found = Counter(touch.kind for touch in touches)
    return {kind.value: found[kind] for kind in Touched if found[kind]}
