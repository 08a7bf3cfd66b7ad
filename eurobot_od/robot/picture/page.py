"""The picture as a page for a browser: the same drawing, with the match played on it.

Rule of this file: the page needs no other file and no network. It is opened from a disk at a competition. So
`page.css` and `page.js`, which plays the match, are written into it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import Any

from eurobot_od.robot.messages import KalmanPositionResponse
from eurobot_od.robot.picture import style
from eurobot_od.robot.picture.ground import place
from eurobot_od.robot.picture.picture import diameter, picture
from eurobot_od.robot.picture.recording import Recording
from eurobot_od.robot.world.bodies import ROBOT_RADIUS


def page(recording: Recording, title: str) -> str:
    """Return the page of a match."""
    css, script = (Path(__file__).with_name(name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
    data = json.dumps({"end": round(recording.end, 3), "robots": list(_robots(recording))})
    data = data.replace("</", "<\\/")  # a browser ends a script at any `</script>`, even inside a string
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{escape(title)}</title>
<style>
{css}</style>
</head>
<body>
<main>
{picture(recording, title)}
<form onsubmit="return false">
<button id="play">Play</button>
<label>speed <select id="speed"><option>1</option><option selected>4</option><option>16</option></select></label>
<input id="time" type="range" min="0" max="{recording.end:.1f}" step="0.1" aria-label="time in s">
<output id="shown"></output>
</form>
</main>
<script type="application/json" id="match">{data}</script>
<script>
{script}</script>
</body>
</html>
"""


def _robots(recording: Recording) -> Iterable[dict[str, Any]]:
    """Yield the robots with their paths as the drawing has them: time, x, y downwards, heading."""
    for whom, path in recording.paths.items():
        ours = whom is KalmanPositionResponse
        yield {
            "colour": style.colour_of(recording.team) if ours else style.OTHERS[whom][1],
            "radius": ROBOT_RADIUS if ours else diameter(recording, whom) / 2,
            "path": [(round(each.time, 3), *place(each.x, each.y), each.angle) for each in path],
        }
