"""Runs `eurobot-od` as if numpy were not installed: `without_numpy.py WORD...`

Rule of this file: nothing but that.
"""

from __future__ import annotations

import sys

sys.modules["numpy"] = None  # type: ignore[assignment]  # an import of it fails from here on, a search finds nothing

from eurobot_od.cli import main  # noqa: E402  # after numpy is gone

if __name__ == "__main__":
    sys.exit(main())
