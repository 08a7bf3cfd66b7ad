"use strict";
// The view of objects: a node's dictionary as a tree, read one by one, by the group, or all of it; and written.

const GROUPS = [                            // of the dictionary (CiA 301, 7.4.1)
  {name: "Communication", from: 0x1000, to: 0x1FFF},
  {name: "Of the maker", from: 0x2000, to: 0x5FFF},
  {name: "Device profile", from: 0x6000, to: 0x9FFF},
  {name: "Others", from: 0xA000, to: 0xFFFF},
];
const IDENTITY = 0x1018;
const MOST_FOUND = 200;                     // lines that a search shows

class ObjectLine {                          // one object: what was read of it, and its controls once it is looked at
  constructor(view, node, object) {
    Object.assign(this, {view, node, object, index: parseInt(object.object, 16), read: null, changed: false, made: null});
    this.words = plain(`${object.object} ${object.name}`);
    this.id = this.index;
    this.named = {node, object: object.object};
    this.writable = object.access.includes("w");
    this.readable = object.access !== "wo" && !object.long;
  }
  get element() {
    if (this.made) return this.made;
    const {object} = this, button = (words, act) => h("button", {onclick: act, "aria-label": `${words} ${object.name}`}, words);
    this.value = h("span", {class: "read"});
    this.was = h("small", {class: "hint"});
    this.input = h("input", {"aria-label": `new value of ${object.name}`, size: 10, placeholder: this.limits,
      onkeydown: event => { if (event.key === "Enter") write.querySelector("button").click(); }});
    const write = sureButton("Write", sure => this.write(sure), {"aria-label": `Write ${object.name}`});
    this.form = h("span", {class: "write", hidden: true}, this.input, write);
    this.made = h("tr", {}, h("td", {class: "id"}, object.object), h("th", {scope: "row"}, object.name.split(".").at(-1)), h("td", {}, object.type),
      h("td", {}, object.access), h("td", {class: "limits"}, this.limits), h("td", {class: "read-cell"}, this.value, " ", this.was),
      h("td", {class: "acts"}, button("Read", () => quietly(this.fetch())), object.plots ? button("Plot", () => quietly(this.plot())) : null, this.form));
    this.tell();
    return this.made;
  }
  get limits() { return this.object.low === null ? "" : `${this.object.low}..${this.object.high}`; }
  tell() {
    if (!this.made) return;
    say(this.value, this.read === null ? (this.object.default === "" ? "" : `default ${this.object.default}`) : this.read.text);
    this.value.classList.toggle("is-wrong", Boolean(this.read?.wrong));
    this.value.classList.toggle("known", this.read !== null);
    this.made.classList.toggle("changed", this.changed);
    say(this.was, this.changed ? `was ${this.before}` : "");
  }
  async fetch() {
    const found = await connection.ask({do: "read", ...this.named}).catch(error => ({text: error.message, wrong: true}));
    const before = this.read && !this.read.wrong ? this.read.text : this.object.default;
    this.changed = !found.wrong && before !== "" && before !== found.text;
    this.before = before;
    this.read = found;
    this.tell();
    return found;
  }
  async write(sure) {
    if (this.input.value.trim() === "") throw new Error(`${this.object.name}: the field is empty${this.limits ? `; allowed: ${this.limits}` : ""}`);
    await connection.ask({do: "write", ...this.named, value: this.input.value, ...sure});
    toast(`${this.object.name} written`);
    await this.fetch();
  }
  async plot() {
    const key = await request({do: "watch", ...this.named}, answer => `${answer} is in the plot`);
    plots.add(new ObjectSeries(sources[0], key, this.named));
  }
}

class ObjectGroup {                         // lines under a heading, which are made when it is opened
  constructor(view, title, lines, inner) {
    Object.assign(this, {view, lines, inner});
    this.body = h("div", {class: "group-body"});
    const isFirst = inner ? lines[0].index < 0x2000 : lines[0].index === IDENTITY;   // what one looks for first is open
    this.details = h("details", {ontoggle: () => this.fill(), open: isFirst},
      h("summary", {}, h("span", {}, title), " ", h("small", {class: "hint"}, String(lines.length))), this.body);
    // Beside the summary, not in it: that is a control itself.
    this.element = h("div", {class: inner ? "object-group" : "object-record"}, this.details,
      h("button", {onclick: () => view.readAll(lines), "aria-label": `Read group ${title}`}, "Read group"));
  }
  fill() {
    if (!this.details.open || !this.details.isConnected || this.body.childElementCount) return;   // a group that a search has replaced would take its lines away
    if (!this.inner) { this.body.append(objectTable(this.lines)); return; }
    const records = new Map();
    for (const line of this.lines) records.set(line.index, [...(records.get(line.index) || []), line]);
    const parts = [];                       // single objects that follow each other, and records
    for (const members of records.values()) {
      if (members.length > 1) parts.push(members);
      else if (parts.at(-1)?.single) parts.at(-1).push(members[0]);
      else parts.push(Object.assign([members[0]], {single: true}));
    }
    const record = lines => new ObjectGroup(this.view, `${hex(lines[0].index, 4)} ${lines[0].object.name.split(".")[0]}`, lines, false).element;
    this.body.after(inParts(this.body, parts, lines => lines.single ? objectTable(lines) : record(lines)));
  }
}
const IN_PARTS = 60;                        // rows that are made at once: the next ones when their end comes into sight
function inParts(box, things, make) {       // fill an element, and return what stands behind it
  let made = 0;
  const end = h("div", {class: "end"});
  const more = () => {
    box.append(...things.slice(made, made + IN_PARTS).map(make));
    made += IN_PARTS;
    stale = true;
    if (made >= things.length) watched.disconnect();
  };
  const watched = new IntersectionObserver(seen => { if (seen.some(each => each.isIntersecting)) { more(); watched.unobserve(end); if (made < things.length) watched.observe(end); } }, {rootMargin: "600px"});
  more();
  if (made < things.length) watched.observe(end);
  return end;
}
function objectTable(lines) {
  const body = h("tbody"), end = inParts(body, lines, line => line.element);
  return h("div", {class: "object-table"}, h("table", {class: "objects"}, h("thead", {}, h("tr", {}, ...["Object", "Name", "Type", "Access", "Limits", "Value"].map(each => h("th", {scope: "col"}, each)), h("td", {class: "acts"}))), body), end);
}

class ObjectsView {
  constructor(source) {
    Object.assign(this, {source, lines: [], loaded: "", reading: null});
    this.chosen = h("select", {"aria-label": "node", onchange: () => this.load()}, ...source.nodes.map(node => h("option", {}, node.name)));
    this.passes = () => true;
    const {box, said} = filterBox("objects", {placeholder: "search", "aria-label": "search objects", title: "a part of a name, 1000-1018; several with commas; ! before what is not wanted"},
      filter => { this.passes = filter; if (this.loaded) this.draw(); });
    this.box = box;
    this.progress = h("progress", {hidden: true, "aria-label": "objects read"});
    this.end = h("button", {hidden: true, onclick: () => { this.reading = null; }}, "End");
    this.tree = h("div", {class: "tree"});
    this.element = h("div", {}, h("div", {class: "tools"}, this.chosen, this.box, said,
      h("button", {onclick: () => this.readAll(this.lines)}, "Read all"), this.progress, this.end), this.tree);
  }
  async load() {
    this.loaded = this.chosen.value;
    this.reading = null;
    const objects = await quietly(request({do: "objects", node: this.loaded}));
    if (!objects) { this.loaded = ""; return; }
    this.lines = objects.map(object => new ObjectLine(this, this.chosen.value, object));
    this.draw();
  }
  draw() {
    if (this.box.value.trim()) {
      const found = this.lines.filter(this.passes);
      const more = found.length > MOST_FOUND ? h("p", {class: "hint"}, `${found.length - MOST_FOUND} more: search for more of the name`) : null;
      this.tree.replaceChildren(...[found.length ? objectTable(found.slice(0, MOST_FOUND))
        : h("p", {class: "hint"}, `No object passes “${this.box.value}”.`), more].filter(Boolean));
    } else {
      const groups = GROUPS.map(({name, from, to}) => [name, this.lines.filter(line => line.index >= from && line.index <= to)]);
      this.tree.replaceChildren(...groups.filter(([, lines]) => lines.length).map(([name, lines]) => new ObjectGroup(this, name, lines, true).element));
      if (!this.lines.length) this.tree.append(h("p", {class: "hint"}, "No file describes this node."));
    }
    stale = true;
  }
  async readAll(lines) {                    // one after the other; whatever is begun meanwhile ends it
    const wanted = lines.filter(line => line.readable), mine = this.reading = {};
    this.progress.max = wanted.length;
    for (const [place, line] of wanted.entries()) {
      if (this.reading !== mine || !connection.alive) break;
      this.progress.value = place;
      for (const each of [this.progress, this.end]) show(each, true);
      await line.fetch();
    }
    if (this.reading !== mine && this.reading !== null) return;
    const failed = wanted.filter(line => line.read?.wrong).length;
    toast(this.reading === mine ? `${wanted.length} objects read${failed ? `, ${failed} refused` : ""}` : "reading was ended", failed > 0);
    this.reading = null;
    for (const each of [this.progress, this.end]) show(each, false);
  }
  show() {
    if (!this.loaded && connection.alive && this.chosen.value) this.load();
    for (const line of this.lines) if (line.made) show(line.form, connection.control && line.writable);
  }
}
const objectsView = () => new ObjectsView(sources[0]);
