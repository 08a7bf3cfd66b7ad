"use strict";
// What the page knows: sources with their rows and frames, the clock, and the server.
//
// Rule of this file: what a source says is shown as text only, never as HTML. A log is complete from the start; a live
// source grows by what the server sends, and keeps the last KEPT frames, and SAMPLES of them for each message.

const KEPT = 110000, SAMPLES = 60000;       // frames of all, and values of a row that are kept
const TRIMMED = 10;                         // a tenth of them is dropped at once beyond that
const LAST = 32;                            // intervals that period and jitter are computed from, as in `monitor`
const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
const SILENT = 2000;                        // ms without a word of the server after which it counts as gone

// Rows: all frames of one message, service or kind of damage

class Row {
  constructor(source, data) {
    const known = data.fields ? data : source.messages.get(data.name);
    const {key, id, name, group, nodes, bits, foreign} = data;
    Object.assign(this, {source, key: key ?? name, id, name, group, nodes, bits, foreign});
    this.fields = known ? known.fields : [];
    this.times = data.times || [];
    this.numbers = data.numbers || [];
    this.data = data.times ? data.data || [] : [];
    this.columns = data.values && data.times ? data.values : this.fields.map(() => []);
    this.texts = data.times ? data.texts : [];  // of what has no values
    this.wrongAt = Object.keys(data.wrong || {}).map(Number).sort((a, b) => a - b);
    this.wrong = data.times ? data.wrong : {};
    this.latest = null;
    this.before = 0;                        // frames of a long log that came before those that are here
  }
  load(data, before) {                      // of a long log: the frames of a window
    const bits = data.bits ?? this.bits;
    Object.assign(this, new Row(this.source, {key: this.key, id: this.id, name: this.name, group: this.group, nodes: this.nodes, foreign: this.foreign, times: [], values: this.fields.map(() => []), texts: [], ...data}), {bits, before});
  }
  append(time, values, text) {              // live: a frame
    this.times.push(Math.max(time, this.times.at(-1) ?? time));  // in order, also when the adapter's clock is set
    this.columns.forEach((column, field) => column.push(values ? values[field] : null));
    this.texts.push(values ? "" : text);
    if (this.times.length > SAMPLES) [this.times, this.texts, ...this.columns].forEach(each => each.splice(0, SAMPLES / TRIMMED));
  }
  now(time) {                               // what is shown of it at a time, null before its first frame
    if (this.latest && clock.frozen === null) return {...this.latest, age: time - this.latest.time};
    const count = upTo(this.times, time), first = Math.max(count - 1 - LAST, 0), last = this.times[count - 1];
    if (!count) return null;
    const number = count - 1 - first, period = number > 1 ? (last - this.times[first]) / number : null;
    let square = 0;
    for (let each = first; each < count - 1; each++) square += (this.times[each + 1] - this.times[each] - period) ** 2;
    return {
      count: this.latest ? this.latest.count - (this.times.length - count) : count + this.before,
      period, jitter: period === null ? null : Math.sqrt(square / number), age: time - last, time: last,
      wrong: upTo(this.wrongAt, count - 1), defects: this.wrong[count - 1] || "", data: this.data[count - 1] || "",
      values: this.texts[count - 1] ? null : this.columns.map(column => column[count - 1]), text: this.textAt(count - 1),
    };
  }
  textAt(place) {                           // of a log: what a frame says
    const values = () => this.fields.map((field, each) => field.unmapped ? "" : `${field.name}=${written(field, this.columns[each][place])}`);
    return this.texts[place] || values().filter(Boolean).join(", ");
  }
  field(name) { return this.fields.findIndex(each => each.name === name); }
  value(name, time) {                       // what a field had at a time
    const count = upTo(this.times, time);
    return count ? this.columns[this.field(name)][count - 1] : undefined;
  }
}

class LoggedFrame {                         // a frame of a log, read from its row when it is looked at
  constructor(row, place) { Object.assign(this, {row, place}); }
  get number() { return this.row.numbers[this.place]; }
  get time() { return this.row.times[this.place]; }
  get data() { return this.row.data[this.place]; }
  get text() { return this.row.textAt(this.place); }
  get wrong() { return this.row.wrong[this.place] || ""; }
}

class Source {
  constructor(data, number) {
    const {name, nodes, machine, groups, bitrate, began} = data;
    Object.assign(this, {number, name, nodes, machine, groups, bitrate, began});
    this.messages = new Map(data.messages.map(each => [each.name, each]));
    this.leftOut = data.left_out || 0;
    this.end = data.end || 0;
    this.forget();
    for (const each of data.rows || []) this.enter(each);
    this.takeEvents(data.events || []);
    this.frames = this.logged(0);
    this.long = data.long ? new LongLog(this) : null;
  }
  logged(first) {                           // the frames of all rows in the order of the bus
    const frames = [...this.rows.values()].flatMap(row => row.numbers.map((_, place) => new LoggedFrame(row, place)));
    return frames.filter(each => each.number >= first).sort((one, two) => one.number - two.number);
  }
  takeEvents(events) { for (const each of events) this.events.set(each.key, each); }
  takeIndex({rows, events, began, end}) {   // of a long log
    for (const each of rows) this.enter(each);
    this.takeEvents(events);
    Object.assign(this, {began, end});
  }
  takeWindow({rows, events, first, counts}) {
    const named = new Map(rows.map(each => [each.key, each]));
    for (const each of rows) this.enter(each);
    for (const row of this.rows.values()) {
      const data = named.get(row.key) || {}, earlier = (data.numbers || []).filter(each => each < first).length;
      row.load(data, (counts[row.key] || 0) - earlier);
    }
    this.takeEvents(events);
    this.frames = this.logged(first);
  }
  forget() {                                // as at the beginning
    this.rows = new Map();
    this.named = new Map();                 // the same by name
    this.events = new Map();
    this.objects = new Map();               // polled by SDO: key to {times, values}
    this.frames = [];                       // in the order of the bus
    this.dropped = 0;                       // frames that were kept once
    this.missed = 0;                        // frames that the server no longer had
    this.next = null;                       // number of the next frame
    this.health = [];
  }
  enter(data) {
    const key = data.key ?? data.name;
    if (!this.rows.has(key)) {
      this.rows.set(key, new Row(this, data));
      if (!this.named.has(plain(data.name))) this.named.set(plain(data.name), this.rows.get(key));
    }
    return this.rows.get(key);
  }
  row(name) { return this.named.get(plain(name)) || null; }
  sorted() { return [...this.rows.values()].sort((a, b) => (a.id ?? 2e9) - (b.id ?? 2e9)); }
  sortedEvents() { return [...this.events.values()].sort((a, b) => a.time - b.time); }
  load(time) {                              // of a log: the share of the bus in the second before
    let bits = 0;
    for (const row of this.rows.values()) bits += (row.bits || 0) * (upTo(row.times, time) - upTo(row.times, time - 1));
    return bits / this.bitrate;
  }
  carrier(node, object) {                   // the series of a message that carries an object of a node, null without one
    for (const row of this.rows.values()) {
      const message = this.messages.get(row.name);
      const field = message && message.senders.includes(node) && row.fields.find(each => each.object === object);
      if (field) return new FieldSeries(row, field.name);
    }
    return null;
  }
  take(snapshot) {
    const begins = this.next === null && snapshot.history.length ? snapshot.history[0][1] : 0;
    for (const each of snapshot.rows) {
      const row = this.enter(each);
      row.latest = each;
      if (each.time < begins) row.append(each.time, each.values, each.text);  // older than all that is kept
    }
    this.takeFrames(snapshot.first, snapshot.history);
    for (const each of snapshot.events) { this.events.delete(each.key); this.events.set(each.key, each); }
    while (this.events.size > 2000) this.events.delete(this.events.keys().next().value);
    this.health = snapshot.nodes;
    this.end = snapshot.time;
    this.began = snapshot.began;
    for (const [key, each] of Object.entries(snapshot.objects)) this.takeObject(key, each);
  }
  takeFrames(first, frames) {
    if (this.next !== null && first > this.next) this.missed += first - this.next;
    frames.forEach(([key, time, data, values, text, wrong], place) => {
      const row = this.rows.get(key);
      row.append(time, values, text);
      row.last = {number: first + place, time, row, data, text, wrong};
      this.frames.push(row.last);
    });
    this.next = first + frames.length;
    if (this.frames.length > KEPT) {
      this.frames.splice(0, KEPT / TRIMMED);
      this.dropped += KEPT / TRIMMED;
    }
  }
  takeObject(key, {samples, trouble}) {
    if (!this.objects.has(key)) this.objects.set(key, {times: [], values: [], trouble: ""});
    const kept = this.objects.get(key);
    kept.trouble = trouble;
    for (const [time, value] of samples) {
      if (time <= kept.times.at(-1)) continue;  // it was in the last snapshot, too
      kept.times.push(time);
      kept.values.push(value);
    }
    if (kept.times.length > SAMPLES) [kept.times, kept.values].forEach(list => list.splice(0, SAMPLES / TRIMMED));
  }
}

const sources = content.sources.map((data, number) => new Source(data, number));
const several = sources.length > 1;

// Values

let radix = "Decimal";
function written(field, value) {            // a value for a person
  if (value === null || value === undefined) return "unknown";
  if (typeof value === "number") {
    const word = field.words && field.words[value];
    return `${Number.isInteger(value) ? RADICES[radix].number(value) : value}${field.unit ? " " + field.unit : ""}${word ? ` (${word})` : ""}`;
  }
  return String(value);
}
function number(field, value) {             // a value for a plot, null if it is none
  if (typeof value === "number") return value;
  if (typeof value === "boolean") return Number(value);
  const found = Object.entries(field.words || {}).find(([, word]) => word === value);
  return found ? Number(found[0]) : null;
}

function saidOf(text, wrong) {              // what a frame says, and what is wrong with it, once
  return !wrong ? text : text && !wrong.includes(text) ? `${text}  ! ${wrong}` : `! ${wrong}`;
}

// Series: what a plot draws; each finds its row again after the server was restarted

class FieldSeries {
  constructor(row, name) {
    Object.assign(this, {source: row.source, message: row.name, field: row.fields[row.field(name)]});
    this.id = JSON.stringify([row.source.number, row.name, name]);
    this.name = `${several ? row.source.name + ": " : ""}${row.name}.${name}`;
    this.unit = this.field.unit;
  }
  get row() { return this.source.row(this.message); }
  get times() { return this.row?.times ?? []; }
  get values() { return this.row?.columns[this.row.field(this.field.name)] ?? []; }
  number(value) { return number(this.field, value); }
  written(value) { return written(this.field, value); }
  get trouble() { return ""; }
  drawn(from, to, pixels) {
    const {long} = this.source;
    return long && !long.has(from, to) ? long.samples(this, from, to, pixels) : thinned(this, from, to, pixels);
  }
}
class ObjectSeries {
  constructor(source, key, watched, unit = "") {
    Object.assign(this, {source, key, watched, unit});
    this.id = JSON.stringify([source.number, null, key]);
    this.name = key;
  }
  get kept() { return this.source.objects.get(this.key) || {times: [], values: [], trouble: ""}; }
  get times() { return this.kept.times; }
  get values() { return this.kept.values; }
  get trouble() { return this.kept.trouble; }
  number(value) { return typeof value === "number" ? value : null; }
  written(value) { return `${value}${this.unit ? " " + this.unit : ""}`; }
  drawn(from, to, pixels) { return thinned(this, from, to, pixels); }
}
const samplesOf = series => [series.times, series.values.map(value => series.number(value))];
function valueAt(series, time) {            // as text, empty before the first one
  const count = upTo(series.times, time);
  return series.trouble || (count ? series.written(series.values[count - 1]) : "");
}
function numberAt(series, time) {
  const count = upTo(series.times, time);
  return count ? series.number(series.values[count - 1]) : null;
}
function seriesOf(id, watched = null) {      // null if there is no such message
  const [number, row, name] = JSON.parse(id);
  if (watched) return new ObjectSeries(sources[number], name, watched);
  const found = sources[number]?.row(row);
  return found && found.field(name) >= 0 ? new FieldSeries(found, name) : null;
}

// The clock

let stale = true;                           // something has changed that is not shown yet
const clock = {
  end: Math.max(0, ...sources.map(each => each.end)),
  speed: 1,
  base: 0, since: null,                     // log: the time at which it was started, and performance.now() then
  received: 0, frozen: null,                // live: performance.now() at the last snapshot; the time it is held at
  get running() { return live ? this.frozen === null : this.since !== null; },
  get time() {
    if (live) return this.frozen ?? (sources[0].end + (connection.alive ? (performance.now() - this.received) / 1000 : 0));
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

// The server

const NO_SERVER = "no connection to the server";
const connection = {
  up: false, control: false, number: 0, waiting: new Map(), state: null, socket: null, pause: 500,
  // A connection that hangs is not closed for a long time.
  get alive() { return this.up && performance.now() - clock.received < SILENT; },
  get trouble() { return !this.alive ? `${NO_SERVER}, trying again` : this.state.trouble; },
  open() {
    this.socket = new WebSocket(`${location.origin.replace(/^http/, "ws")}/live`);
    this.socket.onmessage = message => this.hear(JSON.parse(message.data));
    this.socket.onclose = () => {
      this.up = false;
      stale = true;
      for (const {fail} of this.waiting.values()) fail(new Error(NO_SERVER));
      this.waiting.clear();
      setTimeout(() => this.again(), this.pause);
      this.pause = Math.min(2 * this.pause, 5000);
    };
  },
  again() {                                 // not where the server shows another page by now: that has no bus
    if (!content.leave) { this.open(); return; }
    fetch("/shown").then(answer => answer.text()).then(shown => { if (shown === shownPage) this.open(); })
      .catch(() => setTimeout(() => this.again(), this.pause));
  },
  hear(said) {
    if ("re" in said) {
      const {done, fail} = this.waiting.get(said.re) || {};
      this.waiting.delete(said.re);
      if (!done) return;
      if ("error" in said) fail(Object.assign(new Error(said.error), {asks: said.asks})); else done(said.ok);
      return;
    }
    if (said.learned !== (content.learned ?? 0) && this.follow(said)) return;
    if (!this.up) this.begin(said);
    Object.assign(this, {up: true, control: said.control, state: said});
    sources[0].take(said);
    takeJobs(said.jobs);
    clock.received = performance.now();
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(String(said.turn));    // confirmed: a browser that owes too many is left out
    stale = true;
  },
  follow(said) {                            // a device has shown what it is: the server has a page that lists it
    const told = this.state?.learned;
    if (!said.control && !isUnsaved()) { location.reload(); return true; }
    if (told !== said.learned) toast("a device has shown what it is: load the page again to see it");  // a form may be half filled in, or a file changed
    return false;
  },
  begin(said) {                             // connected, perhaps again: the server tells its whole history anew
    const recorded = this.state?.session !== said.session && this.state?.recording.on && this.state.recording.file;
    if (recorded) toast(`the server was started again: the recording ${recorded} has ended and is gone`, true);
    sources[0].forget();
    jobs.clear();
    clock.frozen = null;
    this.pause = 500;
  },
  ask(request) {
    return new Promise((done, fail) => {
      if (!this.alive) { fail(new Error(NO_SERVER)); return; }
      const id = ++this.number;
      this.waiting.set(id, {done, fail});
      this.socket.send(JSON.stringify({id, ...request}));
    });
  },
};
async function request(what, done, who = connection) {  // ask, and show the outcome as a toast
  try {
    const answer = await who.ask(what);
    if (done) toast(typeof done === "function" ? done(answer) : done);
    return answer;
  } catch (error) {
    toast(error.message, true);
    throw error;
  }
}

// Long work, which runs beside the page: one at a time for each bus, the same in all browsers

const jobs = new Map();                     // the last one of each name
const isRunning = job => Boolean(job) && ["running", "ending"].includes(job.state);
const runningJob = () => [...jobs.values()].find(isRunning);
function takeJobs(said) {
  for (const {first, rows, ...each} of said) {
    const known = jobs.get(each.name), former = known?.number === each.number ? known.rows.slice(0, first) : [];
    jobs.set(each.name, {...each, rows: [...former, ...rows]});
  }
}
function jobWords(job) {                    // how far it is, or how it has ended
  if (!job) return "";
  const far = job.total ? `${job.done} of ${job.total}` : job.done ? String(job.done) : "";
  if (job.error) return `${job.title}: ${job.error}`;
  if (isRunning(job)) return [job.title, job.state === "ending" ? "is ending" : far].filter(Boolean).join(": ");
  return job.state === "ended" ? `${job.title} was ended` : "";
}
function jobBar(...names) {                 // of a view: the progress of its jobs, and what went wrong
  const bar = h("progress", {hidden: true, "aria-label": "progress"}), words = h("span", {class: "hint", role: "status"});
  const end = h("button", {hidden: true, onclick: () => quietly(request({do: "end job"}))}, "End");
  return {element: h("span", {class: "job"}, bar, words, end), show() {
    const [job] = names.map(name => jobs.get(name)).filter(Boolean).sort((one, two) => two.number - one.number);
    const runs = isRunning(job);
    show(bar, runs);
    show(end, runs && connection.control);
    if (runs && job.total) { bar.max = job.total; bar.value = job.done; } else bar.removeAttribute("value");
    say(words, jobWords(job));
    words.classList.toggle("is-wrong", Boolean(job?.error));
    return job;
  }};
}

// How alive a node is: in words, by a sign, and by a colour, the same in every view

const LIFE = {alive: "●", late: "◐", lost: "✕", unknown: "○", "not connected": "⊘"};
const WORST = ["not connected", "lost", "late", "alive", "unknown"];   // what the header shows of several
const LATE_AFTER = 1.5, LOST_AFTER = 2;     // periods without a heartbeat
const UNHEARD = {state: "", age: null, life: "unknown"};

function nodeNow(source, node, time) {      // its state, the age of its last heartbeat, and how alive it is
  if (live) {
    const found = source.health.find(each => each.name === node.name) || UNHEARD;
    return connection.trouble ? {...found, life: "not connected", age: null} : found;
  }
  const row = source.rows.get(0x700 + node.id), now = row ? row.now(time) : null;
  if (!now) return UNHEARD;
  const periods = now.period ? now.age / now.period : null;
  const life = periods === null ? "unknown" : periods > LOST_AFTER + 0.05 / now.period ? "lost" : periods > LATE_AFTER ? "late" : "alive";
  return {state: now.text.split(", ").at(-1), age: now.age, life};
}
function lifeOf(source, time) {             // the worst of all nodes that were heard, and whose it is
  if (live && connection.trouble) return {life: "not connected", text: "not connected"};
  const all = allNodes(source).map(node => ({node, ...nodeNow(source, node, time)}));
  for (const life of WORST) {
    if (life === "unknown") break;
    const found = all.filter(each => each.life === life).map(each => each.node.name);
    if (found.length) return {life, text: `${life === "alive" || found.length > 1 ? found.length : found[0]} ${life}`, names: found};
  }
  return {life: "unknown", text: "no node heard"};
}
function allNodes(source) {                 // nodes that no file describes are heard as well
  const unknown = source.health.filter(each => !source.nodes.some(node => node.name === each.name));
  const heard = unknown.map(each => ({name: each.name, id: Number(each.name.replace("node ", "")), identity: null, file: ""}));
  return [...source.nodes, ...heard].sort((one, two) => one.id - two.id);
}
function isLost(source, row, time) {        // whether all who send it are lost
  const message = source.messages.get(row.name), senders = message ? message.senders : row.nodes;
  const known = source.nodes.filter(each => senders.includes(each.name));
  return known.length > 0 && known.every(each => nodeNow(source, each, time).life === "lost");
}
function lifeSign() {                       // an element with a sign and a word; `set` changes both
  const element = h("span", {class: "life"}), sign = h("span", {class: "sign", "aria-hidden": "true"}), words = h("span", {});
  element.append(sign, " ", words);
  return {element, set(life, text) {
    if (element.dataset.life !== life) element.dataset.life = life;
    say(sign, LIFE[life]);
    say(words, text);
  }};
}

// Panels of other scripts

const panelMakers = new Map();
function panel(name, make) { panelMakers.set(name, make); }
const ownColours = [];                      // of panels: (row, time) to the variable of its colour, null for any other row

function perSource(make) {                  // one element for each source, side by side
  const made = sources.map(make);
  const legends = several ? made.map(each => each.legend).filter(Boolean) : [];   // they say the same: one is enough
  legends.forEach(each => each.remove());
  const element = h("div", {class: "per-source"}, h("div", {class: "sources"}, ...made.map((each, number) =>
    h("div", {class: `source source-${number}`}, several ? h("h2", {}, sources[number].name) : null, each.element))), legends[0]);
  return {element, show: time => made.forEach(each => each.show(time)),
    begins: () => Math.min(...made.map(each => each.begins ? each.begins() : Infinity))};
}
