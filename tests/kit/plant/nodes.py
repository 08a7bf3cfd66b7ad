"""The simulated nodes of the packaging line: they answer what they are asked, and arrive when their way is done."""

from __future__ import annotations

from typing import Any, ClassVar

from eurobot_od.device.bound import BoundObject, setting
from eurobot_od.device.node import Node
from tests.kit.plant import messages as m

HOME = 250.0, 1750.0, 0
"""Where an order finds the lift: mm, mm, degrees."""


class Panel(Node):
    """Commands the others by a program's calls alone."""

    CATALOGUE = m.CATALOGUE


class Lift(Node):
    """Moves to a place; the newest move wins."""

    CATALOGUE = m.CATALOGUE
    maximum_speed = setting("Motion.Maximum speed")

    def reset(self) -> None:
        super().reset()
        self.place: tuple[float, float, int] | None = None
        self.target: tuple[float, float, int] = HOME
        self.begun = self.arrival = 0.0
        self.moves = False

    def order(self, _: m.OrderSet) -> m.OrderConfirm:
        """Go home, which is when it knows its place."""
        self.place = self.target = HOME
        return m.OrderConfirm()

    def position(self) -> m.PlaceResponse:
        """Return where it is now; unknown before the first order."""
        if self.place is None:
            return m.PlaceResponse(None, None, None, m.Source.ENCODER)
        whole = self.arrival - self.begun
        part = 1.0 if self.now >= self.arrival or not whole else (self.now - self.begun) / whole
        x, y = (round(old + part * (new - old)) for old, new in zip(self.place[:2], self.target[:2], strict=True))
        return m.PlaceResponse(x, y, self.target[2], m.Source.ENCODER)

    def move(self, order: m.MoveTo) -> m.MoveConfirm:
        self.halt()
        here = self.place or HOME
        self.moves = True
        self.target = order.x, order.y, order.angle % 360
        way = max(abs(order.x - here[0]), abs(order.y - here[1]))
        self.begun, self.arrival = self.now, self.now + way / max(1, self.maximum_speed * order.speed / 100)
        return m.MoveConfirm()

    def halt(self, _: Any = None) -> None:
        here = self.position()
        if self.place is not None:
            self.place = self.target = here.x or 0, here.y or 0, here.angle or 0
        self.begun, self.arrival, self.moves = self.now, self.now, False

    def state(self) -> m.MoveStateResponse:
        """Return how long its move takes; unknown without one."""
        if not self.moves:
            return m.MoveStateResponse(None)
        return m.MoveStateResponse(max(0, round(1000 * (self.arrival - self.now))))

    def halted(self) -> None:
        self.halt()

    OBJECTS: ClassVar = {
        "Move to": BoundObject(write=m.MoveTo),
        "Move state": BoundObject(read=state),
        "Place": BoundObject(read=position),
    }
    HANDLERS: ClassVar = {
        m.MoveTo: move,
        m.HaltAll: halt,
        m.HaltCause: halt,
        m.HaltLift: halt,
        m.MoveStateRequest: lambda lift, _: lift.state(),
        m.PlaceRequest: lambda lift, _: lift.position(),
        m.OrderSet: order,
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
