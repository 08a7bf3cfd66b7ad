"use strict";
// The files that are edited: what the server says of a text, the edits of it, and how they are undone.
//
// Rule of this file: the server makes each edit and judges it; the page holds the text, and what each edit has changed
// in it. A text has a character for each byte of the file.

async function askEditor(what) {            // the server's answer; throws its reason, which is one line
  const response = await fetch("/files", {method: "POST", body: JSON.stringify(what)}).catch(() => { throw new Error(NO_SERVER); });
  if (!response.ok) throw new Error((await response.text()).trim());
  const said = await response.json();
  if ("error" in said) throw new Error(said.error);
  return said.ok;
}
function textOf(buffer) {                   // bytes as characters; a TextDecoder has no encoding that keeps them all
  const bytes = new Uint8Array(buffer), parts = [];
  for (let at = 0; at < bytes.length; at += 0x8000) parts.push(String.fromCharCode(...bytes.subarray(at, at + 0x8000)));
  return parts.join("");
}
const bytesOf = text => Uint8Array.from(text, each => each.charCodeAt(0));
function changeOf(before, after) {          // the stretch in which two texts differ
  const most = Math.min(before.length, after.length);
  let from = 0, same = 0;
  while (from < most && before.charCodeAt(from) === after.charCodeAt(from)) from++;
  while (same < most - from && before.charCodeAt(before.length - 1 - same) === after.charCodeAt(after.length - 1 - same)) same++;
  return {from, before: before.slice(from, before.length - same), after: after.slice(from, after.length - same)};
}
const replaced = (text, from, old, by) => text.slice(0, from) + by + text.slice(from + old.length);
const commandOf = words => words.map(each => /^[\w:=.,+$-]+$/.test(each) ? each : `"${each}"`).join(" ");
const targetOf = (object, variable) => object.own || !variable ? hex(object.index, 4) : `${hex(object.index, 4)}:${variable.sub}`;

class EditedFile {
  constructor(name, file, text, digest, model) {
    Object.assign(this, {name, file, text, digest, model, saved: text, done: [], undone: [], turn: Promise.resolve()});
    this.chosen = null;                     // {index, sub}: what the form shows
    this.pdo = model.pdos[0]?.name || "TPDO1";
    this.entry = -1;                        // place of the chosen mapping entry
  }
  get isChanged() { return this.text !== this.saved; }
  object(index) { return this.model.objects.find(each => each.index === index); }
  findings(index, sub) {                    // of an object, all of them, or those of one sub-index
    return this.model.findings.filter(each => each.index === index && (sub === undefined || each.sub === sub));
  }
  get mapped() { return this.model.pdos.find(each => each.name === this.pdo) || {name: this.pdo, entries: [], valid: false, isNew: true}; }
  inTurn(act) {                             // an edit begins with the text that the one before has made
    const next = this.turn.then(act);
    this.turn = next.catch(() => {});
    return next;
  }
  edit(...words) {
    return this.inTurn(async () => {
      const {text, changed, warnings, ...model} = await askEditor({do: "edit", name: this.name, text: this.text, words});
      if (text === this.text) return `${commandOf(words)}: nothing changes`;
      this.done.push({words, changed, ...changeOf(this.text, text)});
      this.undone = [];
      Object.assign(this, {text, model});
      return [commandOf(words), ...warnings].join("; ");
    });
  }
  step(from, to, isBack) {                  // undo, or redo
    return this.inTurn(async () => {
      const each = from.at(-1);
      if (!each) return isBack ? "nothing to undo" : "nothing to redo";
      const text = isBack ? replaced(this.text, each.from, each.after, each.before) : replaced(this.text, each.from, each.before, each.after);
      this.model = await askEditor({do: "look", name: this.name, text});
      this.text = text;
      to.push(from.pop());
      return `${isBack ? "undone" : "redone"}: ${commandOf(each.words)}`;
    });
  }
  undo() { return this.step(this.done, this.undone, true); }
  redo() { return this.step(this.undone, this.done, false); }
  save() {
    return this.inTurn(async () => {
      const {digest} = await askEditor({do: "save", file: this.file, digest: this.digest, text: this.text});
      Object.assign(this, {digest, saved: this.text});
      return `${this.name} saved`;
    });
  }
  download() { saved(this.name, new Blob([bytesOf(this.text)])); }
}

const editedFiles = new Map();              // by their place on the disk, or a name of our own for what was dropped
const isUnsaved = () => [...editedFiles.values()].some(each => each.isChanged);
addEventListener("beforeunload", event => { if (isUnsaved()) event.preventDefault(); });
