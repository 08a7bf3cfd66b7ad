"""Write a dissector for Wireshark and tshark, in Lua: names, fields, units, values with names."""

from __future__ import annotations

import argparse

from eurobot_od.cli import options, output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    output.add_output(parser)
    output.add_name(parser)
    options.add_network(parser)


def run(arguments: argparse.Namespace) -> None:
    """Write the file."""
    from eurobot_od.export.wireshark import lua_text

    output.write(arguments.output, lua_text(options.protocol(arguments), output.name(arguments)))
