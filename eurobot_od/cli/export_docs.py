"""Write messages and object dictionaries as a document to read: Markdown or HTML."""

from __future__ import annotations

import argparse

from eurobot_od.cli import options, output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    output.add_output(parser)
    parser.add_argument("--format", choices=("markdown", "html"), help="left out: by FILE's suffix, else markdown")
    options.add_network(parser)


def run(arguments: argparse.Namespace) -> None:
    """Write the file."""
    from eurobot_od.export.docs import docs_text, form_of

    form = arguments.format or (form_of(arguments.output) if arguments.output else "markdown")
    protocol, outlines = options.protocol(arguments), options.devices(arguments)
    output.write(arguments.output, docs_text(protocol, outlines, form))
