"""Lets `python -m eurobot_od` be the command `eurobot-od`; rule: nothing but the call."""

import sys

from eurobot_od.cli import main

sys.exit(main())
