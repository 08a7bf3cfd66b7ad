"""`load` computes bus load and response times, for a network or a robot."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Annotated

from eurobot_od.cli import ExitStatus, RobotName
from eurobot_od.cli.devices import Devices, Dialect, left_out
from eurobot_od.cli.options import BIT_RATE, BitRate, Json, give, whole, write
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.network import NetworkFile, read_network
from eurobot_od.od.network import load as load_files
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.plugin import Plugin
from eurobot_od.support import texts
from eurobot_od.traffic.load import ErrorRate, MessageSet, as_data, chart, load_report, network_set, table, too_slow


def _errors(text: str) -> ErrorRate:
    """Parse N/TIME; raises LocalError."""
    number, slash, time = text.partition("/")
    try:
        rate = ErrorRate(int(number), texts.microseconds(time))
    except (ValueError, LocalError):
        rate = ErrorRate(-1)  # one error for both halves
    if not slash or rate.number < 0 or rate.interval < 1:
        raise LocalError(f"{text!r} is not a number and a time, such as 1/10ms")
    return rate


def load(
    path: Annotated[str | None, Option(metavar="NETWORK", is_file=True)] = None,
    *,
    bitrate: BitRate | None = None,
    errors: Annotated[ErrorRate | None, Option(metavar="N/TIME", read=_errors)] = None,
    mailboxes: Annotated[int | None, Option(metavar="N", read=whole(0, what="a number of mailboxes"))] = None,
    as_json: Json = False,
    svg: Annotated[Path | None, Option(metavar="FILE", is_output=True)] = None,
    dialect: Dialect = None,
    robot_name: RobotName = None,
) -> ExitStatus:
    """Compute how full a CAN bus is and how late each message can be, for a network or a robot.

    Worst-case response times by Davis, Burns, Bril and Lukkien (2007), with transmit mailboxes and errors. Exit status
    1 if a deadline can be missed.

    path: network file or folder of EDS files (default: the robot's network)
    bitrate: bit/s (default: the file's, or 500000)
    errors: at most N bit errors in any TIME, such as 1/10ms
    mailboxes: transmit mailboxes without abort in every node, 0 for enough (default: each node's setting)
    as_json: print as JSON, times in us
    svg: write a chart of the response times

    $ load network.yaml
    $ load network.yaml --errors 1/10ms --svg load.svg
    """
    if path and dialect:
        raise LocalError("--dialect is for a robot's network: leave it out, or the file")
    robot = Devices(network=path, robot_name=robot_name).robot
    messages = _messages(load_files(read_network(path).nodes), Path(path), robot) if path else of_robot(robot, dialect)
    if mailboxes is not None:
        nodes = {each.node for each in messages.messages}
        messages = messages._replace(mailboxes=dict.fromkeys(nodes, mailboxes) if mailboxes else {})
    if errors is not None:
        messages = messages._replace(errors=errors)
    bit_rate = bitrate or messages.bit_rate or BIT_RATE
    report = load_report(messages, bit_rate)
    slower = () if bit_rate in messages.offered and not report.holds else too_slow(messages)
    give(as_json, as_data(report), chain(table(report), slower))
    if svg:
        write(svg, chart(report, f"Response times at {bit_rate / 1000:g} kbit/s") + "\n")
    return ExitStatus.FINE if report.holds else ExitStatus.FOUND


def of_robot(robot: Plugin, dialect: str | None = None) -> MessageSet:
    """Return the messages of a dialect's nodes, with the periods of the dialects' network file, if there is one."""
    return _messages(robot.dialects.load_all(dialect), robot.dialects.network_file(), robot)


def _messages(dictionaries: Sequence[Dictionary], file: Path | None, robot: Plugin) -> MessageSet:
    """Return the messages of devices, with the periods of a network file; raises FileError."""
    with left_out() as refused:
        bindings = Protocol.of_devices(dictionaries, robot.catalogue(), refused).bindings
    names = {each.cob_id: each.name for each in bindings}
    return network_set(dictionaries, names, read_network(file) if file else NetworkFile(), str(file))
