"use strict";
// The page: sources with their rows, a clock, and views that show what stands in the rows at the clock's time.
//
// Rule of this file: what a source says is shown as text only, never as HTML. A log's rows are complete from the start;
// a live source's grow by what the server sends, up to KEPT values. Panels of other scripts register by `panel(...)`.

const content = JSON.parse(document.getElementById("content").textContent);
const live = content.live === true;
const KEPT = 6000, TRIMMED = 1000;          // values of a live row, and how many are dropped at once beyond that
const LAST = 32;                            // intervals that period and jitter are computed from, as in `monitor`
const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
const TABLES = 100;                         // ms between two updates of tables and numbers

// Helpers

function filled(made, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== null && value !== undefined && value !== false) made.setAttribute(name, value);
  }
  made.append(...children.filter(each => each !== null && each !== undefined));
  return made;
}
const h = (tag, attributes, ...children) => filled(document.createElement(tag), attributes, children);
const s = (tag, attributes, ...children) =>
  filled(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
const plain = name => name.replace(/[ _-]/g, "").toLowerCase();
const say = (element, text) => { if (element.textContent !== text) element.textContent = text; };
const show = (element, visible) => { if (element.hidden === visible) element.hidden = !visible; };

function upTo(times, time) {                // how many of the times, which are in order, are not later
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1; else high = middle;
  }
  return low;
}
function saved(name, blob) {
  const link = h("a", {href: URL.createObjectURL(blob), download: name});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);   // not at once: the browser has yet to read it
}
let toastTimer = 0;
function toast(text, wrong) {
  clearTimeout(toastTimer);
  say(toastLine, text);
  toastLine.className = wrong ? "wrong" : "";
  show(toastLine, true);
  toastTimer = setTimeout(() => show(toastLine, false), wrong ? 8000 : 3000);
}
const toastLine = h("output", {id: "toast", role: "status", hidden: true});

// Sources and their rows

class Row {
  constructor(source, data) {
    const known = data.fields ? data : source.messages.get(data.name);
    Object.assign(this, {source, id: data.id, name: data.name, group: data.group, nodes: data.nodes, bits: data.bits});
    this.fields = known ? known.fields : [];
    this.times = data.times || [];
    this.columns = data.values && data.times ? data.values : this.fields.map(() => []);
    this.texts = data.texts || [];
    this.wrongAt = Object.keys(data.wrong || {}).map(Number).sort((a, b) => a - b);
    this.wrong = data.wrong || {};
    this.latest = null;
  }
  get key() { return this.id === null ? this.name : this.id; }
  append(update) {                          // live: the server's latest snapshot of it
    this.latest = update;
    if (!update.values || update.time <= this.times.at(-1)) return;
    this.times.push(update.time);
    this.columns.forEach((column, field) => column.push(update.values[field]));
    if (this.times.length > KEPT) [this.times, ...this.columns].forEach(each => each.splice(0, TRIMMED));
  }
  now(time) {                               // what is shown of it at a time, null before its first frame
    if (this.latest) return {...this.latest, age: time - this.latest.time};
    const count = upTo(this.times, time), first = Math.max(count - 1 - LAST, 0), last = this.times[count - 1];
    if (!count) return null;
    const number = count - 1 - first, period = number ? (last - this.times[first]) / number : null;
    let square = 0;
    for (let each = first; each < count - 1; each++) square += (this.times[each + 1] - this.times[each] - period) ** 2;
    const read = this.texts.length ? this.texts[count - 1] : "";
    return {
      count, period, jitter: number ? Math.sqrt(square / number) : null, age: time - last, time: last,
      wrong: upTo(this.wrongAt, count - 1), defects: this.wrong[count - 1] || "",
      values: read ? null : this.columns.map(column => column[count - 1]), text: read,
    };
  }
  field(name) { return this.fields.findIndex(each => each.name === name); }
  value(name, time) {                       // what a field had at a time
    const count = upTo(this.times, time);
    return count ? this.columns[this.field(name)][count - 1] : undefined;
  }
}

class Source {
  constructor(data, number) {
    Object.assign(this, {number, name: data.name, nodes: data.nodes, machine: data.machine, groups: data.groups, bitrate: data.bitrate});
    this.messages = new Map(data.messages.map(each => [each.name, each]));
    this.leftOut = data.left_out || 0;
    this.end = data.end || 0;
    this.rows = new Map();
    this.events = new Map((data.events || []).map(each => [each.key, each]));
    this.objects = new Map();               // polled by SDO: key to {times, values}
    this.health = [];
    for (const each of data.rows || []) this.enter(each);
  }
  enter(data) {
    const key = data.id === null ? data.name : data.id;
    if (!this.rows.has(key)) this.rows.set(key, new Row(this, data));
    return this.rows.get(key);
  }
  row(name) {
    const wanted = plain(name);
    for (const each of this.rows.values()) if (plain(each.name) === wanted) return each;
    return null;
  }
  sorted() { return [...this.rows.values()].sort((a, b) => (a.id ?? 2e9) - (b.id ?? 2e9)); }
  sortedEvents() { return [...this.events.values()].sort((a, b) => a.time - b.time); }
  load(time) {                              // of a log: the share of the bus in the second before
    let bits = 0;
    for (const row of this.rows.values()) bits += (row.bits || 0) * (upTo(row.times, time) - upTo(row.times, time - 1));
    return bits / this.bitrate;
  }
  take(snapshot) {
    for (const each of snapshot.rows) this.enter(each).append(each);
    for (const each of snapshot.events) { this.events.delete(each.key); this.events.set(each.key, each); }
    while (this.events.size > 2000) this.events.delete(this.events.keys().next().value);
    this.health = snapshot.nodes;
    this.end = snapshot.time;
    for (const [key, each] of Object.entries(snapshot.objects)) {
      if (!this.objects.has(key)) this.objects.set(key, {times: [], values: [], trouble: ""});
      const kept = this.objects.get(key);
      kept.trouble = each.trouble;
      if (each.value === null || each.time <= kept.times.at(-1)) continue;
      kept.times.push(each.time);
      kept.values.push(each.value);
      if (kept.times.length > KEPT) [kept.times, kept.values].forEach(list => list.splice(0, TRIMMED));
    }
  }
}

const sources = content.sources.map((data, number) => new Source(data, number));
const several = sources.length > 1;

function written(field, value) {            // a value for a person
  if (value === null || value === undefined) return "unknown";
  if (typeof value === "number" || typeof value === "boolean") return `${value}${field.unit ? " " + field.unit : ""}`;
  return value;
}
function number(field, value) {             // a value for a plot
  if (typeof value === "number") return value;
  if (typeof value === "boolean") return Number(value);
  const found = Object.entries(field.words || {}).find(([, word]) => word === value);
  return found ? Number(found[0]) : null;
}

class FieldSeries {
  constructor(row, name) {
    Object.assign(this, {row, field: row.fields[row.field(name)], index: row.field(name)});
    this.id = JSON.stringify([row.source.number, row.name, name]);
    this.name = `${several ? row.source.name + ": " : ""}${row.name}.${name}`;
    this.unit = this.field.unit;
  }
  data() { return [this.row.times, this.row.columns[this.index].map(value => number(this.field, value))]; }
  at(time) {
    const count = upTo(this.row.times, time);
    return count ? written(this.field, this.row.columns[this.index][count - 1]) : "";
  }
}
class ObjectSeries {
  constructor(source, key, watched) {
    Object.assign(this, {source, key, watched, unit: ""});
    this.id = JSON.stringify([source.number, null, key]);
    this.name = key;
  }
  kept() { return this.source.objects.get(this.key) || {times: [], values: [], trouble: ""}; }
  data() {
    const {times, values} = this.kept();
    return [times, values.map(value => typeof value === "number" ? value : null)];
  }
  at(time) {
    const {times, values, trouble} = this.kept(), count = upTo(times, time);
    return trouble || (count ? String(values[count - 1]) : "");
  }
}
function seriesOf(id) {
  const [number, row, name] = JSON.parse(id), source = sources[number];
  const found = source.row(row);
  return found && found.field(name) >= 0 ? new FieldSeries(found, name) : null;
}

// The clock

const clock = {
  end: Math.max(0, ...sources.map(each => each.end)),
  speed: 1,
  base: 0, since: null,                     // log: the time at which it was started, and performance.now() then
  received: 0, frozen: null,                // live: performance.now() at the last snapshot; the time it is held at
  get running() { return live ? this.frozen === null : this.since !== null; },
  get time() {
    if (live) return this.frozen ?? (sources[0].end + (connection.up ? (performance.now() - this.received) / 1000 : 0));
    if (this.since === null) return this.base;
    return Math.min(this.base + (performance.now() - this.since) / 1000 * this.speed, this.end);
  },
  seek(time) {
    this.base = Math.min(Math.max(time, 0), this.end);
    if (this.since !== null) this.since = performance.now();
    stale = true;
  },
  play() {
    if (this.base >= this.end) this.base = 0;
    this.since = performance.now();
    stale = true;
  },
  pause() { this.base = this.time; this.since = null; stale = true; },
  toggle() { if (this.running) this.pause(); else this.play(); },
  faster(steps) {
    this.base = this.time;
    if (this.since !== null) this.since = performance.now();
    this.speed = SPEEDS[Math.min(Math.max(SPEEDS.indexOf(this.speed) + steps, 0), SPEEDS.length - 1)];
    stale = true;
  },
};
let stale = true;                           // something has changed that is not shown yet

// The server

const connection = {
  up: false, control: false, skipped: 0, number: 0, waiting: new Map(), state: null, socket: null, pause: 500,
  open() {
    this.socket = new WebSocket(`${location.origin.replace(/^http/, "ws")}/live`);
    this.socket.onmessage = message => this.hear(JSON.parse(message.data));
    this.socket.onclose = () => {
      this.up = false;
      stale = true;
      for (const {fail} of this.waiting.values()) fail(new Error("the server is not there"));
      this.waiting.clear();
      setTimeout(() => this.open(), this.pause);
      this.pause = Math.min(2 * this.pause, 5000);
    };
  },
  hear(said) {
    if ("re" in said) {
      const {done, fail} = this.waiting.get(said.re) || {};
      this.waiting.delete(said.re);
      if (!done) return;
      if ("error" in said) fail(new Error(said.error)); else done(said.ok);
      return;
    }
    if (!this.up) {                         // it may be a new server, whose time starts at 0 again
      if (said.time < sources[0].end) { sources[0].rows.clear(); sources[0].events.clear(); sources[0].objects.clear(); }
      this.pause = 500;
    }
    Object.assign(this, {up: true, control: said.control, skipped: said.skipped, state: said});
    sources[0].take(said);
    clock.received = performance.now();
    this.socket.send(String(said.turn));    // confirmed: a browser that owes too many is left out
    stale = true;
  },
  ask(request) {
    return new Promise((done, fail) => {
      if (!this.up) { fail(new Error("the server is not there")); return; }
      const id = ++this.number;
      this.waiting.set(id, {done, fail});
      this.socket.send(JSON.stringify({id, ...request}));
    });
  },
};
async function request(what, done) {        // ask, and show the outcome as a toast
  try {
    const answer = await connection.ask(what);
    if (done) toast(typeof done === "function" ? done(answer) : done);
    return answer;
  } catch (error) {
    toast(error.message, true);
    throw error;
  }
}
const quietly = promise => promise.catch(() => undefined);

// Views: each has a name, a title and make(), which returns its element and what shows a time in it

const views = [];
const panelMakers = new Map();
function panel(name, make) { panelMakers.set(name, make); }

function perSource(make) {                  // one element for each source, side by side
  const made = sources.map(make);
  const legends = several ? made.map(each => each.legend).filter(Boolean) : [];   // they say the same: one is enough
  legends.forEach(each => each.remove());
  const element = h("div", {class: "per-source"}, h("div", {class: "sources"}, ...made.map((each, number) =>
    h("div", {class: "source"}, several ? h("h3", {}, sources[number].name) : null, each.element))), legends[0]);
  return {element, show: time => made.forEach(each => each.show(time)),
    begins: () => Math.min(...made.map(each => each.begins ? each.begins() : Infinity))};
}

// Messages

let search = "";
const groupColour = (source, group) => {
  const place = source.groups.indexOf(group);
  return place >= 0 ? `group-${place % 4}` : group === "CANopen" ? "group-service" : "group-none";
};

function valueButton(series, content) {
  const add = () => { plots.add(series()); toast(`${series().name} is in the plot`); };
  return h("span", {
    class: "value", role: "button", tabindex: 0, draggable: "true", title: `plot ${series().name}: click, or drag it`,
    onclick: add,
    onkeydown: event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); add(); } },
    ondragstart: event => event.dataTransfer.setData("text/plain", series().id),
  }, ...content);
}

class MessageLine {
  constructor(row) {
    this.row = row;
    const cell = (name, ...inside) => h("td", {class: name, "data-name": name}, ...inside);
    this.values = row.fields.map(field => h("span", {}));
    this.chips = row.fields.map((field, place) => valueButton(
      () => new FieldSeries(row, field.name), [h("i", {}, field.name), " ", this.values[place]]));
    this.text = h("span", {});
    this.defects = h("span", {class: "defects"});
    this.cells = {count: cell("count"), period: cell("period"), jitter: cell("jitter"), age: cell("age"), wrong: cell("bad")};
    this.element = h("tr", {},
      cell("id", identifier(row.id)),
      h("th", {scope: "row", class: groupColour(row.source, row.group), title: [row.group, ...row.nodes].join(", ")}, row.name),
      ...Object.values(this.cells), cell("values", ...this.chips, this.text, this.defects));
    this.words = plain([row.name, row.group, ...row.nodes].join(" "));
  }
  show(time) {
    const now = this.row.now(time), there = now !== null && this.words.includes(plain(search));
    show(this.element, there);
    if (!there) return false;
    say(this.cells.count, String(now.count));
    // What comes when it likes has no period: a mean of such intervals, and how far they are off it, would tell nothing.
    const periodic = now.period !== null && now.jitter < now.period / 2;
    say(this.cells.period, periodic ? (now.period * 1000).toFixed(1) : "");
    say(this.cells.jitter, periodic ? (now.jitter * 1000).toFixed(1) : "");
    say(this.cells.age, Math.max(now.age, 0).toFixed(1));
    this.wrong = now.wrong;
    say(this.cells.wrong, now.wrong ? String(now.wrong) : "");
    this.element.classList.toggle("is-wrong", Boolean(now.defects));
    this.element.classList.toggle("lost", isLost(this.row.source, this.row, time));
    this.element.classList.toggle("old", now.age > Math.max(3 * (now.period || 0), 1));
    this.chips.forEach((chip, place) => {
      show(chip, now.values !== null && !this.row.fields[place].unmapped);
      if (now.values) say(this.values[place], written(this.row.fields[place], now.values[place]));
    });
    say(this.text, now.values ? "" : now.text);
    say(this.defects, now.defects ? `! ${now.defects}` : "");
    return true;
  }
}

const COLUMNS = {count: "Count", period: "Period ms", jitter: "Jitter ms", age: "Age s", bad: "Wrong"};
const chosen = new Set(["count", "period", "age", "bad"]);   // of these columns; the others are always there

views.push({name: "messages", title: "Messages", make() {
  const tables = perSource(source => {
    const body = h("tbody"), lines = new Map();
    const head = (name, words) => h("th", {scope: "col", class: name}, words);
    const table = h("table", {class: "messages", "aria-label": `messages of ${source.name}`}, h("thead", {}, h("tr", {}, head("id", "ID"), head("", "Message"),
      ...Object.entries(COLUMNS).map(each => head(...each)), head("values", "Last values"))), body);
    const none = h("p", {class: "hint", hidden: true});
    const element = h("div", {}, table, none);
    let known = null;
    return {element, show(time) {
      if (known !== source.rows.size) {
        for (const [key, line] of lines) if (source.rows.get(key) !== line.row) { line.element.remove(); lines.delete(key); }
        known = source.rows.size;
        for (const row of source.sorted()) {
          if (!lines.has(row.key)) lines.set(row.key, new MessageLine(row));
          body.append(lines.get(row.key).element);
        }
      }
      const shown = [...lines.values()].filter(line => line.show(time)).length;
      const hidden = name => !chosen.has(name) || (name === "bad" && ![...lines.values()].some(line => line.wrong));
      for (const name of Object.keys(COLUMNS)) table.classList.toggle(`without-${name}`, hidden(name));
      show(table, shown > 0);
      show(none, !shown);
      say(none, search ? `No message, protocol or node has “${search}” in its name.` : "No message yet.");
    }};
  });
  const choice = ([name, words]) => h("label", {}, h("input", {
    type: "checkbox", checked: chosen.has(name),
    onchange: event => { if (event.target.checked) chosen.add(name); else chosen.delete(name); stale = true; },
  }), words);
  const columns = h("details", {class: "columns"}, h("summary", {}, "Columns"), ...Object.entries(COLUMNS).map(choice));
  const box = h("input", {
    type: "search", id: "search", placeholder: "search", "aria-label": "search messages, protocols, nodes",
    oninput: () => { search = box.value; stale = true; },
  });
  const element = h("div", {}, h("div", {class: "tools"}, box,
    columns, h("p", {class: "hint"}, "Click a value, or drag it, to plot it.")), tables.element);
  return {element, show: tables.show};
}});

// Plots

const ownColours = [];                      // of panels: (row, time) to the variable of its colour, null for any other row
const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

class Plot {
  constructor() {
    this.series = [];
    this.chart = null;
    this.cursor = null;                     // the time under the pointer
    this.legend = h("div", {class: "legend"});
    this.canvas = h("div", {class: "chart"});
    this.playhead = h("div", {class: "playhead"});
    this.empty = h("p", {class: "hint"}, "Drag values here, or click them in Messages.");
    this.element = h("section", {
      class: "plot", "aria-label": "plot",
      ondragover: event => { event.preventDefault(); this.element.classList.add("over"); },
      ondragleave: () => this.element.classList.remove("over"),
      ondrop: event => { event.preventDefault(); this.element.classList.remove("over"); this.drop(event); },
      onclick: () => plots.choose(this),
    }, h("div", {class: "plot-head"}, this.legend,
      h("div", {class: "buttons"},
        h("button", {onclick: () => this.save("csv"), "aria-label": "save this plot as CSV"}, "CSV"),
        h("button", {onclick: () => this.save("png"), "aria-label": "save this plot as PNG"}, "PNG"),
        h("button", {onclick: event => { event.stopPropagation(); plots.remove(this); }, "aria-label": "remove this plot"}, "×"))),
    this.empty, this.canvas);
  }
  drop(event) {
    let series = null;
    try { series = seriesOf(event.dataTransfer.getData("text/plain")); } catch { /* something else was dropped */ }
    if (series) this.add(series); else toast("only values of messages and objects can be plotted", true);
  }
  add(series) {
    if (!this.series.some(each => each.id === series.id)) this.series.push(series);
    this.build();
  }
  build() {
    if (this.chart) this.chart.destroy();
    this.chart = null;
    show(this.empty, !this.series.length);
    this.labels = this.series.map(() => h("b", {}));
    this.lines = this.drawnBy();
    this.legend.replaceChildren(...this.series.map((each, place) => h("span", {class: this.lines[place].dash ? "line dashed" : "line"}, each.name, " ",
      this.labels[place], h("button", {"aria-label": `take ${each.name} out of the plot`, onclick: () => {
        this.series.splice(place, 1);
        this.build();
      }}, "×"))));
    this.lines.forEach(({colour}, place) => this.legend.children[place].style.setProperty("--line", `var(${colour})`));
    if (!this.series.length || !this.canvas.clientWidth) return;
    const axis = {stroke: css("--ink"), grid: {stroke: css("--grid"), width: 1}, ticks: {stroke: css("--grid"), width: 1}};
    const units = [...new Set(this.series.map(each => each.unit))].join(", ");
    this.chart = new uPlot({
      width: this.canvas.clientWidth, height: 220, legend: {show: false},
      scales: {x: {time: false}},
      axes: [{...axis, label: "time in s", labelSize: 18}, {...axis, label: units || undefined, labelSize: 18, size: (_, values) => Math.max(60, 18 + 8 * Math.max(0, ...(values || []).map(each => each.length)))}],
      cursor: {sync: {key: "time"}, drag: {x: true, y: false, setScale: false}, bind: {dblclick: () => () => plots.zoom(null)}},
      series: [{}, ...this.series.map((each, place) => ({
        label: each.name, stroke: css(this.lines[place].colour), width: 1.6, spanGaps: true, dash: this.lines[place].dash,
        // Stepped: between two frames a value is the last one. Gaps: joined series have none where another has a time.
        paths: uPlot.paths.stepped({align: 1}), points: {show: false},
      }))],
      hooks: {
        setSelect: [chart => {
          if (chart.select.width < 4) return;
          plots.zoom([chart.posToVal(chart.select.left, "x"), chart.posToVal(chart.select.left + chart.select.width, "x")]);
          chart.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
        }],
        setCursor: [chart => {
          const {left} = chart.cursor;
          this.cursor = left >= 0 ? chart.posToVal(left, "x") : null;
          stale = true;
        }],
      },
    }, this.data(), this.canvas);
    this.chart.over.append(this.playhead);
    this.ranged();
  }
  drawnBy() {                               // of each series: a colour of its own, or of its row's thing; there dashes differ
    const drawn = [];
    for (const {row} of this.series) {
      const own = row && ownColours.map(each => each(row, clock.time)).find(Boolean);
      const plain = drawn.filter(each => !each.own).length, same = drawn.filter(each => each.colour === own).length;
      drawn.push(own ? {own, colour: own, dash: [undefined, [6, 4], [2, 3]][same % 3]}
        : {own, colour: `--line-${plain % 8}`, dash: plain >= 4 ? [6, 4] : undefined});
    }
    return drawn;
  }
  data() { return uPlot.join(this.series.map(each => each.data())); }
  ranged() {
    const [min, max] = plots.range();
    this.chart.setScale("x", {min, max});
  }
  update(time) {
    if (!this.series.length || !this.canvas.clientWidth) return;
    if (!this.chart || this.chart.width !== this.canvas.clientWidth) this.build();
    if (live && clock.running) {            // false: uPlot would choose a range of its own
      this.chart.setData(this.data(), false);
      this.ranged();
    }
    const place = this.chart.valToPos(time, "x");
    show(this.playhead, !live && place >= 0 && place <= this.chart.over.clientWidth);
    this.playhead.style.left = `${place}px`;
    this.labels.forEach((label, number) => say(label, this.series[number].at(this.cursor ?? time)));
  }
  save(form) {
    if (!this.chart) { toast("the plot is empty", true); return; }
    if (form === "csv") {
      const quoted = text => `"${text.replaceAll('"', '""')}"`;
      const [times, ...columns] = this.data();
      const lines = times.map((time, place) => [time, ...columns.map(column => column[place] ?? "")].join(","));
      const head = ["time in s", ...this.series.map(each => each.unit ? `${each.name} in ${each.unit}` : each.name)];
      saved("plot.csv", new Blob([head.map(quoted).join(","), "\n", lines.join("\n"), "\n"], {type: "text/csv"}));
      return;
    }
    const from = this.chart.ctx.canvas, scale = devicePixelRatio, head = 20 * scale * this.series.length + 8 * scale;
    const canvas = h("canvas", {width: from.width, height: from.height + head}), pen = canvas.getContext("2d");
    pen.fillStyle = css("--paper");
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.font = `${13 * scale}px sans-serif`;
    this.series.forEach((each, place) => {
      pen.fillStyle = css(this.lines[place].colour);
      pen.fillText(each.name, 10 * scale, 20 * scale * (place + 1));
    });
    pen.drawImage(from, 0, head);
    canvas.toBlob(blob => saved("plot.png", blob));
  }
}

const WATCHED = 5000;                       // ms after which the page tells the server that an object is still plotted

const plots = {
  all: [], chosen: null, zoomed: null, window: 30, list: h("div", {class: "plots"}),
  range() {
    if (this.zoomed) return this.zoomed;
    return live ? [Math.max(clock.time - this.window, 0), Math.max(clock.time, 1)] : [0, clock.end || 1];
  },
  zoom(range) {
    this.zoomed = range;
    for (const each of this.all) if (each.chart) each.ranged();
  },
  scale(factor) {
    const [low, high] = this.range(), middle = live ? high : Math.min(Math.max(clock.time, low), high);
    this.zoom([middle - (middle - low) * factor, middle + (high - middle) * factor]);
  },
  choose(plot) {
    this.chosen = plot;
    for (const each of this.all) each.element.classList.toggle("chosen", each === plot && this.all.length > 1);
  },
  create() {
    const plot = new Plot();
    this.all.push(plot);
    this.list.append(plot.element);
    this.choose(plot);
    return plot;
  },
  remove(plot) {
    if (plot.chart) plot.chart.destroy();
    plot.element.remove();
    this.all = this.all.filter(each => each !== plot);
    if (!this.all.length) this.create(); else this.choose(this.all.at(-1));
  },
  add(series) { this.chosen.add(series); stale = true; },
  watched() { return this.all.flatMap(plot => plot.series).filter(each => each instanceof ObjectSeries); },
};

views.push({name: "plots", title: "Plots", make() {
  plots.create();
  const windows = h("select", {"aria-label": "span of time", onchange: () => { plots.window = Number(windows.value); plots.zoom(null); }},
    ...[10, 30, 60, 300].map(each => h("option", {value: each, selected: each === plots.window}, `last ${each} s`)));
  const element = h("div", {}, h("div", {class: "tools"},
    h("button", {onclick: () => plots.create()}, "New plot"),
    live ? windows : null,
    h("button", {onclick: () => plots.scale(0.5)}, "Zoom in"), h("button", {onclick: () => plots.scale(2)}, "Zoom out"),
    h("button", {onclick: () => plots.zoom(null)}, "All"),
    h("p", {class: "hint"}, "Drag across a plot to zoom, double-click for all of it.")), plots.list);
  return {element, show: time => plots.all.forEach(each => each.update(time))};
}});

// Nodes

function nodeNow(source, node, time) {      // state, age, and whether it is lost
  if (live) return source.health.find(each => each.name === node.name) || {state: "", age: null, lost: false};
  const row = source.rows.get(0x700 + node.id), now = row ? row.now(time) : null;
  return now ? {state: now.text.split(", ").at(-1), age: now.age, lost: now.period ? now.age > 2 * now.period + 0.05 : false}
    : {state: "", age: null, lost: false};
}
// Bit 29 stands for a 29-bit identifier, which is written with eight digits.
const EXTENDED = 2 ** 29;
const identifier = id => id === null ? "" : (id % EXTENDED).toString(16).toUpperCase().padStart(id < EXTENDED ? 3 : 8, "0");
const hex = (value, digits) => value === null ? "–" : `0x${value.toString(16).toUpperCase().padStart(digits, "0")}`;

function isLost(source, row, time) {        // whether all who send it are lost
  const message = source.messages.get(row.name), senders = message ? message.senders : row.nodes;
  const known = source.nodes.filter(each => senders.includes(each.name));
  return known.length > 0 && known.every(each => nodeNow(source, each, time).lost);
}

class NodeCard {
  constructor(source, node) {
    Object.assign(this, {source, node});
    this.state = h("strong");
    this.beat = h("span");
    this.errors = h("ol", {class: "errors", "aria-label": `EMCY of ${node.name}`});
    const commands = ["start", "stop", "pre-operational", "reset", "reset communication"];
    const [vendor, product, revision, serial] = node.identity || [null, null, null, null];
    this.control = h("div", {class: "buttons", hidden: true}, ...commands.map(command => h("button", {
      onclick: () => quietly(request({do: "nmt", command, node: node.name}, `${command} sent to ${node.name}`)),
    }, command)));
    this.element = h("section", {class: "card"},
      h("h3", {}, node.name, h("small", {}, ` node ${node.id}`)),
      h("p", {class: "state"}, this.state, " ", this.beat),
      h("p", {class: "hint"}, `vendor ${hex(vendor, 8)}, product ${hex(product, 8)}, revision ${hex(revision, 8)}`
        + `, serial ${hex(serial, 8)}; ${node.file || "no file"}`),
      h("h4", {}, "EMCY"), this.errors, this.control);
  }
  show(time) {
    const now = nodeNow(this.source, this.node, time);
    this.element.classList.toggle("lost", now.lost);
    say(this.state, now.age === null ? "not heard" : now.lost ? "LOST" : now.state);
    say(this.beat, now.age === null ? "" : `heartbeat ${now.age.toFixed(1)} s ago`);
    show(this.control, connection.control);
    const errors = this.source.sortedEvents().filter(each =>
      each.kind === "EMCY" && each.data.node === this.node.name && each.time <= time).slice(-20).reverse();
    const text = errors.length ? errors.map(each => `${each.time.toFixed(2)} s  ${each.text}`) : ["none"];
    if (text.join("\n") !== this.told) {
      this.told = text.join("\n");
      this.errors.replaceChildren(...text.map((line, place) => h("li", {class: errors[place]?.wrong ? "is-wrong" : ""}, line)));
    }
  }
}

views.push({name: "nodes", title: "Nodes", make: () => perSource(source => {
  const cards = new Map(), element = h("div", {class: "cards"});
  const enter = node => {
    const card = new NodeCard(source, node);
    cards.set(node.name, card);
    element.append(card.element);
  };
  source.nodes.forEach(enter);
  return {element, show(time) {
    for (const each of source.health) {     // nodes that no file describes are heard as well
      if (!cards.has(each.name)) enter({name: each.name, id: Number(each.name.replace("node ", "")), identity: null, file: ""});
    }
    for (const card of cards.values()) card.show(time);
  }};
})});

// Object dictionaries

if (live) views.push({name: "objects", title: "Objects", make() {
  const source = sources[0], body = h("tbody"), box = h("input", {type: "search", placeholder: "search", "aria-label": "search objects", oninput: () => filter()});
  const chosen = h("select", {"aria-label": "node", onchange: () => load()},
    ...source.nodes.map(node => h("option", {}, node.name)));
  let lines = [], loaded = "";
  const filter = () => lines.forEach(line => show(line.element, line.words.includes(plain(box.value))));
  function lineOf(node, object) {
    const value = h("span", {class: "read"}, object.default === "" ? "" : `default ${object.default}`);
    const named = {node, object: object.object};
    const read = async () => {
      const found = await request({do: "read", ...named}).catch(error => ({text: error.message, wrong: true}));
      value.textContent = found.text;
      value.classList.toggle("is-wrong", Boolean(found.wrong));
    };
    const input = h("input", {"aria-label": `new value of ${object.name}`, size: 8, onkeydown: event => { if (event.key === "Enter") write(); }});
    const write = async () => {
      try {
        await request({do: "write", ...named, value: input.value}, `${object.name} written`);
        await read();
      } catch { /* the toast has said why */ }
    };
    const plot = async () => {
      const key = await request({do: "watch", ...named}, answer => `${answer} is in the plot`);
      plots.add(new ObjectSeries(source, key, named));
    };
    const form = h("span", {class: "write", hidden: true}, input, h("button", {onclick: write}, "Write"));
    const limits = object.low === null ? "" : `${object.low}..${object.high}`;
    const element = h("tr", {},
      h("td", {class: "id"}, object.object), h("th", {scope: "row"}, object.name), h("td", {}, object.type),
      h("td", {}, object.access), h("td", {class: "limits"}, limits), h("td", {class: "read-cell"}, value),
      h("td", {class: "acts"}, h("button", {onclick: () => quietly(read()), "aria-label": `read ${object.name}`}, "Read"),
        h("button", {onclick: () => quietly(plot()), "aria-label": `plot ${object.name}`}, "Plot"), form));
    return {element, form, words: plain(`${object.object} ${object.name}`), writable: object.access.includes("w")};
  }
  async function load() {
    loaded = chosen.value;
    const objects = await quietly(request({do: "objects", node: loaded}));
    if (!objects) { loaded = ""; return; }
    lines = objects.map(object => lineOf(chosen.value, object));
    body.replaceChildren(...lines.map(line => line.element));
    filter();
    stale = true;
  }
  const element = h("div", {}, h("div", {class: "tools"}, chosen, box), h("table", {class: "objects"},
    h("thead", {}, h("tr", {}, ...["Object", "Name", "Type", "Access", "Limits", "Value", ""].map(each => h("th", {scope: "col"}, each)))), body));
  return {element, show() {
    if (!loaded && connection.up && chosen.value) load();
    for (const line of lines) show(line.form, connection.control && line.writable);
  }};
}});

// Sending

if (live) views.push({name: "send", title: "Send", control: true, make() {
  const source = sources[0], names = [...source.messages.keys()];
  const fields = h("div", {class: "fields"}), answer = h("output", {class: "answer"});
  // It opens on nothing: what a stray click could send is then nothing, too.
  const chosen = h("select", {"aria-label": "message", onchange: () => build()},
    h("option", {value: ""}, "choose a message"), ...names.map(name => h("option", {}, name)));
  const main = h("button", {class: "main", disabled: true}, "Send");
  let inputs = [];
  function inputOf(field) {
    const words = Object.values(field.words);
    const wanted = "low" in field ? null : words.length;
    if (wanted) return h("select", {}, ...words.map(word => h("option", {selected: word === field.default}, word)));
    const form = "low" in field && !words.length ? {type: "number", min: field.low, max: field.high} : {type: "text"};
    return h("input", {...form, value: field.default ?? field.low ?? "", "aria-describedby": `allowed-${field.name}`});
  }
  function build() {
    const message = source.messages.get(chosen.value);
    main.disabled = !message;
    say(answer, "");
    inputs = message ? message.fields.filter(field => !field.unmapped).map(field => ({field, input: inputOf(field)})) : [];
    fields.replaceChildren(...inputs.map(({field, input}) => h("label", {},
      `${field.name}${field.unit ? ` in ${field.unit}` : ""}`, input, h("small", {id: `allowed-${field.name}`}, field.allowed))));
  }
  async function send(event) {
    event.preventDefault();
    const values = Object.fromEntries(inputs.filter(({input}) => input.value !== "").map(({field, input}) => [field.name, input.value]));
    try {
      say(answer, `sent ${await connection.ask({do: "send", message: chosen.value, fields: values})}`);
      answer.classList.remove("is-wrong");
    } catch (error) {
      say(answer, error.message);
      answer.classList.add("is-wrong");
    }
  }
  build();
  const all = h("div", {class: "buttons"}, ...["start", "stop", "pre-operational", "reset"].map(command =>
    h("button", {onclick: () => quietly(request({do: "nmt", command, node: "all"}, `${command} sent to all nodes`))}, `${command} all nodes`)));
  return {element: h("div", {class: "card"}, h("form", {class: "send", onsubmit: send},
    h("label", {}, "Message", chosen), fields, main, answer), h("h4", {}, "NMT"), all), show() {}};
}});

// Events

views.push({name: "events", title: "Events", make: () => perSource(source => {
  const list = h("ol", {class: "events"}), nothing = h("p", {class: "hint"}, "Nothing has happened yet.");
  let told = "";
  return {element: h("div", {}, nothing, list), show(time) {
    const events = source.sortedEvents().filter(each => !live || each.time <= time).slice(-500);
    const last = upTo(events.map(each => each.time), time) - 1;
    const state = `${events.length} ${last} ${live ? sources[0].events.size && events.at(-1)?.text : ""}`;
    if (state === told) return;
    told = state;
    show(nothing, !events.length);
    list.replaceChildren(...events.map((each, place) => h("li", {
      class: `${each.wrong ? "is-wrong" : ""} ${place === last ? "current" : ""}`},
    h("button", {disabled: live, onclick: () => { clock.pause(); clock.seek(each.time); }},
      h("span", {class: "at"}, `${each.time.toFixed(2)} s`), h("span", {class: "kind"}, each.kind), h("span", {}, each.text)))));
    if (!live && last >= 0 && list.offsetParent) list.children[last].scrollIntoView({block: "nearest"});
  }};
})});

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

function timeline() {
  const slider = h("input", {
    type: "range", id: "time", min: 0, max: clock.end, step: "any", "aria-label": "time in s",
    oninput: () => clock.seek(Number(slider.value)),
  });
  const lanes = sources.map(source => {
    const marks = source.sortedEvents().filter(each => each.kind !== "boot-up").map(each => {
      const left = 1000 * each.time / (clock.end || 1), width = each.end === null ? 0 : 1000 * (each.end - each.time) / (clock.end || 1);
      const class_ = `mark kind-${each.kind} ${each.wrong ? "is-wrong" : ""}`;
      const shape = width ? s("rect", {x: left, y: 9, width: Math.max(width, 2), height: 8})
        : s("rect", {x: left - 1.5, y: 1, width: 3, height: 18});
      return filled(s("g", {class: class_}, shape), {onclick: () => clock.seek(each.time)}, [s("title", {}, `${each.time.toFixed(2)} s: ${each.text}`)]);
    });
    return s("svg", {class: "lane", viewBox: "0 0 1000 20", preserveAspectRatio: "none", role: "img",
      "aria-label": `events of ${source.name}`}, ...marks);
  });
  const play = h("button", {id: "play", class: "main", onclick: () => clock.toggle()}, "Play");
  const speed = h("select", {id: "speed", "aria-label": "speed", onchange: () => clock.faster(SPEEDS.indexOf(Number(speed.value)) - SPEEDS.indexOf(clock.speed))},
    ...SPEEDS.map(each => h("option", {value: each}, `${each} ×`)));
  const shown = h("output", {id: "shown"});
  const element = h("div", {class: "player"}, h("div", {class: "lanes"}, ...lanes), slider,
    h("div", {class: "buttons"}, h("button", {onclick: () => stepEvent(-1), "aria-label": "event before", title: "event before: ,"}, "‹ Event"),
      play, h("button", {onclick: () => stepEvent(1), "aria-label": "next event", title: "next event: ."}, "Event ›"), speed, shown));
  return {element, show(time) {
    if (document.activeElement !== slider || clock.running || Math.abs(slider.value - time) > 1e-6) slider.value = time;
    say(play, clock.running ? "Pause" : "Play");
    say(shown, `${time.toFixed(1)} s of ${clock.end.toFixed(1)} s`);
    if (speed.value !== String(clock.speed)) speed.value = String(clock.speed);
  }};
}

// The whole

function statusLine() {
  const text = h("span"), load = h("span", {class: live ? "more" : ""}), link = h("a", {hidden: true});
  const skipped = h("span", {class: "hint more", title: "this browser was too slow for them; the bus was read all the same"});
  const dot = h("span", {class: "dot"});
  const freeze = h("button", {id: "freeze", "aria-pressed": "false", title: "hold what is shown: f", onclick: () => toggleFreeze()}, "Freeze");
  const record = h("button", {id: "record", onclick: () => quietly(connection.state?.recording.on
    ? request({do: "stop recording"}, "recorded") : request({do: "record"}, "recording"))}, "Record");
  const element = h("div", {class: "status", role: "status", "aria-live": "off"}, dot, text, load, skipped, live ? freeze : null,
    live ? record : null, link);
  let troubled = "";
  return {element, show(time) {
    if (!live) {
      say(text, sources.map(each => each.leftOut ? `${each.leftOut} frames left out` : "").filter(Boolean).join(", "));
      say(load, `load ${sources.map(each => `${(100 * each.load(time)).toFixed(1)} %`).join(" | ")}`);
      return;
    }
    const state = connection.state, trouble = !connection.up ? "no connection to the server, trying again" : state.trouble;
    element.classList.toggle("is-wrong", Boolean(trouble));
    say(text, trouble || `${time.toFixed(1)} s`);
    freeze.setAttribute("aria-pressed", String(clock.frozen !== null));
    if (!state) return;
    if (state.recording.trouble && state.recording.trouble !== troubled) toast(state.recording.trouble, true);
    troubled = state.recording.trouble;
    say(load, `load ${(100 * state.load).toFixed(1)} %, ${state.rate.toFixed(0)} frames/s, ${state.frames} frames`);
    say(skipped, state.skipped ? `${state.skipped} snapshots skipped` : "");
    show(record, connection.control);
    say(record, state.recording.on ? `Stop (${state.recording.frames})` : "Record");
    record.setAttribute("aria-label", state.recording.on ? "stop recording" : "record");
    record.classList.toggle("recording", state.recording.on);
    element.title = load.textContent;         // a phone has no room for it
    show(link, !state.recording.on && state.recording.file !== "");
    if (state.recording.file) { link.href = `/recording/${state.recording.file}`; say(link, "Save"); link.title = state.recording.file; }
  }};
}
function faults(time) {                    // what a person has to hear of, whatever view they are in
  return sources.flatMap(source => {
    const lost = source.nodes.filter(node => nodeNow(source, node, time).lost).map(node => `${node.name} is lost`);
    const named = new Map();                // of each node its last EMCY
    for (const each of source.sortedEvents()) if (each.kind === "EMCY" && each.time <= time) named.set(each.data.node, each);
    const errors = [...named.values()].filter(each => each.wrong).map(each => each.text);
    return [...(live && !connection.up ? ["no connection to the server"] : []), ...(live && connection.state?.trouble ? [connection.state.trouble] : []), ...lost, ...errors];
  });
}
function toggleFreeze() {
  clock.frozen = clock.frozen === null ? clock.time : null;
  stale = true;
}

function start() {
  const panels = content.panels.filter(each => panelMakers.has(each.name)).map(each => ({name: each.name, title: each.title,
    panel: true, make: () => perSource(source => panelMakers.get(each.name)(each.setup, source))}));
  const all = [...panels, ...views];
  const tabs = all.map((view, place) => h("button", {
    role: "tab", id: `tab-${view.name}`, "aria-controls": `view-${view.name}`, title: `key ${place + 1}`,
    onclick: () => choose(view), onkeydown: event => {
      const shownTabs = tabs.filter(tab => !tab.hidden), here = shownTabs.indexOf(tabs[place]);
      const to = {ArrowRight: here + 1, ArrowLeft: here - 1, Home: 0, End: -1}[event.key];
      if (to === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      const next = shownTabs.at(to % shownTabs.length);
      next.click();
      next.focus();
    },
  }, view.title));
  const made = all.map(view => view.make());
  const first = Math.min(...made.map(each => each.begins ? each.begins() : Infinity));
  if (!live && first < Infinity) clock.seek(first);   // a log opens where there is something to see
  const sections = all.map((view, place) => h("section", {
    class: `view ${view.panel ? "panel" : ""}`, id: `view-${view.name}`, role: "tabpanel", "aria-labelledby": `tab-${view.name}`, tabindex: 0,
  }, made[place].element));
  const status = statusLine(), line = live ? null : timeline();
  const stop = h("button", {id: "stop", hidden: true, title: "Stop: Escape", onclick: () => quietly(stopNow())}, "STOP");
  document.body.append(
    h("header", {}, h("h1", {}, content.title), status.element, h("nav", {role: "tablist", "aria-label": "views"}, ...tabs)),
    h("main", {class: panels.length ? "with-panel" : ""}, ...sections), h("footer", {}, line && line.element, stop), toastLine);
  const alarms = h("div", {id: "alarms", class: "heard-only", role: "alert"});
  document.body.append(alarms);
  const wide = matchMedia("(min-width: 1200px)");
  function choose(view) {
    current = view;
    history.replaceState(null, "", `#${view.name}`);
    layout();
  }
  function layout() {                       // a panel has the whole window, or stands beside another view if there is room
    const beside = wide.matches && panels.length > 0 && !current.panel;
    all.forEach((view, place) => {
      const chosen = view === current;
      tabs[place].setAttribute("aria-selected", String(chosen));
      tabs[place].tabIndex = chosen ? 0 : -1;
      show(tabs[place], !(view.control && !connection.control));
      show(sections[place], chosen || (beside && view.panel === true));
    });
    document.body.classList.toggle("beside", beside);
    document.body.classList.toggle("alone", current.panel === true);
    tabs[all.indexOf(current)].scrollIntoView({block: "nearest", inline: "nearest"});
    stale = true;
  }
  wide.addEventListener("change", layout);
  let current = all.find(view => `#${view.name}` === location.hash) || (live && wide.matches ? views[0] : all[0]);
  layout();
  keyboard(tabs);
  let drawn = 0, controlled = false;
  function frame() {
    const time = clock.time, ended = !live && clock.running && time >= clock.end;
    if (ended) clock.pause();
    if (clock.running || stale) {
      const tables = performance.now() - drawn > TABLES || (stale && !clock.running);
      stale = false;
      if (tables) drawn = performance.now();
      if (controlled !== connection.control) { controlled = connection.control; layout(); }
      show(stop, connection.control);
      document.body.classList.toggle("control", connection.control);
      all.forEach((view, place) => { if (!sections[place].hidden && (tables || view.panel)) made[place].show(time); });
      if (line) line.show(time);
      if (tables) { status.show(time); say(alarms, faults(time).join("; ")); }
      document.body.dataset.time = time.toFixed(3);
    }
    requestAnimationFrame(frame);
  }
  if (live) {
    connection.open();
    setInterval(() => plots.watched().forEach(each => quietly(connection.ask({do: "watch", ...each.watched}))), WATCHED);
  }
  requestAnimationFrame(frame);
}
const stopNow = () => request({do: "stop"}, answer => `stop sent: ${answer}`);

function keyboard(tabs) {
  const log = {
    " ": () => clock.toggle(), "ArrowRight": () => clock.seek(clock.time + 1), "ArrowLeft": () => clock.seek(clock.time - 1),
    ".": () => stepEvent(1), ",": () => stepEvent(-1), "Home": () => clock.seek(0), "End": () => clock.seek(clock.end),
    "+": () => clock.faster(1), "-": () => clock.faster(-1),
  };
  const bus = {"f": toggleFreeze, "Escape": () => { if (connection.control) quietly(stopNow()); }};
  document.addEventListener("keydown", event => {
    const typing = event.target.closest("input:not([type=range]), select, textarea");
    if (event.ctrlKey || event.metaKey || event.altKey || (typing && event.key !== "Escape")) return;
    // A button takes these keys itself: Space on Play would start the log and pause it at once.
    if (event.target.closest("button, [role=button]") && [" ", "Enter"].includes(event.key)) return;
    const tab = tabs.filter(each => !each.hidden)[Number(event.key) - 1];
    const act = (live ? bus : log)[event.key] || (event.key === "/" ? () => { tabs.find(each => each.id === "tab-messages").click(); document.getElementById("search").focus(); } : null)
      || (tab && event.key >= "1" ? () => tab.click() : null);
    if (act) { event.preventDefault(); act(); }
  });
}
document.addEventListener("DOMContentLoaded", start);
