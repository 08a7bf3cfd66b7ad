"use strict";
// Events newest first, the time line of a log, and what `compare` says of two logs.

const MOST_LISTED = 500;

function eventLine(source, event, current) {
  const act = () => { if (live) openTrace(event.time, source); else { clock.pause(); clock.seek(event.time); } };
  return h("li", {class: `${event.wrong ? "is-wrong" : ""} ${current ? "current" : ""}`},
    h("button", {onclick: act, title: live ? "show the frames of that time" : "go there"},
      h("span", {class: "at"}, `${event.time.toFixed(2)} s`), h("span", {class: "kind"}, event.kind), h("span", {}, event.text)));
}

// A node that is lost and back again and again is one event, at the last time, which says how often.
function gathered(events) {
  const pulses = new Map(), others = [];
  for (const each of events) {
    if (each.kind !== "lost" && each.kind !== "back") { others.push(each); continue; }
    const known = pulses.get(each.data.node) || {count: 0, first: each.time}, count = known.count + (each.kind === "lost");
    const text = count > 1 ? `${each.text}, lost ${count} times since ${known.first.toFixed(2)} s` : each.text;
    pulses.set(each.data.node, {count, first: known.first, event: {...each, text, key: `${each.key} ${count}`}});
  }
  return [...others, ...[...pulses.values()].map(each => each.event)].sort((one, two) => one.time - two.time);
}

const eventsView = () => perSource(source => {
  const list = h("ol", {class: "events"}), nothing = h("p", {class: "hint"});
  const kinds = h("select", {"aria-label": "kind of event", onchange: () => { told = null; stale = true; }}, h("option", {value: ""}, "all kinds"));
  let told = null;
  const save = h("button", {title: "as CSV, such as the log of all EMCY", onclick: () => savedText(`${kinds.value || "events"}.csv`, "text/csv", ["time,kind,text",
    ...source.sortedEvents().filter(each => !kinds.value || each.kind === kinds.value).map(each => `${each.time.toFixed(4)},${each.kind},"${each.text.replaceAll('"', '""')}"`)])}, "Save");
  return {element: h("div", {}, h("div", {class: "tools"}, kinds, save, nothing), list), show(time) {
    const all = source.sortedEvents();
    for (const kind of new Set(all.map(each => each.kind))) {
      if (![...kinds.options].some(each => each.value === kind)) kinds.append(h("option", {value: kind}, kind));
    }
    const wanted = all.filter(each => !kinds.value || each.kind === kinds.value), events = gathered(wanted).slice(-MOST_LISTED);
    const current = live ? null : events[upTo(events.map(each => each.time), time) - 1];
    const state = `${events.length} ${current?.key} ${live && wanted.at(-1)?.key} ${wanted.length}`;
    if (state === told) return;
    told = state;
    show(nothing, !events.length);
    say(nothing, all.length ? "None of this kind." : "Nothing has happened yet.");
    list.replaceChildren(...[...events].reverse().map(each => eventLine(source, each, each === current)));
    if (list.offsetParent) list.querySelector(".current")?.scrollIntoView({block: "nearest"});
  }};
});

// The time line of a log

function eventTimes() {
  return [...new Set(sources.flatMap(source => [...source.events.values()].map(each => each.time)))].sort((a, b) => a - b);
}
function stepEvent(direction) {
  const times = eventTimes(), now = clock.time, near = 0.0005;
  const next = direction > 0 ? times.find(each => each > now + near) : times.findLast(each => each < now - near);
  clock.pause();
  clock.seek(next ?? (direction > 0 ? clock.end : 0));
}

function eventMark(each) {
  const end = clock.end || 1, left = 1000 * each.time / end, width = each.end === null ? 0 : 1000 * (each.end - each.time) / end;
  const shape = width ? s("rect", {x: left, y: 9, width: Math.max(width, 2), height: 8}) : s("rect", {x: left - 1.5, y: 1, width: 3, height: 18});
  return filled(s("g", {class: `mark kind-${each.kind} ${each.wrong ? "is-wrong" : ""}`}, shape), {onclick: () => clock.seek(each.time)},
    [s("title", {}, `${each.time.toFixed(2)} s: ${each.text}`)]);
}
function timeline() {
  const slider = h("input", {
    type: "range", id: "time", min: 0, max: clock.end, step: "any", "aria-label": "time in s",
    oninput: () => clock.seek(Number(slider.value)),
  });
  const lanes = sources.map(source => s("svg", {class: "lane", viewBox: "0 0 1000 20", preserveAspectRatio: "none", role: "img",
    "aria-label": `events of ${source.name}`}));
  let marked = "";
  const mark = () => {                      // a long log grows until all of it is read
    const told = [clock.end, ...sources.map(each => each.events.size)].join();
    if (told === marked) return;
    marked = told;
    slider.max = clock.end;
    lanes.forEach((lane, place) => lane.replaceChildren(...sources[place].sortedEvents().filter(each => each.kind !== "boot-up").map(eventMark)));
  };
  const play = h("button", {id: "play", class: "main", onclick: () => clock.toggle()}, "Play");
  const speed = h("select", {id: "speed", "aria-label": "speed", onchange: () => clock.faster(SPEEDS.indexOf(Number(speed.value)) - SPEEDS.indexOf(clock.speed))},
    ...SPEEDS.map(each => h("option", {value: each}, `${each} ×`)));
  const shown = h("output", {id: "shown"});
  const element = h("div", {class: "player"}, h("div", {class: "lanes"}, ...lanes), slider,
    h("div", {class: "buttons"}, h("button", {onclick: () => stepEvent(-1), "aria-label": "event before", title: "event before: ,"}, "‹ Event"),
      play, h("button", {onclick: () => stepEvent(1), "aria-label": "next event", title: "next event: ."}, "Event ›"), speed, shown));
  return {element, show(time) {
    mark();
    if (document.activeElement !== slider || clock.running || Math.abs(slider.value - time) > 1e-6) slider.value = time;
    say(play, clock.running ? "Pause" : "Play");
    say(shown, `${time.toFixed(1)} s of ${clock.end.toFixed(1)} s`);
    if (speed.value !== String(clock.speed)) speed.value = String(clock.speed);
  }};
}

// Two logs

function compareView() {
  const {count, differences} = content.comparison;
  const kinds = [...new Set(differences.map(each => each.kind))].map(kind => `${differences.filter(each => each.kind === kind).length} ${kind}`);
  const of = (most, words) => count > most ? `, ${words} the first ${most}` : "";
  const told = count === 0 ? "The logs do not differ." : `${count} differences: ${kinds.join(", ")}${of(differences.length, "of")}${of(MOST_LISTED, "here")}.`;
  return {element: h("div", {}, h("p", {class: "hint"}, `${sources[1].name} against ${sources[0].name}, as the command compare says it. ${told}`),
    h("ol", {class: "events"}, ...differences.slice(0, MOST_LISTED).map(each => h("li", {}, h("button", {onclick: () => { clock.pause(); clock.seek(each.time); }},
      h("span", {class: "at"}, `${each.time.toFixed(3)} s`), h("span", {class: "kind"}, each.kind), h("span", {}, `${each.name}: ${each.text}`)))))), show() {}};
}

// What is wrong on the bus so far, or in each log: the verdict, and the incidents, worst first. The server has the rules.

const LEVEL_CLASSES = {error: "is-error", warning: "is-warning", note: "is-note"};

function incidentItem({level, title, facts}) {
  return h("details", {class: `incident ${LEVEL_CLASSES[level]}`, "data-key": title.replace(/[\d.]+/g, "")},
    h("summary", {}, h("b", {class: "level"}, level), " ", title),
    h("dl", {}, ...facts.flatMap(([what, text]) => [h("dt", {}, what), h("dd", {}, text)])));
}

function diagnosisOf({name, diagnosis}) {
  const verdict = h("p", {class: "verdict", role: "status"}, "Waiting for frames."), list = h("div", {class: "incidents"});
  let told = "";
  function take(found) {
    say(verdict, found.verdict);
    const text = JSON.stringify(found.incidents);
    if (text === told) return;
    told = text;
    const open = new Set([...list.querySelectorAll("details[open]")].map(each => each.dataset.key));
    const items = found.incidents.map(incidentItem);
    for (const each of items) each.open = open.has(each.dataset.key);
    list.replaceChildren(...items);
  }
  if (diagnosis) take(diagnosis);
  return {element: h("section", {}, several ? h("h2", {}, name) : "", verdict, list), take};
}

function diagnosisView() {
  const all = content.sources.map(diagnosisOf);
  let asked = -Infinity;
  return {element: h("div", {class: "diagnosis"}, ...all.map(each => each.element)), show() {
    if (performance.now() - asked < 1000) return;
    asked = performance.now();
    if (live && connection.up) quietly(connection.ask({do: "diagnosis"}).then(all[0].take));
    for (const {long, number} of sources) if (long && !long.diagnosed) quietly(long.diagnosis().then(all[number].take));
  }};
}
