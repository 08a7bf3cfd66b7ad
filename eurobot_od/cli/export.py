"""Turn EDS and DCF files into other forms: C, DBC, documents, a Wireshark dissector, XDD, concise DCF; logs into MCAP.

Rule of this file: a form is one line of the table, and one module `export_<form>` with `add_arguments` and `run`.
"""

from __future__ import annotations

import argparse
from importlib import import_module

FORMS = {
    "c": "C99 header with structs and functions that pack and unpack all messages",
    "dbc": "DBC (CAN database) of all messages",
    "docs": "messages and objects as Markdown or HTML to read",
    "wireshark": "dissector of all messages for Wireshark and tshark, in Lua",
    "mcap": "log as MCAP, for Foxglove and PlotJuggler",
    "xdd": "device description in XML (CiA 311) of one EDS or DCF",
    "cdcf": "concise DCF (0x1F22) from a DCF, or back",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line of every form."""
    forms = parser.add_subparsers(dest="form", metavar="FORM", required=True)
    for name, text in FORMS.items():
        module = import_module(f"eurobot_od.cli.export_{name}")
        one = forms.add_parser(name, help=text, description=(module.__doc__ or "").splitlines()[0])
        module.add_arguments(one)
        one.set_defaults(run=module.run)


def run(arguments: argparse.Namespace) -> None:
    """Run the form that was asked for."""
    arguments.run(arguments)
