"""Turn EDS and DCF files into other forms: C, DBC, documents, Wireshark dissector, XDD, concise DCF; logs into MCAP."""

from __future__ import annotations

import argparse
from io import BytesIO
from pathlib import Path

from eurobot_od.cli import logs
from eurobot_od.cli import output as files
from eurobot_od.cli.options import Devices, complain_of_repairs, left_out
from eurobot_od.cli.output import OUTPUT
from eurobot_od.cli.remote import print_readings
from eurobot_od.cli.table import DECODED, DEVICES, CommandRow, option
from eurobot_od.errors import DictionaryError, LocalError, MappingError
from eurobot_od.od import network
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.formats import SUFFIXES
from eurobot_od.od.network_file import NodeFile
from eurobot_od.od.values import NODE_IDS
from eurobot_od.support import extras
from eurobot_od.support.files import check_writable, write_whole
from eurobot_od.support.texts import amount

STEM = "pdo"
"""Begins the identifiers in what goes to standard output."""

NAME = option("--name", help=f"prefix of all identifiers (default: the output's name, or {STEM})")


def _stem(name: str | None, output: Path | None) -> str:
    return name or (output.stem if output else STEM)


def c(output: Path | None, name: str | None, devices: Devices) -> None:
    """Write the messages as a C99 header: identifiers, lengths, structs, functions that pack and unpack."""
    from eurobot_od.export.c import c_header

    files.write(output, c_header(devices.protocol(), _stem(name, output)))


def dbc(output: Path | None, devices: Devices) -> None:
    """Write the messages as a DBC file: identifiers, bits, units, limits, value tables, senders and receivers."""
    from eurobot_od.export.dbc import dbc_text

    files.write(output, dbc_text(devices.protocol()))


def docs(output: Path | None, format: str | None, devices: Devices) -> None:  # as the option is called
    """Write messages and object dictionaries as a document to read: Markdown or HTML."""
    from eurobot_od.export.docs import docs_text
    from eurobot_od.export.forms import form_of

    form = format or (form_of(output) if output else "markdown")
    files.write(output, docs_text(devices.protocol(), devices.load(), form))


def wireshark(output: Path | None, name: str | None, devices: Devices) -> None:
    """Write a dissector for Wireshark and tshark, in Lua: names, fields, units, values with names."""
    from eurobot_od.export.wireshark import lua_text

    files.write(output, lua_text(devices.protocol(), _stem(name, output)))


def mcap(log: str, output: Path, reading: logs.ReadOptions, devices: Devices) -> None:
    """Write a log as MCAP for Foxglove and PlotJuggler: a channel for each message, and poses if any."""
    with extras.needed("mcap"):
        from eurobot_od.export.mcap import write
    decoder = devices.decoder()
    check_writable(output)  # before a long log is decoded for nothing
    file = BytesIO()  # what was there before stays if anything fails
    entries = (entry for _, entry in logs.entries([log], reading))
    messages, poses, damage = write(file, entries, decoder, devices.robot.drawings(decoder.protocol))
    write_whole(output, file.getvalue())
    print(f"{output}: {amount(messages, 'message')}, {amount(poses, 'pose')}, {damage} damaged")


def named(file: str | None, path: str | None) -> str:
    """Return the file or the network that a form is made of; raises LocalError unless it is just one."""
    if (file is None) is (path is None):
        raise LocalError("name a FILE, or a network by --network")
    if path is not None:
        network.read_network(path)  # which says what is wrong with it: any other file would be taken for a device's
    return file or path or ""


def xdd(file: str | None, path: str | None, output: Path | None) -> None:
    """Write the device description in XML (CiA 311) of an EDS or DCF: every object with all the file says about it.

    Of a network the descriptions of all nodes are written, into a folder.
    """
    from eurobot_od.export import xdd

    if not network.is_network(source := named(file, path)):
        dictionary = xdd.load(source)
        complain_of_repairs([dictionary])
        files.write(output, xdd.xdd_text(dictionary))
        return
    if output is None:
        raise LocalError("of a network -o names the folder that the files are written to")
    output.mkdir(exist_ok=True)
    for each in network.read_network(source).nodes:
        # Any node-ID will do, as values keep `$NODEID`; the node's modules and patches belong to the device.
        dictionary = Dictionary.load(*each._replace(node_id=each.node_id or NODE_IDS[0]))
        complain_of_repairs([dictionary])
        files.write(output / f"{each.name or Path(each.file).stem}.xdd", xdd.xdd_text(dictionary))


def cdcf(file: str | None, path: str | None, output: Path | None, eds: str | None, node_id: int | None) -> None:
    """Write the concise DCF of a DCF, or show what a concise DCF writes, or turn it into a DCF again.

    The suffix of the file says which way; of a network the DCF files of all nodes are written, into a folder. The
    writes are in the order of CiA 301's PDO procedure (7.5.2.36): a PDO is off while it is mapped.
    """
    # By the suffix: four bytes of a count are not a mark by which a file could be recognised.
    file = named(file, path)
    if network.is_network(file):
        nodes = network.read_network(file).nodes
        if node_id is not None:
            raise LocalError("--node-id is for one file; a network says the node-IDs itself")
        if output is not None:
            output.mkdir(exist_ok=True)
        for each in nodes:
            name = each.name or Path(each.file).stem
            if output is None:
                print(f"{name}:")
            write_concise(each, output / f"{name}.cdcf" if output else None)
    elif Path(file).suffix.lower() in SUFFIXES:
        node = network.node_file(file)
        write_concise(node if node_id is None else node._replace(node_id=node_id), output)
    else:
        read_concise(file, output, eds, node_id)


def write_concise(node: NodeFile, output: Path | None) -> None:
    """Write or print the concise DCF of a DCF, without PDOs that do not hold; raises DictionaryError, LocalError."""
    from eurobot_od.client.configure import all_writes, check_file, check_whole
    from eurobot_od.client.description import from_file
    from eurobot_od.client.reading import decoded
    from eurobot_od.od.concise import pack
    from eurobot_od.od.values import pdo_of

    description, refused = from_file(node.file, node.node_id, node.modules, node.patch), list[MappingError]()
    with left_out() as complained:

        def leave_out(error: MappingError) -> None:
            refused.append(error)
            complained(error)

        if node.node_id is None:
            check_file(description, description.dictionary.node_id, leave_out)
        else:  # who names a node-ID takes the file for that node, whichever it was made for
            check_whole(description, leave_out)
    bad = {pdo_of(error.index or 0) for error in refused}
    writes = [each for each in all_writes(description) if pdo_of(each.address[0]) not in bad - {None}]
    if output is None:
        print_readings(decoded(writes, description.dictionary), as_json=False)
    else:
        write_whole(output, pack(writes))
        print(f"{output}: {len(writes)} writes for node {description.dictionary.node_id}")


def read_concise(file: str, output: Path | None, eds: str | None, node_id: int | None) -> None:
    """Print a concise DCF, or write the DCF that says the same; raises DictionaryError, LocalError, UnknownName."""
    from eurobot_od.bus.live import BITRATE
    from eurobot_od.client.description import from_file
    from eurobot_od.client.reading import dcf_of_writes, decoded
    from eurobot_od.od.concise import Truncated, unpack

    try:
        writes = unpack(Path(file).read_bytes())
    except Truncated as error:
        raise DictionaryError(file, None, f"not a concise DCF: {error}") from error
    named = network.node_file(eds) if eds else None
    description = from_file(named.file, named.node_id if node_id is None else node_id) if named else None
    if output is None:
        print_readings(decoded(writes, description.dictionary if description else None), as_json=False)
    elif description is None:
        raise LocalError("a DCF is made from an EDS and a concise DCF: name the EDS by --eds")
    else:
        files.write_dcf(output, dcf_of_writes(description.dictionary, writes, BITRATE // 1000, output.stem))
        print(f"{output}: for node {description.dictionary.node_id}")


NETWORK = option(
    "--network", dest="path", metavar="PATH", help="network file or folder, whose nodes are all written to a folder"
)

FORMS = {
    "c": CommandRow(c, OUTPUT, NAME, DEVICES),
    "dbc": CommandRow(dbc, OUTPUT, DEVICES),
    "docs": CommandRow(
        docs,
        OUTPUT,
        option("--format", choices=("markdown", "html"), help="default: by FILE's suffix, else markdown"),
        DEVICES,
    ),
    "wireshark": CommandRow(wireshark, OUTPUT, NAME, DEVICES),
    "mcap": CommandRow(
        mcap,
        option("log", metavar="LOG", help="log in any format; -: standard input"),
        option("-o", "--output", type=Path, required=True, metavar="FILE", help="the MCAP file"),
        logs.READING,
        DECODED,
    ),
    "xdd": CommandRow(
        xdd,
        option("file", nargs="?", metavar="FILE", help="an EDS or DCF, or a network"),
        NETWORK,
        option("-o", "--output", type=Path, metavar="FILE", help="default: standard output; of a network a folder"),
    ),
    "cdcf": CommandRow(
        cdcf,
        option(
            "file",
            nargs="?",
            metavar="FILE",
            help="[NODE-ID=]DCF, a network, or a concise DCF",
        ),
        NETWORK,
        option("-o", "--output", type=Path, metavar="FILE", help="default: print the writes; of a network a folder"),
        option("--eds", metavar="[NODE-ID=]FILE", help="EDS of the device that a concise DCF is for"),
        option("--node-id", type=int, metavar="N", help="node-ID (default: the file's)"),
    ),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line of every form."""
    forms = parser.add_subparsers(dest="form", metavar="FORM", required=True)
    for name, row in FORMS.items():
        text = (row.__doc__ or "").partition("\n")[0]
        row.add_arguments(forms.add_parser(name, help=text, description=text))


def run(arguments: argparse.Namespace) -> None:
    """Run the form that was asked for."""
    FORMS[arguments.form].run(arguments)
