"use strict";
// The playing field: paints the scene that it is given, drawings with their layer and their time, and moves the robots
// where their rows say; the goto by hand.
//
// Rule of this file: y grows upwards on the field and downwards on the drawing; `across` is the only place that knows.

panel("field", (setup, source) => {
  const TRAIL = 20, LONGEST_GAP = 2;        // s of the path that is drawn; s between sightings that still belong together
  const KEPT = 60;                          // s that a mark is shown
  const SAID = 5;                           // s that a caption is shown
  const OLD = 2, FRESH = 0.5;               // a place is stale after so many of its periods, and after s at the soonest
  const across = y => setup.height - y;
  function drawn(text) {                    // SVG as text; what it has of other people's texts is escaped there
    const parsed = new DOMParser().parseFromString(`<svg xmlns="http://www.w3.org/2000/svg">${text}</svg>`, "image/svg+xml");
    return document.importNode(parsed.documentElement.firstElementChild, true);
  }
  const layers = Object.fromEntries(setup.layers.map(name => [name, s("g", {class: name})]));
  const aim = s("g", {class: "aim", visibility: "hidden"}, s("circle", {r: 40}), s("path", {d: "M-60 0H60M0-60V60"}));
  const drawing = s("svg", {
    class: "field", viewBox: setup.view, role: "img", "aria-label": "playing field", onclick: event => point(event),
  }, drawn(setup.ground), ...Object.values(layers), aim);

  // The drawing's units are mm, and a name has to be read at any width: the style says how large a pixel is.
  let letter = 38;                          // mm that a line of text is high
  new ResizeObserver(() => {
    const {clientWidth: width, clientHeight: height} = drawing, box = drawing.viewBox.baseVal;
    if (!width || !height) return;
    const pixel = Math.max(box.width / width, box.height / height);
    drawing.style.setProperty("--pixel", pixel);
    letter = Math.max(38, 11 * pixel);
    told = null;                            // the words of the marks are of another size
    stale = true;
  }).observe(drawing);

  const robots = setup.robots.map(({name, message}) => {
    const body = s("g", {class: "body"}), label = s("text", {}, name);
    const group = s("g", {class: "robot"}, body), trail = s("polyline", {points: ""}), doubted = s("g", {class: "dots"});
    layers.robots.append(group);
    layers.names.append(label);
    layers.trails.append(s("g", {class: "trail"}, trail, doubted));
    return {name, message, body, label, group, trail, doubted};
  });
  const board = h("p", {class: "board", role: "status", "aria-live": "off"});
  const list = h("p", {class: "where", role: "status", "aria-live": "off"});
  const legend = h("p", {class: "legend hint"}, ...setup.legend.map(([words, sample]) => h("span", {},
    s("svg", {class: "field sample", viewBox: "-50 -50 100 100", "aria-hidden": "true"}, drawn(sample)), words)));

  // The goto by hand

  const inputs = {};
  const labelled = (name, words, value, more) => h("label", {}, words,
    inputs[name] = h("input", {type: "text", inputmode: "numeric", autocomplete: "off", value, oninput: aimed, ...more}));
  const BOUNDS = {x: [0, setup.width], y: [0, setup.height], angle: [-360, 360], speed: [0, 100]};
  function go() {
    try {
      const numbers = Object.entries(inputs).map(([name, input]) => [name, String(wholeNumber(name, input.value, ...BOUNDS[name]))]);
      const fields = Object.fromEntries(numbers), known = new Set(source.events.keys());
      quietly(request({do: "send", message: "Goto XY", fields}, `goto ${fields.x}, ${fields.y} sent`).then(() => follow(known)));
    } catch (error) { toast(error.message, true); }
  }
  const goButton = askedTwice("Go", go, {class: "main", type: "button"});
  const form = h("form", {class: "goto", hidden: true, "aria-label": "Goto XY", novalidate: true, onsubmit: event => {
    event.preventDefault();                 // Enter in a field asks twice, too
    goButton.click();
  }},
  labelled("x", "x mm", "", {}), labelled("y", "y mm", "", {}),
  labelled("angle", "angle deg", 0, {}), labelled("speed", "speed %", setup.speed, {}),
  h("div", {class: "act"}, goButton, h("span", {class: "hint"}, "click the field for a place")));
  const ASKED = 300, LONGEST = 60000;       // ms: how often the drive is asked, as the core would, and for how long
  let following = 0;
  function follow(known) {                  // the page itself has sent this goto: no core asks how it ends
    clearInterval(following);
    const end = performance.now() + LONGEST;
    following = setInterval(() => {
      const own = [...source.events].filter(([key, each]) => each.kind === "goto" && !known.has(key)).at(-1)?.[1];
      const isOver = own && own.end !== null; // it may be heard late that it has begun
      if (isOver || performance.now() > end) clearInterval(following);
      else connection.ask({do: "send", message: "Goto State Request", fields: {}}).catch(() => clearInterval(following));
    }, ASKED);
  }
  function aimed() {
    const set = [inputs.x, inputs.y].every(each => WHOLE.test(each.value.trim()));
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

  function sighting(row, place) {           // null if it is unknown, or there is none
    const [x, y, angle] = ["x", "y", "angle"].map(name => row.columns[row.field(name)][place]);
    return (x ?? null) === null || y === null ? null : {time: row.times[place], x, y, angle};
  }
  function near(row, place, step) {         // the next known one from there
    let other = place + step;
    while (other >= 0 && other < row.times.length && !sighting(row, other)) other += step;
    return sighting(row, other);
  }
  // No robot drives so fast: the beacons have seen something else.
  const far = (one, two) => Math.hypot(one.x - two.x, one.y - two.y)
    > setup.reach.spread + setup.reach.speed * Math.abs(two.time - one.time);
  function isOutlier(row, place) {          // out of reach from both its neighbours; the last one has no other yet
    const here = sighting(row, place), before = near(row, place, -1), after = near(row, place, 1);
    return Boolean(here && before && far(before, here) && (!after || (far(here, after) && !far(before, after))));
  }
  function believed(row, place, step) {     // the next one from there that is no outlier
    let other = place;
    while (isOutlier(row, other)) other += step;
    return sighting(row, other);
  }
  function between(one, two, time) {
    if (!two || two.time - one.time > LONGEST_GAP) return one;
    const share = Math.min((time - one.time) / (two.time - one.time), 1);
    const turn = ((two.angle - one.angle) % 360 + 540) % 360 - 180;
    const angle = one.angle === null || two.angle === null ? one.angle : one.angle + share * turn;
    return {time, x: one.x + share * (two.x - one.x), y: one.y + share * (two.y - one.y), angle};
  }
  function placeOf(row, time) {             // null if it was not seen yet, or is not known
    let shown = time;
    if (live && row.times.length > 1) {     // moved smoothly, the bus' last interval later
      shown -= Math.min(row.times.at(-1) - row.times.at(-2), LONGEST_GAP / 2);
    }
    const count = upTo(row.times, shown);
    if (!count) return live ? sighting(row, 0) : null;
    const one = believed(row, count - 1, -1);
    return one && between(one, believed(row, count, 1), shown);
  }
  const rowOf = robot => source.row(robot.message);
  function begins() {                       // when somebody was seen first
    const firsts = robots.map(rowOf).filter(Boolean).map(row => row.times.find((_, place) => sighting(row, place)) ?? Infinity);
    return Math.min(...firsts);
  }
  function ageOf(row, time) {               // s since it was seen, 0 while that is as often as it should be
    const now = row.now(time);
    return now && now.age > Math.max(OLD * (now.period || 0), FRESH) ? now.age : 0;
  }
  function looksAt(time) {                  // as the last start configuration says
    const start = source.sortedEvents().findLast(each => each.kind === "start" && each.time <= time);
    return start ? start.data.robots : setup.robots;
  }
  ownColours.push((row, time) => {
    const look = row.source === source && looksAt(time).find(each => plain(each.message) === plain(row.name));
    return look ? look.colour.slice(4, -1) : null;   // `var(--x)`
  });

  function showRobot(robot, look, time) {
    const row = rowOf(robot), place = row && placeOf(row, time);
    for (const each of [robot.group, robot.label]) each.setAttribute("visibility", place ? "visible" : "hidden");
    robot.trail.setAttribute("points", place && look.trail ? trailOf(row, time, place) : "");
    robot.doubted.replaceChildren(...(place ? doubtedOf(row, time) : []));
    if (!place) return null;
    const age = ageOf(row, time), body = place.angle === null ? look.round : look.turned;
    if (robot.painted !== body) robot.body.replaceChildren(drawn(robot.painted = body));
    robot.group.classList.toggle("stale", age > 0);
    robot.group.classList.toggle("lost", isLost(source, row, time));
    for (const each of [robot.group, robot.label]) each.setAttribute("transform", `translate(${place.x} ${across(place.y)})`);
    robot.body.setAttribute("transform", `rotate(${-(place.angle || 0)})`);
    robot.trail.parentNode.style.color = look.colour;
    robot.trail.setAttribute("stroke-dasharray", look.dashes || "none");
    say(robot.label, look.trail ? age ? `${robot.name}, ${age.toFixed(0)} s ago` : robot.name : "");
    name(robot.label, place, look.radius + 20);
    return `${robot.name} ${place.x.toFixed(0)}, ${place.y.toFixed(0)} mm`
      + (place.angle === null ? "" : `, ${Math.round(place.angle + 360) % 360}°`) + (age ? `, seen ${age.toFixed(1)} s ago` : "");
  }
  let written = [], named = [];             // the boxes of the words that stay, and with the names that stand already: mm, on the drawing
  function boxOf(word) {
    const {left, right, top, bottom} = word.getBoundingClientRect(), back = drawing.getScreenCTM().inverse();
    const [one, two] = [new DOMPoint(left, top), new DOMPoint(right, bottom)].map(each => each.matrixTransform(back));
    return {left: one.x, right: two.x, top: one.y, bottom: two.y};
  }
  function name(label, place, away) {       // above its robot, or below, or further off where another name stands
    const half = label.textContent.length * letter * 0.3, middle = across(place.y);
    const box = y => ({left: place.x - half, right: place.x + half, top: middle + y - letter, bottom: middle + y});
    const isFree = one => one.top > 0 && named.every(other => one.right < other.left || other.right < one.left
      || one.bottom < other.top || other.bottom < one.top);
    const tried = [0, 1, 2, 3].flatMap(each => [-away - each * letter, away + (each + 1) * letter]);
    const y = tried.find(each => isFree(box(each))) ?? tried[middle < away + letter ? 1 : 0];
    if (label.textContent) named.push(box(y));
    label.setAttribute("y", y);
  }
  function boardAt(time) {                  // the match's clock, the points so far, and how each node is
    const points = new Map(), events = source.sortedEvents(), start = events.findLast(each => each.kind === "start" && each.time <= time);
    for (const {data} of events.filter(each => each.kind === "points")) points.set(data.robot, 0);
    for (const {data} of events.filter(each => each.kind === "points" && each.time <= time)) points.set(data.robot, points.get(data.robot) + data.points);
    const nodes = source.nodes.map(node => [node.name, nodeNow(source, node, time)]).filter(([, now]) => now.state || now.life === "lost");
    return [h("b", {class: "clock"}, start ? `${Math.max(time - start.time, 0).toFixed(1)} s since the start` : "before the start"),
      ...[...points].map(([robot, sum]) => h("b", {class: "points"}, `${robot} ${sum}`)),
      h("i", {class: "caption"}, events.findLast(each => each.kind === "said" && each.time <= time && time - each.time < SAID)?.text ?? ""),
      ...nodes.map(([node, now]) => {
        const sign = lifeSign();
        sign.set(now.life, now.life === "alive" ? `${node} ${now.state}` : `${node} ${now.life}`);
        return sign.element;
      })];
  }
  const within = (row, from, to) => [...Array(Math.max(to - from, 0)).keys()].map(each => from + each).filter(each => sighting(row, each));
  function trailOf(row, time, place) {
    const seen = within(row, upTo(row.times, time - TRAIL), upTo(row.times, place.time));
    return [...seen.filter(each => !isOutlier(row, each)).map(each => sighting(row, each)), place].map(({x, y}) => `${x},${across(y)}`).join(" ");
  }
  function doubtedOf(row, time) {
    const seen = within(row, upTo(row.times, time - TRAIL), upTo(row.times, time)).filter(each => isOutlier(row, each));
    return seen.map(each => sighting(row, each)).map(({x, y}) => s("circle", {cx: x, cy: across(y), r: 22}));
  }

  // What happens

  let told = null;
  function showItems(time) {
    const events = source.sortedEvents().filter(each => each.time <= time);
    const start = events.findLast(each => each.kind === "start")?.time ?? -Infinity;   // those of an earlier match are gone
    const shown = events.filter(each => each.kind === "start" || (each.end ?? each.time) >= start).flatMap(each => each.data.items || [])
      .filter(([layer, , begin, end]) => begin <= time && (end === null || end > time) && (layer !== "marks" || time - begin < KEPT));
    const state = shown.map(([, drawing]) => drawing).join();
    if (state === told) return;
    told = state;
    for (const name of ["rings", "routes", "targets", "marks"]) {
      layers[name].replaceChildren(...shown.filter(([layer]) => layer === name).map(([, drawing]) => drawn(drawing)));
    }
    written = [...drawing.querySelectorAll("text")].filter(each => !layers.names.contains(each)).map(boxOf);
  }
  return {
    begins, legend,
    element: h("div", {class: "field-panel"}, board, drawing, h("div", {class: "aside"}, list, form, legend)),
    show(time) {
      const looks = looksAt(time);
      showItems(time);
      named = [...written];
      board.replaceChildren(...boardAt(time));
      say(list, robots.map((robot, place) => showRobot(robot, looks[place], time)).filter(Boolean).join(" · ") || "no robot seen yet");
      show(form, connection.control);
    },
  };
});
