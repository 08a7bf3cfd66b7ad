"""Each number of the protocol table is written once: changed there, it is another one in all that is made of it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml

from eurobot_od.cli.show import object_row, picture, table
from eurobot_od.errors import FieldError, MappingError, YamlError
from eurobot_od.export.dbc import dbc_text
from eurobot_od.export.forms import docs_text
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.make import read_table
from eurobot_od.od.make.text import make_files
from eurobot_od.od.objects import all_objects
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import NOTHING
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import CATALOGUE
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.web.page import described
from tests.rows import rows

# Without the row that the barriers are optional, with which some widths could only be changed together.
TABLE = re.sub(r"\n +optional: .*", "", (dialects.eds_folder() / "protocol.yaml").read_text(encoding="utf-8"))
NUMBER = re.compile(r"-?\d+|0x[0-9A-Fa-f]+")


class Number(NamedTuple):
    """A number of the table: the keys that lead to it, and where it stands."""

    path: str
    start: int
    end: int

    def replaced(self, number: int) -> str:
        """Return the table with another number there."""
        return f"{TABLE[: self.start]}{number}{TABLE[self.end :]}"


def numbers(node: yaml.Node | None, path: str = "") -> Iterator[Number]:
    """Yield all numbers of the table; those of an alias once."""
    if isinstance(node, yaml.ScalarNode):
        if not node.style and NUMBER.fullmatch(node.value):
            yield Number(path, node.start_mark.index, node.end_mark.index)
        return
    assert node is not None
    keyed = node.value if isinstance(node, yaml.MappingNode) else [(None, each) for each in node.value]
    for key, value in keyed:
        yield from numbers(value, f"{path}/{key.value if key else ''}")


NUMBERS = list({(each.start): each for each in numbers(yaml.compose(TABLE))}.values())

ALL = frozenset({"frame", "show", "dbc", "docs", "page", "eds"})
SHOWN: Sequence[tuple[str, frozenset[str]]] = (
    # what a number is, and where it has to be seen
    (r"/messages/.*/identifier", ALL),
    (r"/(objects|dialects/\w+/fields)/.*/(range/|codes/.*)", ALL),
    (r"/(objects|dialects/\w+/fields)/.*/bits", ALL - {"page"}),  # which shows values, and no bits
    (r"/dialects/\w+/(widths|reserved)/.*", ALL - {"dbc", "page"}),
    (r"/objects/.*/index", ALL - {"frame", "dbc"}),
    (r"/(objects|dialects/\w+/fields)/.*/default", frozenset({"eds", "show", "docs"})),
    (r".*/(settings|readings|defaults)/.*", frozenset({"eds", "show"})),
    (r".*/(node_id|revision_number|product_number|number|serial_number)", frozenset({"eds", "page"})),
    (r".*", frozenset({"eds"})),
)

REFUSED = (
    # (which numbers may be refused, whatever takes their place; why)
    (r"/objects/.*/Angle/range/ .*", "a heading is a full circle: the class of the message would contradict it"),
    (r"/bit_rates/ 500", "every node has to have the bit rate of the network"),
    (r".*/range/ 0", "the default is 0, and a table with a default outside the range is refused"),
    (r".*/codes/.* [01]", "a field of one bit has no third number, and none stands for two codes"),
    (r"/nodes/drive/settings/Match clock/fields/Time left/bits 32", "its code needs all bits that a number may have"),
    (r"/objects/Goto XY/fields/(X position|Barriers)/bits .*", "all 64 bits of the frame are used"),
)


def is_seen(number: Number) -> bool:
    """Return whether a change of a number is seen wherever it has to be, or refused where that is all that can be."""
    written = f"{number.path} {TABLE[number.start : number.end]}"
    unseen = unseen_places(number)
    return not unseen or (unseen == {"refused"} and any(re.fullmatch(pattern, written) for pattern, _ in REFUSED))


def products(text: str, dialect: str) -> dict[str, str]:
    """Return all that is made of a table, by what it is called; raises MappingError, YamlError."""
    made = make_files(read_table(text, "protocol.yaml"))
    files = {Path(name): each for name, each in made.items() if name.startswith(dialect)}
    dictionaries = tuple(Dictionary.read(each.encode(), name) for name, each in files.items())
    protocol = EurobotProtocol.of_devices(dictionaries, CATALOGUE)
    shown = [*table(protocol.bindings), *(line for each in protocol.bindings for line in picture(each))]
    objects = [" ".join(object_row(each)) for one in dictionaries for each in all_objects(one.objects)]
    return {
        "eds": json.dumps(made),
        "frame": json.dumps([*frames(protocol)]),
        "show": "\n".join(shown + objects),
        "dbc": dbc_text(protocol),
        "docs": docs_text(protocol, dictionaries, "markdown"),
        "page": json.dumps(described(Decoder(dictionaries, CATALOGUE))),
    }


TRIED = sorted({limit + step for limit in (0, 50, 100, 359, 2000, 3000, 0x0FFFFE) for step in (-1, 0, 1)} | {2, 3})
"""Values around the limits of all fields."""


def frames(protocol: EurobotProtocol) -> Iterator[str]:
    """Yield the frames of all messages: with all bits of a field, with each of its codes, and with numbers."""
    for binding in protocol.bindings:
        fields = binding.layout.fields
        for field in fields or [""]:
            ones = {each: binding.layout.raws[each][-1 if each == field else 0] for each in fields}
            packed = binding.pack(ones)
            yield f"{binding.cob_id:03X} {packed.hex()} {binding.decode(packed)!r}"
        yield from (
            f"{field}={each}: {raw(binding, field, each)}" for field in fields for each in tried(binding, field)
        )
        if binding.unknown:
            yield f"{binding.unknown.code:X}"


def tried(binding: Binding, field: str) -> Sequence[Any]:
    return [None, *TRIED, *(getattr(binding.kinds[field], "_needed", {}).values())]


def raw(binding: Binding, field: str, value: Any) -> int | str:
    try:
        return binding.raw(field, value)
    except FieldError:
        return "refused"


@cache
def before(dialect: str) -> Mapping[str, str]:
    return products(TABLE, dialect)


def changes(number: Number, dialect: str) -> Iterator[dict[str, str]]:
    """Yield what is made with other numbers, without those that the rules of a table refuse."""
    old = int(TABLE[number.start : number.end], 0)
    for new in (old + 1, old - 1, old + 0x20, old + 5, old + 300, 800, 2 * old or 1):
        with suppress(YamlError, MappingError):
            yield products(number.replaced(new), dialect)


def unseen_places(number: Number) -> frozenset[str]:
    """Return where a change of a number is not seen, of those places where it has to be; "refused" if there is none."""
    dialect = "firmware2014" if "firmware2014" in number.path else "canopen"
    wanted = next(places for pattern, places in SHOWN if re.fullmatch(pattern, number.path))
    unseen = frozenset({"refused"})
    for now in changes(number, dialect):
        unseen = wanted - {place for place in wanted if now[place] != before(dialect)[place]}
        if not unseen:  # a number next to a code would not be sent as a number anyway: another one may show it
            break
    return unseen


def test_the_table_has_numbers_of_all_kinds() -> None:
    counts = [sum(bool(re.fullmatch(pattern, each.path)) for each in NUMBERS) for pattern, _ in SHOWN]
    assert all(counts)
    assert len(NUMBERS) > 350


@rows("number", NUMBERS, sample=6)
def test_a_number_that_is_changed_in_the_table_is_changed_everywhere(number: Number) -> None:
    assert is_seen(number), unseen_places(number)


@pytest.mark.long
def test_each_number_of_the_table_changes_everywhere() -> None:
    assert [each for each in NUMBERS if not is_seen(each)] == []


CONTRADICTIONS = [
    ("range: [0, 359], default: 0", "range: [0, 358], default: 0", "angle is a full circle"),
    ("unit: cm}  # 0", "unit: mm}  # 0", "enemy_1_diameter is in cm, and in mm in the table"),
    ("yellow: 0, red: 1", "green: 0, red: 1", "team_colour knows no code 'green'"),
    ("blocked: 0xFFFFFE, ", "", "time needs the code 'blocked'"),
    ('unit: "%"}', "unit: mm}", "speed is in %, and in mm in the table"),
]


@pytest.mark.parametrize(("old", "new", "text"), CONTRADICTIONS)
def test_a_table_and_a_class_that_cannot_agree_are_told_with_both_places(old: str, new: str, text: str) -> None:
    source = TABLE.replace(old, new, 1).replace("default: yellow", "default: red")
    assert source != TABLE
    with pytest.raises(MappingError, match=re.escape(text)) as caught:
        products(source, "canopen")
    assert re.search(r"\.eds: .*0x2\d{3}:\d.*class is at .*messages\.py:\d+", str(caught.value))


SCALES = [
    # a step of the table, what is sent, and its raw value
    ("0.1 mm", 123.4, 1234),
    ("2 mm", 3000, 1500),
    ("mm", 3000, 3000),
]


@pytest.mark.parametrize(("unit", "sent", "expected"), SCALES)
def test_a_step_of_the_table_is_the_step_of_the_frame(unit: str, sent: float, expected: int) -> None:
    source = TABLE.replace(
        "X position: {bits: 12, range: [0, 3000], default: 0, unit: mm}",
        f"X position: {{bits: 12, range: [0, 3000], default: 0, unit: {unit}}}",
    )
    made = make_files(read_table(source, "protocol.yaml"))
    files = {Path(name): each for name, each in made.items() if name.startswith("canopen")}
    protocol = EurobotProtocol.of_devices(
        (Dictionary.read(each.encode(), name) for name, each in files.items()), CATALOGUE
    )
    assert protocol.binding("Goto XY").raw("x", sent) == expected


def test_an_enum_without_numbers_has_those_of_the_table() -> None:
    binding = EurobotProtocol.load().binding("Navi Position Response")
    kind = binding.kinds["source"]
    assert all(isinstance(each, Enum) and not isinstance(each, int) for each in kind.enum)  # type: ignore[attr-defined]
    assert dict(kind.named_values()) == {0: "internal", 1: "confederate", 2: "enemy 1", 3: "enemy 2"}


def test_a_workbench_without_the_robots_classes_has_the_tables_units_and_codes() -> None:
    protocol = Protocol.of_devices(dialects.load_all(), NOTHING)
    position = protocol.binding("Navi Position Response")
    message = position.decode(position.pack({"x": 255, "y": 700, "angle": 1023, "source": 2}))
    texts = [kind.text(value) for kind, value in zip(position.kinds.values(), message)]
    assert texts == ["255 mm (unknown)", "700 mm", "1023 deg (unknown)", "2 (enemy_1)"]
