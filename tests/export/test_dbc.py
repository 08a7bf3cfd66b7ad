"""The DBC file, judged by others: cantools, canmatrix, and C code that cantools makes of it, against our codec."""

from __future__ import annotations

import math
import random
import re
import struct
import subprocess
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import canmatrix.formats
import cantools
import pytest
from cantools.database.can import Database, Message
from cantools.database.can.c_source import generate

from eurobot_od.errors import MappingError
from eurobot_od.export.dbc import dbc_text, text_of
from eurobot_od.export.description import DescribedField, DescribedMessage, Numeral
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.codec import Layout, Slot
from eurobot_od.pdo.kinds import Real
from eurobot_od.pdo.protocol import Protocol
from tests.export import made_up
from tests.kit import plant

FRAMES = 2000
"""Random frames for each message."""


@cache
def protocol(dialect: str) -> Protocol:
    return plant.protocol(dialect)


@cache
def database(dialect: str) -> Database:
    loaded = cantools.database.load_string(dbc_text(protocol(dialect)), "dbc", strict=True)
    assert isinstance(loaded, Database)
    return loaded


def cases() -> list[tuple[str, str]]:
    """Return the messages of whole numbers; others have tests of their own, as a NaN is not equal to itself."""
    return [(dialect, each.name) for dialect in plant.DIALECTS for each in protocol(dialect).bindings if is_whole(each)]


def is_whole(binding: Binding) -> bool:
    return not any(isinstance(kind, Real) for kind in binding.kinds.values())


def random_data(binding: Binding, number: int = FRAMES) -> list[bytes]:
    chance = random.Random(binding.name)
    return [chance.randbytes(binding.layout.length) for _ in range(number)]


# cantools


@pytest.mark.parametrize(("dialect", "name"), cases())
def test_cantools_reads_what_the_files_say_and_frames_as_the_codec_does(dialect: str, name: str) -> None:
    binding = protocol(dialect).binding(name)
    message = database(dialect).get_message_by_frame_id(binding.cob_id)
    assert (message.name, message.length) == (name.replace(" ", "_"), binding.layout.length)
    assert set(message.senders) == set(binding.senders)
    for signal in message.signals:
        assert set(signal.receivers) == set(binding.receivers)
        assert (signal.unit or "") == binding.kinds[signal.name].raw_unit
        assert (signal.minimum, signal.maximum) == binding.limits[signal.name]
    if not binding.layout.fields:
        return
    for data in random_data(binding):
        decoded = message.decode(data, decode_choices=False)
        assert decoded == binding.unpack(data)
        assert message.encode(decoded, strict=False) == binding.pack(binding.unpack(data))


@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_no_other_message_is_there(dialect: str) -> None:
    assert len(database(dialect).messages) == len(protocol(dialect).bindings)


CHOICES = [
    ("Halt Cause", "cause", {0: "operator", 1: "curtain"}),
    ("Move State Response", "time", {0: "arrived", 0xFFFFFD: "unknown", 0xFFFFFE: "blocked", 0xFFFFFF: "not possible"}),
    ("Place Response", "source", {0: "encoder", 1: "camera", 2: "laser"}),
    ("Place Response", "angle", {0x3FF: "unknown"}),
    ("Order Set", "colour", {0: "green", 1: "blue"}),
    ("Weight Response", "weight", {0xFFFF: "overload"}),
    # 255 mm alone is a place
    ("Place Response", "x", {}),
    ("Move To", "angle", {}),
]


@pytest.mark.parametrize("dialect", plant.DIALECTS)
@pytest.mark.parametrize(("message", "field", "choices"), CHOICES)
def test_value_tables(dialect: str, message: str, field: str, choices: Mapping[int, str]) -> None:
    signal = database(dialect).get_message_by_name(message.replace(" ", "_")).get_signal_by_name(field)
    assert {raw: str(name) for raw, name in (signal.choices or {}).items()} == choices


# canmatrix


@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_canmatrix_names_the_nodes(dialect: str) -> None:
    loaded: Any = canmatrix.formats.loads(dbc_text(protocol(dialect)), "dbc")
    (found,) = loaded.values()
    assert found.load_errors == []
    assert [each.name for each in found.ecus] == ["panel", "lift", "scale"]


def test_words_of_the_format_are_no_names() -> None:
    field = made_up.Field("Enum", made_up.UNSIGNED8, 8)
    device = made_up.dictionary([("Filter", [field]), ("Float", [field])], "enum.eds")
    text = dbc_text(Protocol([(device, device.pdos)]))
    assert "\nBU_: enum_2\n" in text
    assert re.findall(r"^BO_ \d+ (\w+):", text, flags=re.MULTILINE) == ["Filter_2", "Float_2"]
    assert re.findall(r"^ SG_ (\w+) :", text, flags=re.MULTILINE) == ["enum_2", "enum_2"]


# C


def c_program(messages: list[Message]) -> str:
    """Write a program that reads `number hex` lines, unpacks, packs again and prints the values."""
    cases = "\n".join(map(c_case, count(), messages))
    return f"""
#include <inttypes.h>
#include <stdio.h>
#include "bus.h"
int main(void)
{{
    unsigned number, octet, length;
    while (scanf("%u %u", &number, &length) == 2) {{
        uint8_t data[8] = {{0}}, again[8] = {{0}};
        for (unsigned i = 0; i < length; i++) {{
            if (scanf("%2x", &octet) != 1) return 1;
            data[i] = (uint8_t)octet;
        }}
        switch (number) {{
{cases}
        }}
        for (unsigned i = 0; i < length; i++) printf("%02x", again[i]);
        printf("\\n");
    }}
    return 0;
}}
"""


def c_case(number: int, message: Message) -> str:
    name = message.name.lower()
    prints = "".join(f'printf("%" PRIu64 " ", (uint64_t)m.{signal.name});' for signal in message.signals)
    return f"""
        case {number}: {{
            struct bus_{name}_t m;
            if (bus_{name}_unpack(&m, data, length) != 0) return 2;
            if (bus_{name}_pack(again, &m, sizeof(again)) != (int)length) return 3;
            {prints}
            break;
        }}"""


@pytest.mark.long
@pytest.mark.parametrize("dialect", plant.DIALECTS)
def test_c_code_compiles_without_warning_and_agrees_with_the_codec(dialect: str, tmp_path: Path) -> None:
    messages = [
        each
        for each in database(dialect).messages
        if each.signals and is_whole(protocol(dialect).binding_of(each.frame_id))
    ]
    header, source, *_ = generate(database(dialect), "bus", "bus.h", "bus.c", "fuzzer.c")
    (tmp_path / "bus.h").write_text(header)
    (tmp_path / "bus.c").write_text(source)
    (tmp_path / "main.c").write_text(c_program(messages))
    strict = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    subprocess.run(["gcc", *strict, "bus.c", "main.c", "-o", "judge"], cwd=tmp_path, check=True)
    asked, expected = [], []
    for number, message in enumerate(messages):
        binding = protocol(dialect).binding_of(message.frame_id)
        for data in random_data(binding):
            values = binding.unpack(data)
            asked.append(f"{number} {len(data)} {data.hex()}")
            raw = " ".join(str(values[signal.name]) for signal in message.signals)
            expected.append(f"{raw} {binding.pack(values).hex()}")
    judge = [str(tmp_path / "judge")]
    judged = subprocess.run(judge, input="\n".join(asked), capture_output=True, text=True, check=True)
    assert judged.stdout.splitlines() == expected


# Any network


def typed_database(messages: Sequence[DescribedMessage]) -> Database:
    loaded = cantools.database.load_string(text_of(messages), "dbc", strict=True)
    assert isinstance(loaded, Database)
    return loaded


ANY = list(made_up.ANY_NUMBERS.items())
ANY_PROTOCOL = made_up.protocol(ANY)
ANY_MESSAGES = made_up.typed(ANY_PROTOCOL, ANY)


REALS = {32: "<f", 64: "<d"}


def raw_of(value: float, field: DescribedField) -> int:
    """Return the bits of a number."""
    if field.numeral is Numeral.REAL:
        return int.from_bytes(struct.pack(REALS[field.width], value), "little")
    return int(value) & ((1 << field.width) - 1)


def bits_of(binding: Binding, data: bytes) -> dict[str, int]:
    """Return the fields of a frame as numbers without a sign."""
    widths = binding.layout.widths
    return {field: raw & ((1 << widths[field]) - 1) for field, raw in binding.unpack(data).items()}


def is_exact(binding: Binding, data: bytes) -> bool:
    """Return whether no REAL in a frame is a NaN, whose bits no number keeps."""
    return all(
        not math.isnan(struct.unpack(REALS[field.width], raw.to_bytes(field.width // 8, "little"))[0])
        for raw, field in zip(bits_of(binding, data).values(), message_of(binding).fields, strict=True)
        if field.numeral is Numeral.REAL
    )


def message_of(binding: Binding) -> DescribedMessage:
    return next(each for each in ANY_MESSAGES if each.cob_id == binding.cob_id)


@pytest.mark.parametrize("binding", ANY_PROTOCOL.bindings)
def test_cantools_reads_numbers_of_any_type_and_place_as_we_do(binding: Binding) -> None:
    signals = typed_database(ANY_MESSAGES).get_message_by_frame_id(binding.cob_id)
    fields = message_of(binding).fields
    for data in (each for each in made_up.random_data(binding, FRAMES) if is_exact(binding, each)):
        values: Any = signals.decode(data, decode_choices=False)
        assert {field.name: raw_of(values[field.name], field) for field in fields} == bits_of(binding, data)
        assert signals.encode(values, strict=False) == binding.pack(binding.unpack(data))


@pytest.mark.parametrize("binding", ANY_PROTOCOL.bindings)
def test_canmatrix_reads_numbers_of_any_type_and_place_as_we_do(binding: Binding) -> None:
    loaded: Any = canmatrix.formats.loads(text_of(ANY_MESSAGES), "dbc")
    (found,) = loaded.values()
    assert found.load_errors == []
    (frame,) = (each for each in found.frames if each.arbitration_id.id == binding.cob_id)
    fields = message_of(binding).fields
    for data in (each for each in made_up.random_data(binding, FRAMES // 10) if is_exact(binding, each)):
        values = {name: each.raw_value for name, each in frame.decode(data).items()}
        assert {field.name: raw_of(values[field.name], field) for field in fields} == bits_of(binding, data)


@pytest.mark.parametrize("messages", [made_up.badly_named(), made_up.many()], ids=["bad names", "512 messages"])
def test_any_names_are_read(messages: list[DescribedMessage]) -> None:
    text = text_of(messages)
    assert re.fullmatch(r"[\t\x20-\x7E\n]+", text)
    names = [(each.name, *(signal.name for signal in each.signals)) for each in typed_database(messages).messages]
    assert len({message.lower() for message, *_ in names}) == len(messages)
    assert all(len({each.lower() for each in signals}) == len(signals) for _, *signals in names)
    loaded: Any = canmatrix.formats.loads(text, "dbc")
    (found,) = loaded.values()
    assert len(found.frames) == len(messages)


def test_no_multiplexing_is_invented() -> None:
    assert not any(each.is_multiplexed() for each in typed_database(ANY_MESSAGES).messages)


# What DBC cannot say


def test_a_field_in_pieces_is_refused() -> None:
    spoilt = plant.protocol()
    binding = spoilt.binding("Move State Response")
    binding.layout = Layout([Slot("time", 12, 12), Slot("time", 0, 12)])
    with pytest.raises(MappingError, match="Move State Response: time is not contiguous"):
        dbc_text(spoilt)


def test_a_comment_keeps_the_names_and_indices_of_the_file() -> None:
    text = dbc_text(protocol("plain"))
    assert 'CM_ SG_ 514 x "0x2000:1 Move to.X position; 0..3000 mm";' in text
    assert re.search(r'^CM_ BO_ 514 "Move To: .+";$', text, re.MULTILINE)
    slices = "0x3000:1 Move to slices.X position (11:4), 0x3000:3 Move to slices.X position (3:0); 0..3000 mm"
    assert f'CM_ SG_ 514 x "{slices}";' in dbc_text(protocol("packed"))


def test_a_message_of_which_nothing_is_known_has_no_empty_comment() -> None:
    made = made_up.protocol(list(made_up.ANY_NUMBERS.items()))
    assert '""' not in "".join(each for each in dbc_text(made).splitlines() if each.startswith("CM_"))
