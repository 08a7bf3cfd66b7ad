"""Runs `eurobot-od` with the arguments given, in an environment that it sets up itself: `python3 tools/run.py match`.

Rule of this file: standard library only, and nothing but the call.
"""

from __future__ import annotations

import sys

from environment import call, prepare

if __name__ == "__main__":
    sys.exit(call(prepare(), "-m", "eurobot_od", *sys.argv[1:]))
