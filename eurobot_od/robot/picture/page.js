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
