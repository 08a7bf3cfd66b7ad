"use strict";
// The trace: frame by frame in the order of the bus. Only the lines that are in sight are in the page, so that 100 000
// of them are as quick as ten.

const NARROW = matchMedia("(max-width: 760px)");
const lineHeight = () => NARROW.matches ? 48 : 24;   // px of a frame: a phone has two lines for it
const MOST_COPIED = 20000;

const TIMES = {                             // how a frame's time is written: (frame, the one before it, trace)
  Relative: frame => frame.time.toFixed(6),
  Absolute: (frame, _, trace) => {
    const began = trace.source.began;
    if (!(began > 1e6)) return frame.time.toFixed(6);  // a log whose clock is not the calendar's
    const moment = began + frame.time, day = new Date(moment * 1000);
    return `${day.toTimeString().slice(0, 8)}.${String(Math.floor(moment % 1 * 1e6)).padStart(6, "0")}`;
  },
  Delta: (frame, before) => before ? (frame.time - before.time).toFixed(6) : "–",
  "To mark": (frame, _, trace) => trace.marked ? (frame.time - trace.marked.time).toFixed(6) : "mark a line",
};
let timeForm = "Relative";

function identifierTest(text) {             // `180,200`, `180-1FF`, `!080`, in hexadecimal digits; throws what it does not understand
  const misread = word => { throw new Error(`“${word}” is no identifier: write 180, 180-1FF, or !080 for all others`); };
  const fits = listFilter(text.replace(/(?<!-)\s+(?!-)/g, ","), word => numberTest(word, misread));
  return id => id !== null && fits(id % EXTENDED);
}
const FILTERS = {                           // what a frame must have, by the name of the control
  node: value => frame => frame.row.nodes.includes(value),
  message: value => frame => frame.row.name === value,
  identifier: value => { const fits = identifierTest(value); return frame => fits(frame.row.id); },
  text: value => {
    const wanted = value.toLowerCase();
    // Bytes are found as they are shown, and without blanks between them.
    return frame => `${frame.row.name} ${frame.text} ${frame.wrong} ${octets(frame.data).join(" ")} ${frame.data}`.toLowerCase().includes(wanted);
  },
};

class Trace {
  constructor(source) {
    Object.assign(this, {source, chosen: {}, found: [], seen: 0, following: live, fixed: false, marked: null, shownTop: -1, at: null});
    this.rows = h("div", {class: "lines"});
    this.space = h("div", {class: "space"}, this.rows);
    this.box = h("div", {class: "frames", tabindex: 0, role: "region", "aria-label": `frames of ${source.name}`,
      onscroll: () => this.scrolled(), onkeydown: event => this.key(event)}, this.head(), this.space);
    this.count = h("span", {class: "hint", role: "status", "aria-live": "off"});
    this.element = h("div", {class: several ? "trace" : "trace one-channel"}, this.tools(), this.box);
    this.named();
  }
  head() { return h("div", {class: "line head", "aria-hidden": "true"}, ...["Time s", "Channel", "ID", "Len", "Data", "Message", "Meaning"].map(each => h("span", {}, each))); }
  tools() {
    const input = (name, words, size) => h("input", {type: "search", size, placeholder: words, "aria-label": `frames with this ${words}`,
      oninput: event => this.filter(name, event.target.value.trim(), event.target)});
    const times = h("select", {"aria-label": "times", onchange: () => { timeForm = times.value; this.draw(); }},
      ...Object.keys(TIMES).map(each => h("option", {}, each)));
    this.nodes = this.choice("node", "all nodes");
    this.messages = this.choice("message", "all messages");
    this.inputs = {node: this.nodes, message: this.messages, identifier: input("identifier", "identifier", 10), text: input("text", "text", 12)};
    this.pauser = h("button", {"aria-pressed": "false", onclick: () => this.follow(!this.following)}, "Pause");
    const fixer = h("button", {"aria-pressed": "false", title: "one line for each message, or all frames", onclick: () => {
      this.fixed = !this.fixed;
      fixer.setAttribute("aria-pressed", String(this.fixed));
      this.refilter();
    }}, "Fixed");
    const other = (words, act) => h("button", {onclick: act}, words);
    return h("div", {class: "tools"}, live ? this.pauser : null, fixer, this.nodes, this.messages,
      this.inputs.identifier, this.inputs.text,
      ...(content.sources[this.source.number].long ? [other("‹ Before", () => quietly(this.next(true))), other("Next ›", () => quietly(this.next(false)))] : []), times, radixChoice(),
      other("Copy", () => this.copy()), other("CSV", () => this.export("csv")), other("Log", () => this.export("log")), this.count);
  }
  choice(name, all) {
    return h("select", {"aria-label": name, onchange: event => this.filter(name, event.target.value)}, h("option", {value: ""}, all));
  }
  named() {                                 // the filters that the address names: `#trace?identifier=180,200`
    for (const [name, value] of namedFilters("trace")) {
      if (!(name in FILTERS)) continue;
      const input = this.inputs[name];
      if (input.tagName === "SELECT") this.offer(input, [value]);
      input.value = value;
      try { FILTERS[name](value); this.chosen[name] = value; } catch { input.setAttribute("aria-invalid", "true"); }
    }
  }
  offer(select, names) {                    // new nodes and messages are entered as they are heard
    for (const name of names) {
      if (![...select.options].some(each => each.value === name)) select.append(h("option", {value: name}, name));
    }
  }
  filter(name, value, input) {              // one that is not understood filters nothing, and says so
    const {[name]: _, ...others} = this.chosen;
    this.misread = "";
    try {
      FILTERS[name](value);
      this.chosen = value ? {...others, [name]: value} : others;
    } catch (error) { this.misread = error.message; this.chosen = others; }
    input?.setAttribute("aria-invalid", String(this.misread !== ""));
    nameFilters("trace", this.chosen);
    this.refilter();
  }
  refilter() {
    this.found = [];
    this.seen = 0;
    this.take();
    this.draw();
  }
  fits(frame) { return this.tests.every(each => each(frame)); }
  take() {                                  // the frames that are new since the last time
    const {frames, dropped} = this.source;
    if (frames !== this.taken) {
      const number = this.source.long ? this.marked?.number : null;   // in another window it is the same frame
      Object.assign(this, {taken: frames, found: [], seen: dropped, marked: frames.find(each => each.number === number) ?? null});
    }
    this.tests = this.testsOf(Object.entries(this.chosen));
    if (this.fixed) {
      const last = row => row.last || new LoggedFrame(row, upTo(row.times, clock.time) - 1);
      this.found = this.source.sorted().map(last).filter(each => each.place !== -1 && this.fits(each));
      return;
    }
    if (dropped && this.found.length && this.found[0].number < frames[0].number) {
      this.found = this.found.filter(each => each.number >= frames[0].number);
    }
    for (let each = Math.max(this.seen - dropped, 0); each < frames.length; each++) if (this.fits(frames[each])) this.found.push(frames[each]);
    this.seen = dropped + frames.length;
  }
  follow(following) {
    this.following = following;
    this.pauser.setAttribute("aria-pressed", String(!following));
    this.take();                            // what came before a pause belongs to what is paused
    this.draw();
  }
  scrolled() {                              // away from the end: what is read must not run away
    const {scrollTop, clientHeight, scrollHeight} = this.box;
    if (scrollTop === this.shownTop) return;  // it has scrolled itself
    const {long} = this.source, edge = scrollTop <= 0 ? 0 : scrollTop + clientHeight >= scrollHeight - 1 ? this.found.length - 1 : -1;
    if (long && !long.asking && edge >= 0 && this.found.length) this.turn(this.found[edge].time);
    if (this.following && !this.fixed && scrollTop < this.shownTop && scrollTop + clientHeight < scrollHeight - lineHeight()) this.follow(false);
    this.draw(false);
  }
  async turn(time) {                        // of a long log: the frames around the first or the last one that is here
    const {long} = this.source, there = edge => edge <= 0 || edge >= this.source.end;
    if (there(time === this.found[0].time ? long.from : long.to)) return;
    await long.window(time);
    this.at = null;
    clock.seek(time);
  }
  async next(back) {                        // of a long log: to the next frame that passes the filters, but that of the text
    const {long} = this.source, tests = this.testsOf(Object.entries(this.chosen).filter(([name]) => name !== "text"));
    const rows = this.source.sorted().filter(row => tests.every(each => each({row}))).map(row => row.name);
    const time = await request({do: "next", rows, time: this.marked?.time ?? clock.time, back}, null, long);
    if (time === null) toast(`no ${back ? "earlier" : "later"} frame passes the filters`); else await this.jump(time);
  }
  testsOf(chosen) { return chosen.map(([name, value]) => FILTERS[name](value)); }
  async jump(time) {                        // to the first frame at a time or after it
    if (this.source.long) {
      clock.pause();
      clock.seek(this.at = time);
      await this.source.long.reach(time);
    }
    this.follow(false);
    if (this.fixed) this.fixed = false;
    this.refilter();
    const place = Math.min(upTo(this.found.map(each => each.time), time - 1e-9), this.found.length - 1);
    this.marked = this.found[place] || null;
    this.box.scrollTop = Math.max(place * lineHeight() - this.box.clientHeight / 3, 0);
    this.draw(false);
  }
  key(event) {
    const step = {ArrowDown: 1, ArrowUp: -1}[event.key];
    if (!step || !this.found.length) return;
    event.preventDefault();
    event.stopPropagation();
    if (this.following && live) this.follow(false);
    const place = Math.min(Math.max(this.found.indexOf(this.marked) + step, 0), this.found.length - 1);
    this.mark(this.found[place]);
    const top = place * lineHeight(), {scrollTop, clientHeight} = this.box;
    if (top < scrollTop || top + lineHeight() > scrollTop + clientHeight) this.box.scrollTop = top - clientHeight / 2;
  }
  mark(frame) {
    this.marked = frame;
    if (!live) { clock.pause(); clock.seek(this.at = frame.time); }
    this.draw(false);
  }
  draw(toEnd = this.following && !this.fixed) {
    const height = this.box.clientHeight, line = lineHeight();
    if (!height) return;
    this.space.style.height = `${this.found.length * line}px`;
    if (toEnd) this.box.scrollTop = this.box.scrollHeight;
    this.shownTop = this.box.scrollTop;
    const first = Math.max(Math.floor(this.shownTop / line) - 2, 0), last = Math.min(first + Math.ceil(height / line) + 5, this.found.length);
    this.rows.style.transform = `translateY(${first * line}px)`;
    const shown = this.found.slice(first, last);
    while (this.rows.children.length < shown.length) this.rows.append(this.line());
    while (this.rows.children.length > shown.length) this.rows.lastChild.remove();
    shown.forEach((each, place) => this.fill(this.rows.children[place], each, this.found[first + place - 1]));
    const {missed, dropped} = this.source, {length} = this.found;
    this.count.classList.toggle("is-wrong", Boolean(this.misread));
    say(this.count, [this.misread, `${length} ${length === 1 ? "frame" : "frames"}`, Object.keys(this.chosen).length ? `of ${this.source.frames.length}` : "",
      this.source.long?.index ? `around ${clock.time.toFixed(1)} s, of ${this.source.long.index.frames}` : "",
      this.source.frames[0]?.number > 0 && live ? `kept since ${this.source.frames[0].time.toFixed(1)} s` : "",
      missed && !dropped ? `${missed} missed: this browser was too slow` : ""].filter(Boolean).join(", "));
  }
  cells(frame, before) {
    const {row} = frame, meaning = row.foreign ? "" : saidOf(frame.text, frame.wrong);
    return [TIMES[timeForm](frame, before, this), this.source.name, identifier(row.id), String(frame.data.length / 2),
      RADICES[radix].bytes(frame.data), row.foreign ? "not in any file" : row.name, meaning];
  }
  line() {                                  // made once, and filled again and again: that takes half the time
    const line = h("div", {onclick: () => this.mark(line.frame)}, ...Array.from({length: 7}, () => h("span", {})));
    return line;
  }
  fill(line, frame, before) {
    const {row} = frame;
    const look = ["line", groupColour(row.source, row.group), frame.wrong && !row.foreign ? "is-wrong" : "", row.foreign ? "foreign" : "", frame === this.marked ? "marked" : ""];
    line.frame = frame;
    line.className = look.join(" ");
    this.cells(frame, before).forEach((each, place) => {
      const cell = line.children[place];
      if (cell.textContent !== each) cell.textContent = cell.title = each;
    });
  }
  lines() { return this.found.map((frame, place) => this.cells(frame, this.found[place - 1])); }
  async copy() {
    const lines = this.lines().slice(-MOST_COPIED).map(each => each.join("\t"));
    try {
      await navigator.clipboard.writeText(lines.join("\n"));
      toast(`${lines.length} lines copied`);
    } catch { toast("this browser lets no page copy: export the frames instead", true); }
  }
  export(form) {
    if (form === "csv") {
      const head = ["time", "channel", "identifier", "length", "data", "message", "meaning"];
      savedText("trace.csv", "text/csv", [head, ...this.lines()].map(each => each.map(quoted).join(",")));
      return;
    }
    const began = this.source.began || 0;   // as candump writes it
    savedText("trace.log", "text/plain", this.found.filter(each => each.row.id !== null).map(each =>
      `(${(began + each.time).toFixed(6)}) can0 ${identifier(each.row.id)}#${each.data.toUpperCase()}`));
  }
  show(time) {
    this.offer(this.nodes, allNodes(this.source).map(each => each.name));
    this.offer(this.messages, this.source.sorted().map(each => each.name));
    if (this.following || this.fixed || this.taken !== this.source.frames) this.take();
    this.draw();
    if (live || this.at === time) return;   // a log is seen where its time is
    this.at = time;
    this.box.scrollTop = upTo(this.found.map(each => each.time), time) * lineHeight() - this.box.clientHeight / 2;
    this.draw();
  }
}

const traces = sources.map(source => new Trace(source));
const traceView = () => perSource(source => traces[source.number]);
function openTrace(time, source = sources[0]) {
  document.getElementById("tab-trace").click();
  traces[source.number].jump(time);
}
