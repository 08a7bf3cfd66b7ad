"use strict";
// The forms of the view of files: one for the chosen object, one for a new object or sub-index.

const FIELDS = [                            // of the form: a key of the file, its word for the form; `if`: the objects that have it
  {key: "datatype", send: "DataType", label: "type", choices: each => each.types},
  {key: "accesstype", send: "AccessType", label: "access", choices: each => each.access},
  {key: "defaultvalue", send: "DefaultValue", label: "default"},
  {key: "parametervalue", send: "ParameterValue", label: "value", if: file => file.model.configuration},
  {key: "lowlimit", send: "LowLimit", label: "low limit"},
  {key: "highlimit", send: "HighLimit", label: "high limit"},
  {key: "unit", send: "Unit", label: "unit", if: file => file.hasUnits},
  {key: "factor", send: "Factor", label: "factor", if: file => file.hasUnits},
  {key: "offset", send: "Offset", label: "offset", if: file => file.hasUnits},
];
const labelled = (text, ...more) => h("label", {}, h("span", {}, text), ...more);

class ObjectForm {                          // what the file says of the chosen object, to be changed
  constructor(view) {
    Object.assign(this, {view, element: h("section", {class: "object-form", "aria-label": "object"})});
  }
  draw() {
    const {file} = this.view, {chosen} = file, object = chosen && file.object(chosen.index);
    const variable = object && (object.own ? object.variables[0] : object.variables.find(each => each.sub === chosen.sub));
    if (!object) { this.element.replaceChildren(h("p", {class: "hint"}, "Choose an object of the tree.")); return; }
    const target = targetOf(object, variable), part = chosen.sub === null || object.own ? undefined : chosen.sub;
    this.fields = [this.field("name", "ParameterName", variable ? variable.name : object.name), ...(variable ? this.variableFields(file, variable) : [])];
    const button = (text, act, more = {}) => h("button", {type: "button", "data-focus": text, onclick: act, ...more}, text);
    this.element.replaceChildren(h("div", {}, h("h3", {}, h("span", {class: "id"}, target), ` ${object.own || !variable ? object.name : `${object.name}: ${variable.name}`}`, h("small", {class: "hint"}, ` ${object.own ? object.kind : variable ? `of ${object.kind}` : object.kind}`)),
      this.view.findingList(file.findings(object.index, part)),
      h("form", {class: "edit-form", novalidate: true, onsubmit: event => { event.preventDefault(); this.apply(target); }}, h("div", {class: "edit-fields"}, ...this.fields.map(each => each.element)),
        h("div", {class: "buttons"}, h("button", {class: "main", type: "submit", "data-focus": "apply"}, "Apply"),
          variable?.is_mappable ? button(`Map into ${file.pdo}`, () => this.view.bar.add(target)) : null,
          object.own ? null : button("Add a sub-index", () => this.view.adder.begin(object)), button("Remove", () => this.view.remove(object, variable))))));
  }
  field(label, send, was, input) {
    const made = input || h("input", {type: "text", autocomplete: "off", spellcheck: "false", "data-focus": `field ${send}`, value: was});
    const element = labelled(label, made);
    element.classList.toggle("wide", send === "ParameterName");
    return {send, was, element, read: () => made.type === "checkbox" ? (made.checked ? "1" : "0") : made.value.trim()};
  }
  variableFields(file, variable) {
    const shown = FIELDS.filter(each => !each.if || each.if(file) || variable.entries[each.key]).map(each => {
      const written = variable.entries[each.key] || "", was = each.key === "datatype" ? variable.type || written : each.choices ? written.toLowerCase() : written;
      return this.field(each.label, each.send, was, each.choices && choiceOf(each.choices(this.view.known), was, `field ${each.send}`));
    });
    const map = h("input", {type: "checkbox", "data-focus": "field PDOMapping", checked: variable.is_mappable});
    return [...shown, this.field("mappable into PDOs", "PDOMapping", variable.is_mappable ? "1" : "0", map)];
  }
  apply(target) {
    const other = this.fields.filter(each => each.read() !== each.was).map(each => `${each.send}=${each.read()}`);
    if (other.length) this.view.edit(["set", target, ...other]); else this.view.tell("nothing is changed in the form");
  }
}
function choiceOf(choices, was, focus) {
  const all = choices.includes(was) ? choices : [was, ...choices];
  return h("select", {"data-focus": focus}, ...all.map(each => h("option", {value: each, selected: each === was}, each || "none")));
}

class ObjectAdder {                         // the form for a new object, or a new sub-index
  constructor(view) {
    this.view = view;
    const input = (name, more) => h("input", {type: "text", autocomplete: "off", size: 9, "data-focus": `new ${name}`, ...more});
    this.index = input("index", {placeholder: "0x2100"});
    this.sub = input("sub-index", {placeholder: "none", size: 5});
    this.name = input("name", {size: 20});
    this.kind = choiceOf(["VAR", "ARRAY", "RECORD"], "VAR", "new kind");
    this.kind.addEventListener("change", () => this.fit());
    this.default = input("default", {placeholder: "none"});
    this.places = h("div", {class: "edit-fields"});
    this.form = h("form", {class: "edit-form", novalidate: true, onsubmit: event => { event.preventDefault(); this.add(); }}, this.places,
      h("div", {class: "buttons"}, h("button", {class: "main", type: "submit", "data-focus": "add"}, "Add")));
    this.element = h("details", {class: "adder"}, h("summary", {"data-focus": "adder"}, "Add an object"), this.form);
  }
  build() {                                 // once it is known what there is to choose
    this.type = choiceOf(this.view.known.types, "UNSIGNED16", "new type");
    this.access = choiceOf(this.view.known.access, "rw", "new access");
    this.map = h("input", {type: "checkbox", "data-focus": "new mappable"});
    this.ofVariable = [labelled("type", this.type), labelled("access", this.access), labelled("default", this.default), labelled("mappable into PDOs", this.map)];
    this.kindField = labelled("kind", this.kind);
    this.sub.addEventListener("input", () => this.fit());
    this.places.replaceChildren(labelled("index", this.index), labelled("sub-index", this.sub), labelled("name", this.name), this.kindField, ...this.ofVariable);
  }
  get isVariable() { return this.sub.value.trim() !== "" || this.kind.value === "VAR"; }
  fit() {
    show(this.kindField, this.sub.value.trim() === "");
    for (const each of this.ofVariable) show(each, this.isVariable);
  }
  begin(object) {                           // a sub-index of an object
    this.element.open = true;
    this.index.value = hex(object.index, 4);
    this.sub.value = String(Math.max(0, ...object.variables.map(each => each.sub).filter(each => each < 255)) + 1);
    this.fit();
    this.name.focus();
  }
  add() {
    const index = this.index.value.trim(), sub = this.sub.value.trim(), target = sub === "" ? index : `${index}:${sub}`;
    if (!index || !this.name.value.trim()) { this.view.tell("a new object has an index and a name", true); return; }
    const variable = [`type=${this.type.value}`, `access=${this.access.value}`, `map=${this.map.checked ? 1 : 0}`, ...(this.default.value.trim() === "" ? [] : [`default=${this.default.value.trim()}`])];
    this.view.edit(["add", target, this.name.value.trim(), ...(sub === "" ? [`kind=${this.kind.value}`] : []), ...(this.isVariable ? variable : [])], file => {
      const number = parseInt(index.replace(/^0x/i, ""), 16);
      this.view.reveal(number, sub === "" ? null : Number(sub));
      this.name.value = "";
      if (sub !== "") this.sub.value = String(Number(sub) + 1);
      else if (file.object(number + 1) === undefined) this.index.value = hex(number + 1, 4);
    }, "new name");
  }
}
