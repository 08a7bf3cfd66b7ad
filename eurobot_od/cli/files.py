"""Commands that write files: `export` and `make-eds`."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from io import BytesIO
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from eurobot_od import loading
from eurobot_od.cli import ExitStatus, complain
from eurobot_od.cli.decode import Log, Reading, decoder_for, entries
from eurobot_od.cli.devices import Devices, complain_of_repairs, left_out
from eurobot_od.cli.options import (
    BIT_RATE,
    BitRate,
    Clone,
    FrameNames,
    Moment,
    OneDevice,
    Output,
    assigned,
    write,
    write_dcf,
)
from eurobot_od.cli.signature import Forms, Option
from eurobot_od.errors import DictionaryError, LocalError, MappingError, YamlError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.formats import SUFFIXES
from eurobot_od.od.network import NodeFile, is_network, node_file, read_network
from eurobot_od.od.values import NODE_IDS
from eurobot_od.support import extras
from eurobot_od.support.files import check_writable, read_whole, write_whole
from eurobot_od.support.texts import amount

if TYPE_CHECKING:
    from eurobot_od.od.dcf import Write
    from eurobot_od.od.values import Address

# Other forms

STEM = "pdo"
"""Prefix of identifiers in code that is written to standard output."""

Name: TypeAlias = Annotated[str | None, f"prefix of all identifiers (default: the output's name, or {STEM})"]


def _stem(name: str | None, output: Path | None) -> str:
    return name or (output.stem if output else STEM)


def c(*, output: Output = None, name: Name = None, devices: Devices) -> None:
    """Write the messages as a C99 header: identifiers, lengths, structs, functions that pack and unpack.

    $ export c --eds 5=motor.eds -o motor.h
    """
    from eurobot_od.export.c import c_header  # here, as the other forms do not need it

    write(output, c_header(devices.protocol(), _stem(name, output)))


def dbc(*, output: Output = None, devices: Devices) -> None:
    """Write the messages as a DBC file: identifiers, bits, units, limits, value tables, senders and receivers.

    $ export dbc --eds 5=motor.eds -o motor.dbc
    """
    from eurobot_od.export.dbc import dbc_text

    write(output, dbc_text(devices.protocol()))


def docs(*, output: Output = None, format: Literal["markdown", "html"] | None = None, devices: Devices) -> None:
    """Write messages and object dictionaries as a document to read: Markdown or HTML.

    format: default: by FILE's suffix, else markdown

    $ export docs --eds 5=motor.eds -o motor.md
    $ export docs --eds 5=motor.eds --format html -o motor.html
    """
    from eurobot_od.export.forms import docs_text, form_of

    form = format or (form_of(output) if output else "markdown")
    write(output, docs_text(devices.protocol(), devices.load(), form))


def wireshark(*, output: Output = None, name: Name = None, devices: Devices) -> None:
    """Write a dissector for Wireshark and tshark, in Lua: names, fields, units, values with names.

    $ export wireshark --eds 5=motor.eds -o motor.lua
    """
    from eurobot_od.export.wireshark import lua_text

    write(output, lua_text(devices.protocol(), _stem(name, output)))


def mcap(
    log: Log,
    *,
    output: Annotated[Path, Option("-o", metavar="FILE", is_output=True)],
    reading: Reading,
    devices: Devices,
    names: FrameNames,
) -> None:
    """Write a log as MCAP for Foxglove and PlotJuggler: a channel for each message, and poses if any.

    log: log in any format; -: standard input
    output: the MCAP file

    $ export mcap run.log -o run.mcap --eds 5=motor.eds
    """
    with extras.needed("mcap"):
        from eurobot_od.traffic.mcap import write as write_mcap
    decoder = decoder_for([log], reading, devices, names)
    check_writable(output)  # before a long log is decoded
    file = BytesIO()  # so that an existing file stays if anything fails
    logged = (entry for _, entry in entries([log], reading))
    messages, poses, damage = write_mcap(file, logged, decoder, devices.robot.drawings(decoder.protocol))
    write_whole(output, file.getvalue())
    print(f"{output}: {amount(messages, 'message')}, {amount(poses, 'pose')}, {amount(damage, 'defect')}")


def suite(
    log: Log,
    *,
    node: Annotated[str, Option(metavar="NAME")],
    begin: Annotated[Moment, Option("--from")] = 0.0,
    end: Annotated[Moment, Option("--to")] = inf,
    output: Output = None,
    reading: Reading,
    devices: Devices,
    names: FrameNames,
) -> None:
    """Write a stretch of a log as a suite of checks for a node, ready to be edited and run by `check`.

    What the node was asked and told becomes steps with its answers, what it sent by itself the ranges and periods that
    were seen.

    log: log in any format; -: standard input
    node: the node that the suite is for
    begin: time of the first frame, from the log's begin (default: all)
    end: time of the last frame, from the log's begin

    $ export suite run.log --node motor --eds 5=motor.eds -o motor.yaml
    $ export suite run.log --node motor --from 10s --to 20s --eds 5=motor.eds
    """
    from eurobot_od.check.recorded import suite_of

    decoder = decoder_for([log], reading, devices, names)
    logged = (entry[1:] for _, entry in entries([log], reading))
    write(output, suite_of(decoder, node, logged, f"{node} as in {Path(log).name}", begin, end))


IN_THE_NETWORK = "a network's file says `modules` and `patch` of each node"

DeviceFile: TypeAlias = Annotated[str, Option(metavar="FILE", is_file=True)]


def canopennode(
    file: DeviceFile,
    *,
    output: Annotated[Path, Option("-o", metavar="FOLDER")],
    name: Annotated[str, "begins all identifiers, and names the files"] = "OD",
    storage: Annotated[Sequence[tuple[str, str]], assigned("INDEX=GROUP")] = (),
    device: OneDevice,
) -> ExitStatus:
    """Write the object dictionary as C for CANopenNode 4: OD.h and OD.c.

    What the stack with its default configuration needs and the file lacks is said, as by `lint --for canopennode`; the
    exit status is 1 then.

    file: an EDS, DCF, XDD or XDC
    output: the folder for OD.h and OD.c
    storage: storage group of an object, such as 2100=PERSIST_APP; repeatable

    $ export canopennode motor.eds -o firmware
    """
    from eurobot_od.export.canopennode import object_dictionary, storage_groups
    from eurobot_od.lint.findings import Severity, count
    from eurobot_od.lint.rules import stack_findings

    if output.suffix in (".c", ".h"):
        raise LocalError(f"-o {output} is to be a folder, for OD.h and OD.c; write -o {output.parent / 'firmware'}")
    groups = storage_groups(storage, name)
    dictionary = device.load(file)
    complain_of_repairs([dictionary])
    found = stack_findings(dictionary.content, str(dictionary.file), "canopennode")
    made = object_dictionary(dictionary, name, groups)
    output.mkdir(exist_ok=True)  # late, so that a failure leaves no empty folder
    for file_name, text in made.items():
        write(output / file_name, text)
    shown = [each for each in found if each.severity is not Severity.INFO]
    print("\n".join(map(str, shown)), end="\n" if shown else "")
    print(f"{output}: {' and '.join(made)}, {amount(len(dictionary.members), 'object')}")
    return ExitStatus.FOUND if count(found, Severity.ERROR) else ExitStatus.FINE


def eds(file: DeviceFile, *, output: Output = None, device: OneDevice) -> None:
    """Write the EDS of a device in the form that every tool reads.

    Of a DCF it leaves out what is one device's own: values, node-ID and bit rate.

    file: an EDS, DCF, XDD or XDC

    $ export eds motor.xdd -o motor.eds
    """
    from eurobot_od.od.dcf import Dcf, eds_text

    dictionary = device.load(file)
    complain_of_repairs([dictionary])
    name = output.name if output else f"{dictionary.file.stem}.eds"
    write_dcf(output, Dcf(eds_text(dictionary, name).encode(dictionary.normal.encoding), {}))


def dcf(
    file: Annotated[str, Option(metavar="NODE-ID=FILE", is_file=True)],
    *,
    output: Output = None,
    bitrate: BitRate = BIT_RATE,
    device: OneDevice,
) -> None:
    """Write the DCF of a device that need not be there: its file, the values of a patch, its node-ID and bit rate.

    file: node-ID, and an EDS, DCF, XDD or XDC
    bitrate: bit/s that it is commissioned with

    $ export dcf 5=motor.eds --patch ours.yaml -o motor5.dcf
    """
    from eurobot_od.od.dcf import with_contents

    if node_file(file).node_id is None:
        raise LocalError(f"say which node the DCF is for: 5={file}")
    dictionary = device.load(file)
    complain_of_repairs([dictionary])
    stem = output.stem if output else dictionary.file.stem
    write_dcf(output, with_contents(dictionary, {}, dictionary.node_id, stem, bitrate // 1000, stem))


def xdd(file: DeviceFile, *, output: Output = None, device: OneDevice) -> None:
    """Write the device description in XML (CiA 311) of an EDS or DCF: every object with all the file says about it.

    Of a network the descriptions of all nodes are written, into a folder.

    file: an EDS or DCF, or a network
    output: default: standard output; of a network a folder

    $ export xdd motor.eds -o motor.xdd
    """
    from eurobot_od.export.xdd import xdd_text

    if not is_network(file):
        dictionary = device.load(file)
        complain_of_repairs([dictionary])
        write(output, xdd_text(dictionary))
        return
    if output is None:
        raise LocalError("of a network -o names the folder that the files are written to")
    device.refuse(IN_THE_NETWORK)
    texts: dict[str, str] = {}
    for each in read_network(file).nodes:
        # Any node-ID, as values keep `$NODEID`; the node's modules and patches belong to the device.
        dictionary = each.load(each.node_id or NODE_IDS[0])
        complain_of_repairs([dictionary])
        texts[f"{each.name or Path(each.file).stem}.xdd"] = xdd_text(dictionary)
    output.mkdir(exist_ok=True)  # late, so that a failure leaves no empty folder
    for name, text in texts.items():
        write(output / name, text)


def cdcf(
    file: Annotated[str, Option(metavar="FILE", is_file=True)],
    *,
    output: Output = None,
    eds: Annotated[str | None, Option(metavar="[NODE-ID=]FILE", is_file=True)] = None,
    clone: Clone,
    device: OneDevice,
) -> None:
    """Write the concise DCF of a DCF, or show what a concise DCF writes.

    The suffix of the file says which; of a network the DCF files of all nodes are written, into a folder. The writes
    are in the order of CiA 301's PDO procedure (7.5.2.36): a PDO is off while it is mapped.

    file: [NODE-ID=]DCF, a network, or a concise DCF
    output: default: print the writes; of a network a folder
    eds: EDS of the device that a concise DCF is for, to name its objects

    $ export cdcf 5=motor.eds -o motor.bin
    """
    # By the suffix, as a concise DCF begins with a mere count.
    if is_network(file):
        device.refuse(IN_THE_NETWORK)
        made = {each.name or Path(each.file).stem: concise(each, clone) for each in read_network(file).nodes}
        if output is not None:
            output.mkdir(exist_ok=True)  # late, so that a failure leaves no empty folder
        for name, each in made.items():
            if output is None:
                print(f"{name}:")
            write_concise(*each, output / f"{name}.cdcf" if output else None)
    elif Path(file).suffix.lower() in SUFFIXES:
        node = node_file(file)._replace(modules=device.module, patch=device.patch)
        write_concise(*concise(node, clone), output)
    elif output is not None:
        raise LocalError(f"{file} is not a DCF: what a concise DCF writes is printed, without -o")
    else:
        show_concise(file, eds)


def concise(node: NodeFile, clone: Clone) -> tuple[list[Write], Dictionary]:
    """Return the writes of a DCF, without invalid PDOs, and its dictionary; raises DictionaryError.

    The DCF may be that of another node.
    """
    from eurobot_od.client.configure import all_writes, check_file, check_whole
    from eurobot_od.od.dcf import renumbered
    from eurobot_od.od.values import pdo_of

    dictionary = node._replace(name="").load()
    if node.node_id is not None:
        dictionary = renumbered(dictionary, node.node_id, clone.chosen)
    refused = list[MappingError]()
    with left_out() as complained:

        def leave_out(error: MappingError) -> None:
            refused.append(error)
            complained(error)

        if node.node_id is None:
            check_file(dictionary, dictionary.node_id, leave_out, leave_out)
        else:  # with a node-ID, the file is used for that node, even if it was made for another
            check_whole(dictionary, leave_out, leave_out)
    bad = {pdo_of(error.index or 0) for error in refused}
    writes = [each for each in all_writes(dictionary) if pdo_of(each.address[0]) not in bad - {None}]
    return writes, dictionary


def write_concise(writes: Sequence[Write], dictionary: Dictionary, output: Path | None) -> None:
    """Write a concise DCF, or print its writes."""
    from eurobot_od.cli.objects import print_readings
    from eurobot_od.client.configure import decoded
    from eurobot_od.od.dcf import pack

    if output is None:
        print_readings(decoded(writes, dictionary), as_json=False)
    else:
        write_whole(output, pack(writes))
        print(f"{output}: {len(writes)} writes for node {dictionary.node_id}")


def show_concise(file: str, eds: str | None) -> None:
    """Print the writes of a concise DCF; raises DictionaryError, LocalError."""
    from eurobot_od.cli.objects import print_readings
    from eurobot_od.client.configure import decoded
    from eurobot_od.od.dcf import Truncated, unpack

    try:
        writes = unpack(read_whole(file))
    except Truncated as error:
        raise DictionaryError(file, None, f"not a concise DCF: {error}") from error
    named = node_file(eds) if eds else None
    dictionary = Dictionary.load(named.file, named.node_id) if named else None
    print_readings(decoded(writes, dictionary), as_json=False)


def bus(*, network: Annotated[str, Option(metavar="PATH", is_file=True)], output: Output = None, clone: Clone) -> None:
    """Write a network as the YAML of dcfgen and ros2_canopen (`bus.yml`): nodes, files, and what a master writes.

    network: network file or folder

    $ export bus --network network.yaml -o bus.yml
    """
    from eurobot_od.od.bus_file import bus_text
    from eurobot_od.od.objects import at, data_type, label

    described = read_network(network)
    folder = output.parent if output else Path()
    nodes: dict[str, tuple[int, str, list[tuple[Address, int]]]] = {}
    for each in described.nodes:
        writes, dictionary = concise(each, clone)
        numbers: list[tuple[Address, int]] = []
        for address, data in writes:
            variable = at(address, dictionary.objects)
            value = data_type(variable).read(data)
            if isinstance(value, int):
                numbers.append((address, int(value)))
            else:
                complain(f"left out {label(variable)}: such a file has only whole numbers")
        name = re.sub(r"\W", "_", each.name or Path(each.file).stem)
        nodes[name] = (dictionary.node_id, Path(os.path.relpath(each.file, folder)).as_posix(), numbers)
    write(output, bus_text(nodes, described.bit_rate))


export = Forms(
    "Turn device files into other forms: EDS, DCF, XDD, C, DBC, Lua, documents; logs into MCAP and suites.",
    {each.__name__: each for each in (c, canopennode, dbc, docs, wireshark, mcap, suite, eds, dcf, xdd, cdcf, bus)},
)


def make_eds(
    table: Annotated[Path, Option(metavar="TABLE")],
    *,
    output: Annotated[Path, Option("-o", metavar="FOLDER")],
    check: bool = False,
    same_revision: bool = False,
) -> ExitStatus:
    """Make EDS files from a table: of one device, or of a network's protocol.

    The table of a device makes its EDS (docs/idea-to-firmware.md); that of a network (docs/eds.md) a folder for each
    dialect, with a file for each node, and the network file.

    table: YAML of a device (`device:`), or of a network (`nodes:`)
    output: folder for the EDS, or for the folders of the dialects
    check: write nothing; list the files that differ, with exit status 1 if any do
    same_revision: write changed bits or codes of messages although the dialect's revision_number is as before

    $ make-eds thermometer.yaml -o .
    $ make-eds eds/protocol.yaml -o made
    $ make-eds eds/protocol.yaml -o made --check
    """
    from eurobot_od.od.make import read_table
    from eurobot_od.od.make.device import device_eds, is_device_table, read_device_table
    from eurobot_od.od.make.text import changed_bits, differences, make_files, write_files
    from eurobot_od.support.yaml_places import START, PlacedError, Problem, placed_lines, telling

    # Bytes that are not UTF-8 become a character that the table refuses, with its line and column.
    source = read_whole(table).decode(errors="replace")
    if is_device_table(source):
        name = f"{table.stem}.eds"
        try:
            texts = {name: device_eds(read_device_table(source, str(table)), name).decode()}
        except PlacedError as error:
            raise YamlError(table, placed_lines(table, [Problem(error.place or START, str(error))])) from error
        read = None
    else:
        read = read_table(source, table, loading.table_of)
        texts = make_files(read)
    if not check:
        with telling(table) as problems:
            problems += changed_bits(read, texts, output) if read and not same_revision else ()
        write_files(texts, output)
        return ExitStatus.FINE
    found = differences(texts, output)
    print("\n".join(found) or f"{output}: as the table says: {amount(len(texts), 'file')}")
    return ExitStatus.FOUND if found else ExitStatus.FINE
