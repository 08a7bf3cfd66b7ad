"""Print the completion script of a shell; `--help` says where to put it.

The scripts are in the package; `tools/make_completion.py` makes them, with shtab.
"""

from __future__ import annotations

import argparse
from importlib.resources import files

SHELLS = {"bash": "eurobot-od.bash", "zsh": "_eurobot-od", "fish": "eurobot-od.fish"}
"""The file of each shell, with the name under which the shell finds it."""

PLACES = """where to put it:
  bash  eurobot-od completion bash > ~/.local/share/bash-completion/completions/eurobot-od
  zsh   eurobot-od completion zsh > FOLDER/_eurobot-od, a folder of $fpath
  fish  eurobot-od completion fish > ~/.config/fish/completions/eurobot-od.fish
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    # PLACES is a table, which the usual formatter would fill up to a paragraph.
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = PLACES
    parser.add_argument("shell", choices=SHELLS, help="the shell")


def run(arguments: argparse.Namespace) -> None:
    """Print the text."""
    print((files("eurobot_od") / "completions" / SHELLS[arguments.shell]).read_text(encoding="utf-8"), end="")
