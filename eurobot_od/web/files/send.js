"use strict";
// The view to send: messages by a form made of their mapping, frames as bytes; lists of them with periods, bursts and
// triggers, which are started together.
//
// Rule of this file: nothing has a value that nobody has typed or the file does not give. What may move something is
// asked twice: the server says what that is, and why. What goes on by itself ends with the page.

const isPlan = message => content.panels.some(each => each.plan === message.name);

class MessageForm {                         // the fields of a message; `request` throws what is wrong with them
  constructor(message) {
    this.message = message;
    this.inputs = message.fields.filter(field => !field.unmapped).map(field => ({field, input: this.input(field)}));
    this.element = h("div", {class: "fields"}, ...this.inputs.map(({field, input}) => h("label", {},
      `${field.name}${field.unit ? ` in ${field.unit}` : ""}`, input, h("small", {id: `allowed-${field.name}`}, field.allowed))));
  }
  input(field) {
    const words = Object.values(field.words), described = {"aria-describedby": `allowed-${field.name}`};
    if (!("low" in field) && words.length) {
      return h("select", described, field.default === undefined ? h("option", {value: ""}, "choose") : null,
        ...words.map(word => h("option", {selected: word === field.default}, word)));
    }
    const value = field.default === undefined ? "" : String(field.default).split(" ")[0];
    return h("input", {...described, type: "text", inputmode: "text", autocomplete: "off", value});
  }
  set(values) { for (const {field, input} of this.inputs) input.value = values[field.name] ?? ""; }
  request() {
    const empty = this.inputs.filter(({input}) => input.value.trim() === "").map(({field}) => field.name);
    if (empty.length) throw new Error(`not sent: ${empty.join(", ")} ${empty.length === 1 ? "is" : "are"} empty`);
    return {do: "send", message: this.message.name, fields: Object.fromEntries(this.inputs.map(({field, input}) => [field.name, input.value.trim()]))};
  }
}

class FrameForm {                           // a frame as it is: an identifier and bytes
  constructor(identifier = "", data = "") {
    this.identifier = h("input", {type: "text", size: 9, autocomplete: "off", value: identifier, "aria-label": "identifier, hexadecimal", placeholder: "1A5"});
    this.bytes = h("input", {type: "text", size: 26, autocomplete: "off", value: data, "aria-label": "bytes, hexadecimal", placeholder: "01 02 FF"});
    this.element = h("div", {class: "fields"}, h("label", {}, "identifier", this.identifier, h("small", {}, "000..7FF, hexadecimal")),
      h("label", {}, "data", this.bytes, h("small", {}, "up to 8 bytes, hexadecimal; empty for none; R and a length for a remote frame: R1")));
  }
  request() {
    if (this.identifier.value.trim() === "") throw new Error("not sent: the identifier is empty");
    return {do: "send frame", frame: `${this.identifier.value.trim().toUpperCase().padStart(3, "0")}#${this.bytes.value.replace(/\s/g, "").toUpperCase()}`};
  }
}

const wordsOf = ({send, fields, period, burst, gap, trigger}) => [
  [send, Object.entries(fields || {}).map(([name, value]) => `${name}=${value}`).join(", ")].filter(Boolean).join(" "),
  burst ? `${burst} at once${gap ? `, ${gap} apart` : ""}` : "", period ? `each ${period}` : "", trigger ? `on ${trigger}` : ""].filter(Boolean).join(" · ");
const onceOf = ({send, fields}) => send.includes("#") ? {do: "send frame", frame: send} : {do: "send", message: send, fields: fields || {}};

class Timing {                              // when a row is sent, besides once: `row` throws what is wrong with it
  constructor() {
    const box = (words, placeholder, size) => h("input", {type: "text", size, autocomplete: "off", "aria-label": words, placeholder});
    this.period = box("period in ms, empty for once", "once", 6);
    this.burst = box("frames at once", "1", 4);
    this.gap = box("ms between the frames of a burst", "0", 4);
    this.trigger = box("trigger", "at the start; 185, motor.TPDO1.speed becomes > 100", 34);
    this.element = h("div", {class: "buttons"}, h("label", {}, "period in ms", this.period), h("label", {}, "burst", this.burst), h("label", {}, "gap in ms", this.gap), h("label", {}, "trigger", this.trigger));
  }
  row({do: _, frame, message, fields}) {
    const ms = (name, box) => box.value.trim() === "" ? {} : {[name]: `${wholeNumber(name, box.value, 5, 60000)} ms`};
    const burst = this.burst.value.trim() === "" ? {} : {burst: wholeNumber("burst", this.burst.value, 1, 1000)};
    const trigger = this.trigger.value.trim();
    return {send: frame ?? message, ...(fields ? {fields} : {}), ...ms("period", this.period), ...burst, ...ms("gap", this.gap), ...(trigger ? {trigger} : {})};
  }
}

class SendList {                            // rows that are sent one by one or together, kept in this browser, and by name in the server's folder
  constructor() {
    this.rows = kept("send rows", []);
    this.own = Math.random().toString(36);  // by which the server's lists are known to be ours
    this.list = h("ol", {class: "send-list", "aria-label": "rows of the list"});
    this.running = h("ul", {class: "send-list", "aria-label": "lists that are sent"});
    this.all = h("span", {});
    this.names = h("select", {"aria-label": "kept lists"});
    this.name = h("input", {size: 16, "aria-label": "name of the list", placeholder: "name"});
    this.keeping = h("form", {class: "buttons", onsubmit: event => { event.preventDefault(); loudly(this.keep()); }}, this.names,
      h("button", {type: "button", onclick: () => loudly(this.open())}, "Open"), h("button", {type: "button", onclick: () => loudly(this.forget())}, "Remove"), this.name, h("button", {}, "Keep list"));
    this.element = h("div", {}, h("h3", {}, "List"), this.running, this.list, h("div", {class: "buttons"}, this.all), this.keeping,
      h("p", {class: "hint"}, "What is sent ends with this page, or with STOP. A kept list is a file for the command send."));
    this.draw();
  }
  change(rows) {
    this.rows = rows;
    keep("send rows", rows);
    this.draw();
  }
  add(row) { this.change([...this.rows, row]); }
  async load() {
    this.loaded = true;
    this.names.replaceChildren(...(await connection.ask({do: "lists"})).map(each => h("option", {}, each)));
    if (this.name.value) this.names.value = this.name.value;
    for (const each of [this.names, ...this.keeping.querySelectorAll("button[type=button]")]) show(each, this.names.options.length > 0);
  }
  async keep() {
    await connection.ask({do: "keep list", name: this.name.value.trim(), rows: this.rows});
    await this.load();
    toast(`${this.name.value.trim()} is kept`);
  }
  async open() {
    this.change(await connection.ask({do: "list", name: this.names.value}));
    this.name.value = this.names.value;
  }
  async forget() {
    await connection.ask({do: "remove list", name: this.names.value});
    await this.load();
  }
  async begin(key, title, rows, sure) { await connection.ask({do: "begin list", key: `${this.own} ${key}`, title, rows, ...sure}); }
  button(words, rows, act) {                // what carries out a plan is always asked twice, here and not by the server
    return rows.some(each => isPlan({name: each.send})) ? askedTwice(words, () => loudly(act({})), {}) : sureButton(words, act);
  }
  draw() {
    const once = async (row, sure) => toast(`sent ${await connection.ask({...onceOf(row), ...sure})}`);
    this.list.replaceChildren(...this.rows.map((row, place) => h("li", {}, h("span", {}, wordsOf(row)), h("span", {class: "buttons"}, this.button("Send", [row], sure => once(row, sure)),
      row.period || row.burst || row.trigger ? this.button("Start", [row], sure => this.begin(`row ${Math.random()}`, wordsOf(row), [row], sure)) : null,
      h("button", {onclick: () => this.change(this.rows.filter((_, each) => each !== place)), "aria-label": `remove ${wordsOf(row)}`}, "×")))));
    this.all.replaceChildren(this.rows.length ? this.button("Start all", this.rows, sure => this.begin("all", this.name.value.trim() || "the list", this.rows, sure)) : "");
  }
  show() {
    if (!this.loaded && connection.alive && connection.control) loudly(this.load());
    const all = Object.entries(connection.state?.lists || {}), told = JSON.stringify(all);
    if (told === this.told) return;
    const keys = all.map(([key, {ended}]) => `${key} ${ended}`).join();
    if (keys !== this.keys) {
      this.keys = keys;
      this.running.replaceChildren(...all.map(([key, {title, ended}]) => h("li", {class: ended ? "" : "running"}, h("span", {}, title), h("span", {class: "hint"}), " ",
        ended ? null : h("button", {onclick: () => quietly(request({do: "end list", key}))}, "End"))));
    }
    this.told = told;
    all.forEach(([, {sent, ended}], place) => say(this.running.children[place].querySelector(".hint"), `${sent} sent${ended ? `; ${ended}` : ""}`));
  }
}

function sendView() {
  const source = sources[0], RAW = "(a frame as bytes)", SYNC = "(SYNC)";
  const place = h("div", {}), answer = h("output", {class: "answer"}), list = new SendList();
  // It opens on nothing: what a stray click could send is then nothing, too.
  const chosen = h("select", {"aria-label": "message", onchange: () => build()}, h("option", {value: ""}, "choose a message"),
    ...[RAW, SYNC, ...source.messages.keys()].map(name => h("option", {}, name)));
  const timing = new Timing();
  const once = sureButton("Send", sure => send(sure), {class: "main", type: "submit"});
  const keepIt = h("button", {type: "button", onclick: () => tried(() => {
    list.add(timing.row(form.request()));
    return "in the list";
  })}, "Add to list");
  let form = null, careful = null;
  const isMoving = () => Boolean(form.message && isPlan(form.message));
  async function tried(act) {
    try {
      say(answer, await act());
      answer.classList.remove("is-wrong");
    } catch (error) {
      if (error.asks) throw error;
      say(answer, error.message);
      answer.classList.add("is-wrong");
    }
  }
  const send = sure => tried(async () => `sent ${await connection.ask({...form.request(), ...sure})}`);
  function build() {
    const message = source.messages.get(chosen.value);
    form = chosen.value === RAW ? new FrameForm() : chosen.value === SYNC ? new FrameForm("080") : message ? new MessageForm(message) : null;
    careful = form && isMoving() ? askedTwice("Send", () => send({}), {class: "main", type: "button"}) : null;
    say(answer, careful ? "This moves something: Send has to be pressed twice." : "");
    answer.classList.remove("is-wrong");
    once.querySelector("button").disabled = keepIt.disabled = !form;
    show(once, !careful);
    acts.replaceChildren(...[once, careful, keepIt].filter(Boolean));
    place.replaceChildren(...(form ? [form.element, timing.element] : []));
  }
  const acts = h("div", {class: "buttons"});
  build();
  const submit = event => {                 // Enter in a field
    event.preventDefault();
    if (form) (careful || once.querySelector("button")).click();
  };
  const all = h("div", {class: "buttons"}, ...NMT.slice(0, 4).map(command => nmtButton(command, "all", `${command} all nodes`)));
  return {element: h("div", {class: "card"}, h("form", {class: "send", novalidate: true, onsubmit: submit},
    h("label", {}, "Message", chosen), place, acts, answer), list.element, h("h3", {}, "NMT"), all), show: () => list.show()};
}
