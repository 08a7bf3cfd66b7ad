"""Compares what a C compiler and tshark read with our C header and our dissector, frame by frame.

Both dialects and all messages with data are read, by random frames; raw values are compared, since rounding could hide
a bit.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from eurobot_od.export import c, wireshark
from eurobot_od.export.description import DescribedField, DescribedMessage, Numeral, described
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot import dialects
from eurobot_od.robot.protocol import EurobotProtocol
from interop_rows.row import Answer, Differs, agree
from interop_rows.tools import run

FRAMES = 10_000
"""Random frames for each message."""

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wsign-conversion")
NAME = "bus"


class Sample(NamedTuple):
    """A frame of a message, and the raw values that we read in it, by field."""

    number: int
    data: bytes
    values: Mapping[str, int]

    def bits(self, field: DescribedField) -> int:
        """Return the bits of a field, as an unsigned number."""
        return self.values[field.name] & ((1 << field.width) - 1)


def samples(protocol: Protocol, frames: int) -> list[Sample]:
    """Return random frames of each message with fields; every tenth is as short as the message may be."""
    found = []
    for number, binding in enumerate(protocol.bindings):
        chance = random.Random(binding.name)
        if not binding.layout.fields:
            continue
        for each in range(frames):
            data = chance.randbytes(binding.lengths[0] if each % 10 == 0 else binding.layout.length)
            found.append(Sample(number, data, binding.unpack(data)))
    return found


# C


def by_compiler(folder: Path) -> Answer:
    """Compile the header of each dialect; unpack and pack random frames with it."""
    for dialect in dialects.names():
        protocol = EurobotProtocol.load(dialect)
        compare_c(protocol, described(protocol), folder, FRAMES)
    flags = " ".join(STRICT)
    return Answer(f"`cc {flags}`: no warning; {FRAMES} random frames of each message unpacked and packed as by us")


def compare_c(protocol: Protocol, messages: Sequence[DescribedMessage], folder: Path, frames: int) -> None:
    """Check that the header of the messages reads and writes each frame like the protocol; raises Differs."""
    wanted = samples(protocol, frames)
    judge = compiled(c.header_of(messages, NAME), program(c.blocks_of(messages, NAME)), folder)
    asked, answers = folder / "asked", folder / "answers"
    asked.write_text("".join(f"{each.number} {len(each.data)} {each.data.hex()}\n" for each in wanted))
    done = run("sh", "-c", f'"{judge}" < "{asked}" > "{answers}"')
    agree("the judge's status", done.returncode, 0)
    for sample, line in zip(wanted, answers.read_text().splitlines(), strict=True):
        binding = protocol.bindings[sample.number]
        message = messages[sample.number]
        raw = " ".join(f"{sample.bits(field):x}" for field in message.fields)
        agree(f"{binding.name} {sample.data.hex()}", line, f"{raw} {binding.pack(sample.values).hex()}")


def compiled(header: str, source: str, folder: Path) -> Path:
    """Compile a program with a header; raises Differs for any output of the compiler."""
    (folder / f"{NAME}.h").write_text(header, encoding="ascii")
    (folder / "main.c").write_text(source, encoding="ascii")
    judge = folder / "judge"
    done = run("cc", *STRICT, "-O1", "-o", judge, folder / "main.c")
    if done.returncode or done.stderr:
        raise Differs(done.stderr)
    return judge


def program(blocks: Iterable[c.MessageBlock]) -> str:
    """Return a program that reads lines of number, length and data, and prints raw values and the data packed again."""
    cases = "\n".join(_case(number, block) for number, block in enumerate(blocks) if block.members)
    return f"""
#include <inttypes.h>
#include <stdio.h>
#include "{NAME}.h"
int main(void)
{{
    unsigned number, octet;
    size_t length, size;
    while (scanf("%u %zu", &number, &length) == 2) {{
        uint8_t data[8] = {{0}}, again[8] = {{0}};
        for (size_t i = 0; i < length; i++) {{
            if (scanf("%2x", &octet) != 1) return 1;
            data[i] = (uint8_t)octet;
        }}
        size = 0;
        (void)data;
        switch (number) {{
{cases}
        default: return 4;
        }}
        for (size_t i = 0; i < size; i++) printf("%02x", again[i]);
        printf("\\n");
    }}
    return 0;
}}
"""


def _case(number: int, block: c.MessageBlock) -> str:
    prints = "\n            ".join(map(_printed, block.members))
    return f"""        case {number}: {{
            {block.name}_t m;
            if ({block.name}_unpack(&m, data, {block.message.shortest}u - 1u)) return 5;
            if (!{block.name}_unpack(&m, data, length)) return 2;
            if ({block.name}_pack(again, {block.message.length}u - 1u, &m) != 0u) return 6;
            size = {block.name}_pack(again, sizeof again, &m);
            if (size != {block.message.length}u) return 3;
            {prints}
            break;
        }}"""


def _printed(member: c.Member) -> str:
    mask = f"UINT64_C(0x{(1 << member.field.width) - 1:X})"
    if member.field.numeral is Numeral.REAL:
        copy = f"{member.raw_type} r; memcpy(&r, &m.{member.name}, sizeof r);"
        return f'{{ {copy} printf("%" PRIx64 " ", (uint64_t)r); }}'
    return f'printf("%" PRIx64 " ", (uint64_t)m.{member.name} & {mask});'


# tshark

REALS = {32: "<f", 64: "<d"}
"""Formats of REALs by their bits."""

EPOCH = 1_400_000_000
"""Time of the log's frames, in seconds; any time would do."""


def by_tshark(folder: Path) -> Answer:
    """Dissect random frames with tshark and the dissector of each dialect."""
    for dialect in dialects.names():
        protocol = EurobotProtocol.load(dialect)
        compare_tshark(protocol, described(protocol), folder, FRAMES // 10)
    return Answer(f"both dialects: every field of {FRAMES // 10} random frames of each message as by us")


def compare_tshark(protocol: Protocol, messages: Sequence[DescribedMessage], folder: Path, frames: int) -> None:
    """Check that tshark reads the protocol's values in each frame; raises Differs."""
    wanted = samples(protocol, frames)
    log, script = folder / "frames.log", folder / "bus.lua"
    script.write_text(wireshark.text_of(messages, NAME), encoding="ascii")
    lines = (
        f"({EPOCH + n / 1000:.6f}) can0 {messages[each.number].cob_id:03X}#{each.data.hex()}\n"
        for n, each in enumerate(wanted)
    )
    log.write_text("".join(lines), encoding="ascii")
    found = dissected(log, script)
    agree("the number of dissected frames", len(found), len(wanted))
    for sample, items in zip(wanted, found, strict=True):
        message = messages[sample.number]
        theirs = [_read(item, field) for item, field in zip(items, message.fields, strict=True)]
        ours = [_meant(sample.bits(field), field) for field in message.fields]
        agree(f"{message.name} {sample.data.hex()}", theirs, ours)


def dissected(log: Path, script: Path) -> list[list[str]]:
    """Return our fields' values in each frame of a log, as tshark writes them; raises Differs if it complains."""
    done = run("tshark", "-X", f"lua_script:{script}", "-r", log, "-T", "pdml", "-Y", NAME)
    complaints = [line for line in done.stderr.splitlines() if not line.startswith("Running as user")]
    agree("tshark's complaints", complaints, [])
    packets = ElementTree.fromstring(done.stdout).iter("packet")
    return [[each.get("show", "") for each in _items(packet)] for packet in packets]


def _items(packet: ElementTree.Element) -> list[ElementTree.Element]:
    (proto,) = (each for each in packet.iter("proto") if each.get("name") == NAME)
    return [each for each in proto if each.get("name", "").startswith(f"{NAME}.")]


def _read(shown: str, field: DescribedField) -> int | str:
    """Return a value that tshark shows: a whole number, or a REAL with six digits, as many as tshark writes."""
    return f"{float(shown):.6g}" if field.numeral is Numeral.REAL else int(shown)


def _meant(raw: int, field: DescribedField) -> int | str:
    if field.numeral is Numeral.REAL:
        (value,) = struct.unpack(REALS[field.width], raw.to_bytes(field.width // 8, "little"))
        return _read(repr(value), field)
    sign = raw >> (field.width - 1) if field.numeral is Numeral.SIGNED else 0
    return raw - (sign << field.width)
