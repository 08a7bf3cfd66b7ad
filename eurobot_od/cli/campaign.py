"""What commands that do many things in parallel share: the workers, and where results are kept."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from eurobot_od.cli import options
from eurobot_od.errors import LocalError
from eurobot_od.support import extras, progress

if TYPE_CHECKING:
    from collections.abc import Iterator

    from eurobot_od.season.campaign import Workers
    from eurobot_od.season.results import Results

OPTIONS = ("jobs", "executor", "results", "resume")

Thing = TypeVar("Thing")


def add_workers(parser: argparse.ArgumentParser, option: str) -> argparse._ArgumentGroup:
    """Add --jobs and --executor, which go with the option for many things."""
    group = parser.add_argument_group(f"many at once, with {option}")
    group.add_argument("--jobs", type=options.jobs, metavar="N", help="processes (default: one per core)")
    group.add_argument("--executor", metavar="dask://HOST:PORT", help="use the workers of a Dask scheduler instead")
    return group


def add_campaign(parser: argparse.ArgumentParser, option: str) -> None:
    """Add the options of `add_workers`, --results and --resume."""
    group = add_workers(parser, option)
    group.add_argument("--results", type=Path, metavar="FOLDER", help="keep all results in this folder, as Parquet")
    group.add_argument("--resume", action="store_true", help="continue the run whose results are in that folder")


def refuse(arguments: argparse.Namespace, option: str) -> None:
    """Refuse the options without the one that they go with; raises LocalError."""
    for name in OPTIONS:
        if getattr(arguments, name, None):
            raise LocalError(f"--{name} goes with {option} only")


@contextmanager
def workers(arguments: argparse.Namespace, things: int) -> Iterator[Workers]:
    """Give the workers for a number of things; raises LocalError."""
    from eurobot_od.season import campaign

    if arguments.executor and arguments.jobs:
        raise LocalError("--jobs is for processes of this machine, and does not go with --executor")
    with ExitStack() as stack:
        # A missing package is one only while the workers are made; later an ImportError would be a fault in the work.
        with extras.needed("cluster"):
            found = stack.enter_context(campaign.workers(arguments.executor, arguments.jobs, things))
        yield found


def results(
    arguments: argparse.Namespace, record: type[Thing], settings: Callable[[], Mapping[str, Any]]
) -> Results[Thing] | None:
    """Return where the results are kept, None for nowhere; raises LocalError."""
    if arguments.results is None:
        if arguments.resume:
            raise LocalError("--resume needs --results: the folder of the run to continue")
        return None
    with extras.needed("cluster"):
        from eurobot_od.season.results import Results
    return Results(arguments.results, record, settings(), arguments.resume)


def counted(things: Iterable[Thing], number: int, what: str, workers: Workers, hidden: bool = False) -> Iterable[Thing]:
    """Pass on things and show how far it is, unless that is `hidden`."""
    # More workers than things say nothing of how long it takes.
    return things if hidden else progress.counted(things, number, what, min(workers.number, number))
