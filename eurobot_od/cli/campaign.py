"""What commands that do many things in parallel share: the workers, and where results are kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar

from eurobot_od.cli.options import whole
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError
from eurobot_od.season import MOST_JOBS
from eurobot_od.support import extras, progress

if TYPE_CHECKING:
    from eurobot_od.season.campaign import Workers
    from eurobot_od.season.results import Results

Thing = TypeVar("Thing")

Jobs: TypeAlias = Annotated[int, Option(metavar="N", read=whole(1, MOST_JOBS, f"a number from 1 to {MOST_JOBS}"))]


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """Many things at once: what does them, and where the results are kept.

    jobs: processes (default: one per core)
    executor: use the workers of a Dask scheduler instead
    results: keep all results in this folder, as Parquet
    resume: continue the run whose results are in that folder
    """

    jobs: Jobs | None = None
    executor: Annotated[str | None, Option(metavar="dask://HOST:PORT")] = None
    results: Annotated[Path | None, Option(metavar="FOLDER")] = None
    resume: bool = False

    def refuse(self, option: str) -> None:
        """Refuse the options without the one that they go with; raises LocalError."""
        for name in self.given:
            raise LocalError(f"--{name} goes with {option} only")

    @property
    def given(self) -> list[str]:
        """The names of the options that are given."""
        return [name for name, value in vars(self).items() if value]

    @contextmanager
    def workers(self, things: int) -> Iterator[Workers]:
        """Give the workers for a number of things; raises LocalError."""
        from eurobot_od.season import campaign  # one thing is done without `multiprocessing`

        if self.executor and self.jobs:
            raise LocalError("--jobs is for processes of this machine, and does not go with --executor")
        with ExitStack() as stack:
            # A missing package is one only while the workers are made; later it would be a fault in the work.
            with extras.needed("cluster"):
                found = stack.enter_context(campaign.workers(self.executor, self.jobs, things))
            yield found

    def kept(self, record: type[Thing], settings: Callable[[], Mapping[str, Any]]) -> Results[Thing] | None:
        """Return where the results are kept, None for nowhere; raises LocalError."""
        if self.results is None:
            if self.resume:
                raise LocalError("--resume needs --results: the folder of the run to continue")
            return None
        with extras.needed("cluster"):
            from eurobot_od.season.results import Results
        return Results(self.results, record, settings(), self.resume)


def counted(things: Iterable[Thing], number: int, what: str, workers: Workers, hidden: bool = False) -> Iterable[Thing]:
    """Pass on things and show how far it is, unless that is `hidden`."""
    # More workers than things say nothing of how long it takes.
    return things if hidden else progress.counted(things, number, what, min(workers.number, number))
