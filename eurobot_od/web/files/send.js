"use strict";
// The view to send: messages by a form made of their mapping, frames as bytes, either of them again and again; lists
// that this browser keeps.
//
// Rule of this file: nothing has a value that nobody has typed or the file does not give. What may move something is
// asked twice: the server says what that is, and why. What goes on by itself ends with the page: it says each second that
// it is still wanted.

const STILL = 1000;                         // ms between two words that a frame is still to be sent
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
      h("label", {}, "data", this.bytes, h("small", {}, "up to 8 bytes, hexadecimal; empty for none")));
  }
  request() {
    if (this.identifier.value.trim() === "") throw new Error("not sent: the identifier is empty");
    return {do: "send frame", frame: `${this.identifier.value.trim().toUpperCase().padStart(3, "0")}#${this.bytes.value.replace(/\s/g, "").toUpperCase()}`};
  }
}

const wordsOf = request => request.frame ?? `${request.message} ${Object.entries(request.fields).map(([name, value]) => `${name}=${value}`).join(", ")}`;

class SendList {                            // what is kept to be sent again: once, or with a period
  constructor() {
    this.items = kept("send list", []);
    this.cycles = new Map();                // of the items that are sent again and again, what they were asked as
    this.list = h("ol", {class: "send-list", "aria-label": "kept messages and frames"});
    this.element = h("div", {}, h("h3", {}, "List"), h("p", {class: "hint"}, "Kept in this browser. What is sent again and again ends with this page, or with STOP."), this.list);
    this.draw();
    setInterval(() => this.again(), STILL);
  }
  add(request, period) {
    this.items.push({request, period});
    keep("send list", this.items);
    this.draw();
  }
  remove(item) {
    this.end(item);
    this.items = this.items.filter(each => each !== item);
    keep("send list", this.items);
    this.draw();
  }
  async begin(item, sure) {
    const {request: {do: _, ...what}, period} = item, key = `page ${this.items.indexOf(item)} ${Math.random()}`;
    await connection.ask({do: "cycle", key, period, ...what, ...sure});
    toast(`sent each ${period} ms`);
    this.cycles.set(item, {key, period, ...what, ...sure});
    this.draw();
  }
  end(item) {
    const cycle = this.cycles.get(item);
    this.cycles.delete(item);
    if (cycle) quietly(connection.ask({do: "end cycle", key: cycle.key}));
    this.draw();
  }
  again() {
    for (const [item, cycle] of this.cycles) {
      connection.ask({do: "cycle", again: true, ...cycle}).catch(error => { this.cycles.delete(item); toast(`${wordsOf(item.request)}: ${error.message}`, true); this.draw(); });
    }
  }
  draw() {
    const once = async (item, sure) => toast(`sent ${await connection.ask({...item.request, ...sure})}`);
    const act = (item, words, done) => item.request.message && isPlan({name: item.request.message})
      ? askedTwice(words, () => done(item, {}).catch(error => toast(error.message, true)), {}) : sureButton(words, sure => done(item, sure));
    this.list.replaceChildren(...this.items.map(item => h("li", {class: this.cycles.has(item) ? "running" : ""}, h("span", {}, wordsOf(item.request)),
      h("span", {class: "buttons"}, act(item, "Send", once), !item.period ? null
        : this.cycles.has(item) ? h("button", {class: "main", onclick: () => this.end(item)}, `End (each ${item.period} ms)`)
          : act(item, `Each ${item.period} ms`, (each, sure) => this.begin(each, sure)),
      h("button", {onclick: () => this.remove(item), "aria-label": `remove ${wordsOf(item.request)}`}, "×")))));
  }
}

function sendView() {
  const source = sources[0], RAW = "(a frame as bytes)", SYNC = "(SYNC)";
  const place = h("div", {}), answer = h("output", {class: "answer"}), list = new SendList();
  // It opens on nothing: what a stray click could send is then nothing, too.
  const chosen = h("select", {"aria-label": "message", onchange: () => build()}, h("option", {value: ""}, "choose a message"),
    ...[RAW, SYNC, ...source.messages.keys()].map(name => h("option", {}, name)));
  const period = h("input", {type: "text", inputmode: "numeric", size: 6, "aria-label": "period in ms, empty for once", placeholder: "once"});
  const once = sureButton("Send", sure => send(sure), {class: "main", type: "submit"});
  const keepIt = h("button", {type: "button", onclick: () => tried(() => {
    list.add(form.request(), period.value.trim() === "" ? 0 : wholeNumber("period", period.value, 5, 60000));
    return "kept in the list";
  })}, "Keep in list");
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
    acts.replaceChildren(...[once, careful, h("label", {}, "period in ms", period), keepIt].filter(Boolean));
    place.replaceChildren(...(form ? [form.element] : []));
  }
  const acts = h("div", {class: "buttons"});
  build();
  const submit = event => {                 // Enter in a field
    event.preventDefault();
    if (form) (careful || once.querySelector("button")).click();
  };
  const all = h("div", {class: "buttons"}, ...NMT.slice(0, 4).map(command => nmtButton(command, "all", `${command} all nodes`)));
  return {element: h("div", {class: "card"}, h("form", {class: "send", novalidate: true, onsubmit: submit},
    h("label", {}, "Message", chosen), place, acts, answer), list.element, h("h3", {}, "NMT"), all), show() {}};
}
