"""The simulated nodes of the packaging line: they answer what they are asked, and arrive when their way is done."""

from __future__ import annotations

from typing import Any, ClassVar

from eurobot_od.device.bound import BoundObject, setting
from eurobot_od.device.node import Node
from tests.kit.plant import messages as m


class Panel(Node):
    """Commands the others by a program's calls alone."""

    CATALOGUE = m.CATALOGUE


class Lift(Node):
    """Moves to a place in a straight line; the newest move wins."""

    CATALOGUE = m.CATALOGUE
    maximum_speed = setting("Motion.Maximum speed")

    def reset(self) -> None:
        super().reset()
        self.place: tuple[float, float, int] = (0, 0, 0)
        self.begun = self.arrival = 0.0
        self.target = self.place

    def position(self) -> m.PlaceResponse:
        """Return where it is now."""
        whole = self.arrival - self.begun
        part = 1.0 if self.now >= self.arrival or not whole else (self.now - self.begun) / whole
        x, y = (round(old + part * (new - old)) for old, new in zip(self.place[:2], self.target[:2], strict=True))
        return m.PlaceResponse(x, y, self.target[2], m.Source.ENCODER)

    def move(self, order: m.MoveTo) -> m.MoveConfirm:
        self.halt()
        self.target = order.x, order.y, order.angle % 360
        way = max(abs(order.x - self.place[0]), abs(order.y - self.place[1]))
        self.begun, self.arrival = self.now, self.now + way / max(1, self.maximum_speed * order.speed / 100)
        return m.MoveConfirm()

    def halt(self, _: Any = None) -> None:
        here = self.position()
        self.place = self.target = here.x or 0, here.y or 0, here.angle or 0
        self.begun = self.arrival = self.now

    def state(self) -> m.MoveStateResponse:
        """Return how long its move takes."""
        return m.MoveStateResponse(max(0, round(1000 * (self.arrival - self.now))))

    def halted(self) -> None:
        self.halt()

    OBJECTS: ClassVar = {"Move to": BoundObject(write=m.MoveTo), "Place": BoundObject(read=position)}
    HANDLERS: ClassVar = {
        m.MoveTo: move,
        m.HaltAll: halt,
        m.HaltCause: halt,
        m.HaltLift: halt,
        m.MoveStateRequest: lambda lift, _: lift.state(),
        m.PlaceRequest: lambda lift, _: lift.position(),
        m.OrderSet: lambda *_: m.OrderConfirm(),
        m.CheckLiftRequest: lambda *_: m.CheckLiftResponse(),
    }


class Scale(Node):
    """Weighs the same box all the time."""

    CATALOGUE = m.CATALOGUE

    def weight(self) -> m.WeightResponse:
        """Return what is on it."""
        return m.WeightResponse(12.5, 21.5)

    OBJECTS: ClassVar = {"Weight": BoundObject(read=weight)}
    HANDLERS: ClassVar = {
        m.WeightRequest: lambda scale, _: scale.weight(),
        m.OrderSet: lambda *_: m.OrderConfirm(),
        m.CheckScaleRequest: lambda *_: m.CheckScaleResponse(),
    }
