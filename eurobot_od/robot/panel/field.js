"use strict";
// The playing field: who is where at the clock's time, the goto under way with the way to it, gotos and stops before it.
//
// Rule of this file: y grows upwards on the field and downwards on the drawing; `across` is the only place that knows.

panel("field", (setup, source) => {
  const TRAIL = 20, LONGEST_GAP = 2;        // s of the path that is drawn; s between sightings that still belong together
  const MARGIN = 40;                        // mm from the border to an axis' numbers
  const OLD = 2, FRESH = 0.5;               // a place is stale after so many of its periods, and after s at the soonest
  const across = y => setup.height - y;
  const ground = new DOMParser().parseFromString(
    `<svg xmlns="http://www.w3.org/2000/svg">${setup.ground}</svg>`, "image/svg+xml").documentElement.firstElementChild;
  const layer = name => s("g", {class: name});
  const rings = layer("rings"), dots = layer("dots"), trails = layer("trails"), routes = layer("routes"), marks = layer("marks"), bodies = layer("bodies");
  const aim = s("g", {class: "aim", visibility: "hidden"}, s("circle", {r: 40}), s("path", {d: "M-60 0H60M0-60V60"}));
  const drawing = s("svg", {
    class: "field", viewBox: `-200 -50 ${setup.width + 280} ${setup.height + 150}`, role: "img", "aria-label": "playing field",
    onclick: event => point(event),
  }, ground, rings, dots, trails, routes, marks, bodies, aim);

  // The drawing's units are mm, and a name has to be read at any width: the style says how large a pixel is.
  let letter = 38;                          // mm that a line of text is high
  new ResizeObserver(() => {
    const width = drawing.clientWidth, pixel = drawing.viewBox.baseVal.width / width;
    if (!width) return;
    drawing.style.setProperty("--pixel", pixel);
    letter = Math.max(38, 11 * pixel);
    stale = true;
  }).observe(drawing);
  // Its letters are larger than those of the printed picture, so they need other places to stay off the lines.
  for (const text of ground.querySelectorAll("text")) {
    const zone = text.previousElementSibling, x = Number(text.getAttribute("x")), y = Number(text.getAttribute("y"));
    if (x < 0) filled(text, {x: -MARGIN, y: y - 11, "dominant-baseline": "middle"}, []);
    else if (y > setup.height) filled(text, {y: setup.height + MARGIN}, []);
    else if (zone && zone.tagName === "rect" && x !== 0) {
      const left = zone.x.baseVal.value, right = left + zone.width.baseVal.value, isLeft = x < setup.width / 2;
      filled(text, {x: isLeft ? left + MARGIN / 2 : right - MARGIN / 2, y: zone.y.baseVal.value + MARGIN / 2,
        "text-anchor": isLeft ? "start" : "end", "dominant-baseline": "hanging"}, []);
    }
  }

  const robots = setup.robots.map(robot => {
    const corners = robot.outline.map(([x, y]) => `${x},${-y}`).join(" ");
    const shape = corners ? ["polygon", {points: corners}] : ["circle", {r: robot.radius || 40}];
    const body = s(shape[0], {...shape[1], "stroke-dasharray": robot.dashes});
    const front = s("line", {x2: robot.radius || 40});
    const name = s("text", {y: -(robot.radius || 40) - 20}, robot.name);
    const group = s("g", {class: robot.radius ? "robot" : "robot raw", visibility: "hidden"}, body, front, name);
    const trail = s("polyline", {class: "trail", points: ""}), doubted = s("g");
    dots.append(doubted);
    bodies.append(group);
    if (robot.radius) trails.append(trail);
    return {...robot, group, body, front, trail, doubted, label: name};
  });
  const list = h("p", {class: "where", role: "status", "aria-live": "off"});
  const sample = (inside, words, name = "") => h("span", {},
    s("svg", {class: "field sample", viewBox: "-50 -50 100 100", "aria-hidden": "true"}, s("g", {class: name}, inside)), words);
  const OCTAGON = "-14,-35 14,-35 35,-14 35,14 14,35 -14,35 -35,14 -35,-14";
  const legend = h("p", {class: "legend hint"},
    sample(s("polyline", {points: "-45,20 0,-20 45,20"}), "way to the goto", "routes"),
    sample(s("circle", {r: 30}), "goto", "marks goto"), sample(s("circle", {r: 30}), "goto, reached", "marks goto reached"),
    sample(s("polygon", {points: OCTAGON}), "stop", "stop"),
    sample(s("circle", {r: 36, class: "forced"}), "barrier, never crossed", "rings"),
    sample(s("circle", {r: 36, class: "normal"}), "barrier, avoided if there is a way round", "rings"),
    sample(s("circle", {r: 36}), "not seen for longer than twice its period", "robot stale"),
    sample(s("circle", {r: 22}), "seen where it cannot be", "dots"));

  // The goto by hand

  const inputs = {};
  const labelled = (name, words, value, more) => h("label", {}, words,
    inputs[name] = h("input", {type: "number", value, required: true, oninput: aimed, ...more}));
  const form = h("form", {class: "goto", hidden: true, "aria-label": "Goto XY", onsubmit: event => {
    event.preventDefault();
    const fields = Object.fromEntries(Object.entries(inputs).map(([name, input]) => [name, input.value]));
    quietly(request({do: "send", message: "Goto XY", fields}, `goto ${fields.x}, ${fields.y} sent`).then(follow));
  }},
  labelled("x", "x mm", "", {min: 0, max: setup.width}), labelled("y", "y mm", "", {min: 0, max: setup.height}),
  labelled("angle", "angle deg", 0, {}), labelled("speed", "speed %", setup.speed, {min: 0, max: 100}),
  h("div", {class: "act"}, h("button", {class: "main"}, "Go"), h("span", {class: "hint"}, "click the field for a place")));
  const ASKED = 300, LONGEST = 60000;       // ms: how often the drive is asked, as the core would, and for how long
  let following = 0;
  function follow() {                       // a goto that is sent from here is no core's: nobody else asks how it ends
    clearInterval(following);
    const end = performance.now() + LONGEST;
    following = setInterval(() => {
      const last = source.sortedEvents().filter(each => each.kind === "goto").at(-1);
      if (!last || last.end !== null || performance.now() > end) clearInterval(following);
      else connection.ask({do: "send", message: "Goto State Request", fields: {}}).catch(() => clearInterval(following));
    }, ASKED);
  }
  function aimed() {
    const set = inputs.x.value !== "" && inputs.y.value !== "";
    aim.setAttribute("visibility", set ? "visible" : "hidden");
    if (set) aim.setAttribute("transform", `translate(${inputs.x.value} ${across(Number(inputs.y.value))})`);
  }
  function point(event) {
    if (!connection.control) return;
    const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse());
    const within = (value, most) => String(Math.round(Math.min(Math.max(value, 0), most)));
    inputs.x.value = within(place.x, setup.width);
    inputs.y.value = within(across(place.y), setup.height);
    aimed();
  }

  // Who is where

  function turn(from, to) { return ((to - from) % 360 + 540) % 360 - 180; }
  function known(row, place) {             // a sighting, null if it is unknown
    const x = row.columns[row.field("x")][place], y = row.columns[row.field("y")][place];
    return x === null || y === null || x === undefined ? null : {x, y, time: row.times[place]};
  }
  // No robot drives so fast: the beacons have seen something else.
  const far = (one, two) => Math.hypot(one.x - two.x, one.y - two.y)
    > setup.reach.spread + setup.reach.speed * Math.abs(two.time - one.time);
  function isOutlier(row, place) {          // out of reach from both its neighbours; the last one has no other yet
    const here = known(row, place), before = near(row, place, -1), after = near(row, place, 1);
    return Boolean(here && before && far(before, here) && (!after || (far(here, after) && !far(before, after))));
  }
  function near(row, place, step) {
    let other = place + step;
    while (other >= 0 && other < row.times.length && !known(row, other)) other += step;
    return other >= 0 && other < row.times.length ? known(row, other) : null;
  }
  function believed(row, place, step) {     // the next one from there that is no outlier
    let other = place;
    while (isOutlier(row, other)) other += step;
    return other >= 0 && other < row.times.length ? sighting(row, other) : null;
  }
  function sighting(row, place) {
    const at = name => row.columns[row.field(name)][place];
    return {time: row.times[place], x: at("x"), y: at("y"), angle: at("angle")};
  }
  function between(one, two, time) {
    if (!two || two.x === null || one.x === null || two.time - one.time > LONGEST_GAP) return one;
    const share = Math.min((time - one.time) / (two.time - one.time), 1);
    const angle = one.angle === null || two.angle === null ? one.angle : one.angle + share * turn(one.angle, two.angle);
    return {time, x: one.x + share * (two.x - one.x), y: one.y + share * (two.y - one.y), angle};
  }
  function placeOf(row, time) {             // null if it was not seen yet, or is not known
    let shown = time;
    if (live && row.times.length > 1) {     // moved smoothly, the bus' last interval later
      shown -= Math.min(row.times.at(-1) - row.times.at(-2), LONGEST_GAP / 2);
    }
    const count = upTo(row.times, shown);
    if (!count) return row.times.length && live ? sighting(row, 0) : null;
    const one = believed(row, count - 1, -1), place = one && between(one, believed(row, count, 1), shown);
    return !place || place.x === null || place.y === null ? null : place;
  }
  function begins() {                       // when somebody was seen first
    const firsts = robots.map(rowOf).filter(Boolean).map(row => row.times.find((_, place) => known(row, place)) ?? Infinity);
    return Math.min(...firsts);
  }
  function radiusOf(robot, time) {
    const start = robot.diameter && source.row(setup.start), diameter = start ? start.value(robot.diameter, time) : 0;
    return diameter ? diameter * 5 : robot.radius;   // cm of the diameter are 5 mm of the radius each
  }
  function colourOf(robot, time) {
    const start = robot.colour ? null : source.row(setup.start);
    const team = start && start.value("team_colour", time), colour = robot.colour || setup.teams[team];
    // The page has colours of its own, as the printed picture's are for paper.
    return colour ? `var(--robot-${(robot.colour ? robot.name : team).replaceAll(" ", "-")}, ${colour})` : "var(--ink)";
  }
  const rowOf = robot => source.row(robot.message);
  function ageOf(row, time) {               // s since it was seen, 0 while that is as often as it should be
    const now = row.now(time);
    return now && now.age > Math.max(OLD * (now.period || 0), FRESH) ? now.age : 0;
  }

  function showRobot(robot, time) {
    const row = rowOf(robot), place = row && placeOf(row, time);
    robot.group.setAttribute("visibility", place ? "visible" : "hidden");
    if (!place) { robot.trail.setAttribute("points", ""); robot.doubted.replaceChildren(); return null; }
    const age = ageOf(row, time), seen = age ? `, seen ${age.toFixed(1)} s ago` : "";
    robot.group.classList.toggle("stale", age > 0);
    robot.group.classList.toggle("lost", isLost(source, row, time));
    say(robot.label, age ? `${robot.name}, ${age.toFixed(0)} s ago` : robot.name);
    const radius = robot.radius ? radiusOf(robot, time) : 40, colour = colourOf(robot, time);
    robot.group.setAttribute("transform", `translate(${place.x} ${across(place.y)})`);
    robot.group.style.color = colour;
    robot.trail.style.color = robot.doubted.style.color = colour;
    if (robot.outline.length) robot.body.setAttribute("transform", `rotate(${-(place.angle || 0)})`);
    else robot.body.setAttribute("r", radius);
    const isBelow = across(place.y) < radius + 20 + letter;   // above it there is the border
    robot.label.setAttribute("y", isBelow ? radius + 20 + letter : -radius - 20);
    robot.front.setAttribute("visibility", place.angle === null ? "hidden" : "inherit");
    robot.front.setAttribute("x2", radius);
    robot.front.setAttribute("transform", `rotate(${-(place.angle || 0)})`);
    robot.doubted.replaceChildren(...doubtedOf(row, time));
    if (robot.radius) robot.trail.setAttribute("points", trailOf(row, time, place));
    return `${robot.name} ${place.x.toFixed(0)}, ${place.y.toFixed(0)} mm${place.angle === null ? "" : `, ${Math.round(place.angle + 360) % 360}°`}${seen}`;
  }
  function trailOf(row, time, place) {
    const points = [], x = row.columns[row.field("x")], y = row.columns[row.field("y")];
    for (let each = upTo(row.times, time - TRAIL); each < upTo(row.times, place.time); each++) {
      if (x[each] !== null && !isOutlier(row, each)) points.push(`${x[each]},${across(y[each])}`);
    }
    points.push(`${place.x},${across(place.y)}`);
    return points.join(" ");
  }
  function doubtedOf(row, time) {
    const found = [];
    for (let each = upTo(row.times, time - TRAIL); each < upTo(row.times, time); each++) {
      if (isOutlier(row, each)) found.push(s("circle", {cx: known(row, each).x, cy: across(known(row, each).y), r: 22}));
    }
    return found;
  }

  // Gotos, stops, touches

  function discOf(event) {
    const reached = event.data.outcome === "arrived";
    return s("g", {class: `goto ${reached ? "reached" : ""}`, transform: `translate(${event.data.x} ${across(event.data.y) + 68})`},
      s("title", {}, event.text), s("circle", {r: 30}), s("text", {y: 12}, event.mark));
  }
  function targetOf(event) {
    return s("g", {class: "target", transform: `translate(${event.data.x} ${across(event.data.y)})`},
      s("circle", {r: 26}), s("circle", {r: 8, class: "dot"}),
      s("path", {d: "M68 0L30-20V20Z", transform: `rotate(${-event.data.angle})`}));
  }
  function signOf(event) {
    const {x, y} = event.data.place;
    return s("g", {class: event.kind, transform: `translate(${x} ${across(y) - 78})`}, s("title", {}, event.text),
      s("polygon", {points: OCTAGON}), s("text", {y: 12}, event.mark));
  }
  function ringOf([number, passage]) {
    const [name, x, y, radius] = setup.barriers[number];
    return s("circle", {class: passage > 1 ? "forced" : "normal", cx: x, cy: across(y), r: radius + setup.ring}, s("title", {}, name));
  }
  let told = null;
  function showEvents(time) {
    const past = source.sortedEvents().filter(each => each.time <= time);
    const gotos = past.filter(each => each.kind === "goto"), last = gotos.at(-1);
    const under = last && (last.end === null || last.end > time) ? last : null;
    const shown = past.filter(each => time - each.time < 3 * TRAIL).slice(-40);
    const state = shown.map(each => each.key + each.end).join() + (under ? under.key : "");
    if (state === told) return;
    told = state;
    rings.replaceChildren(...(under ? Object.entries(under.data.barriers).map(ringOf) : []));
    const way = under && under.data.route;
    routes.replaceChildren(...(way ? [s("polyline", {points: way.map(([x, y]) => `${x},${across(y)}`).join(" ")}), targetOf(under)] : []));
    marks.replaceChildren(
      ...gotos.filter(each => shown.includes(each)).map(each => discOf(each.end !== null && each.end > time ? {...each, data: {...each.data, outcome: ""}} : each)),
      ...shown.filter(each => each.data.place && each.kind !== "goto").map(signOf));
  }
  return {
    begins,
    element: h("div", {class: "field-panel"}, drawing, list, form, legend),
    show(time) {
      say(list, robots.map(robot => showRobot(robot, time)).filter(Boolean).join(" · ") || "no robot seen yet");
      showEvents(time);
      show(form, connection.control);
    },
  };
});
