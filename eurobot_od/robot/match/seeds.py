"""Plays a match for each of many seeds, with any workers.

Matches come in the order of their seeds, and are the same whoever plays them; each process reads the EDS files and the
strategies once.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path

from eurobot_od import plugin
from eurobot_od.robot.match.played import PlayedMatch, play
from eurobot_od.robot.match.referee import Players, StrategyFiles
from eurobot_od.robot.match.stage import EdsFiles, Performance
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.robot_file import file_for
from eurobot_od.robot.world import World
from eurobot_od.season import campaign
from eurobot_od.season.campaign import HERE, Workers
from eurobot_od.season.results import Results
from eurobot_od.support.files import digest_of

SHIPPED = StrategyFiles()

SEED = "{seed}"
"""The placeholder for the seed in the name of a log."""


def play_many(
    options: MatchOptions,
    seeds: range,
    workers: Workers = HERE,
    strategies: StrategyFiles = SHIPPED,
    results: Results[PlayedMatch] | None = None,
    log: str | None = None,
) -> Generator[PlayedMatch, None, None]:
    """Play a match for each seed; `results` keeps them, and those that it already has are not played again.

    `log` is the name of a file for the frames of each match, with `{seed}` in it.

    Raises UnknownName, FileError, LocalError before anything is played, ChildProcessError if a process dies.
    """
    player = SeedPlayer(options, strategies, _digest(options, strategies), log)
    Performance(options, stage(player)[0], World(options, lambda: 0.0))  # raises here, once
    return campaign.run(player, seeds, workers, results)


@dataclass(frozen=True)
class SeedPlayer:
    """Plays the match of a seed; `digest` is that of the files that are read for it.

    `log` is the name of a file for the frames, with `{seed}` in it.
    """

    options: MatchOptions
    strategies: StrategyFiles
    digest: str
    log: str | None = None

    def __call__(self, seed: int) -> PlayedMatch:
        """Play."""
        log = None if self.log is None else Path(self.log.replace(SEED, str(seed)))
        return play(replace(self.options, seed=seed), *stage(self), log)


# One is enough: a process plays one campaign, and a changed file has another digest and so another key.
@lru_cache(1)
def stage(player: SeedPlayer) -> tuple[EdsFiles, Players]:
    """Read the EDS files and the strategies: once in each process, unless they change."""
    return EdsFiles.read(player.options), player.strategies.load()


def settings(options: MatchOptions, strategies: StrategyFiles) -> dict[str, str]:
    """Return everything that the matches of any seeds depend on: the options, and the contents of the files.

    Raises UnknownName, LocalError.
    """
    given = {name: str(value) for name, value in asdict(options).items() if name != "seed"}
    return {"campaign": "matches", **given, "files": _digest(options, strategies)}


def _digest(options: MatchOptions, strategies: StrategyFiles) -> str:
    """Return a digest of the EDS files, the robot's file and the strategies."""
    folder = plugin.find(options.robot).dialects.folder(options.dialect)
    return digest_of([*sorted(folder.glob("*.eds")), file_for(folder), *strategies])
