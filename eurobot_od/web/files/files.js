"use strict";
// The view of files: which one is open, what lint finds in it, its edits, and the keys.

const ORIGINS = {named: "Named", network: "Devices of the page", library: "Library"};
const AGAIN = 2000;                         // ms after which the list of files is asked for again

class FilesView {
  constructor() {
    Object.assign(this, {file: null, known: null, asked: false});
    this.tree = new FileTree(this);
    this.bar = new MappingBar(this);
    this.form = new ObjectForm(this);
    this.adder = new ObjectAdder(this);
    this.chosen = h("select", {"aria-label": "file", "data-focus": "file", onchange: () => quietly(this.open(this.chosen.value))});
    this.picker = h("input", {type: "file", multiple: true, accept: ".eds,.dcf", hidden: true, onchange: () => { this.take([...this.picker.files]); this.picker.value = ""; }});
    const button = (text, act, more) => h("button", {"data-focus": text, onclick: act, ...more}, text);
    this.undo = button("Undo", () => this.step("undo"), {title: "Ctrl+Z"});
    this.redo = button("Redo", () => this.step("redo"), {title: "Ctrl+Y"});
    this.save = button("Save", () => this.store(), {class: "main", title: "Ctrl+S"});
    this.load = button("Download", () => this.file.download());
    this.profile = h("select", {"aria-label": "profile to insert", "data-focus": "profile", onchange: () => this.insert()});
    this.answer = h("output", {class: "file-answer", role: "status"});
    this.summary = h("summary", {"data-focus": "findings"});
    this.findings = h("details", {class: "findings", ontoggle: () => { if (this.file) this.drawFindings(); }}, this.summary);
    this.edits = h("details", {class: "edits"});
    this.acts = h("span", {class: "buttons", hidden: true}, this.undo, this.redo, this.profile, this.load, this.save);
    this.body = h("div", {class: "file-body", hidden: true}, this.tree.element,
      h("div", {class: "file-side"}, this.bar.element, this.form.element, this.adder.element, this.findings, this.edits));
    this.start = h("p", {class: "drop-hint"}, "Choose a file, or drop EDS and DCF files here. What you change stays in this page until you download or save it.");
    this.element = h("div", {class: "files", onkeydown: event => this.key(event), ondragover: event => this.over(event), ondragleave: () => this.element.classList.remove("over"), ondrop: event => this.drop(event)},
      h("div", {class: "tools"}, this.chosen, this.picker, button("Open…", () => this.picker.click(), {"aria-label": "open files of this computer"}), this.acts, this.answer), this.start, this.body);
  }
  tell(text, isWrong = false) {
    say(this.answer, text);
    this.answer.classList.toggle("is-wrong", isWrong);
  }
  find() { this.tree.box.focus(); }

  // Which file

  async list() {
    this.asked = true;
    try { this.known = await askEditor({do: "list"}); } catch (error) {
      this.tell(error.message, true);
      setTimeout(() => { this.asked = false; stale = true; }, AGAIN);
      return;
    }
    this.profile.replaceChildren(h("option", {value: ""}, "Insert profile"), ...this.known.profiles.map(each => h("option", {value: each}, `CiA ${each}`)));
    this.adder.build();
    this.adder.fit();
    this.drawFiles();
    const first = this.known.files.find(each => each.origin === "named");
    if (first && !this.file) await quietly(this.open(first.file));
  }
  drawFiles() {
    const dropped = [...editedFiles].filter(([, each]) => each.file === null).map(([file, each]) => ({file, name: each.name, origin: "dropped"}));
    const groups = Object.entries({dropped: "Dropped", ...ORIGINS}).map(([origin, label]) => [label, [...dropped, ...this.known.files].filter(each => each.origin === origin)]);
    const key = [...editedFiles].find(([, each]) => each === this.file)?.[0] ?? "";
    const names = new Map();
    for (const {name} of this.known.files) names.set(name, (names.get(name) || 0) + 1);
    const option = each => h("option", {value: each.file, selected: each.file === key}, `${editedFiles.get(each.file)?.isChanged ? "● " : ""}${names.get(each.name) > 1 ? each.file : each.name}`);
    this.chosen.replaceChildren(...(key ? [] : [h("option", {value: ""}, "choose a file")]), ...groups.filter(([, files]) => files.length).map(([label, files]) => h("optgroup", {label}, ...files.map(option))));
  }
  async open(file) {
    try {
      if (!editedFiles.has(file)) {
        const {text, digest, ...model} = await askEditor({do: "open", file});
        editedFiles.set(file, new EditedFile(file.split(/[\\/]/).at(-1), file, text, digest, model));
      }
      this.present(file, "");
    } catch (error) { this.tell(error.message, true); this.drawFiles(); }
  }
  present(key, words) {
    this.file = editedFiles.get(key);
    this.tell(words);
    this.draw();
  }
  async take(files) {                       // of this computer: dropped, or chosen
    for (const each of files) {
      try {
        if (!this.known) throw new Error(NO_SERVER);
        if (each.size > this.known.largest) throw new Error(`${each.name}: ${each.size} bytes; the page edits files of up to ${this.known.largest / 2 ** 20} MB`);
        const text = textOf(await each.arrayBuffer());
        const model = await askEditor({do: "look", name: each.name, text});
        let key = each.name;
        for (let number = 2; editedFiles.has(key); number++) key = `${each.name} (${number})`;
        editedFiles.set(key, new EditedFile(each.name, null, text, null, model));
        this.present(key, `${each.name} is open`);
      } catch (error) { this.tell(error.message, true); }
    }
  }
  over(event) {
    if (!event.dataTransfer.types.includes("Files")) return;
    event.preventDefault();
    this.element.classList.add("over");
  }
  drop(event) {
    this.element.classList.remove("over");
    if (!event.dataTransfer.files.length) return;
    event.preventDefault();
    this.take([...event.dataTransfer.files]);
  }

  // Edits

  async done(promise, focus, then) {        // an edit, an undo, a save: its answer, and what the file is afterwards
    const {file} = this;
    this.element.setAttribute("aria-busy", "true");
    try {
      const words = await promise;
      if (file !== this.file) return;
      then?.(file);
      this.tell(words);
      this.draw(focus);
    } catch (error) { if (file === this.file) this.tell(error.message, true); } finally { this.element.removeAttribute("aria-busy"); }
  }
  edit(words, then, focus) { return this.done(this.file.edit(...words), focus, then); }
  step(way) { return this.done(this.file[way](), undefined); }
  store() { return this.done(this.file.save(), undefined); }
  insert() {
    const {value} = this.profile;
    if (value) this.edit(["insert", "profile", value]);
  }
  remove(object, variable) { return this.edit(["remove", targetOf(object, variable)], file => { file.chosen = variable && !object.own ? {index: object.index, sub: null} : null; }, "tree"); }
  key(event) {
    if (!this.file || !(event.ctrlKey || event.metaKey) || event.altKey) return;
    const typing = event.target.matches("input") && event.target.value !== event.target.defaultValue, key = event.key.toLowerCase();
    const act = key === "s" ? () => { if (this.isSaveable) this.store(); else this.file.download(); } : typing ? null
      : key === "y" || (key === "z" && event.shiftKey) ? () => this.step("redo") : key === "z" ? () => this.step("undo") : null;
    if (!act) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }
  get isSaveable() { return this.known.files.some(each => each.file === this.file.file && each.saves); }

  // Which object

  choose(index, sub, focus) {
    this.file.chosen = {index, sub};
    this.draw(focus);
  }
  reveal(index, sub) {
    this.tree.reveal(index, sub);
    this.file.chosen = {index, sub};
  }
  chooseLabel(label) {
    const [index, sub] = label.split(":"), object = this.file.object(parseInt(index, 16));
    if (!object) { this.tell(`${label} is not in the file`, true); return; }
    this.reveal(object.index, object.own ? null : Number(sub));
    this.draw();
    this.tree.toChosen();
  }

  // What is shown

  findingList(findings) {
    if (!findings.length) return null;
    return h("ul", {class: "finding-list"}, ...findings.map(each => h("li", {class: `is-${each.level}`}, h("b", {}, each.level), ` ${each.code} `, each.message)));
  }
  drawFindings() {
    const {findings} = this.file.model;
    say(this.summary, `Findings of lint: ${worded(findings).map(([number, level]) => counted(number, level)).join(", ") || "no error, no warning"}`);
    const list = this.findings.open ? findings.slice(0, MOST_FOUND) : [], hidden = findings.length - list.length;
    const where = each => each.index === null ? "" : `${hex(each.index, 4)}${each.sub === null ? "" : `:${each.sub}`} `;
    this.findings.replaceChildren(this.summary, h("ul", {class: "finding-list"}, ...list.map(each => h("li", {class: `is-${each.level}`}, h("b", {}, each.level), ` ${each.code} line ${each.line} `,
      each.index === null ? null : h("button", {onclick: () => this.chooseLabel(`${hex(each.index, 4)}:${each.sub ?? 0}`)}, where(each)), ` ${each.message}`))),
    ...(this.findings.open && hidden > 0 ? [h("p", {class: "hint"}, `and ${hidden} more`)] : []));
  }
  drawEdits() {
    const {done} = this.file, open = this.edits.open;
    this.edits.replaceChildren(h("summary", {"data-focus": "edits"}, `Edits: ${done.length || "none yet"}`), h("ol", {}, ...done.map(each => h("li", {}, h("code", {}, commandOf(each.words)), h("pre", {tabindex: 0}, each.changed.join("\n"))))));
    this.edits.open = open;
  }
  draw(focus = this.element.contains(document.activeElement) ? document.activeElement.dataset.focus : undefined) {
    const {file} = this;
    file.hasUnits = file.model.objects.some(object => object.variables.some(each => each.entries.unit || each.entries.factor));
    for (const [each, shown] of [[this.start, false], [this.acts, true], [this.body, true], [this.save, this.isSaveable]]) show(each, shown);
    this.undo.disabled = !file.done.length;
    this.redo.disabled = !file.undone.length;
    this.save.disabled = !file.isChanged;
    this.profile.value = "";
    this.drawFiles();
    for (const each of [this.tree, this.bar, this.form]) each.draw();
    this.drawFindings();
    this.drawEdits();
    this.focus(focus);
  }
  focus(name) {                             // an element that was made anew has the focus of the one before
    if (name === undefined) return;
    const found = name === "tree" ? this.tree.list.querySelector("[tabindex='0']") : this.element.querySelector(`[data-focus="${CSS.escape(name)}"]`);
    if (found && found !== document.activeElement) found.focus({preventScroll: found.closest(".file-tree") === null});
  }
  show() { if (!this.asked && (!live || connection.alive)) quietly(this.list()); }
}
const filesView = () => new FilesView();
