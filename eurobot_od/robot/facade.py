"""The core node on a live bus, for scripts and the REPL: every call waits for its result.

Each method does what the core's method of the same name does, and waits for it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Mapping
from contextlib import ExitStack
from functools import partial, wraps
from pathlib import Path
from types import MappingProxyType
from typing import Any, Concatenate, ParamSpec, cast

from eurobot_od import loading
from eurobot_od.bus import live as runtime
from eurobot_od.bus.live.event_loop import EndedBySigterm, apart, run
from eurobot_od.device.timers import Call, Result
from eurobot_od.pdo.kinds import Message, MessageT
from eurobot_od.plugin import Plugins
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.node import Actuators, DistanceSensor

Arguments = ParamSpec("Arguments")


def _waited_for(
    method: Callable[Concatenate[Core, Arguments], Call[Result]],
) -> Callable[Concatenate[Robot, Arguments], Result]:
    """Return a method that makes the core's call and waits for its result.

    Ctrl-C cancels the call: a goto then ends with a stop.
    """

    @wraps(method)
    def wait(self: Robot, /, *arguments: Arguments.args, **names: Arguments.kwargs) -> Result:
        call = method(self.core, *arguments, **names)
        try:
            return call.result()
        finally:
            call.cancel()  # no effect on a finished call

    return wait


class Robot:
    """The robot as its core node sees it, on any python-can bus; a context manager.

    ```python
    with Robot("socketcan", "can0") as robot:
        robot.check_nodes()
        robot.configure_start(TeamColour.RED, enemies=1, enemy_1_diameter=30)
        print(robot.goto(1500, 1000, 90, speed=50).outcome)
    ```
    However the block is left, by its end, an exception, Ctrl-C or SIGTERM, the robot is stopped and seen to stand
    before the bus is closed; NotStanding if it was not. A bus that is lost meanwhile is opened again.

    Args:
        interface: name of python-can's interface; default: that of python-can's configuration, else the in-process bus
        channel: the adapter or bus; default: as `interface`
        bitrate: in bit/s; default: as `interface`
        dialect: name or folder of the EDS files; default: as for the commands
        sensor: the robot's distance sensor, which the core reads while it drives
        actuators: what the robot does tasks with
        robot: a team's own, by name or folder (see `loading.find`); its messages go by `send`, `ask`, `hear` and `on`
        settings: numbers in place of those of the core's file, such as `{"Goto handshake.Transmissions": 3}`

    Raises:
        BusError: the bus cannot be opened
        DictionaryError: the EDS files cannot be used
        UnknownName: there is no such robot, dialect or setting
    """

    def __init__(
        self,
        interface: str | None = None,
        channel: str | None = None,
        bitrate: int | None = None,
        dialect: str | Path | None = None,
        sensor: DistanceSensor | None = None,
        actuators: Actuators | None = None,
        robot: str | None = None,
        settings: Mapping[str, int] = MappingProxyType({}),
    ) -> None:
        found = loading.find(robot)
        file = found.dialects.load("core", dialect)
        core = cast(type[Core], Plugins(found).kind(file) if "core" in found.nodes else Core)
        configured = file.configured({file.address(name): value for name, value in settings.items()})
        self.core = core(configured, sensor, actuators)
        opener = partial(runtime.open_bus, interface, channel, bitrate)
        self.live = runtime.Live.node(opener(), self.core, opener=opener)

    def __enter__(self) -> Robot:
        self._leaving = ExitStack()
        sigterm = self._leaving.enter_context(EndedBySigterm())
        self._leaving.enter_context(self.live)
        # Called first, so that a second SIGTERM does not interrupt the stop.
        self._leaving.callback(sigterm.hold)
        return self

    def __exit__(self, *raised: Any) -> None:
        self._leaving.__exit__(*raised)

    def start_match(self, duration: float | None = None) -> None:
        """Start the match; see `Core.start_match`."""
        self.core.start_match(duration)

    def play(self, strategy: Callable[[Core], Coroutine[Any, Any, Result]]) -> Result | None:
        """Run a team's strategy, a coroutine that awaits the core's calls, and return its result.

        The end of the match, after `start_match`, ends it as well, and None is returned. Raises what it raises, and
        ProgramFailed if it hangs. Works in a notebook, too.
        """
        return apart(lambda: run(self._until_match_ends(strategy)))

    async def _until_match_ends(self, strategy: Callable[[Core], Coroutine[Any, Any, Result]]) -> Result | None:
        """Await a strategy, and cancel it when the match ends."""
        loop = asyncio.get_running_loop()
        playing = asyncio.ensure_future(strategy(self.core))
        self.core.at_match_end = lambda: loop.call_soon_threadsafe(playing.cancel)
        try:
            return await playing
        except asyncio.CancelledError:
            if self.core.match_over:
                return None
            raise
        finally:
            self.core.at_match_end = lambda: None

    async def play_async(self, strategy: Callable[[Core], Coroutine[Any, Any, Result]]) -> Result | None:
        """Run a strategy as `play` does, for a program with its own event loop, which goes on meanwhile."""
        return await asyncio.to_thread(self.play, strategy)

    def send(self, message: Message) -> None:
        """Send a message; see `Core.send`."""
        self.core.send(message)

    def on(self, message: type[MessageT], function: Callable[[MessageT], object]) -> Callable[[], None]:
        """Register a function that is called with each message of a type, on the bus's thread; see `Core.on`."""
        return self.core.on(message, function)

    ask = _waited_for(Core.ask)
    hear = _waited_for(Core.hear)
    check_nodes = _waited_for(Core.check_nodes)
    configure_start = _waited_for(Core.configure_start)
    recover = _waited_for(Core.recover)
    goto = _waited_for(Core.goto)
    position = _waited_for(Core.position)
    stop = _waited_for(Core.stop)
    emergency_stop = _waited_for(Core.emergency_stop)
    emergency_shutdown = _waited_for(Core.emergency_shutdown)
    obstacle = _waited_for(Core.obstacle)
    act = _waited_for(Core.act)
