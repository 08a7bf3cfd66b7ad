"use strict";
// The page that begins with nothing: connect, simulate, open a log. One choice ends it, and the server shows the page of
// that at the same address.

const connection = {
  async ask(what) {
    const answer = await fetch("/start", {method: "POST", body: JSON.stringify(what)}).then(found => found.json());
    if ("error" in answer) throw new Error(answer.error);
    return answer.ok;
  },
};
async function choose(what, button) {       // the server ends this page once the choice holds
  button.disabled = true;
  try { await connection.ask(what); toast("opening ..."); } catch (error) { button.disabled = false; toast(error.message, true); }
}

class Connecting {
  constructor() {
    this.interface = h("input", {size: 12, "aria-label": "interface of python-can", placeholder: "socketcan"});
    this.channel = h("input", {size: 22, "aria-label": "channel", placeholder: "can0"});
    this.rate = h("select", {"aria-label": "bit rate"}, h("option", {value: ""}, "bit rate as configured"),
      ...content.start.rates.map(each => h("option", {value: each}, `${each / 1000} kbit/s`)));
    this.found = h("div", {class: "buttons"}, h("span", {class: "hint"}, "looking for adapters ..."));
    const connect = h("button", {class: "main", onclick: () => choose({do: "connect", ...this.bus, bit_rate: this.rate.value ? Number(this.rate.value) : null}, connect)}, "Connect");
    this.listen = h("button", {onclick: () => this.findOut()}, "Listen and find out");
    this.element = h("section", {class: "card"}, h("h2", {}, "Connect to a bus"), this.found,
      h("div", {class: "buttons"}, this.interface, this.channel, this.rate, connect, this.listen),
      h("p", {class: "hint"}, "Listening sends nothing: each bit rate is tried with an adapter that stays silent."));
    const {last} = content.start;           // the bus of the last time
    if (last) { this.interface.value = last.interface; this.channel.value = last.channel; this.rate.value = last.bit_rate || ""; }
    this.load();
  }
  get bus() { return {interface: this.interface.value.trim(), channel: this.channel.value.trim()}; }
  async load() {
    const all = await connection.ask({do: "adapters"}).catch(error => { toast(error.message, true); return []; });
    this.found.replaceChildren(...(all.length ? all.map(each => h("button", {onclick: () => { this.interface.value = each.interface; this.channel.value = each.channel; }},
      `${each.interface} ${each.channel}${each.is ? ` (${each.is})` : ""}`)) : [h("span", {class: "hint"}, "No adapter is found: name one, or simulate a bus.")]));
    if (all.length === 1 && !this.interface.value) this.found.firstChild.click();
  }
  async findOut() {
    this.listen.disabled = true;
    try {
      for (const rate of content.start.rates) {
        toast(`listening at ${rate / 1000} kbit/s ...`);
        const count = await connection.ask({do: "listen", ...this.bus, bit_rate: rate});
        if (!count) continue;
        this.rate.value = String(rate);
        toast(`${count} frames at ${rate / 1000} kbit/s`);
        return;
      }
      toast("nothing was heard at any bit rate", true);
    } catch (error) { toast(error.message, true); } finally { this.listen.disabled = false; }
  }
}

class Simulating {
  constructor() {
    this.chosen = [];
    this.known = h("select", {"aria-label": "device of the library"});
    this.list = h("ul", {class: "send-list", "aria-label": "simulated devices"});
    this.begin = h("button", {class: "main", onclick: () => choose({do: "simulate", devices: this.chosen}, this.begin)}, "Simulate");
    this.words = h("p", {class: "hint"});
    this.element = h("section", {class: "card"}, h("h2", {}, "Simulate a bus"),
      h("div", {class: "buttons"}, this.known, h("button", {onclick: () => this.add()}, "Add"), this.begin), this.list, this.words,
      dropZone("drop an EDS, DCF or XDD into the library", file => loudly(this.keep(file)), DEVICE_FILES));
    this.load();
    this.draw();
  }
  async load() {
    const all = await quietly(connection.ask({do: "devices"})) || [];
    this.known.replaceChildren(...all.map(({file, name}) => h("option", {value: file}, `${name} (${file.split(/[\\/]/).at(-1)})`)));
    say(this.words, all.length ? `The library has ${all.length === 1 ? "1 device" : `${all.length} devices`}.` : "The library has no device yet: drop its file here.");
  }
  async keep(file) {
    const lines = await connection.ask({do: "add to library", file: await upload(file)});
    toast(lines.join("; "));
    await this.load();
  }
  add() {
    if (!this.known.value) { toast("the library has no device yet: drop its file", true); return; }
    const used = this.chosen.map(each => each.node_id), free = [...Array(127).keys()].map(each => each + 1).find(each => !used.includes(each));
    this.chosen.push({file: this.known.value, node_id: free, name: this.known.selectedOptions[0].textContent});
    this.draw();
  }
  draw() {
    this.begin.disabled = !this.chosen.length;
    this.list.replaceChildren(...this.chosen.map(each => h("li", {}, h("label", {}, "node ", h("input", {type: "number", min: 1, max: 127, value: each.node_id,
      "aria-label": `node-ID of ${each.name}`, onchange: event => { each.node_id = Number(event.target.value); }})), h("span", {}, each.name),
    h("button", {"aria-label": `remove ${each.name}`, onclick: () => { this.chosen = this.chosen.filter(other => other !== each); this.draw(); }}, "×"))));
  }
}

function opening() {
  const list = h("div", {class: "buttons"});
  const load = async () => list.replaceChildren(...(await quietly(connection.ask({do: "logs"})) || []).slice(0, 12).map(log => {
    const open = h("button", {onclick: () => choose({do: "open", log}, open)}, log);
    return open;
  }));
  const drop = dropZone("drop a log", async file => { toast(`reading ${file.name} ...`); await loudly(upload(file).then(name => connection.ask({do: "open", file: name}))); });
  load();
  const edit = h("button", {onclick: () => choose({do: "edit"}, edit)}, "Edit device files");
  return h("section", {class: "card"}, h("h2", {}, "Open a log"), h("div", {class: "buttons"}, drop), list, h("h2", {}, "Without a bus"), h("div", {class: "buttons"}, edit));
}

function start() {
  const card = content.start.act ? [new Connecting().element, new Simulating().element, opening()]
    : [h("p", {}, "This page is read-only: start the server with --control.")];
  document.body.append(h("header", {}, h("div", {class: "top"}, h("h1", {}, "CANopen workbench"), h("span", {class: "hint"}, content.start.folder))),
    h("main", {}, h("div", {class: "start"}, ...card)), toastLine);
  document.body.classList.add("beginning");
  document.body.dataset.time = "0";
  watchServer();
}
document.addEventListener("DOMContentLoaded", start);
