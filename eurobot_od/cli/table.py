"""Commands as rows of a table: a function, and how each of its parameters is given on the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od.cli import options

if TYPE_CHECKING:
    from eurobot_od.cli import ExitStatus


class Parameter(NamedTuple):
    """A parameter of a command's function: what it adds to the command line, and how its value is read there."""

    name: str
    add: Callable[[argparse.ArgumentParser], object]
    read: Callable[[argparse.Namespace], Any]


def option(*names: str, **settings: Any) -> Parameter:
    """Return the parameter of one option or argument, described as for `add_argument`; it is called as its value is."""
    # As argparse derives it; of `-o`, `--output` the long one, which stands last.
    name = settings.get("dest") or names[-1].lstrip("-").replace("-", "_")
    return Parameter(name, lambda parser: parser.add_argument(*names, **settings), attrgetter(name))


JSON = option("--json", dest="as_json", action="store_true", help="print as JSON")
DEVICES = Parameter("devices", options.add_network, options.Devices.of)


def with_emcy(parameter: Parameter) -> Parameter:
    """Return a parameter that adds --emcy as well, the file with the words of error codes."""

    def add(parser: argparse.ArgumentParser) -> None:
        parameter.add(parser)
        options.add_emcy(parser)

    return parameter._replace(add=add)


DECODED = with_emcy(DEVICES)
"""Devices whose frames are decoded."""

BUS = Parameter("open_bus", options.add_bus, options.opener)
RECONNECT = Parameter("reopen", options.add_reconnect, options.reopener)


class CommandRow:
    """A command: its function, whose docstring begins with the line of its help, and the function's parameters."""

    def __init__(self, function: Callable[..., ExitStatus | None], *parameters: Parameter) -> None:
        self.function, self.parameters, self.__doc__ = function, parameters, function.__doc__

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Describe the command line."""
        for each in self.parameters:
            each.add(parser)

    def run(self, arguments: argparse.Namespace) -> ExitStatus | None:
        """Call the function with what the command line says."""
        return self.function(**{each.name: each.read(arguments) for each in self.parameters})
