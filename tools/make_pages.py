#!/usr/bin/env python3
"""Makes the reference pages and lists that are committed, from the code: `.venv/bin/python tools/make_pages.py`.

`--check` compares them instead of writing them, and names those that are out of date.
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))  # the defects of the rules of lint, and the reported device, are the tests'

import lint_mutants  # noqa: E402

from eurobot_od.canopen_names import MISSING  # noqa: E402
from eurobot_od.check.conformance import page  # noqa: E402
from eurobot_od.check.conformance.clauses import Tier  # noqa: E402
from eurobot_od.check.conformance.page import DeviceRun  # noqa: E402
from eurobot_od.check.report import CheckedDevice  # noqa: E402
from eurobot_od.device.faults import FAULTS  # noqa: E402
from eurobot_od.device.simulated import SimulatedDevice  # noqa: E402
from eurobot_od.export.forms import docs_text, markdown_of  # noqa: E402
from eurobot_od.lint.findings import LEVELS  # noqa: E402
from eurobot_od.od.dictionary import Dictionary  # noqa: E402
from eurobot_od.robot import dialects  # noqa: E402
from eurobot_od.robot.check.diagnosis import EurobotRule  # noqa: E402
from eurobot_od.robot.protocol import EurobotProtocol  # noqa: E402
from eurobot_od.sdo.wire import REMEDIES, Reason, code_and_reason  # noqa: E402
from eurobot_od.traffic.diagnosis.incidents import IncidentRule  # noqa: E402
from eurobot_od.traffic.diagnosis.rules import BusRule  # noqa: E402
from tests.kit.devices import IO_MODULE, NODE_ID, results, suites_of  # noqa: E402

# docs/aborts.md

ABORTS_HEAD = """# Why did my SDO abort?

For anybody whose SDO transfer was aborted: every abort that our devices send, with its reasons. Our devices are the
robot's nodes and any device that `canopen-workbench node` or `simulated()` runs. Clauses are those of CiA 301.

In Python a simulated device also has the reason:

```python
from contextlib import suppress

from eurobot_od import simulated
from eurobot_od.errors import NodeRefused

with simulated("docs/motor.eds", node_id=5) as network:
    with suppress(NodeRefused):
        network[5][0x1800, 2].raw = 0
    print(network.devices[5].device.sdo_service.aborted.reason.name)  # TRANSMISSION_TYPE
```

Made from the table in `eurobot_od/sdo/wire.py` by `tools/make_pages.py`; a test provokes each row. The name leads to
the line that sends it: `grep -rn Reason.PDO_VALID eurobot_od/`.

| code | sent when | clause | name |
|---|---|---|---|
"""

REMEDIES_HEAD = """
## What to do

By the code, whatever device sent it. A command that is refused ends with this, and in Python a NodeRefused has it as a
note.

| code | what to do |
|---|---|
"""


def aborts() -> str:
    """Return the page of all aborts, sorted by code."""
    rows = sorted(Reason, key=lambda each: each.code)  # stable: reasons with one code keep the order of the table
    lines = (f"| {code_and_reason(each.code)} | {each.when} | {each.clause} | `{each.name}` |" for each in rows)
    remedies = (f"| {code_and_reason(code)} | {remedy} |" for code, remedy in REMEDIES.items())
    return "".join([ABORTS_HEAD, *(f"{line}\n" for line in lines), REMEDIES_HEAD, *(f"{each}\n" for each in remedies)])


# docs/canopen.md

CANOPEN_PAGE = ROOT / "docs" / "canopen.md"

NAMES_HEAD = """## Names that we do not have

Of canopen 2.4, with `import eurobot_od as canopen`. The error about such a name, also of an import, ends with what the
table says; made from `eurobot_od/canopen_names.py` by `tools/make_pages.py`.

| of | canopen's name | use instead |
|---|---|---|
"""


def canopen_names() -> str:
    """Return the page about the canopen package with its last section, the names that are missing, made anew."""
    by_remedy: dict[tuple[str, str], list[str]] = {}
    for kind, names in MISSING.items():
        for name, remedy in names.items():
            by_remedy.setdefault((kind, remedy), []).append(f"`{name}`")
    lines = (f"| `{kind}` | {', '.join(names)} | {remedy} |\n" for (kind, remedy), names in by_remedy.items())
    return CANOPEN_PAGE.read_text("utf-8").partition(NAMES_HEAD.splitlines()[0])[0] + NAMES_HEAD + "".join(lines)


# docs/diagnosis-rules.md

DIAGNOSIS_HEAD = """# Rules of `diagnose`

For anybody with a finding of [`diagnose`](diagnose.md): what it looks for, the likely cause, what to do, and the clause
or source. Of incidents of one level, those further up are shown first.

Made from `eurobot_od/traffic/diagnosis/rules.py` and `eurobot_od/robot/check/diagnosis.py` by `tools/make_pages.py`.
`tests/traffic/diagnosis/defects.py` has a log for each rule.
"""


def diagnosis_rules() -> str:
    """Return the page of the rules of `diagnose`."""
    ours, robots = "\n".join(incident_rules(BusRule)), "\n".join(incident_rules(EurobotRule))
    return f"{DIAGNOSIS_HEAD}\n## Any bus\n\n{ours}\n\n## The robot of 2014\n\n{robots}\n"


def incident_rules(rules: Iterable[IncidentRule]) -> Iterator[str]:
    """Yield the lines of a table of rules."""
    yield "| rule | level | what must not be | likely cause | what to do | source |"
    yield "|---|---|---|---|---|---|"
    for each in rules:
        texts = (each.what, each.cause, each.remedy, each.clause)
        yield f"| `{each.id}` | {LEVELS[each.severity]} | {' | '.join(text.replace('|', '&#124;') for text in texts)} |"


# tests/public_names.txt

MODULES = ("eurobot_od", "eurobot_od.errors", "eurobot_od.robot", "eurobot_od.robot.model.messages")
"""Modules with the public names: those in their `__all__`."""

NAMES = ROOT / "tests" / "public_names.txt"


def public_names() -> str:
    """Return the public names with their signatures, one a line."""
    return "".join(f"{line}\n" for line in names())


def names() -> Iterator[str]:
    """Yield a line for each public name, and for each public member of a public class."""
    for module in map(import_module, MODULES):
        for name in sorted({*module.__all__, *getattr(module, "_EXTRAS", ())}):
            if inspect.ismodule(thing := getattr(module, name)):
                continue
            yield described(f"{module.__name__}.{name}", thing)
            if inspect.isclass(thing):
                yield from members(f"{module.__name__}.{name}", thing)


def members(name: str, kind: type) -> Iterator[str]:
    """Yield the members of a class that this package defines, without private ones."""
    for member in sorted(each for each in dir(kind) if not each.startswith("_")):
        home = next(base for base in kind.__mro__ if member in vars(base))
        if home.__module__.startswith("eurobot_od"):
            yield described(f"{name}.{member}", inspect.getattr_static(kind, member))


def described(name: str, thing: Any) -> str:
    """Return a name with its signature, or with its kind."""
    if isinstance(thing, (classmethod, staticmethod)):
        thing = thing.__func__
    if isinstance(thing, property):
        return f"{name}: property"
    if isinstance(thing, type) and issubclass(thing, Enum):  # whose own signature is another with each Python
        return f"{name}: enumeration"
    if not callable(thing) or not (inspect.isroutine(thing) or inspect.isclass(thing)):
        return f"{name}: attribute"
    try:
        signature = str(inspect.signature(thing))
    except ValueError:
        return name
    # Types of named tuples that nobody has looked up yet: Python 3.14 has them as they are written.
    signature = re.sub(r"""ForwardRef\((['"])(.*?)\1\)""", r"\2", signature)
    return name + re.sub(" at 0x[0-9a-f]+", "", signature)


MESSAGES_READER = "For firmware of the robot: all messages and objects, bit by bit. Made by `tools/make_pages.py`."


def messages() -> str:
    """Return the page with all messages of the robot, bit by bit, and the objects of its nodes."""
    text = docs_text(EurobotProtocol.load(), dialects.load_all(), "markdown")
    return text.replace("\n", f"\n\n{MESSAGES_READER}\n", 1)


# docs/reports/io-module.md

REPORT = ROOT / "docs" / "reports" / "io-module.md"


def conformance_report() -> str:
    """Return the conformance report of a simulated I/O module with a fault in its node guarding."""
    module = Dictionary.load(IO_MODULE, NODE_ID)
    kind = FAULTS["guarding-toggle-stuck"].given_to(SimulatedDevice)
    done = list(results(suites_of(module, Tier.DESTRUCTIVE), kind))
    return markdown_of([*page.blocks(DeviceRun(CheckedDevice(module), Tier.DESTRUCTIVE, done))])


MADE: Mapping[Path, Callable[[], str]] = {
    ROOT / "docs" / "messages.md": messages,
    ROOT / "docs" / "aborts.md": aborts,
    CANOPEN_PAGE: canopen_names,
    ROOT / "docs" / "diagnosis-rules.md": diagnosis_rules,
    REPORT: conformance_report,
    lint_mutants.OUTPUT: lint_mutants.page,
    NAMES: public_names,
}
"""Each file that is made, and the function that makes its text."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the files, or return 1 if one is out of date."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare the files instead of writing them")
    options = parser.parse_args(arguments)
    outdated = {file: text for file, make in MADE.items() if file.read_text("utf-8") != (text := make())}
    for file, text in outdated.items():
        print(f"{file.relative_to(ROOT)}: {'out of date; run tools/make_pages.py' if options.check else 'written'}")
        if not options.check:
            file.write_text(text, "utf-8")
    return 1 if options.check and outdated else 0


if __name__ == "__main__":
    sys.exit(main())
