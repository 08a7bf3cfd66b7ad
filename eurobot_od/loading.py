"""Where plug-ins come from, and which of them count: a robot, and any number of device packages.

Ours is found like anybody's. What the user has typed comes first, then what is in the environment, then what is
installed, by an entry point:

- One robot counts: what `--robot` or EUROBOT_OD_ROBOT names, or else the installed one that the network file names by
  `robot:`, or else the installed one: one of somebody else's package before ours. For devices whose files are named,
  and for the program `canopen-workbench`, there is none.
- All device packages count, for devices of their identity: those that `--package` or EUROBOT_OD_PACKAGES names, before
  those that are installed.

A user names an installed plug-in, a folder or file of Python, or a module. Data runs no code: a network file may have
come with somebody's logs, and names what is installed. A plug-in that cannot be loaded is one warning, and what does
not need it goes on; only a robot that the user has named is an error then.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from functools import cache, lru_cache, partial
from importlib import import_module
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od.errors import LocalError, PackageWarning, RobotWarning, UnknownName, look_up
from eurobot_od.od import DEFAULT
from eurobot_od.plugin import NOTHING, Plugin

if TYPE_CHECKING:
    from eurobot_od.client.program import DownloadProcedure
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.traffic.dbc import ForeignMessage


class PluginKind(NamedTuple):
    """A kind of plug-in, `what` it is called, and where one is found.

    `group` is that of its entry points, `variable` the environment's that names it. In a folder it is the `attribute`
    of the module in the `file`. A `warning` says that one is left out.
    """

    what: str
    group: str
    variable: str
    file: str
    attribute: str
    warning: type[RobotWarning]

    def installed(self) -> Mapping[str, Installed]:
        """Return the installed ones by their names."""
        return _installed(self)

    def load(self, name: str) -> Plugin:
        """Load the one that a user names; raises UnknownName, LocalError."""
        if name in self.installed():
            return self.installed()[name].load()
        if (path := Path(name)).is_dir() or path.suffix == ".py":
            return self._of_file(path / self.file if path.is_dir() else path, name)
        from importlib.util import find_spec

        package = name.partition(".")[0]
        if not package.isidentifier() or find_spec(package) is None:
            raise UnknownName(self.what, name, self.installed())
        return self.imported(name, name, name)

    def imported(self, target: str, name: str, file: str) -> Plugin:
        """Import one, `module:attribute`, of which `file` tells; raises LocalError for all that it raises."""
        module, _, attribute = target.partition("[")[0].strip().partition(":")
        what = f"{self.what} {name}"
        with blaming(what, module, file):
            found: object = import_module(module)
            for each in (attribute or self.attribute).split("."):
                found = getattr(found, each, None)
        plugin = _checked(found, f"{what}: {file}: no `{target}` there")
        return plugin if target.startswith(OURS) else Guard(self, what, module, file).plugin(plugin)

    def _of_file(self, file: Path, name: str) -> Plugin:
        from eurobot_od.support import extras

        loaded = extras.load(file)
        found = _checked(getattr(loaded, self.attribute, None), f"{file}: no `{self.attribute}` in it")
        return Guard(self, f"{self.what} {name}", loaded.__name__, str(file)).plugin(found)

    def if_possible(self, load: Callable[[], Plugin]) -> Plugin | None:
        """Return a plug-in; None, and a warning, if it cannot be loaded."""
        try:
            return load()
        except (LocalError, OSError) as error:
            self.warn(f"{error}; going on without it")
            return None

    def warn(self, what: str) -> None:
        """Warn that one is left out."""
        from warnings import warn

        warn(what, self.warning, stacklevel=2)


ROBOTS = PluginKind("robot", "eurobot_od.robots", "EUROBOT_OD_ROBOT", "robot.py", "ROBOT", RobotWarning)
DEVICES = PluginKind(
    "device package", "eurobot_od.devices", "EUROBOT_OD_PACKAGES", "device.py", "DEVICE", PackageWarning
)

NONE = "none"
"""What `--robot` says for the workbench alone."""

OURS = "eurobot_od."
"""What the names of the modules start with that this package brings itself."""


# Which count


def find(name: str | None = None, network: str | Path = DEFAULT, *, alone: bool = False) -> Plugin:
    """Return the robot that is meant: `name`, or the environment's, or the `network` file's, or the installed one.

    `alone`: the installed one does not count. Raises UnknownName; LocalError, with the place, for a named one that
    cannot be loaded, and if several are installed; FileError for the network file.
    """
    return named(name, network) or (NOTHING if alone else the_installed())


def named(name: str | None, network: str | Path = DEFAULT) -> Plugin | None:
    """Return the robot that is named: `name`, or the environment's, or the `network` file's; None without a name.

    Raises as `find`.
    """
    if typed := name or os.environ.get(ROBOTS.variable):
        return _typed(ROBOTS, typed)
    if os.path.isfile(network):  # noqa: PTH113
        from eurobot_od.od.network import read_network  # costs what most commands do not need

        if written := read_network(network).robot:
            return _written(written, Path(network))
    return None


@lru_cache
def _typed(kind: PluginKind, name: str) -> Plugin:
    return NOTHING if name == NONE else kind.load(name)


def _written(name: str, file: Path) -> Plugin:
    """Return the robot that a network file names, none if it is not an installed one that can be loaded."""
    if name == NONE:
        return NOTHING
    if name in ROBOTS.installed():
        return ROBOTS.if_possible(ROBOTS.installed()[name].load) or NOTHING
    path = file.parent / name
    typed = quote(str(path if path.is_dir() else name))
    what = f"{file}: robot: {name} is not an installed robot, and a file runs no code"
    ROBOTS.warn(f"{what}; to run it, set {ROBOTS.variable}, or type --robot {typed}")
    return NOTHING


def the_installed() -> Plugin:
    """Return the robot that counts where none is named; raises LocalError if two do."""
    for ours in (False, True):  # ours last: who has installed a robot of their own means that
        robots = [each for each in ROBOTS.installed().values() if each.is_ours is ours]
        loaded = {each.name: robot for each in robots if (robot := ROBOTS.if_possible(each.load))}
        if len(loaded) > 1:
            raise LocalError(f"several robots are installed: name one by --robot: {', '.join(sorted(loaded))}")
        for robot in loaded.values():
            return robot
    return NOTHING


def packages(named: Sequence[str] = ()) -> tuple[Plugin, ...]:
    """Return the device packages that count: those `named`, those of the environment, and the installed ones."""
    variable = [each for each in os.environ.get(DEVICES.variable, "").split(os.pathsep) if each]
    return _packages(DEVICES, tuple(dict.fromkeys((*named, *variable))))


@lru_cache
def _packages(kind: PluginKind, named: tuple[str, ...]) -> tuple[Plugin, ...]:
    typed: list[Callable[[], Plugin]] = [partial(kind.load, each) for each in named]
    loaders = [*typed, *(each.load for each in kind.installed().values())]
    found = map(kind.if_possible, loaders)
    return tuple(each for each in found if each)


def table_of(name: str) -> Path | None:
    """Return the protocol table of an installed robot, which another table `extends`.

    Raises UnknownName, LocalError: a table is data, and runs no code but what is installed.
    """
    return look_up("installed robot", name, ROBOTS.installed()).load().table


# Installed ones


class Installed(NamedTuple):
    """An installed plug-in: its `name`, where it is (`module:attribute`), and the `file` that says so."""

    kind: PluginKind
    name: str
    target: str
    file: str

    @property
    def package(self) -> str:
        """What pip calls the package that brings it."""
        return Path(self.file).parent.name.partition("-")[0]

    @property
    def is_ours(self) -> bool:
        """Whether this package brings it itself."""
        return self.target.startswith(OURS)

    def load(self) -> Plugin:
        """Import it; raises LocalError, with the place, whatever goes wrong in it."""
        return self.kind.imported(self.target, self.name, self.file)


@lru_cache
def _installed(kind: PluginKind) -> Mapping[str, Installed]:
    found: dict[str, Installed] = {}
    for file, text in _entry_points():
        for line in text.partition(f"[{kind.group}]")[2].partition("\n[")[0].splitlines():
            name, equals, target = map(str.strip, line.partition("="))
            if equals:  # the first one counts, as it does for an import
                found.setdefault(name, Installed(kind, name, target, file))
    return found


@lru_cache
def _entry_points() -> Sequence[tuple[str, str]]:
    """Return the files with entry points and their texts, in the order in which Python looks for packages.

    They are read from where packages have them (PyPA's "Entry points specification"), as `importlib.metadata` takes
    40 ms for that.
    """
    found = []
    for folder in dict.fromkeys(each or os.curdir for each in sys.path):  # "" in `sys.path` is the working folder
        try:
            with os.scandir(folder) as entries:
                files = [f"{each.path}/entry_points.txt" for each in entries if each.name.endswith(".dist-info")]
        except OSError:  # a zip file, or nothing
            continue
        for file in (each for each in files if os.access(each, os.R_OK)):
            with open(file, encoding="utf-8", errors="replace") as text:  # noqa: PTH123 (pathlib takes longer)
                found.append((file, text.read()))
    return found


# What is wrong with one


class Guard(NamedTuple):
    """Keeps what a plug-in raises from ending the program with a traceback: `what` it is, its `module` and `file`.

    What is imported late can be broken, too. A part of a robot then raises LocalError, with the place. Of a device
    package it is left out where all else can go on, and a warning says so once.
    """

    kind: PluginKind
    what: str
    module: str
    file: str

    def plugin(self, plugin: Plugin) -> Plugin:
        """Return a plug-in with all its parts guarded."""
        instead = INSTEAD if self.kind is DEVICES else {}
        called = {name: part for name, part in plugin._asdict().items() if callable(part)}
        parts: dict[str, Any] = {name: self.call(part, instead.get(name)) for name, part in called.items()}
        parts["nodes"] = {name: self.call(kind) for name, kind in plugin.nodes.items()}
        guarded = plugin._replace(**parts)
        if self.kind is not DEVICES:
            return guarded
        # Once each: a function may define its classes anew in each call.
        watchers = cache(lambda: [self._watcher(each) for each in guarded.watchers()])
        panels = cache(lambda: [self.spared(each, OF_PANELS) for each in guarded.panels()])
        program = plugin.program and partial(self._program, guarded)
        return guarded._replace(
            watchers=watchers, panels=panels, frames=partial(self._frames, guarded), program=program
        )

    def call(self, part: Callable[..., Any], instead: Callable[..., Any] | None = None) -> Callable[..., Any]:
        """Return a function that raises LocalError; with `instead` it warns, and returns what that returns."""

        def call(*args: Any) -> Any:
            try:
                with blaming(self.what, self.module, self.file):
                    found = part(*args)
                    return list(found) if isinstance(found, Iterator) else found
            except LocalError as error:
                if instead is None:
                    raise
                self.kind.warn(f"{error}; going on without it")
                return instead(*args)

        return call

    def spared(self, kind: type[Any], methods: Mapping[str, Callable[..., Any] | None]) -> type[Any]:
        """Return a class whose `methods` are guarded as `call` does it, each with what stands in its place."""
        found: dict[str, Any] = {}
        for name, instead in methods.items():
            part = getattr(kind, name)
            of_class = getattr(part, "__func__", None)
            found[name] = classmethod(self.call(of_class, instead)) if of_class else self.call(part, instead)
        return type(kind.__name__, (kind,), found)

    def _watcher(self, kind: type[Any]) -> type[Any]:
        spared = self.spared(kind, OF_WATCHERS)
        listener = spared.listener

        def listening(*args: Any) -> Any:
            take = listener(*args)
            return take and self.call(take, nothing)

        spared.listener = listening
        return spared

    def _program(self, plugin: Plugin) -> DownloadProcedure:
        assert plugin.program is not None
        found = plugin.program()
        found = found._replace(objection=self.call(found.objection))
        return found._replace(crc=self.call(found.crc)) if found.crc else found

    def _frames(self, plugin: Plugin, device: Dictionary) -> Mapping[int, ForeignMessage]:
        found = plugin.frames(device).items()
        return {cob_id: each._replace(fields=self.call(each.fields, INSTEAD["frames"])) for cob_id, each in found}


INSTEAD: Mapping[str, Callable[..., Any]] = {
    "device": lambda: None,
    "frames": lambda _: {},
    "watchers": tuple,
    "panels": tuple,
    "actions": dict,
    "faults": dict,
}
"""What stands in place of a part of a device package that raises; without the other parts nothing can go on."""


def nothing(*_: Any) -> None:
    """Do nothing."""


OF_WATCHERS: Mapping[str, Callable[..., Any]] = dict.fromkeys(("take", "listener", "tick", "gap", "end"), nothing)
OF_PANELS: Mapping[str, Callable[..., Any] | None] = {
    "take": lambda *_: (),
    "fits": lambda *_: False,
    "of": lambda panel, _: panel,
    "setup": lambda _: {},
    "beside": None,
    "objection": None,  # what it may object to is not sent
}
"""Methods of a package's watchers and panels, and what stands in their place when they raise; None: a LocalError."""


@contextmanager
def blaming(what: str, module: str, otherwise: str) -> Iterator[None]:
    """Turn all that somebody's `module` raises into a LocalError with its place there, or with `otherwise`."""
    try:
        with redirect_stdout(sys.stderr):  # standard output may be a document, such as --json
            yield
    except (KeyboardInterrupt, LocalError):
        raise
    except BaseException as error:  # SystemExit, and what `pytest.skip` raises, must not end what needs no plug-in
        from eurobot_od.support import extras

        inside = f"{module.rpartition('.')[0] or module}."
        said = extras.complaint(error, otherwise, lambda frame: f"{frame.f_globals['__name__']}.".startswith(inside))
        raise LocalError(f"{what}: {said}") from None


def _checked(found: object, otherwise: str) -> Plugin:
    if not isinstance(found, Plugin):
        raise LocalError(f"{otherwise} that is an eurobot_od.plugin.Plugin")
    return found
