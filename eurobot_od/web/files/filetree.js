"use strict";
// The objects of a file as a tree, with a search; what can be mapped is dragged from it.

const SIGNS = {error: "✖", warning: "▲"};   // beside an object with findings
const counted = (number, word) => `${number} ${word}${number === 1 ? "" : "s"}`;
const worded = findings => Object.keys(SIGNS).map(level => [findings.filter(each => each.level === level).length, level]).filter(([number]) => number);

class FileTree {                            // objects of a file; the arrow keys go from one to the next
  constructor(view) {
    Object.assign(this, {view, open: new Set(GROUPS.map(each => each.name))});
    this.box = h("input", {type: "search", placeholder: "search: /", "aria-label": "search the objects of the file", oninput: () => this.seek()});
    this.list = h("div", {role: "tree", "aria-label": "objects of the file", onclick: event => this.click(event), onkeydown: event => this.key(event), ondragstart: event => this.drag(event)});
    this.hint = h("p", {class: "hint"});
    this.element = h("div", {class: "file-tree"}, this.box, this.list, this.hint);
  }
  get file() { return this.view.file; }
  rows() {
    const wanted = plain(this.box.value), rows = [];
    for (const {name, from, to} of GROUPS) {
      const objects = this.file.model.objects.filter(each => each.index >= from && each.index <= to);
      if (wanted || !objects.length) { rows.push(...objects.flatMap(object => this.found(object, wanted))); continue; }
      const isOpen = this.open.has(name);
      rows.push({key: name, level: 1, name, isOpen, count: objects.length});
      for (const object of isOpen ? objects : []) rows.push(...this.objectRows(object));
    }
    return rows;
  }
  objectRows(object) {
    const key = String(object.index), isOpen = object.own || !object.variables.length ? undefined : this.open.has(key);
    const row = {key, level: 2, object, variable: object.own ? object.variables[0] : null, name: object.name, isOpen};
    return [row, ...(isOpen ? object.variables.map(variable => this.subRow(object, variable, 3)) : [])];
  }
  subRow(object, variable, level) { return {key: `${object.index}:${variable.sub}`, level, object, variable, sub: variable.sub, name: variable.name}; }
  found(object, wanted) {                   // what a search finds, without the tree around it
    const own = plain(`${hex(object.index, 4)} ${object.name}`).includes(wanted);
    const subs = object.own ? [] : object.variables.filter(each => plain(each.name).includes(wanted)).map(each => ({...this.subRow(object, each, 1), name: `${object.name}: ${each.name}`}));
    return [...(own ? [{...this.objectRows(object)[0], level: 1, isOpen: undefined}] : []), ...subs];
  }
  seek() {
    const {chosen} = this.file;
    if (chosen && !this.box.value) this.reveal(chosen.index, chosen.sub);
    this.draw();
    if (!this.box.value) this.toChosen();
  }
  toChosen() { this.list.querySelector("[aria-selected=true]")?.scrollIntoView({block: "nearest"}); }
  draw() {
    const rows = this.rows(), {scrollTop} = this.list, most = this.box.value ? MOST_FOUND : rows.length, chosen = this.chosenKey;
    const first = rows.some(each => each.key === chosen) ? chosen : rows[0]?.key;
    this.byKey = new Map(rows.map(each => [each.key, each]));
    this.list.replaceChildren(...rows.slice(0, most).map(row => this.item(row, chosen, first)));
    this.list.scrollTop = scrollTop;
    say(this.hint, !rows.length ? "No object has this in its name or number." : rows.length > most ? `${rows.length - most} more: search for more of the name` : "");
    show(this.list, rows.length > 0);
  }
  get chosenKey() {
    const {chosen} = this.file;
    return chosen && (chosen.sub === null ? String(chosen.index) : `${chosen.index}:${chosen.sub}`);
  }
  item(row, chosen, first) {
    const {object, variable, sub} = row, findings = object ? worded(this.file.findings(object.index, sub)) : [];
    const says = findings.map(([number, level]) => counted(number, level)).join(", "), number = object && (sub === undefined ? hex(object.index, 4) : `:${sub}`);
    return h("div", {role: "treeitem", class: `item level-${row.level}`, "data-key": row.key, "data-focus": `tree ${row.key}`, "aria-level": row.level,
      "aria-expanded": row.isOpen === undefined ? null : String(row.isOpen), "aria-selected": String(row.key === chosen), tabindex: row.key === first ? 0 : -1,
      draggable: variable?.is_mappable ? "true" : null, title: variable?.is_mappable ? "drag it into the 64 bits" : null},
    h("span", {class: "twist", "aria-hidden": "true"}, row.isOpen === undefined ? "" : row.isOpen ? "▾" : "▸"),
    object ? h("span", {class: "id"}, number) : null, h("span", {class: "name"}, row.name), object ? h("small", {}, variable?.type || object.kind) : h("small", {}, String(row.count)),
    says ? h("span", {class: `signs is-${findings[0][1]}`, role: "img", "aria-label": says, title: says}, findings.map(([count, level]) => `${SIGNS[level]}${count}`).join(" ")) : null);
  }
  rowOf(event) { return this.byKey.get(event.target.closest("[role=treeitem]")?.dataset.key); }
  click(event) {
    const row = this.rowOf(event);
    if (!row) return;
    if (!row.object || event.target.closest(".twist")) { this.turn(row, !row.isOpen); return; }
    if (row.isOpen === false) this.open.add(row.key);
    this.view.choose(row.object.index, row.sub ?? null, `tree ${row.key}`);
  }
  turn(row, isOpen) {
    if (row.isOpen === undefined) return;
    if (isOpen) this.open.add(row.key); else this.open.delete(row.key);
    this.view.draw(`tree ${row.key}`);
  }
  key(event) {
    const row = this.rowOf(event), items = [...this.list.children], here = items.indexOf(event.target.closest("[role=treeitem]"));
    const go = place => { const item = items[Math.min(Math.max(place, 0), items.length - 1)]; items[here].tabIndex = -1; item.tabIndex = 0; item.focus(); };
    const parent = () => { const above = items.slice(0, here).findLastIndex(each => Number(each.ariaLevel) < row.level); if (above >= 0) go(above); };
    const act = {ArrowDown: () => go(here + 1), ArrowUp: () => go(here - 1), Home: () => go(0), End: () => go(items.length - 1),
      ArrowRight: () => { if (row.isOpen === false) this.turn(row, true); else if (row.isOpen) go(here + 1); },
      ArrowLeft: () => { if (row.isOpen) this.turn(row, false); else parent(); },
      Enter: () => event.target.click(), " ": () => event.target.click(),
      m: () => { if (row.variable) this.view.bar.add(targetOf(row.object, row.variable)); },
      Delete: () => { if (row.object) this.view.remove(row.object, row.sub === undefined ? null : row.variable); }}[event.key];
    if (!row || !act || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }
  drag(event) {
    const row = this.rowOf(event);
    if (row?.variable) event.dataTransfer.setData("text/plain", JSON.stringify({object: targetOf(row.object, row.variable)}));
  }
  reveal(index, sub) {                      // so that an object is among the rows
    this.box.value = "";
    this.open.add(GROUPS.find(each => index >= each.from && index <= each.to)?.name);
    if (sub !== null) this.open.add(String(index));
  }
}
