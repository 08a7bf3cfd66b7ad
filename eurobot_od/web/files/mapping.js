"use strict";
// The 64 bits of a PDO: what is mapped where, moved by drag or by keys. Each change is an edit of the file.

const PDO_BITS = 64;

class MappingBar {
  constructor(view) {
    this.view = view;
    this.chosen = h("select", {"aria-label": "PDO", "data-focus": "pdo", onchange: () => this.choose(this.chosen.value)});
    this.free = h("span", {class: "hint"});
    this.bits = h("div", {class: "pdo-bits", role: "group", "aria-label": "mapped objects",
      ondragover: event => this.over(event), ondragleave: () => this.mark(-1), ondrop: event => this.drop(event)});
    this.bytes = h("div", {class: "pdo-bytes", "aria-hidden": "true"}, ...Array.from({length: PDO_BITS / 8}, (_, byte) => h("span", {}, String(byte))));
    this.line = h("p", {class: "entry-line"});
    this.element = h("section", {class: "pdo", "aria-label": "PDO mapping"},
      h("div", {class: "buttons"}, h("h3", {}, "PDO mapping"), this.chosen, this.free), this.bytes, this.bits, this.line);
  }
  get file() { return this.view.file; }
  get entries() { return this.file.mapped.entries; }
  choose(pdo) {
    Object.assign(this.file, {pdo, entry: -1});
    this.view.draw();
  }
  freeNames() {                            // the next PDO of each direction
    return ["RPDO", "TPDO"].map(direction => {
      const numbers = new Set(this.file.model.pdos.filter(each => each.name.startsWith(direction)).map(each => Number(each.name.slice(4))));
      let number = 1;
      while (numbers.has(number)) number++;
      return `${direction}${number}`;
    });
  }
  draw() {
    const {pdos} = this.file.model, pdo = this.file.mapped, used = this.entries.reduce((sum, each) => sum + each.bits, 0);
    const option = (value, text) => h("option", {value, selected: value === this.file.pdo}, text);
    this.chosen.replaceChildren(...pdos.map(each => option(each.name, `${each.name}${each.valid ? "" : " (off)"}`)), ...this.freeNames().map(each => option(each, `new ${each}`)));
    say(this.free, pdo.multiplexed ? "multiplexed: it maps nothing" : `${used} of ${PDO_BITS} bits`);
    this.file.entry = Math.min(this.file.entry, this.entries.length - 1);
    let bit = 0;
    const blocks = this.entries.map((each, place) => { bit += each.bits; return this.block(each, place, bit - each.bits); });
    const rest = h("span", {class: "free"});
    rest.style.gridColumn = `span ${Math.max(PDO_BITS - used, 1)}`;
    this.bits.replaceChildren(...blocks, ...(used < PDO_BITS ? [rest] : []));
    this.tell();
  }
  block(entry, place, bit) {
    const isChosen = place === this.file.entry, words = `${entry.object}, ${this.span(entry, bit)}`;
    const made = h("button", {class: `entry entry-${place % 6}`, draggable: "true", "data-focus": `entry ${place}`, "aria-pressed": String(isChosen),
      title: `${entry.name}: ${words}`, tabindex: isChosen || (place === 0 && this.file.entry < 0) ? 0 : -1,
      onclick: () => this.point(place), onkeydown: event => this.key(event, place),
      ondragstart: event => event.dataTransfer.setData("text/plain", JSON.stringify({entry: place}))},
    h("span", {}, entry.name), h("small", {}, String(entry.bits)), h("span", {class: "heard-only"}, words));
    made.style.gridColumn = `span ${Math.min(Math.max(entry.bits, 1), PDO_BITS)}`;
    return made;
  }
  span(entry, bit) { return entry.bits === 1 ? `bit ${bit}` : `bits ${bit} to ${bit + entry.bits - 1}`; }
  tell() {                                  // the chosen entry in words, and its buttons
    const {entry: place} = this.file, entry = this.entries[place];
    if (!entry) {
      this.line.replaceChildren(h("span", {class: "hint"}, this.entries.length ? "Drag an object here from the tree. Choose one to move it: Shift with an arrow key, Delete."
        : "Drag an object here from the tree, or choose it and press Map."));
      return;
    }
    const bit = this.entries.slice(0, place).reduce((sum, each) => sum + each.bits, 0);
    const button = (text, act, unable) => h("button", {disabled: unable, "data-focus": text, onclick: act}, text);
    this.line.replaceChildren(h("span", {}, h("span", {class: "id"}, entry.object), ` ${entry.name}, ${this.span(entry, bit)} `), h("span", {class: "buttons"},
      button("◀ Earlier", () => this.move(place, place - 1), place === 0), button("Later ▶", () => this.move(place, place + 1), place === this.entries.length - 1),
      button("Unmap", () => this.remove(place)), button("Show object", () => this.view.chooseLabel(entry.object))));
  }
  point(place) {
    this.file.entry = place;
    this.view.draw(`entry ${place}`);
  }
  key(event, place) {
    const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    if (step && event.shiftKey) this.move(place, place + step);
    else if (step) this.point(Math.min(Math.max(place + step, 0), this.entries.length - 1));
    else if (event.key === "Delete" || event.key === "Backspace") this.remove(place);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  // Edits

  map(objects, entry) {
    return this.view.edit(["map", this.file.pdo, ...objects], () => { this.file.entry = entry; }, entry >= 0 ? `entry ${entry}` : "pdo");
  }
  add(object, place = this.entries.length) {
    const objects = this.entries.map(each => each.object);
    objects.splice(place, 0, object);
    return this.map(objects, place);
  }
  move(from, to) {
    if (to < 0 || to >= this.entries.length || to === from) return;
    const objects = this.entries.map(each => each.object);
    objects.splice(to, 0, ...objects.splice(from, 1));
    this.map(objects, to);
  }
  remove(place) {
    const objects = this.entries.map(each => each.object);
    objects.splice(place, 1);
    this.map(objects, Math.min(place, objects.length - 1));
  }

  // Drag

  placeAt(x) {                              // before which entry something is dropped
    const blocks = [...this.bits.querySelectorAll(".entry")];
    const place = blocks.findIndex(each => { const box = each.getBoundingClientRect(); return x < box.x + box.width / 2; });
    return place < 0 ? blocks.length : place;
  }
  mark(place) {
    for (const [at, each] of [...this.bits.children].entries()) each.classList.toggle("insert", at === place);
  }
  over(event) {
    if (!event.dataTransfer.types.includes("text/plain")) return;
    event.preventDefault();
    this.mark(this.placeAt(event.clientX));
  }
  drop(event) {
    let said = {};
    try { said = JSON.parse(event.dataTransfer.getData("text/plain")); } catch { return; }
    event.preventDefault();
    this.mark(-1);
    const place = this.placeAt(event.clientX);
    if (typeof said.object === "string") this.add(said.object, place);
    else if (Number.isInteger(said.entry)) this.move(said.entry, place > said.entry ? place - 1 : place);
  }
}
