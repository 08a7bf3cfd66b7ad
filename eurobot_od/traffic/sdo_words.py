"""What an SDO frame says by itself (CiA 301, 7.2.4.3).

Rule of this file: one frame at a time, of 8 bytes; what only the frames before it tell is in `transfers`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.profiles.words import with_words, words
from eurobot_od.od.values import Address
from eurobot_od.sdo.wire import (
    ANSWER_SUB_COMMAND,
    BLOCK_SIZE_GIVEN,
    EXPEDITED,
    LAST,
    REQUEST_SUB_COMMAND,
    Block,
    ClientCommand,
    Initiate,
    ServerCommand,
    code_and_reason,
    part_in,
)

SdoText: TypeAlias = Callable[["Dictionary | None", bytes], str]
Commands: TypeAlias = Mapping[int, SdoText]


def frame_words(commands: Commands, dictionary: Dictionary | None, data: bytes) -> str:
    """Say what an SDO frame asks or answers; `commands` are those of its direction."""
    text = commands.get(data[0] >> 5)
    return text(dictionary, data) if text else f"command {data[0] >> 5}"


def object_words(dictionary: Dictionary | None, address: Address) -> str:
    """Write an object with its name, if the device's file has it."""
    index, subindex = address
    where = f"0x{index:04X}:{subindex:02X}"
    variable = dictionary.variable(address) if dictionary else None
    return where if variable is None else f"{where} {variable.qualname.replace('.', ', ')}"


def value_words(dictionary: Dictionary | None, address: Address, octets: bytes) -> str:
    """Write a value by its object's type; as bytes if that is not known, or has another length."""
    variable = dictionary.variable(address) if dictionary else None
    if variable is None:
        return octets.hex(" ")
    try:
        value = data_type(variable).read(octets)
    except ValueError:  # a length that the type does not have
        return octets.hex(" ")
    return with_words(value.hex(" ") if isinstance(value, bytes) else str(value), words(variable, value))


def _segment(_: Dictionary | None, data: bytes) -> str:
    return f"segment of {len(part_in(data))} bytes" + ", the last" * (data[0] & LAST)


def _abort(dictionary: Dictionary | None, data: bytes) -> str:
    _, address, _ = abort = Initiate.of(data)
    return f"abort {object_words(dictionary, address)}: {code_and_reason(abort.number)}"


def _of_object(what: str, value: bool = False) -> SdoText:
    def text(dictionary: Dictionary | None, data: bytes) -> str:
        initiate = Initiate.of(data)
        said = f"{what} {object_words(dictionary, initiate.address)}"
        if not value:
            return said
        if not initiate.command & EXPEDITED:
            return said if initiate.size is None else f"{said}, {initiate.size} bytes"
        return f"{said} = {value_words(dictionary, initiate.address, initiate.rest[: initiate.size])}"

    return text


def _plainly(what: str) -> SdoText:
    return lambda _dictionary, _data: what


def _block(mask: int, words: Mapping[int, SdoText]) -> SdoText:
    """Return the words of a block transfer by its sub-command."""

    def text(dictionary: Dictionary | None, data: bytes) -> str:
        found = words.get(data[0] & mask)
        return found(dictionary, data) if found else f"block command 0x{data[0]:02X}"

    return text


def _begun(what: str, with_size: bool = False) -> SdoText:
    def text(dictionary: Dictionary | None, data: bytes) -> str:
        initiate = Initiate.of(data)
        size = f", {initiate.number} bytes" * bool(with_size and initiate.command & BLOCK_SIZE_GIVEN)
        return f"{what} {object_words(dictionary, initiate.address)} in blocks{size}"

    return text


_ACKNOWLEDGED: SdoText = lambda _, data: f"block taken up to segment {data[1]}"  # noqa: E731 (a row of the tables)

REQUESTS: Commands = {
    ClientCommand.DOWNLOAD_SEGMENT: _segment,
    ClientCommand.DOWNLOAD: _of_object("write", value=True),
    ClientCommand.UPLOAD: _of_object("read"),
    ClientCommand.UPLOAD_SEGMENT: _plainly("next segment"),
    ClientCommand.ABORT: _abort,
    ClientCommand.BLOCK_UPLOAD: _block(
        REQUEST_SUB_COMMAND[ClientCommand.BLOCK_UPLOAD],
        {
            Block.INITIATE: _begun("read"),
            Block.END: _plainly("end of blocks taken"),
            Block.ACKNOWLEDGE: _ACKNOWLEDGED,
            Block.START: _plainly("start of blocks"),
        },
    ),
    ClientCommand.BLOCK_DOWNLOAD: _block(
        REQUEST_SUB_COMMAND[ClientCommand.BLOCK_DOWNLOAD],
        {Block.INITIATE: _begun("write", with_size=True), Block.END: _plainly("end of blocks")},
    ),
}

ANSWERS: Commands = {
    ServerCommand.UPLOAD_SEGMENT: _segment,
    ServerCommand.DOWNLOAD_SEGMENT: _plainly("segment taken"),
    ServerCommand.UPLOAD: _of_object("value of", value=True),
    ServerCommand.DOWNLOAD: _of_object("written"),
    ServerCommand.ABORT: _abort,
    ServerCommand.BLOCK_DOWNLOAD: _block(
        ANSWER_SUB_COMMAND[ServerCommand.BLOCK_DOWNLOAD],
        {
            Block.INITIATE: _begun("ready for"),
            Block.END: _plainly("end of blocks taken"),
            Block.ACKNOWLEDGE: _ACKNOWLEDGED,
        },
    ),
    ServerCommand.BLOCK_UPLOAD: _block(
        ANSWER_SUB_COMMAND[ServerCommand.BLOCK_UPLOAD],
        {Block.INITIATE: _begun("value of", with_size=True), Block.END: _plainly("end of blocks")},
    ),
}
