"""Large tables whose rows prove one rule, in one test: all rows are tried, and each that fails is named.

A table of up to `FEW` rows is `pytest.mark.parametrize`, so that each row is a test that runs alone, with fixtures of
its own. A larger one would make thousands of tests, which cost more than what they try.
"""

from __future__ import annotations

import functools
import inspect
import random
from collections.abc import Callable, Iterable
from typing import Any

import pytest
from hypothesis import settings

Test = Callable[..., None]

SEED = 2014
"""Seed by which a sample of rows is drawn."""

FEW = 40
"""Most rows of a table that is `pytest.mark.parametrize`."""

LONGEST = 300
"""Characters of a row in a message."""


def rows(names: str, table: Iterable[Any], *, sample: int | None = None) -> Callable[[Test], Test]:
    """Try a test on all rows of a table, which looks as in `pytest.mark.parametrize`; the other arguments are fixtures.

    Fixtures are made once for all rows, but each row gets a folder of its own in `tmp_path`. A row may be skipped. A
    generator is asked for its rows when the test runs, not when it is collected. `sample`: so many rows, the same ones
    each time; with --hypothesis-profile=campaign, as each night, all of them.
    """
    arguments = names.split(", ")

    @functools.cache
    def everything() -> list[tuple[Any, ...]]:
        found = [tuple(row) if len(arguments) > 1 else (row,) for row in table]
        if len(found) <= FEW:
            raise pytest.UsageError(f"{names}: {len(found)} rows; a table of up to {FEW} is pytest.mark.parametrize")
        return found

    def chosen() -> list[tuple[Any, ...]]:
        if sample is None or settings.default is not settings.get_profile("suite"):
            return everything()
        return random.Random(SEED).sample(everything(), sample)

    def decorate(test: Test) -> Test:
        signature = inspect.signature(test)

        @functools.wraps(test)
        def walk(*instance: object, **fixtures: Any) -> None:
            failed: list[tuple[dict[str, Any], BaseException]] = []
            skipped: list[BaseException] = []
            tried = chosen()
            folder = fixtures.get("tmp_path")
            for number, case in enumerate(tried):
                if folder:
                    fixtures["tmp_path"] = folder / f"row-{number}"
                    fixtures["tmp_path"].mkdir()
                row = dict(zip(arguments, case, strict=True))
                try:
                    test(*instance, **fixtures, **row)
                except (Exception, pytest.fail.Exception) as error:
                    failed.append((row, error))
                except pytest.skip.Exception as error:
                    skipped.append(error)
            if len(skipped) == len(tried):
                raise skipped[0]
            if failed:
                first = failed[0][1]
                first.add_note(f"{len(failed)} of {len(tried)} rows failed, this is the first of:")
                for row, _ in failed:
                    first.add_note("  " + ", ".join(f"{name}={value!r}" for name, value in row.items())[:LONGEST])
                raise first

        others = [each for each in signature.parameters.values() if each.name not in arguments]
        walk.__signature__ = signature.replace(parameters=others)  # type: ignore[attr-defined]
        return walk

    return decorate
