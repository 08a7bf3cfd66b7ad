"""Which suites and steps are run, by their tags and names."""

from __future__ import annotations

from collections.abc import Sequence

from eurobot_od.check.suite import Suite
from eurobot_od.errors import LocalError


def is_chosen(texts: Sequence[str], name: str) -> bool:
    """Tell whether a step's name contains one of some texts; without texts all are chosen."""
    return not texts or any(text.lower() in name.lower() for text in texts)


def chosen(suites: Sequence[Suite], tags: Sequence[str], steps: Sequence[str]) -> list[Suite]:
    """Return the suites with one of the tags and with one of the steps, all if there are none; raises LocalError."""
    tagged = [suite for suite in suites if not tags or set(tags) & set(suite.tags)]
    if not tagged:
        known = sorted({tag for suite in suites for tag in suite.tags})
        raise LocalError(f"no suite is tagged {' or '.join(tags)}; tags: {', '.join(known) or 'none'}")
    found = [suite for suite in tagged if any(is_chosen(steps, step.name) for step in suite.steps)]
    if steps and not found:
        raise LocalError(f"no step is named like {' or '.join(steps)}")
    return found if steps else tagged
