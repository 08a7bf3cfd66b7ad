"""A manufacturer's texts about a device, in addition to its EDS: for error codes, units and values.

    emcy: {0xFF01: probe broken, 0x73xx: sensor}
    units:
      Motor.Temperature: {unit: degC, factor: 0.1}    # or only a unit: `Motor.Speed: rpm`
    words:
      0x2003: {0: idle, 1: running}
      0x1002: {bit 0: door open, bit 7: fan blocked}

They are in `STEM.device.yaml` or `device.yaml` beside the EDS, or in a device package. An entry that does not fit the
file is ignored with a warning.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from warnings import warn

from eurobot_od.errors import EurobotError, FileError, LocalError, PackageWarning, YamlError
from eurobot_od.od import objects as od
from eurobot_od.od.values import parse_number
from eurobot_od.support.files import read_whole

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary, ODVariable

    from eurobot_od.support.yaml_shapes import Shape

DEVICE_FILE = "device.yaml"
"""Name of the file; `STEM.device.yaml` for one of several devices in a folder."""

BIT = re.compile(r"bit\s*([0-9]{1,2})", re.IGNORECASE)


class MakersUnit(NamedTuple):
    """Scale of an object: its physical value is `raw * factor + offset`, in `unit`."""

    unit: str = ""
    factor: float = 1
    offset: float = 0


class ObjectWords(NamedTuple):
    """Texts for the values of an object, and for its bits."""

    codes: Mapping[int, str]
    bits: Mapping[int, str]


class MakersWords(NamedTuple):
    """Texts from a `file`: for error codes by code, for objects by name or number."""

    file: str = ""
    emcy: Mapping[int, str] = {}
    units: Mapping[str, MakersUnit] = {}
    words: Mapping[str, ObjectWords] = {}

    def describe(self, objects: ObjectDictionary) -> None:
        """Set units and texts of a device's objects; warns of an object that it does not have."""
        for variable, unit in self._found(objects, self.units):
            variable.unit, variable.factor = unit.unit, unit.factor
            variable.offset = unit.offset  # type: ignore[attr-defined]  # canopen has none
        for variable, words in self._found(objects, self.words):
            variable.value_descriptions = dict(words.codes)
            variable.bit_definitions = {name: [bit] for bit, name in words.bits.items()}

    def _found(self, objects: ObjectDictionary, said: Mapping[str, Any]) -> Iterator[tuple[ODVariable, Any]]:
        for name, value in said.items():
            try:
                variable = od.find_one(str(name), objects)
                if not od.is_described(variable):
                    raise LocalError(f"the device has no object {name}")
            except EurobotError as error:
                line = getattr(getattr(name, "place", None), "line", 1)
                warn(f"{self.file}:{line}: {error}", PackageWarning, stacklevel=2)
            else:
                yield variable, value


def device_yaml_of(file: Path) -> Path | None:
    """Return the `device.yaml` of a device file, or None."""
    beside = (file.with_name(f"{file.stem}.{DEVICE_FILE}"), file.with_name(DEVICE_FILE))
    return next((each for each in beside if each.is_file()), None)


@lru_cache
def read_maker(file: Path) -> MakersWords:
    """Read a manufacturer's file; an unreadable one is empty, with a warning."""
    try:
        return parse_maker(read_whole(file).decode("utf-8", "replace"), str(file))
    except (FileError, YamlError, OSError) as error:
        warn(f"{str(error).splitlines()[0]}; going on without it", PackageWarning, stacklevel=2)
        return MakersWords(str(file))


def parse_maker(text: str, file: str) -> MakersWords:
    """Parse a manufacturer's file; raises YamlError."""
    from eurobot_od.support import yaml_shapes as shapes

    plain = plain_shapes()
    keys = {
        "emcy": shapes.Key(_error_words()),
        "units": shapes.Key(shapes.mapping(plain[MakersUnit], shapes.SCALAR)),
        "words": shapes.Key(shapes.mapping(plain[ObjectWords], shapes.SCALAR)),
    }
    said: dict[str, Any] = shapes.read_yaml(text, shapes.record(dict, keys), file)
    return MakersWords(file, **said)


def plain_shapes() -> dict[Any, Shape[Any]]:
    """Return the shapes of a unit and of an object's texts, for any file that has them."""
    from eurobot_od.support import yaml_shapes as shapes

    unit = shapes.shape_of(MakersUnit, {**shapes.PLAIN, str: shapes.SCALAR})

    def read_unit(node: Any, problems: Any) -> MakersUnit:
        is_long = isinstance(node.value, list)
        return unit.read(node, problems) if is_long else MakersUnit(str(shapes.SCALAR.read(node, problems)))

    by_value = shapes.mapping(shapes.TEXT, shapes.converted(shapes.SCALAR, _value_key))
    return {MakersUnit: shapes.Shape(read_unit), ObjectWords: shapes.converted(by_value, _object_words)}


def _value_key(text: str) -> tuple[str, int]:
    bit = BIT.fullmatch(text.strip())
    number = parse_number(text.strip())
    if bit:
        return "bit", int(bit[1])
    if number is None or number.relative:
        raise LocalError(f"{str(text)!r} is neither a value, such as 3, nor a bit, such as `bit 3`")
    return "value", number.value


def _object_words(said: Mapping[tuple[str, int], str]) -> ObjectWords:
    of = {kind: {n: str(text) for (each, n), text in said.items() if each == kind} for kind in ("value", "bit")}
    return ObjectWords(of["value"], of["bit"])


# Texts for emergency error codes: `0x7310: speed`, `0x73xx: sensor`, `0xFF01..0xFF0F: axis`

KEY = re.compile(r"0x(?P<first>[0-9A-F]{1,4}|[0-9A-F]{2,3}X{1,2})(\.\.0x(?P<last>[0-9A-F]{1,4}))?", re.IGNORECASE)
"""A code, a class of codes with x for any digit, or a range."""


def read_error_words(file: str | Path) -> dict[int, str]:
    """Read a file and return the texts by code; the narrowest entry for a code applies. Raises FileError."""
    from eurobot_od.support.yaml_shapes import read_yaml

    return read_yaml(read_whole(file).decode("utf-8", "replace"), _error_words(), file)


def _error_words() -> Shape[dict[int, str]]:
    from eurobot_od.support.yaml_shapes import SCALAR, TEXT, converted, mapping

    def by_code(ranges: Mapping[range, str]) -> dict[int, str]:
        # The narrowest is last, and so replaces wider entries.
        widest_first = sorted(ranges.items(), key=lambda each: len(each[0]), reverse=True)
        return {code: str(text) for codes, text in widest_first for code in codes}

    return converted(mapping(TEXT, converted(SCALAR, _codes)), by_code)


def _codes(key: str) -> range:
    """Return the codes of a key; raises LocalError for an invalid one."""
    codes = range(0)
    found = KEY.fullmatch(key.strip())
    if found is not None and not ("X" in found["first"].upper() and (len(found["first"]) < 4 or found["last"])):
        low, high = (int(found["first"].upper().replace("X", digit), 16) for digit in "0F")
        codes = range(low, (int(found["last"], 16) if found["last"] else high) + 1)
    if not codes:
        raise LocalError(f"{str(key)!r} is not an error code: write 0x7310, 0x73xx or 0x7380..0x738F")
    return codes
