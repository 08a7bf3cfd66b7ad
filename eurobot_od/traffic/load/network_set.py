"""The messages of a network of devices: what their EDS files say, and what a network file says about the rest.

A TPDO with an event timer or a SYNC falls due by itself, no more often than its inhibit time; so do heartbeats
(0x1017), SYNC (0x1006), and EMCY with an inhibit time (0x1015). All else has a row in the network file's `traffic`.

A message without a known period is refused, as no bound holds without it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from eurobot_od.errors import DictionaryError, FileError, LocalError
from eurobot_od.od import standard, values
from eurobot_od.od.dictionary import Dictionary, SdoChannel
from eurobot_od.od.network import NetworkFile, TrafficEntry
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import PdoDirection
from eurobot_od.support import texts
from eurobot_od.traffic.load.analysis import MessageSet, PeriodicMessage

SERVER_NODE_ID = 3
"""Sub-index of an SDO client's record (CiA 301, 7.5.2.34)."""
MAILBOXES = "Transmit.Mailboxes"
"""A setting of a device that says how many mailboxes it has."""

MS, INHIBIT_UNIT = 1000, 100
"""Microseconds of a millisecond, and of the unit of inhibit times."""


def network_set(
    dictionaries: Iterable[Dictionary], names: Mapping[int, str], network: NetworkFile, file: str
) -> MessageSet:
    """Return the messages of some devices; `names` are those of the PDOs by COB-ID, `file` is the network file's name.

    Raises FileError for a row of the network file that does not hold, LocalError for messages without a period.
    """
    devices = tuple(dictionaries)
    reader = _Rows(devices, network.traffic, file)
    pdos = [_pdo(device, each, names) for device in devices for each in _sent_pdos(device)]
    services = [each for device in devices for each in _services(device, devices)]
    rows = [*((each.name, each) for each in pdos), *services]
    reader.refuse_unknown({row for row, _ in rows})
    by_itself = [each for device in devices for each in _by_itself(device, devices, names)]
    by_rows = [each for row, message in rows for each in reader.sent(row, message)]
    known = {(each.identifier, each.node) for each in (*by_itself, *by_rows)}
    missing = dict.fromkeys(each.name for each in pdos if (each.identifier, each.node) not in known)
    if missing:
        raise LocalError(f"no period is known of {', '.join(missing)}; say it in `traffic` of the network file")
    mailboxes = {device.name: count for device in devices if (count := _mailboxes(device))}
    bit_rate = None if network.bit_rate is None else network.bit_rate * 1000
    rates = [set(device.objects.device_information.allowed_baudrates) for device in devices]
    offered = tuple(sorted(set.intersection(*rates))) if rates else ()
    # What several nodes send by one name is told apart by the node.
    sent = [each.name for each in by_rows]
    apart = [e._replace(name=f"{e.name} {e.node}") if sent.count(e.name) > 1 else e for e in by_rows]
    urgent_first = sorted([*by_itself, *apart], key=lambda each: each.identifier)
    return MessageSet(tuple(urgent_first), mailboxes, bit_rate=bit_rate, offered=offered)


def _mailboxes(device: Dictionary) -> int | None:
    try:
        return device.number(device.address(MAILBOXES))
    except DictionaryError:  # no device has to have such a setting
        return None


# What the EDS files say


def _sent_pdos(device: Dictionary) -> Iterator[Pdo]:
    return (each for each in device.pdos if each.direction is PdoDirection.TPDO and each.valid)


def _pdo(device: Dictionary, pdo: Pdo, names: Mapping[int, str]) -> PeriodicMessage:
    name = names.get(pdo.cob_id, f"{device.name}.{pdo.name}")
    return PeriodicMessage.of(name, pdo.cob_id, pdo.length, device.name)


def _by_itself(
    device: Dictionary, devices: Iterable[Dictionary], names: Mapping[int, str]
) -> Iterator[PeriodicMessage]:
    """Give what a device sends by timer or SYNC, or whenever its inhibit time allows."""
    cycle = next((number for each in devices if (number := each.number(standard.SYNC_PERIOD))), 0)
    for pdo in _sent_pdos(device):
        message, inhibit = _pdo(device, pdo, names), pdo.inhibit_time * INHIBIT_UNIT
        if pdo.is_synchronous and cycle:  # type 0, with the next SYNC if it has changed, may be as often as type 1
            yield message.every(cycle * max(pdo.transmission_type, 1), f"transmission type {pdo.transmission_type}")
        elif inhibit:  # before the event timer, which only says how seldom it may be sent
            yield message.every(inhibit, "inhibit time")
        elif pdo.event_timer:
            yield message.every(pdo.event_timer * MS, "event timer")
    if heartbeat := device.number(standard.HEARTBEAT_TIME):
        identifier = values.ERROR_CONTROL_BASE + device.node_id
        message = PeriodicMessage.of(f"Heartbeat {device.name}", identifier, 1, device.name)
        yield message.every(heartbeat * MS, "0x1017")
    if (device.number(standard.SYNC) or 0) & standard.SYNC_PRODUCER and (own := device.number(standard.SYNC_PERIOD)):
        yield PeriodicMessage.of("SYNC", values.SYNC_COB_ID, 0, device.name).every(own, "0x1006")
    if pause := device.number(standard.EMCY_INHIBIT_TIME):
        yield _emcy(device).every(pause * INHIBIT_UNIT, "0x1015")


def _emcy(device: Dictionary) -> PeriodicMessage:
    identifier = device.cob_id(standard.EMCY, values.EMCY_BASE)
    return PeriodicMessage.of(f"EMCY {device.name}", identifier, 8, device.name)


def _services(device: Dictionary, devices: Iterable[Dictionary]) -> Iterator[tuple[str, PeriodicMessage]]:
    """Give the services with the names of their rows: EMCY without an inhibit time, SDO if a client is there."""
    if not device.number(standard.EMCY_INHIBIT_TIME):
        yield "EMCY", _emcy(device)
    for client in devices:
        if any(client.number((index, SERVER_NODE_ID)) == device.node_id for index in standard.SDO_CLIENTS):
            at, request = SdoChannel.of(device), f"SDO request {device.name}"
            yield "SDO", PeriodicMessage.of(request, at.requests, 8, client.name)
            yield "SDO", PeriodicMessage.of(f"SDO answer {device.name}", at.answers, 8, device.name, request)


# What the network file says


class _Rows:
    """The rows of a network file's traffic, with the settings of the devices."""

    def __init__(self, devices: tuple[Dictionary, ...], rows: Mapping[str, TrafficEntry], file: str) -> None:
        self._devices, self._rows, self._file = devices, rows, file

    def refuse_unknown(self, known: set[str]) -> None:
        """Refuse a row of a message that no node sends."""
        for name in self._rows:
            if name not in known:
                raise self._error(name, f"traffic of {name!r}, which no node sends")

    def sent(self, name: str, message: PeriodicMessage) -> Iterator[PeriodicMessage]:
        """Give a message as its row says, if there is one."""
        row = self._rows.get(name)
        if row is not None:
            sent = message.every(self._period(name, row), row.reason)
            yield sent._replace(
                deadline=self._time(row.deadline, message.node) if row.deadline else sent.period,
                jitter=self._time(row.jitter, message.node) if row.jitter else 0,
                answers=row.answers or message.answers,
            )

    def _period(self, name: str, row: TrafficEntry) -> int:
        met = {name}
        while row.answers:  # an answer is as frequent as what it answers; in a circle nothing has a period
            if row.answers in met or row.answers not in self._rows:
                raise self._error(row.answers, f"{name!r} answers {row.answers!r}, which has no period")
            met.add(row.answers)
            row = self._rows[row.answers]
        period = self._time(row.every, "") if row.every else 0
        if not period:
            raise self._error(
                row.every or name, f"{name!r} has a period of 0" if row.every else f"{name!r} has no period"
            )
        return period

    def _time(self, text: str, node: str) -> int:
        """Return the us of a duration, or of a setting in ms: the node's own before another's."""
        if texts.is_duration(text):
            return texts.microseconds(text)
        for device in sorted(self._devices, key=lambda each: each.name != node):
            try:
                number = device.number(device.address(text))
            except DictionaryError:
                continue
            if number is not None:
                return number * MS
        raise self._error(text, f"{text!r} is neither a duration nor a setting of a device")

    def _error(self, at: str, what: str) -> FileError:
        """Return the error at a text of the network file, which knows its place."""
        known = next((name for name in self._rows if name == at), at)  # the file's own text, with its place
        place = getattr(at, "place", None) or getattr(known, "place", None)
        return FileError(f"{self._file}:{place.line}:{place.column}" if place else self._file, what)
