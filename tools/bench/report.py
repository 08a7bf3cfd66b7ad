"""Writes the figures of all rounds as JSON, with the machine and the versions they were measured on.

The file has all figures behind the table; units are in the names.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from bench.measure import Claim, Measured, Scale, compare

PACKAGES = ("eurobot-od", "python-can", "canopen", "cantools", "bitstruct", "dcf-tools", "rich")
CPUS = Path("/proc/cpuinfo")


def write(file: Path, measured: Iterable[Measured], scale: Scale) -> None:
    """Write the report; raises OSError."""
    report = {"machine": machine(), "versions": dict(_versions()), "rounds": scale.rounds, "short": scale.short}
    report["series"] = [_series(each, not scale.short) for each in measured]
    file.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def machine() -> dict[str, Any]:
    """Return a description of the machine, and the date."""
    return {
        "measured": datetime.now(UTC).isoformat(timespec="seconds"),
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "system": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load_before": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def _processor() -> str:
    lines = CPUS.read_text().splitlines() if CPUS.is_file() else []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor())


def _versions() -> Iterator[tuple[str, str]]:
    for package in PACKAGES:
        try:
            yield package, version(package)
        except PackageNotFoundError:
            yield package, "not installed"


def _series(measured: Measured, judged: bool) -> dict[str, Any]:
    return {
        "group": measured.series.group,
        "name": measured.series.name,
        "rounds": {
            name: [{quantity.value: figure for quantity, figure in figures.items()} for figures in rounds]
            for name, rounds in measured.rounds.items()
        },
        "gaps": {name: gap._asdict() for name, gap in measured.gaps.items()},
        "claims": [_claim(measured, claim, judged) for claim in measured.series.claims],
    }


def _claim(measured: Measured, claim: Claim, judged: bool) -> dict[str, Any]:
    said = {
        "name": claim.name,
        "ours": claim.ours,
        "peer": claim.peer,
        "quantity": claim.quantity.value,
        "compared": claim.way.value,
        "wanted": claim.wanted,
    }
    if gap := measured.gap(claim):
        return said | {"wrong" if gap.wrong else "not_measured": gap.why}
    comparison = compare(measured, claim, judged)
    return said | {"value": comparison.value, "spread": comparison[4:6], "verdict": comparison.verdict.value}
