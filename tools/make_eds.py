#!/usr/bin/env python3
"""Makes the EDS files of this repository from eds/protocol.yaml; with `--check`, names the files that differ."""

import sys

from environment import ROOT, ensure

ensure("yaml")  # a bare Python starts this file again in the repository's environment
sys.path.insert(0, str(ROOT))  # the package next door, installed or not

from eurobot_od.cli import main  # noqa: E402

EDS = ROOT / "eds"

if __name__ == "__main__":
    sys.exit(main(["make-eds", str(EDS / "protocol.yaml"), "-o", str(EDS), *sys.argv[1:]]))
