"""The shapes of what a step sends and expects: messages, raw frames, and the services of CANopen.

Before a suite is read, all its words are collected (`Vocabulary`): the messages and objects of its EDS files and its
variables. So each word can be checked where it is used. A field may have its name in the EDS or a short one: `X
position` or `x`. A service (heartbeat, emergency, NMT command, SDO transfer) without a node is that of the node under
test, if there is only one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias, TypeVar

import yaml

from eurobot_od.check import suite
from eurobot_od.check.values import FieldValues, Operand, Scale, ValueProblem, Values, expectation
from eurobot_od.device.nmt import STATE_NAMES
from eurobot_od.errors import LocalError, UnknownName, meant
from eurobot_od.frame import Frame, RemoteFrame
from eurobot_od.od import network
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.pdos import OnRefused, fatal
from eurobot_od.od.standard import EMCY
from eurobot_od.od.values import ERROR_CONTROL_BASE, base_identifier, parse_number
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import NOTHING, Catalogue, KeyedForm, Kind, field_name, plain_name
from eurobot_od.sdo.wire import AbortCode
from eurobot_od.support import texts
from eurobot_od.support import yaml_shapes as shapes
from eurobot_od.support.declared import Within
from eurobot_od.support.yaml_places import NodeReader, PlacedText, Problems, read_all, refuse, refusing, taken
from eurobot_od.support.yaml_shapes import NUMBER, SCALAR, Key, Shape, converted, pairs_of
from eurobot_od.traffic.meaning import Decoder

# Words

T = TypeVar("T")

LONGEST_TIME = 86_400.0
"""Maximum time of a step, without repetitions, in s."""


def _at_most_a_day(seconds: float) -> float:
    if seconds > LONGEST_TIME:
        raise LocalError(f"{seconds:g} s is too long: at most {texts.text(LONGEST_TIME)}, a day")
    return seconds


DURATION = converted(shapes.DURATION, _at_most_a_day)
SOME_TIME = converted(DURATION, shapes.longer_than_0)
MAX_COUNT = 100_000
"""Maximum number of repetitions of a step, including those of the steps inside it, and of measured periods."""

COUNT = shapes.within(shapes.shape_of(int), Within(1, MAX_COUNT), "a number of times")
WITHIN = {"within": Key(DURATION)}
NAME = shapes.matching(r"[A-Za-z_][A-Za-z0-9_]*", "a name of letters, digits and _")


class Networks(NamedTuple):
    """The networks that suites may be for, and the catalogue of their message types.

    `find` returns the path of a suite's `dialect`, for None that of the default network; it raises UnknownName. `load`
    returns the devices of such a path. `refused` is called with invalid PDOs of their files. `actions` are those of
    device packages. `decoder` makes the decoder for the frames in reports.
    """

    find: Callable[[str | None], Path]
    catalogue: Catalogue = NOTHING
    load: Callable[[Path], tuple[Dictionary, ...]] = lambda path: network.load(network.read_network(path).nodes)
    refused: OnRefused = fatal
    actions: Mapping[str, MakeRow] = MappingProxyType({})
    decoder: Callable[[Iterable[Dictionary], Catalogue, OnRefused], Decoder] = Decoder


class Vocabulary(NamedTuple):
    """The words of one suite: those of its EDS files, and its variables.

    `constants` are variables with their values, `saved` those that a step sets. `nodes` are under test; `networks` has
    the networks of other suites.
    """

    networks: Networks
    decoder: Decoder
    dictionaries: Mapping[str, Dictionary]
    constants: Mapping[str, str]
    saved: frozenset[str]
    nodes: tuple[str, ...]

    def scale(self, values: Values) -> Scale:
        """Return what these values are read with."""
        return Scale(values, self.constants, self.saved)


def texts_at(root: yaml.Node, key: str) -> dict[str, str]:
    """Return the names and plain values below a key of the document: `{name: value}`, a list, or one value."""
    node = next((value for name, value in pairs_at(root) if name == key), None)
    if isinstance(node, yaml.ScalarNode):
        return {node.value: node.value}
    if isinstance(node, yaml.SequenceNode):
        return {each.value: each.value for each in node.value if isinstance(each, yaml.ScalarNode)}
    return {name: value.value for name, value in pairs_at(node) if isinstance(value, yaml.ScalarNode)}


def saved_names(node: yaml.Node) -> Iterator[str]:
    """Yield the names of all variables that steps below a node save."""
    if isinstance(node, yaml.SequenceNode):
        for each in node.value:
            yield from saved_names(each)
    for name, value in pairs_at(node):
        if name != "save":
            yield from saved_names(value)
        elif isinstance(value, yaml.ScalarNode):  # `sdo: {read: ..., save: t}`
            yield value.value
        else:  # `save: {t: Goto State Response.time}`, the action
            yield from (each for each, _ in pairs_at(value))


def pairs_at(node: yaml.Node | None) -> list[tuple[str, yaml.Node]]:
    """Return the keys and values of a mapping, nothing for any other node."""
    # No error for a wrong shape: the format reads everything again and reports it.
    if not isinstance(node, yaml.MappingNode):
        return []
    return [(key.value, value) for key, value in node.value if isinstance(key, yaml.ScalarNode)]


# Services

STATES = {name: state for state, name in STATE_NAMES.items()} | {suite.ANY: None}


def _or_any(shape: Shape[T], instead: T) -> Shape[T]:
    """Return a shape that also accepts the word `any`, read as `instead`."""

    def read(node: yaml.Node, problems: Problems) -> T:
        # The value of a list's node is a list, which equals no word.
        return instead if node.value == suite.ANY else shape.read(node, problems)

    return Shape(read)


def with_0x(digits: int, shape: Shape[T]) -> Shape[T]:
    """Return a shape of a code that also refuses as many hexadecimal digits without `0x`: it would be decimal."""

    def read(node: yaml.Node, problems: Problems) -> T:
        if isinstance(node, yaml.ScalarNode) and re.fullmatch(rf"[0-9A-Fa-f]{{{digits}}}", node.value):
            refuse(node, problems, f"{node.value!r} is hexadecimal; did you mean 0x{node.value}?")
        return shape.read(node, problems)

    return Shape(read)


TRANSFERS = {each.value: each for each in (suite.Blocks.PLAIN, suite.Blocks.WITHOUT_CRC)}


def _abort_code(text: str) -> int:
    """Parse an abort code, with all its digits if it is hexadecimal; raises LocalError."""
    if text.isdecimal() and len(text) <= 10 and int(text) <= 0xFFFFFFFF:
        return int(text)
    if not re.fullmatch(r"0[xX][0-9A-Fa-f]{8}", text):
        known = [f"0x{each:08X}" for each in AbortCode]
        raise LocalError(f"{text!r} is not an abort code of 8 hexadecimal digits{meant(text, known)}")
    return int(text, 16)


_ABORT = with_0x(8, converted(SCALAR, _abort_code))
ABORTS = _or_any(converted(shapes.one_or_more(_ABORT), suite.AbortCodes), suite.AbortCodes(()))


class ServiceShapes:
    """The shapes of services, for one document."""

    def __init__(self, words: Vocabulary) -> None:
        self._words = words
        self.node_key = Key(shapes.named(words.dictionaries, "node"))
        self.nodes = len(words.nodes)
        code_range = Within(0, 0xFFFF)  # (CiA 301, 7.2.7)
        number: Shape[Any] = with_0x(4, shapes.within(NUMBER, code_range, "error code"))
        state = Key(shapes.named(STATES, "NMT state"), "state in the heartbeat", needed=True)
        code = Key(_or_any(number, None), "error code, or any", needed=True)
        self.heartbeat: Shape[suite.Pattern] = self.service("state", state, self._heartbeat)
        self.emcy: Shape[suite.Pattern] = self.service("code", code, self._emergency, {"save": Key(NAME)})

    def dictionary(self, given: Dictionary | None) -> Dictionary:
        """Return the EDS of the given node, or of the only node under test; raises LocalError."""
        if given is not None:
            return given
        if len(self._words.nodes) != 1:
            raise LocalError("which node? Write it next to this, `node: drive`, or give the suite one node")
        return self._words.dictionaries[self._words.nodes[0]]

    def of(self, given: Dictionary | None) -> suite.NodeServices:
        """Return the services of a node; raises LocalError."""
        return suite.NodeServices.of(self.dictionary(given))

    def service(
        self, name: str, key: Key, make: Callable[..., T], more: Mapping[str, Key] = MappingProxyType({})
    ) -> Shape[T]:
        """Return the shape of a service: its one value, or a mapping that also has the node and more keys."""
        keys = {name: key, "node": self.node_key, **more}
        long: Shape[dict[str, Any]] = shapes.record(dict, keys)

        def read(node: yaml.Node, problems: Problems) -> T:
            is_long = isinstance(node, yaml.MappingNode)
            parts = long.read(node, problems) if is_long else {name: key.shape.read(node, problems)}
            with refusing(node, problems):
                return make(parts[name], parts.get("node"), **{each: parts[each] for each in more if each in parts})

        return Shape(read)

    def _heartbeat(self, state: Any, given: Dictionary | None) -> suite.Pattern:
        node = self.dictionary(given)
        return suite.ServicePattern(suite.HEARTBEAT, node.name, ERROR_CONTROL_BASE + node.node_id, state)

    def _emergency(self, code: int | None, given: Dictionary | None, save: str | None = None) -> suite.Pattern:
        node = self.dictionary(given)
        cob_id = base_identifier(node.default(EMCY))
        if cob_id is None:  # a step that waits for an EMCY would always be red
            raise LocalError(f"the EDS of {node.name} has no EMCY (0x{EMCY[0]:04X})")
        return suite.ServicePattern(suite.EMCY, node.name, cob_id, code, save)


# Frames


RAW = re.compile(r"(?P<id>[0-7]?[0-9A-Fa-f]{1,2})#(?:(?P<remote>R[0-8]?)|(?P<data>(?:[0-9A-Fa-f]{2}){0,8}))")
_DIGIT = r"(?:[0-9A-Fa-f?]|\[[0-9A-Fa-f]{1,16}\])"
RAW_PATTERN = re.compile(rf"(?P<id>[0-7]?[0-9A-Fa-f]{{1,2}})#(?P<data>(?:{_DIGIT}{{2}}){{0,8}})")
NO_ANSWER = "nothing"
"""Word that ends the answers to a message."""

ORDERS = {"any": suite.Order.ANY, "all": suite.Order.ALL}


class FrameShapes:
    """The shapes of frames, for one document."""

    def __init__(self, words: Vocabulary, services: ServiceShapes) -> None:
        self._words = words
        self._protocol = words.decoder.protocol
        self._others: dict[str, Shape[suite.Pattern]] = {
            "raw": Shape(_read_raw_pattern),
            "heartbeat": services.heartbeat,
            "emcy": services.emcy,
        }
        self.sent: Shape[suite.Sent] = Shape(self._read_sent)
        self.answers: Shape[dict[int, suite.Sent | None]] = Shape(self._read_answers)
        self.pattern: Shape[suite.Pattern] = Shape(self._read_pattern)
        self.patterns: Shape[suite.Patterns] = Shape(self._read_patterns)
        self.field: Shape[suite.FieldOf] = converted(SCALAR, self._field_of)

    # What is sent

    def _read_sent(self, node: yaml.Node, problems: Problems) -> suite.Sent:
        name, value = _named(node, problems)
        if name == "raw" and value is not None:
            match = _match(RAW, value, problems, "a frame such as 008#D27423")
            cob_id = int(match["id"], 16)
            remote = match["remote"]
            data = match["data"]
            # `R4` asks for 4 bytes: a remote frame has a length, and no data.
            frame = RemoteFrame(cob_id, bytes(int(remote[1:] or 0))) if remote else Frame(cob_id, bytes.fromhex(data))
            return suite.SentFrame(frame)
        binding = taken(name, problems, self._protocol.binding)
        fields = self._fields(binding, value, problems, partial(_operand, binding))
        missing = [each for each in binding.kinds if each not in fields and each not in binding.defaults]
        if missing:
            refuse(node, problems, f"{binding.name}: {', '.join(missing)} missing")
        sent = suite.SentMessage(self._protocol, binding, fields)
        # Encoding shows which values are wrong only together, such as half of an unknown position. Variables that
        # steps save have no value yet.
        if all(operand.variable is None for operand in fields.values()):
            with refusing(node, problems):
                sent.frame({})
        return sent

    def _read_answers(self, node: yaml.Node, problems: Problems) -> dict[int, suite.Sent | None]:
        """Read what each message is answered with; None ends its answers."""
        pairs = pairs_of(node, problems)
        # The value of a list's or mapping's node is a list, so only a plain text equals this word.
        parts: Iterator[tuple[NodeReader[suite.Sent | None], yaml.Node]] = (
            (self._read_sent if value.value != NO_ANSWER else lambda *_: None, value) for value in pairs.values()
        )
        answers = read_all(parts, problems)
        bindings = [taken(name, problems, self._protocol.binding) for name in pairs]
        return {binding.cob_id: answer for binding, answer in zip(bindings, answers)}

    # What is expected

    def _read_pattern(self, node: yaml.Node, problems: Problems) -> suite.Pattern:
        name, value = _named(node, problems)
        # Without a value it may be a message, as a network may have a PDO called `heartbeat`.
        if value is not None and name in self._others:
            return self._others[name].read(value, problems)
        binding = taken(name, problems, self._protocol.binding)
        return suite.MessagePattern(self._protocol, binding, self._fields(binding, value, problems, expectation))

    def _read_patterns(self, node: yaml.Node, problems: Problems) -> suite.Patterns:
        several = shapes.listing(self.pattern).read
        if isinstance(node, yaml.SequenceNode):
            return suite.Patterns(suite.Order.IN_ORDER, several(node, problems))
        if isinstance(node, yaml.MappingNode):
            name, value = _named(node, problems)
            if value is not None and name in ORDERS:
                return suite.Patterns(ORDERS[name], several(value, problems))
        return suite.Patterns(suite.Order.IN_ORDER, (self.pattern.read(node, problems),))

    # Fields

    def _fields(
        self, binding: Binding, node: yaml.Node | None, problems: Problems, read: Callable[[str, Scale], T]
    ) -> dict[str, T]:
        """Read a message's fields and their values; all problems are reported."""
        if node is None or (isinstance(node, yaml.ScalarNode) and node.value == "" and not node.style):
            return {}  # nothing after the message's name; '' in quotes is a text, and wrong here

        def read_at(key: PlacedText, value: yaml.Node, problems: Problems) -> tuple[str, T]:
            field = taken(key, problems, lambda name: _field(binding, name))
            kind = binding.kinds[field]
            scale = self._words.scale(FieldValues(kind, binding.limits[field]))
            return field, _read_value(value, kind, scale, problems, read)

        return dict(
            read_all(((partial(read_at, key), each) for key, each in pairs_of(node, problems).items()), problems)
        )

    def _field_of(self, text: PlacedText) -> suite.FieldOf:
        # From the right, as a message's name may have a dot itself: `my motor.TPDO1.Speed`.
        message, _, field = text.rpartition(".")
        # Without a dot, look up the whole text, so that the error does not name an empty message.
        binding = self._protocol.binding(message or str(text))
        return suite.FieldOf(binding, _field(binding, field))


def _named(node: yaml.Node, problems: Problems) -> tuple[PlacedText, yaml.Node | None]:
    """Return the name of a message, and the node after it."""
    if isinstance(node, yaml.ScalarNode):
        return SCALAR.read(node, problems), None
    pairs = pairs_of(node, problems)
    if len(pairs) != 1:
        refuse(node, problems, f"expected one message, found {len(pairs)} keys")
    return next(iter(pairs.items()))


def _read_raw_pattern(node: yaml.Node, problems: Problems) -> suite.Pattern:
    match = _match(
        RAW_PATTERN, node, problems, "a frame such as 008#D274?? with ? for any digit, [23] for one of these"
    )
    return suite.FramePattern(int(match["id"], 16), match["data"].upper())


def _match(form: re.Pattern[str], node: yaml.Node, problems: Problems, what: str) -> re.Match[str]:
    text = SCALAR.read(node, problems)
    match = form.fullmatch(text)
    if match is None:
        refuse(node, problems, f"expected {what}, found {str(text)!r}")
    return match


def _field(binding: Binding, name: str) -> str:
    """Return a field by its name; raises UnknownName if the EDS does not map it."""
    field = field_name(name)
    if field not in binding.limits:
        raise UnknownName(f"field of {binding.name}", str(name), binding.limits)
    return field


def _operand(binding: Binding, text: str, scale: Scale) -> Operand:
    """Read a value to send; one out of range can be sent as a raw frame only. Raises as `Scale.operand`."""
    try:
        return scale.operand(text)
    except ValueProblem as error:
        # A suite may test a node with a forbidden value, but must say so by a raw frame.
        number = parse_number(text) is not None
        hint = f"; {{raw: '{binding.cob_id:03X}#...'}} sends any bits" if number else ""
        raise ValueProblem(f"{error}{hint}") from None


def _read_value(node: yaml.Node, kind: Kind, scale: Scale, problems: Problems, read: Callable[[str, Scale], T]) -> T:
    """Read a field's value; some kinds also accept a mapping."""
    if kind.keyed_form is not None and isinstance(node, yaml.MappingNode):
        words = _keyed(kind.keyed_form).read(node, problems)
        # Converted to the text that the kind parses, so that a mapping and a text mean the same.
        text = ",".join(f"{key}:{word}" for key, word in words.items()) or "none"
    else:
        text = str(SCALAR.read(node, problems))
    with refusing(node, problems):
        return read(text, scale)


def _keyed(form: KeyedForm) -> Shape[dict[Any, Any]]:
    """Return the shape of a mapping from keys, in any spelling, to words."""
    keys = {plain_name(key): key for key in form.keys}

    def known(text: PlacedText) -> str:
        if plain_name(text) not in keys:
            raise UnknownName(form.key, str(text), form.keys)
        return keys[plain_name(text)]

    words = shapes.named({word: word for word in form.words}, form.word)
    return shapes.mapping(words, converted(SCALAR, known))


# Actions


class ActionRow(NamedTuple):
    """A row of the table of actions: an action's shape, what makes it, and its further keys, by name.

    Without `make`, the shape reads the action itself.
    """

    shape: Shape[Any]
    make: Callable[..., suite.Action] = lambda action, **keys: action._replace(**keys) if keys else action
    extra: Mapping[str, Key] = MappingProxyType({})


class DocumentShapes:
    """The shapes for the keys of actions, for one document."""

    def __init__(self, words: Vocabulary, step: Shape[suite.Step]) -> None:
        self.words = words
        self.step = step
        self.services = ServiceShapes(words)
        self.frames = FrameShapes(words, self.services)


MakeRow: TypeAlias = Callable[[DocumentShapes], ActionRow]
"""Makes an action's row for one document."""
