"""The README's Python examples run as they stand, and print what their comments say.

The lines for a robot on a real bus are left out: they need one, and real time.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PLAY, REHEARSE, PROTOCOL, LAMP, WATCH, DEVICE = re.findall(r"^```python\n(.*?)^```", README, re.DOTALL | re.MULTILINE)
PRINTED = re.compile(r"^ *print\(.*\)  # (.*)$", re.MULTILINE)
EXAMPLES = {
    "a rehearsal": PLAY + REHEARSE.partition("with Robot")[0],
    "frames": PROTOCOL,
    "a program of one's own": LAMP,
    "nodes watched": WATCH,
    "a device of any EDS": DEVICE.replace("eds/", f"{ROOT}/eds/"),
}


@pytest.mark.parametrize("example", EXAMPLES.values(), ids=EXAMPLES)
def test_an_example_prints_what_it_says(
    example: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)  # where it writes its files
    exec(compile(example, "README.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    said = [text.partition("...") for text in PRINTED.findall(example)]
    assert len(lines) == len(said)
    for line, (begin, cut, _) in zip(lines, said):
        assert line == begin or (cut and line.startswith(begin))
