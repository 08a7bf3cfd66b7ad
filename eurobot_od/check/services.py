"""CANopen services in suites: heartbeats, emergencies, NMT commands, SDO transfers, each of a node.

A service without a node is that of the node under test, if there is one only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import yaml
from canopen.objectdictionary import ODVariable

from eurobot_od.check.patterns import ANY, EmergencyPattern, HeartbeatPattern, Pattern
from eurobot_od.check.suite import AbortCodes, Action, Dump, Nmt, NodeServices, SdoRead, SdoWrite, SelfReported
from eurobot_od.check.values import ObjectValues, expectation
from eurobot_od.check.vocabulary import NAME, Vocabulary
from eurobot_od.device.nmt import ALL_NODES, COMMAND_NAMES, STATE_NAMES, NmtCommand
from eurobot_od.errors import LocalError
from eurobot_od.od import objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import COMMANDS, EMCY
from eurobot_od.od.values import BASE_IDENTIFIER, DOMAIN, ERROR_CONTROL_BASE, NOT_SCANNED, NOT_VALID
from eurobot_od.support import yaml_shapes as shapes
from eurobot_od.support.declared import Within
from eurobot_od.support.yaml_places import Problems, refusing, taken
from eurobot_od.support.yaml_shapes import NUMBER, SCALAR, TEXT, Key, Shape, converted

T = TypeVar("T")

NMT_COMMANDS = {name: command for command, name in COMMAND_NAMES.items()}
STATES = {name: state for state, name in STATE_NAMES.items()} | {ANY: None}


def _or_any(shape: Shape[T], instead: T) -> Shape[T]:
    """Make a shape that also takes the word `any`, read as `instead`."""
    return Shape(
        # the value of a list's node is a list, which equals no word
        lambda node, problems: instead if node.value == ANY else shape.read(node, problems),
        {"anyOf": [{"const": ANY}, shape.schema]},
    )


ABORTS = _or_any(converted(shapes.one_or_more(NUMBER), AbortCodes), AbortCodes(()))


class ServiceShapes:
    """The shapes of services, with the words of one document."""

    def __init__(self, words: Vocabulary) -> None:
        self._words = words
        self._node = shapes.named(words.dictionaries, "node")
        state = Key(shapes.named(STATES, "NMT state"), "state in the heartbeat", needed=True)
        number: Shape[Any] = shapes.within(NUMBER, Within(0, 0xFFFF), "error code")  # of 16 bits (CiA 301, 7.2.7)
        code = Key(_or_any(number, None), "error code, or any", needed=True)
        command = Key(shapes.named(NMT_COMMANDS, "NMT command"), "NMT command", needed=True)
        self.heartbeat: Shape[Pattern] = self._service("state", state, self._heartbeat)
        self.emcy: Shape[Pattern] = self._service("code", code, self._emergency)
        self.nmt: Shape[Action] = self._service("command", command, self._nmt)
        when = Key(
            shapes.named({"before": False, "equal": True}, "dump"),
            "`before`: keep them; `equal`: compare with what was kept",
            needed=True,
        )
        self.dump: Shape[Action] = self._service("when", when, self._dump)
        none = Key(shapes.named({"none": True}, "errors"), "none are there", needed=True)
        self.errors: Shape[Action] = self._service(
            "wanted", none, lambda _, given: SelfReported(NodeServices.of(self._dictionary(given)))
        )
        sdo = {
            "read": Key(SCALAR, "object to read: 0x1017, 0x1018:1, or its name in any letter case"),
            "write": Key(SCALAR, "object to write"),
            "value": Key(SCALAR, "value to write"),
            "data": Key(TEXT, "bytes to write or to expect, in hexadecimal, instead of a value"),
            "expect": Key(SCALAR, "the value to be read"),
            "abort": Key(ABORTS, "the abort code, or one of several, or any, with which the node has to refuse"),
            "optional": Key(ABORTS, "abort codes that mean that the node lacks this: the step is skipped"),
            "transfer": Key(shapes.named({"block": True}, "transfer"), "transferred in blocks"),
            "save": Key(NAME, "variable that gets the value"),
            "node": Key(self._node, "whose object; default: the node under test"),
        }
        self._sdo_parts: Shape[dict[str, Any]] = shapes.record(dict, sdo)
        self.sdo: Shape[Action] = Shape(self._read_sdo, self._sdo_parts.schema)

    def _dictionary(self, given: Dictionary | None) -> Dictionary:
        """Return the EDS of the node that is meant; raises LocalError."""
        if given is not None:
            return given
        if len(self._words.nodes) != 1:
            raise LocalError("which node? Write it next to this, `node: drive`, or give the suite one node")
        return self._words.dictionaries[self._words.nodes[0]]

    def _service(self, name: str, key: Key, make: Callable[[Any, Dictionary | None], T]) -> Shape[T]:
        """Make the shape of a service: its one value, or a mapping that also says which node."""
        keys = {name: key, "node": Key(self._node, "which node; default: the node under test")}
        long: Shape[dict[str, Any]] = shapes.record(dict, keys)

        def read(node: yaml.Node, problems: Problems) -> T:
            is_long = isinstance(node, yaml.MappingNode)
            parts = long.read(node, problems) if is_long else {name: key.shape.read(node, problems)}
            with refusing(node, problems):
                return make(parts[name], parts.get("node"))

        return Shape(read, {"anyOf": [key.shape.schema, long.schema]})

    def _heartbeat(self, state: Any, given: Dictionary | None) -> Pattern:
        node = self._dictionary(given)
        return HeartbeatPattern(node.name, ERROR_CONTROL_BASE + node.node_id, state)

    def _emergency(self, code: int | None, given: Dictionary | None) -> Pattern:
        node = self._dictionary(given)
        entry = node.default(EMCY)
        # Bit 31 set: the EMCY does not exist (CiA 301, 7.5.2.17), so a step that waits for one could only be red.
        if not isinstance(entry, int) or entry & NOT_VALID:
            raise LocalError(f"the EDS of {node.name} has no EMCY (0x{EMCY[0]:04X})")
        return EmergencyPattern(node.name, entry & BASE_IDENTIFIER, code)

    def _nmt(self, command: NmtCommand, given: Dictionary | None) -> Action:
        # Other services have to ask which node; NMT has a node-ID for all of them, 0 (CiA 301, 7.2.8.2.1).
        to_all = given is None and len(self._words.nodes) != 1
        return Nmt(command, ALL_NODES if to_all else self._dictionary(given).node_id)

    def _dump(self, equal: bool, given: Dictionary | None) -> Action:
        node = self._dictionary(given)
        # What keeps its value while nobody writes it: `ro` is measured, 0x1003 a history, a DOMAIN a file of any size.
        steady = (each for each in objects.all_objects(node.objects) if each.access_type in ("rw", "const"))
        kept = (each for each in steady if each.index not in COMMANDS and objects.data_type(each) is not DOMAIN)
        chosen = (each for each in kept if not node.flags(objects.address_of(each)) & NOT_SCANNED)
        return Dump(NodeServices.of(node), tuple(chosen), equal)

    # SDO

    def _read_sdo(self, node: yaml.Node, problems: Problems) -> Action:
        given = self._sdo_parts.read(node, problems)
        with refusing(node, problems):
            verb = _verb(given)
            dictionary = self._dictionary(given.get("node"))
        named = taken(given[verb], problems, lambda text: objects.find_one(text, dictionary.objects))
        value = next((given[key] for key in ("data", "expect", "value") if key in given), None)
        where = given[verb] if value is None else value
        variable = taken(where, problems, lambda _: _looked_at(named, given, dictionary))
        scale, service = self._words.scale(ObjectValues(variable)), NodeServices.of(dictionary)
        refusals = {"abort": given.get("abort"), "optional": given.get("optional")}
        blocks: bool = given.get("transfer", False)
        if verb == "read":
            expected = None if value is None else taken(value, problems, lambda text: expectation(text, scale))
            return SdoRead(service, variable, expected, **refusals, blocks=blocks, save=given.get("save"))
        operand = taken(where, problems, scale.operand)
        return SdoWrite(service, variable, operand, **refusals, blocks=blocks)


def _looked_at(variable: ODVariable, given: Mapping[str, Any], dictionary: Dictionary) -> ODVariable:
    """Return an object as a step looks at it; raises LocalError for a value of one that no file describes."""
    # Bytes are compared whatever the type; so are those of an object that the file lacks and the step only reads.
    if "data" in given or not ({"expect", "value"} & given.keys() or objects.is_described(variable)):
        return objects.changed(variable, data_type=DOMAIN.code)
    if not objects.is_described(variable):
        raise LocalError(f"{objects.label(variable)} is not in the EDS of {dictionary.name}; use 'data'")
    # What is to be refused may be all that its type can carry.
    return objects.changed(variable, min=None, max=None) if "abort" in given else variable


EXCLUDED = {"read": ("value",), "write": ("expect", "save")}
"""Keys that an SDO step of a kind must not have."""


def _verb(given: Mapping[str, Any]) -> str:
    """Return whether an SDO step reads or writes; raises LocalError for keys that do not go together."""
    _one_of(given, "an SDO step", "read", "write")
    verb = "read" if "read" in given else "write"
    wrong = [key for key in EXCLUDED[verb] if key in given]
    if wrong:
        raise LocalError(f"'{wrong[0]}' does not belong to an SDO {verb}")
    if verb == "write":
        _one_of(given, "an SDO write", "value", "data")
    elif "data" in given and "expect" in given:
        raise LocalError("an SDO read expects either a value or bytes: 'expect' or 'data'")
    elif "abort" in given and any(key in given for key in ("expect", "data", "save")):
        raise LocalError("an SDO read that is refused with 'abort' has nothing to expect or save")
    return verb


def _one_of(given: Mapping[str, Any], what: str, one: str, other: str) -> None:
    if (one in given) == (other in given):
        raise LocalError(f"{what} has either '{one}' or '{other}'")
