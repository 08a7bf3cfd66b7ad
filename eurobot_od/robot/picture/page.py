"""The picture as a page for a browser: the same drawing, with the match played on it.

Rule of this file: the page needs no other file and no network. It is opened from a disk at a competition.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from html import escape
from typing import Any

from eurobot_od.robot.messages import KalmanPositionResponse
from eurobot_od.robot.picture import style
from eurobot_od.robot.picture.ground import place
from eurobot_od.robot.picture.picture import ROBOT_RADIUS, diameter, picture
from eurobot_od.robot.picture.recording import Recording

STYLE = """
body { margin: 0; font: 16px/1.4 system-ui, sans-serif; color: #22262b; background: #fff; }
main { max-width: 1400px; margin: 0 auto; padding: 0 1rem; }
svg { width: 100%; height: auto; display: block; }
form { display: flex; gap: 1rem; align-items: center; padding: .7rem 0; }
form { position: sticky; bottom: 0; background: #fffd; }
input { flex: 1; } output { min-width: 6em; text-align: right; font-variant-numeric: tabular-nums; }
button { min-width: 5em; font: inherit; padding: .2rem .6rem; }
@media print { form { display: none; } }
"""

SCRIPT = """
const match = JSON.parse(document.getElementById("match").textContent);
const field = document.getElementById("field"), slider = document.getElementById("time");
const play = document.getElementById("play"), shown = document.getElementById("shown");
const make = (tag, attributes, parent) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return parent.appendChild(made);
};
const robots = match.robots.map(robot => {
  const group = make("g", {visibility: "hidden"}, field);
  const edge = {stroke: "#22262b", "stroke-width": 8};
  make("circle", {r: robot.radius, fill: robot.colour, "fill-opacity": .55, ...edge}, group);
  const front = make("line", {x2: robot.radius, stroke: "#22262b", "stroke-width": 12}, group);
  return {...robot, group, front};
});
const turn = (from, to) => ((to - from) % 360 + 540) % 360 - 180;
function at(path, time) {
  let last = 0;
  while (last + 1 < path.length && path[last + 1][0] <= time) last++;
  const one = path[last], two = path[last + 1];
  if (one[0] > time) return null;
  if (!two) return one;
  const share = (time - one[0]) / (two[0] - one[0]);
  const angle = one[3] === null || two[3] === null ? null : one[3] + share * turn(one[3], two[3]);
  return [time, one[1] + share * (two[1] - one[1]), one[2] + share * (two[2] - one[2]), angle];
}
function show(time) {
  slider.value = time;
  shown.textContent = time.toFixed(1) + " s";
  for (const robot of robots) {
    const seen = at(robot.path, time);
    robot.group.setAttribute("visibility", seen ? "visible" : "hidden");
    if (!seen) continue;
    robot.group.setAttribute("transform", `translate(${seen[1]} ${seen[2]}) rotate(${-(seen[3] || 0)})`);
    robot.front.setAttribute("visibility", seen[3] === null ? "hidden" : "inherit");
  }
}
let last = null;
function step(now) {
  if (last === null) return;
  const time = Math.min(+slider.value + (now - last) / 1000 * +document.getElementById("speed").value, match.end);
  last = now;
  show(time);
  if (time < match.end) requestAnimationFrame(step); else pause();
}
function pause() { last = null; play.textContent = "Play"; }
play.onclick = () => {
  if (last !== null) return pause();
  if (+slider.value >= match.end) show(0);
  play.textContent = "Pause";
  last = performance.now();
  requestAnimationFrame(step);
};
slider.oninput = () => show(+slider.value);
show(match.end);
"""


def page(recording: Recording, title: str) -> str:
    """Return the page of a match."""
    data = json.dumps({"end": round(recording.end, 3), "robots": list(_robots(recording))}).replace("</", "<\\/")
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{escape(title)}</title>
<style>{STYLE}</style>
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
<script>{SCRIPT}</script>
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
