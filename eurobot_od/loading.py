"""Where plug-ins come from, and which of them are used: one robot, and any number of device packages.

Ours is found like any other. What the user has typed takes precedence over the environment, this over what is installed
(entry points):

- One robot is used: the one of `--robot` or EUROBOT_OD_ROBOT; otherwise the installed one that the network file names
by `robot:`; otherwise the installed one, another package's rather than ours. For devices given by their files, and for
the program `canopen-workbench`, there is none.
- All device packages are used, for devices with their identity: those of `--package` or EUROBOT_OD_PACKAGES before the
  installed ones.

A user names an installed plug-in, a folder or file of Python, or a module. Data runs no code: a network file may come
with somebody else's logs, so it can only name installed plug-ins. A plug-in that cannot be loaded is one warning, and
the rest goes on; only a robot that the user has named is an error.
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
    """A kind of plug-in: `what` it is called, and where plug-ins are found.

    `group` is the group of entry points, `variable` the environment variable that names it. In a folder, it is the
    `attribute` of the module in the `file`. `warning` is the category for one that is left out.
    """

    what: str
    group: str
    variable: str
    file: str
    attribute: str
    warning: type[RobotWarning]

    def installed(self) -> Mapping[str, Installed]:
        """Return the installed plug-ins by name."""
        return _installed(self)

    def load(self, name: str) -> Plugin:
        """Load the plug-in that a user names; raises UnknownName, LocalError."""
        if name in self.installed():
            return self.installed()[name].load()
        if (path := Path(name)).is_dir() or path.suffix == ".py":
            return self._of_file(path / self.file if path.is_dir() else path, name)
        from importlib.util import find_spec

        package = name.partition(".")[0]
        if not package.isidentifier() or find_spec(package) is None:
            unknown = UnknownName(self.what, name, self.installed())
            unknown.add_note(f"no folder with a {self.file} is called so here")
            raise unknown
        return self.imported(name, name, name)

    def imported(self, target: str, name: str, file: str) -> Plugin:
        """Import a plug-in, `module:attribute`; raises LocalError for anything that fails.

        `file` is the place for errors.
        """
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
        """Return a plug-in; None, with a warning, if it cannot be loaded."""
        try:
            return load()
        except (LocalError, OSError) as error:
            self.warn(f"{error}; going on without it")
            return None

    def warn(self, what: str) -> None:
        """Warn that a plug-in is left out."""
        from warnings import warn

        warn(what, self.warning, stacklevel=2)


ROBOTS = PluginKind("robot", "eurobot_od.robots", "EUROBOT_OD_ROBOT", "robot.py", "ROBOT", RobotWarning)
DEVICES = PluginKind(
    "device package", "eurobot_od.devices", "EUROBOT_OD_PACKAGES", "device.py", "DEVICE", PackageWarning
)

NONE = "none"
"""Value of `--robot` for no robot."""

OURS = "eurobot_od."
"""Prefix of the names of this package's own modules."""


# Which are used


def find(name: str | None = None, network: str | Path = DEFAULT, *, alone: bool = False) -> Plugin:
    """Return the robot to use: that of `name`, the environment, or the `network` file, otherwise the installed one.

    `alone`: the installed one is not used. Raises UnknownName; LocalError, with the place, for a named robot that
    cannot be loaded, and if several are installed; FileError for the network file.
    """
    return named(name, network) or (NOTHING if alone else the_installed())


def named(name: str | None, network: str | Path = DEFAULT) -> Plugin | None:
    """Return the robot that `name`, the environment or the `network` file names; None if none does.

    Raises as `find`.
    """
    if typed := name or os.environ.get(ROBOTS.variable):
        return _typed(ROBOTS, typed)
    if os.path.isfile(network):  # noqa: PTH113
        from eurobot_od.od.network import read_network  # here, as most commands do not need it

        if written := read_network(network).robot:
            return _written(written, Path(network))
    return None


@lru_cache
def _typed(kind: PluginKind, name: str) -> Plugin:
    return NOTHING if name == NONE else kind.load(name)


def _written(name: str, file: Path) -> Plugin:
    """Return the robot that a network file names; NOTHING if it is not installed or cannot be loaded."""
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
    """Return the robot to use if none is named; raises LocalError if there are several."""
    for ours in (False, True):  # ours last: a user who has installed another robot wants that
        robots = [each for each in ROBOTS.installed().values() if each.is_ours is ours]
        loaded = {each.name: robot for each in robots if (robot := ROBOTS.if_possible(each.load))}
        if len(loaded) > 1:
            raise LocalError(f"several robots are installed: name one by --robot: {', '.join(sorted(loaded))}")
        for robot in loaded.values():
            return robot
    return NOTHING


def packages(named: Sequence[str] = ()) -> tuple[Plugin, ...]:
    """Return the device packages to use: those `named`, those of the environment, and the installed ones."""
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

    Raises UnknownName, LocalError. Only installed robots, as a table is data and must not run code.
    """
    return look_up("installed robot", name, ROBOTS.installed()).load().table


# Installed ones


class Installed(NamedTuple):
    """An installed plug-in: its `name`, where it is (`module:attribute`), and the `file` of its entry point."""

    kind: PluginKind
    name: str
    target: str
    file: str

    @property
    def package(self) -> str:
        """Name of its package for pip."""
        return Path(self.file).parent.name.partition("-")[0]

    @property
    def is_ours(self) -> bool:
        """Whether it belongs to this package."""
        return self.target.startswith(OURS)

    def load(self) -> Plugin:
        """Import it; raises LocalError, with the place, for anything that fails."""
        return self.kind.imported(self.target, self.name, self.file)


@lru_cache
def _installed(kind: PluginKind) -> Mapping[str, Installed]:
    found: dict[str, Installed] = {}
    for file, text in _entry_points():
        for line in text.partition(f"[{kind.group}]")[2].partition("\n[")[0].splitlines():
            name, equals, target = map(str.strip, line.partition("="))
            if equals:  # the first one wins, as for an import
                found.setdefault(name, Installed(kind, name, target, file))
    return found


@lru_cache
def _entry_points() -> Sequence[tuple[str, str]]:
    """Return the files of entry points and their texts, in the order in which Python searches packages.

    They are read directly (PyPA's "Entry points specification"), as `importlib.metadata` takes 40 ms.
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


# Errors of plug-ins


class Guard(NamedTuple):
    """Turns the exceptions of a plug-in into errors or warnings: `what` it is, its `module` and `file`.

    This includes parts that are imported later. A failing part of a robot raises LocalError, with the place. A failing
    part of a device package is left out, with one warning, if everything else can go on.
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
        # Called once each, as a function may define new classes in each call.
        watchers = cache(lambda: [self._watcher(each) for each in guarded.watchers()])
        panels = cache(lambda: [self.spared(each, OF_PANELS) for each in guarded.panels()])
        program = plugin.program and partial(self._program, guarded)
        return guarded._replace(
            watchers=watchers, panels=panels, frames=partial(self._frames, guarded), program=program
        )

    def call(self, part: Callable[..., Any], instead: Callable[..., Any] | None = None) -> Callable[..., Any]:
        """Return a function that raises LocalError; with `instead` it warns, and returns the result of that."""

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
        """Return a class with guarded `methods`; each has a replacement as in `call`."""
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
"""Replacements for failing parts of a device package; without the other parts, nothing can go on."""


def nothing(*_: Any) -> None:
    """Do nothing."""


OF_WATCHERS: Mapping[str, Callable[..., Any]] = dict.fromkeys(("take", "listener", "tick", "gap", "end"), nothing)
OF_PANELS: Mapping[str, Callable[..., Any] | None] = {
    "take": lambda *_: (),
    "fits": lambda *_: False,
    "of": lambda panel, _: panel,
    "setup": lambda _: {},
    "beside": None,
    "objection": None,  # a frame that it cannot check is not sent
}
"""Replacements for failing methods of a package's panels; None: LocalError. `OF_WATCHERS` are those of watchers."""


@contextmanager
def blaming(what: str, module: str, otherwise: str) -> Iterator[None]:
    """Turn every exception of a plug-in's `module` into a LocalError with its place there, or with `otherwise`."""
    try:
        with redirect_stdout(sys.stderr):  # standard output may be JSON
            yield
    except (KeyboardInterrupt, LocalError):
        raise
    except BaseException as error:  # SystemExit and pytest's exceptions, too, as the rest must go on
        from eurobot_od.support import extras

        inside = f"{module.rpartition('.')[0] or module}."
        said = extras.complaint(error, otherwise, lambda frame: f"{frame.f_globals['__name__']}.".startswith(inside))
        raise LocalError(f"{what}: {said}") from None


def _checked(found: object, otherwise: str) -> Plugin:
    if not isinstance(found, Plugin):
        raise LocalError(f"{otherwise} that is an eurobot_od.plugin.Plugin")
    return found
