"""Logs of lines as people paste them: python-can's messages, CRTD, Yacht Devices, analysers, CSV by its columns."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

from eurobot_od.frame import HIGHEST_IDENTIFIER
from eurobot_od.traffic import entries
from eurobot_od.traffic.entries import Raw
from eurobot_od.traffic.formats.lines import LineFormat, matched

# python-can's `str(message)`: `Timestamp:        1.500000    ID:      181    S Rx                DL:  3    41 42 00`


MESSAGE = re.compile(
    rb"Timestamp:\s*(?P<time>[\d.]+)\s+ID:\s*(?P<identifier>[0-9a-f]{1,8})\s+(?P<format>[SX])(?:\s+[RT]x)?"
    rb"(?P<flags>(?:\s+(?:E|R|F|BS|EI))*)\s+(?:DLC?):\s*(?P<length>\d+)(?P<data>(?:\s+[0-9a-f]{2}\b)*)"
    rb"(?:\s+'.*')?(?:\s+Channel:\s*(?P<channel>\S+))?\s*",
    re.IGNORECASE | re.DOTALL,
)


class MessageFormat(LineFormat):
    """Reads printed python-can messages, also after a logger's prefix; other lines are comments."""

    def comment(self, line: bytes) -> bool:
        return b"Timestamp:" not in line

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        found = matched(MESSAGE.fullmatch(line[line.index(b"Timestamp:") :]))
        data = bytes.fromhex(found["data"].decode())
        flags = found["flags"].split()
        is_error, is_remote, is_fd = (each in flags for each in (b"E", b"R", b"F"))
        said = int(found["identifier"], 16), data, int(found["length"]), found["format"] in b"Xx"
        raw = entries.recorded(*said, is_remote, is_error, is_fd)
        return entries.seconds(found["time"]), (found["channel"] or b"").decode(), raw


# CRTD, `1566812345.123456 1R11 7DF 02 01 0C`, of OVMS; records of other types are comments, events and statistics


CRTD = re.compile(rb"([\d.]+)\s+(\d*)[RT](11|29)\s+([0-9A-F]{1,8})((?:\s+[0-9A-F]{2})*)\s*", re.IGNORECASE)
CRTD_OTHER = re.compile(rb"[\d.]+\s+\d*C[A-Z]{2}\b")


class CrtdFormat(LineFormat):
    """Reads one log in CRTD."""

    def comment(self, line: bytes) -> bool:
        return super().comment(line) or CRTD_OTHER.match(line) is not None

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, channel, width, identifier, data = matched(CRTD.fullmatch(line)).groups()
        raw = entries.frame(int(identifier, 16), bytes.fromhex(data.decode()), width == b"29")
        return entries.seconds(stamp), channel.decode(), raw


# Yacht Devices' RAW, `17:33:21.107 R 19F51323 01 2F 30 70 00 2F 30 70`: NMEA 2000, so all identifiers have 29 bits


YACHT = re.compile(rb"\s*(\d+):(\d+):([\d.]+)\s+[RT]\s+([0-9A-F]{8})((?:\s+[0-9A-F]{2})*)\s*", re.IGNORECASE)


class YachtFormat(LineFormat):
    """Reads the RAW messages of a gateway of Yacht Devices; times are those of the day."""

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        hours, minutes, seconds, identifier, data = matched(YACHT.fullmatch(line)).groups()
        time = int(hours) * 3600 + int(minutes) * 60 + entries.seconds(seconds)
        return time, "", entries.frame(int(identifier, 16), bytes.fromhex(data.decode()), extended=True)


# CARBUS Analyzer, `14,687\t1\t0004\t4E0\t8\t24 00 00 00 00 00 00 00\t00000000\t$`: after the comma ms, in version 3 us


CARBUS_HEAD = re.compile(rb"@ TEXT @ (\d+) @", re.IGNORECASE)
CARBUS_DIGITS = {2: 3, 3: 6}
"""Decimal places of a time, by version."""


class CarbusFormat(LineFormat):
    """Reads one trace of CARBUS Analyzer."""

    def __init__(self) -> None:
        self._digits = CARBUS_DIGITS[3]

    def comment(self, line: bytes) -> bool:
        if head := CARBUS_HEAD.match(line.strip()):
            self._digits = CARBUS_DIGITS.get(int(head[1]), self._digits)
        return super().comment(line) or head is not None

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, channel, _, identifier, length, text, *_ = line.strip().split(b"\t")
        whole, _, part = stamp.partition(b",")
        time = int(whole) + int(part or b"0") / 10**self._digits
        number = int(identifier, 16)
        data = bytes.fromhex(text.decode())
        extended = number > HIGHEST_IDENTIFIER or len(identifier) > EXTENDED_FROM
        return time, channel.decode(), entries.recorded(number, data, int(length), extended)


EXTENDED_FROM = 4
"""Maximum number of digits of an 11-bit identifier."""


# Microchip's CAN BUS Analyzer, `1234;RX;0x181;3;0x41;0x42;0x00`; between two lines of `//---` stands the head


class MicrochipFormat(LineFormat):
    """Reads one log of Microchip's CAN BUS Analyzer; times are in ms."""

    def comment(self, line: bytes) -> bool:
        return b";" not in line

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, direction, identifier, length, *octets = line.strip().rstrip(b";").split(b";")
        if direction.upper() not in (b"RX", b"TX"):
            raise ValueError(line)
        number = int(identifier, 0)
        data = bytes([int(octet, 0) for octet in octets])
        extended = number > HIGHEST_IDENTIFIER or identifier[-1:] in b"xX"
        return float(stamp.replace(b",", b".")) / 1000, "", entries.recorded(number, data, int(length), extended)


# CSV whose first line names its columns: any order, any other columns between them


NAMES: Mapping[str, Sequence[str]] = {
    "time": ("time", "timestamp", "timestamps", "t", "abstime", "reltime", "systemtime", "timeabs", "timerel", "ts"),
    "id": ("id", "canid", "identifier", "arbitrationid", "frameid", "messageid", "msgid", "cobid", "addr", "address"),
    "data": ("data", "payload", "databytes", "databyte", "bytes", "candata", "message"),
    "length": ("dlc", "len", "length", "dl", "datalength", "size"),
    "extended": ("extended", "ext", "ide", "isextended", "isextendedid"),
    "remote": ("remote", "rtr", "isremote", "isremoteframe"),
    "channel": ("channel", "bus", "chn", "interface", "chan"),
}
"""Names of columns, without spaces, signs, units and `(hex)`."""

OCTET = re.compile(r"(?:d|b|data|byte|databyte|db)(\d)|byte([a-h])")
UNIT = re.compile(r"[(\[_ ]\s*(ms|us|µs|ns|s|sec|seconds|hex|dec)\s*[)\]]?$", re.IGNORECASE)
SMALLER_UNIT = 1e11
"""Times from here on are in ms, us or ns since 1970, although the column does not say so."""

PER_SECOND = {"ms": 1e3, "us": 1e6, "µs": 1e6, "ns": 1e9}
TRUE = ("1", "true", "yes", "x", "ext", "extended", "29", "rtr", "remote")


class ColumnsFormat(LineFormat):
    """Reads CSV by column names, with hexadecimal identifiers and data, and times in s or a named unit."""

    def __init__(self) -> None:
        self._delimiter = ","
        self._places: dict[str, int] = {}
        self._octets: list[int] = []
        self._per_second, self._base = 1.0, 16

    def comment(self, line: bytes) -> bool:
        if not self._places and b"," not in line and b";" not in line and b"\t" not in line:
            return True  # a title above the names
        return super().comment(line) or (not self._places and self._head(line.decode("utf-8", "replace")))

    def _head(self, line: str) -> bool:
        self._delimiter = max(",;\t", key=line.count)
        words = [each.strip() for each in self._split(line)]
        units = [found[1].lower() if (found := UNIT.search(each)) else "" for each in words]
        names = [re.sub(r"[^a-z0-9]", "", UNIT.sub("", each).lower()) for each in words]
        octets = {found[1] or found[2]: place for place, name in enumerate(names) if (found := OCTET.fullmatch(name))}
        found_at = {what: [names.index(name) for name in known if name in names] for what, known in NAMES.items()}
        self._places = {what: places[0] for what, places in found_at.items() if places}
        if "id" not in self._places or not (octets or "data" in self._places):
            self._places = {}
            return False
        self._octets = [octets[number] for number in sorted(octets)] if "data" not in self._places else []
        time = units[self._places["time"]] if "time" in self._places else ""
        self._per_second = PER_SECOND.get(time, 1.0)
        self._base = 10 if units[self._places["id"]] == "dec" else 16
        return True

    def _split(self, line: str) -> list[str]:
        try:
            return next(csv.reader([line.strip()], delimiter=self._delimiter))
        except csv.Error:  # a carriage return within the line, or a field of 128 KiB
            return [line]

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        if not self._places:
            raise ValueError(line)
        words = [each.strip() for each in self._split(line.decode("utf-8"))]
        said = {what: words[place] for what, place in self._places.items() if place < len(words)}
        data = self._data(said, words)
        number = int(said["id"].rstrip("hHxX"), 16 if said["id"][:2].lower() == "0x" else self._base)
        extended = number > HIGHEST_IDENTIFIER or said.get("extended", "").lower() in TRUE
        is_remote = said.get("remote", "").lower() in TRUE
        length = int(said["length"]) if said.get("length") else len(data)
        raw = entries.recorded(number, data, length, extended, is_remote)
        return self._time(said.get("time", "")), said.get("channel", ""), raw

    def _data(self, said: Mapping[str, str], words: Sequence[str]) -> bytes:
        """Return the data of one column, or of a column for each byte."""
        if "data" not in said:
            octets = [words[place] for place in self._octets if place < len(words) and words[place]]
            return bytes([int(each, 16) for each in octets][: int(said["length"]) if said.get("length") else None])
        text = re.sub(r"0x|[\s,:_-]|^b'|'$", "", said["data"], flags=re.IGNORECASE)
        return bytes.fromhex(text)

    def _time(self, text: str) -> float:
        if not text:
            return 0.0
        if re.search(r"\d-\d|\dT\d", text):
            found = datetime.fromisoformat(text)
            return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
        *larger, seconds = text.split(":")
        total = 0.0
        for each in larger:
            total = (total + int(each)) * 60
        total = (total + float(seconds.replace(",", "."))) / self._per_second
        while total >= SMALLER_UNIT:
            total /= 1000
        return entries.seconds(total)


# candump of long ago, `<0x18eeff01> [8] 00 11 22 33 44 55 66 77`; it says neither time nor channel


OLD = re.compile(rb"\s*<0x([0-9a-f]{1,8})>\s+\[(\d)\]((?:\s+[0-9a-f]{2}\b)*)(\s+remote request)?\s*", re.IGNORECASE)
OLD_BASE = 3
"""Maximum number of digits of an 11-bit identifier."""


class OldFormat(LineFormat):
    """Reads the output of the first versions of candump."""

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        identifier, length, text, remote = matched(OLD.match(line)).groups()
        data = bytes.fromhex(text.decode())[: int(length)]
        extended = len(identifier) > OLD_BASE
        return 0.0, "", entries.recorded(int(identifier, 16), data, int(length), extended, remote)
