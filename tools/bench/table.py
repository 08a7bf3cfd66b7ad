"""Writes comparisons as lines of a table, each as soon as its series is measured, so the columns are fixed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bench.measure import Claim, Comparison, Measured, Quantity, Way, compare

WIDTHS = (9, 62, 8, 8, 8, 17, 9, 0)
HEAD = ("group", "row", "ours", "peer", "compared", "spread", "wanted", "")

TIMES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))
SCALES: dict[Quantity, tuple[tuple[float, str], ...]] = {
    Quantity.TIME: TIMES,
    Quantity.MEAN: TIMES,
    Quantity.MEMORY: ((1e6, "MB"),),
    Quantity.CPU: ((0.01, "%"),),
    Quantity.CPU_TIME: TIMES,
    Quantity.LOAD: ((0.01, "%"),),
    Quantity.COUNT: ((1.0, ""),),
}
"""Units of each quantity, the largest first; the first that gives at least 1 is taken, else the last."""


def in_units(figure: float, quantity: Quantity) -> str:
    """Write a figure with its unit: with three digits, or all digits of a count."""
    unit, name = next((each for each in SCALES[quantity] if abs(figure) >= each[0]), SCALES[quantity][-1])
    number = figure / unit
    digits = f"{number:.0f}" if abs(number) >= 100 else f"{number:.3g}"
    return f"{digits} {name}".rstrip()


def compared(value: float, claim: Claim) -> str:
    """Write the value of a comparison."""
    if claim.way in (Way.TIMES_AS_FAST, Way.RATIO):
        return f"{value:.2f}x"
    return in_units(value, claim.quantity)


def wanted(claim: Claim) -> str:
    """Write the limit of a claim."""
    if claim.wanted is None:
        return "reported"
    return f"{'>=' if claim.way is Way.TIMES_AS_FAST else '<='} {compared(claim.wanted, claim)}"


def cells(comparison: Comparison, group: str) -> tuple[str, ...]:
    """Return a comparison as the columns of HEAD."""
    claim = comparison.claim
    quantity = comparison.claim.quantity
    spread = f"{compared(comparison.least, claim)}..{compared(comparison.greatest, claim)}"
    peer = "-" if comparison.peer is None else in_units(comparison.peer, quantity)
    value = compared(comparison.value, claim)
    verdict = comparison.verdict.value
    return group, claim.name, in_units(comparison.ours, quantity), peer, value, spread, wanted(claim), verdict


def line(columns: Sequence[str]) -> str:
    """Write columns as a line."""
    return "  ".join(f"{text:<{width}}" for text, width in zip(columns, WIDTHS)).rstrip()


def lines(measured: Measured, judged: bool) -> Iterator[str]:
    """Yield a line for each claim of a series; one without figures says why."""
    for claim in measured.series.claims:
        group = measured.series.group
        gap = measured.gap(claim)
        if gap is None:
            yield line(cells(compare(measured, claim, judged), group))
        else:
            yield line((group, claim.name, f"{'wrong' if gap.wrong else 'not measured'}: {gap.why}"))
