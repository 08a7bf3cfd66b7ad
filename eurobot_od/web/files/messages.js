"use strict";
// The view of messages: one line for each, with its last values; a value is plotted by a click, or dragged.

let passes = () => true;                    // the filter
const groupColour = (source, group) => {
  const place = source.groups.indexOf(group);
  return place >= 0 ? `group-${place % 4}` : group === "CANopen" ? "group-service" : "";
};

const COLUMNS = {count: "Count", period: "Period ms", jitter: "Jitter ms", age: "Age s", length: "Bytes", data: "Data", bad: "Wrong"};
const chosenColumns = new Set(kept("columns", ["count", "period", "age", "bad"]));  // the others are always there
const PLOTTABLE = field => !field.unmapped && !field.is_text;

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
    this.values = row.fields.map(() => h("span", {}));
    this.chips = row.fields.map((field, place) => {
      const inside = [h("i", {}, field.name), " ", this.values[place]];
      return PLOTTABLE(field) ? valueButton(() => new FieldSeries(row, field.name), inside) : h("span", {class: "value text"}, ...inside);
    });
    this.text = h("span", {});
    this.defects = h("span", {class: row.foreign ? "hint" : "defects"});
    this.cells = {};
    for (const name of Object.keys(COLUMNS)) this.cells[name] = cell(name);
    const name = row.foreign ? "not in any file" : row.name;
    this.element = h("tr", {class: row.foreign ? "foreign" : ""},
      cell("id", identifier(row.id)),
      h("th", {scope: "row", class: groupColour(row.source, row.group), title: [row.group, ...row.nodes].join(", ")}, name),
      ...Object.values(this.cells), cell("values", ...this.chips, this.text, this.defects));
    this.id = row.id === null ? null : row.id % EXTENDED;
    this.words = plain([row.name, row.group, identifier(row.id), ...row.nodes].join(" "));
  }
  show(time) {
    const now = this.row.now(time), there = now !== null && passes(this);
    show(this.element, there);
    if (!there) return false;
    // What comes when it likes has no period: a mean of such intervals, and how far they are off it, would tell nothing.
    const periodic = now.period !== null && now.jitter < now.period / 2;
    const ms = seconds => periodic ? (seconds * 1000).toFixed(1) : "–";
    this.wrong = this.row.foreign ? 0 : now.wrong;
    const texts = {count: String(now.count), period: ms(now.period), jitter: ms(now.jitter), age: Math.max(now.age, 0).toFixed(1),
      length: String(now.data.length / 2), data: RADICES[radix].bytes(now.data), bad: this.wrong ? String(this.wrong) : ""};
    for (const [name, text] of Object.entries(texts)) say(this.cells[name], text);
    this.element.classList.toggle("aperiodic", !periodic);
    this.element.classList.toggle("is-wrong", Boolean(now.defects) && !this.row.foreign);
    this.element.classList.toggle("lost", isLost(this.row.source, this.row, time));
    this.element.classList.toggle("old", now.age > Math.max(3 * (now.period || 0), 1));
    this.chips.forEach((chip, place) => {
      show(chip, now.values !== null && !this.row.fields[place].unmapped);
      if (now.values) say(this.values[place], written(this.row.fields[place], now.values[place]));
    });
    say(this.text, now.values || this.row.foreign || now.defects.includes(now.text) ? "" : now.text);
    say(this.defects, this.row.foreign ? RADICES[radix].bytes(now.data) : now.defects ? `! ${now.defects}` : "");
    return true;
  }
}

function messageTable(source) {
  const body = h("tbody"), lines = new Map();
  const head = (name, words) => h("th", {scope: "col", class: name}, words);
  const table = h("table", {class: "messages", "aria-label": `messages of ${source.name}`}, h("thead", {}, h("tr", {}, head("id", "ID"), head("", "Message"),
    ...Object.entries(COLUMNS).map(each => head(...each)), head("values", "Last values"))), body);
  const none = h("p", {class: "hint", hidden: true});
  let known = null;
  function enter() {
    if (known === source.rows && lines.size === source.rows.size) return;
    known = source.rows;
    for (const [key, line] of lines) if (source.rows.get(key) !== line.row) { line.element.remove(); lines.delete(key); }
    for (const row of source.sorted()) {
      if (!lines.has(row.key)) lines.set(row.key, new MessageLine(row));
      body.append(lines.get(row.key).element);
    }
  }
  return {element: h("div", {}, table, none), show(time) {
    enter();
    const shown = [...lines.values()].filter(line => line.show(time)).length;
    const hidden = name => !chosenColumns.has(name) || (name === "bad" && ![...lines.values()].some(line => line.wrong));
    for (const name of Object.keys(COLUMNS)) table.classList.toggle(`without-${name}`, hidden(name));
    show(table, shown > 0);
    show(none, !shown);
    say(none, lines.size ? "No message, protocol or node passes the filter." : "No message yet.");
  }};
}

function radixChoice() {                    // also for the trace
  const chosen = h("select", {class: "radix", "aria-label": "how numbers are written", onchange: () => {
    radix = chosen.value;
    for (const each of document.querySelectorAll("select.radix")) each.value = radix;
    stale = true;
  }}, ...Object.keys(RADICES).map(name => h("option", {selected: name === radix}, name)));
  return chosen;
}

function messagesView() {
  const tables = perSource(messageTable);
  const choice = ([name, words]) => h("label", {}, h("input", {
    type: "checkbox", checked: chosenColumns.has(name),
    onchange: event => {
      if (event.target.checked) chosenColumns.add(name); else chosenColumns.delete(name);
      keep("columns", [...chosenColumns]);
      stale = true;
    },
  }), words);
  const columns = h("details", {class: "columns"}, h("summary", {}, "Columns"), ...Object.entries(COLUMNS).map(choice));
  const {box, said} = filterBox("messages", {id: "search", placeholder: "search", "aria-label": "search messages, protocols, nodes",
    title: "a part of a name, 180-1FF; several with commas; ! before what is not wanted"}, filter => { passes = filter; stale = true; });
  const element = h("div", {}, h("div", {class: "tools"}, box, said, radixChoice(),
    columns, h("p", {class: "hint"}, "Click a value, or drag it, to plot it.")), tables.element);
  return {element, show: tables.show};
}
