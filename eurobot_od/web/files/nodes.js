"use strict";
// The view of nodes: a scan, devices without a node-ID, and for each node how alive it is, its EMCY and the errors that it
// remembers, and with control its NMT commands.

const NMT = ["start", "stop", "pre-operational", "reset", "reset communication"];
const LSS_RATES = [1000, 800, 500, 250, 125, 50, 20, 10];   // kbit/s (CiA 305)

function nmtButton(command, node, words) {  // what may move something asks first, and so does what goes to all
  const act = async sure => { await connection.ask({do: "nmt", command, node, ...sure}); toast(`${command} sent to ${node === "all" ? "all nodes" : node}`); };
  return node === "all" && command === "pre-operational" ? askedTwice(words, () => act({}).catch(error => toast(error.message, true)), {}) : sureButton(words, act, node === "all" ? {} : {"data-armed": "press again"});   // the reason beside it says what
}
const identityText = ([vendor, product, revision, serial]) =>
  `vendor ${hex(vendor, 8)}, product ${hex(product, 8)}, revision ${hex(revision, 8)}, serial ${hex(serial, 8)}`;

class NodeCard {
  constructor(source, node) {
    Object.assign(this, {source, node});
    this.life = lifeSign();
    this.state = h("span");
    this.errors = h("ol", {class: "errors", tabindex: 0, "aria-label": `EMCY of ${node.name}`});
    this.remembered = h("ol", {class: "remembered", tabindex: 0, hidden: true, "aria-label": `errors that ${node.name} remembers`});
    this.control = h("div", {class: "buttons", hidden: true}, ...NMT.map(command => nmtButton(command, node.name, command)));
    this.element = h("section", {class: "card"},
      h("h2", {}, node.name, h("small", {}, ` node ${node.id}`)),
      h("p", {class: "state"}, this.life.element, " ", this.state),
      h("p", {class: "hint"}, `${identityText(node.identity || [null, null, null, null])}; ${node.file || "no file"}`),
      h("h3", {}, "EMCY"), this.errors, this.remembered,
      live ? h("p", {}, h("button", {onclick: () => quietly(this.remember())}, "Error history")) : null, this.control);
  }
  async remember() {
    const {lines} = await request({do: "errors", node: this.node.name});
    this.remembered.replaceChildren(...lines.map(line => h("li", {}, line)));
    show(this.remembered, true);
  }
  show(time) {
    const now = nodeNow(this.source, this.node, time);
    this.element.dataset.life = now.life;
    this.life.set(now.life, now.life === "unknown" && now.age === null ? "never heard" : now.life);
    const ago = now.age === null ? "" : `heard ${Math.max(now.age, 0).toFixed(1)} s ago`;
    say(this.state, [now.age === null ? "" : now.life === "lost" ? `was ${now.state}` : now.state, ago].filter(Boolean).join(", "));
    show(this.control, connection.control);
    const errors = this.source.sortedEvents().filter(each =>
      each.kind === "EMCY" && each.data.node === this.node.name && each.time <= time).slice(-20).reverse();
    const text = errors.length ? errors.map(each => `${each.time.toFixed(2)} s  ${each.text}`) : ["none"];
    if (text.join("\n") !== this.told) {
      this.told = text.join("\n");
      this.errors.replaceChildren(...text.map((line, place) => h("li", {class: errors[place]?.wrong ? "is-wrong" : ""}, line)));
    }
  }
}

const heading = (...names) => h("thead", {}, h("tr", {}, ...names.map(each => h("th", {scope: "col"}, each))));

class ScanTable {                           // the nodes of the bus, each as it is found, with its file
  constructor() {
    this.bar = jobBar("scan");
    this.rows = h("tbody");
    this.missing = h("p", {hidden: true});
    this.table = h("table", {class: "found", hidden: true, "aria-label": "nodes found"}, heading("Node", "Name", "State", "Identity", "File"), this.rows);
    this.start = h("button", {class: "main", onclick: () => quietly(this.scan())}, "Scan");
    this.element = h("div", {}, h("div", {class: "tools"}, this.start, this.bar.element), this.table, this.missing);
  }
  show() {
    const job = this.bar.show();
    this.start.disabled = Boolean(runningJob());
    const told = job ? `${job.number} ${job.rows.length} ${job.state}` : "", isHalfFilled = [...document.querySelectorAll("#view-nodes input[type=text]")].some(each => each.value);
    // A device of which a file is known since is shown by it, also if another browser has found it.
    if (job?.state === "done" && connection.state.learned !== (content.learned ?? 0) && !isHalfFilled) { location.hash = "#nodes"; location.reload(); return; }
    if (!job || told === this.told) return;
    this.told = told;
    show(this.table, true);
    this.rows.replaceChildren(...job.rows.map(each => this.row(each)));
    if (job.state === "done" && !job.rows.length) this.rows.append(h("tr", {}, h("td", {colspan: 5}, "no node answers")));
    const missing = job.result?.missing || [];
    show(this.missing, missing.length > 0);
    this.missing.classList.toggle("is-wrong", missing.length > 0);
    say(this.missing, `missing: ${missing.join(", ")}`);
  }
  async scan() { await request({do: "scan"}); }
  async add(file) {
    const lines = await request({do: "add to library", file: await upload(file)});
    toast(lines.join("; "));
    await this.scan();
  }
  row({node_id: id, name, state, identity, file, further}) {
    const drop = connection.control ? dropZone("no file: drop one", dropped => loudly(this.add(dropped)), DEVICE_FILES) : h("span", {class: "is-wrong"}, "no file");
    const known = file ? h("span", {}, file) : identity ? drop : h("span", {class: "is-wrong"}, "it says no identity");
    return h("tr", {}, h("td", {}, String(id)), h("th", {scope: "row"}, name || "–"), h("td", {}, state || "–"),
      h("td", {class: "hint"}, identity ? identityText(Object.values(identity)) : "–"), h("td", {}, known, further ? h("small", {class: "hint"}, ` ${further}`) : null));
  }
}

class LssTable {                            // devices without a node-ID, each with a form that gives it one
  constructor() {
    this.bar = jobBar("lss", "lss set");
    this.rows = h("tbody");
    this.table = h("table", {class: "found", hidden: true, "aria-label": "devices without a node-ID"}, heading("Device", "File", "Settings"), this.rows);
    this.start = h("button", {onclick: () => quietly(request({do: "find lss"}))}, "Find devices without a node-ID");
    this.done = h("p", {class: "hint", role: "status"});
    this.identity = h("input", {size: 34, "aria-label": "identity of a device that is not found", placeholder: "vendor:product:revision:serial"});
    this.element = h("div", {hidden: true}, h("div", {class: "tools"}, this.start, this.bar.element, this.identity, h("button", {onclick: () => this.name()}, "Name it")), this.table, this.done);
  }
  name() {                                  // a device with an addressing of its own does not answer the search
    const numbers = this.identity.value.trim().split(":").map(Number);
    if (numbers.length !== 4 || numbers.some(each => !Number.isInteger(each))) { toast("an identity has four numbers: vendor:product:revision:serial", true); return; }
    show(this.table, true);
    this.rows.append(this.row({identity: numbers, text: this.identity.value.trim(), file: ""}));
  }
  show() {
    show(this.element, connection.control);
    this.bar.show();
    this.start.disabled = Boolean(runningJob());
    const found = jobs.get("lss"), set = jobs.get("lss set");
    say(this.done, set?.state === "done" ? set.result : "");
    const told = found ? `${found.number} ${found.rows.length} ${found.state}` : "";
    if (!found || told === this.told) return;
    this.told = told;
    show(this.table, found.rows.length > 0);
    this.rows.replaceChildren(...found.rows.map(each => this.row(each)));
    if (found.state === "done" && !found.rows.length) say(this.done, "no device without a node-ID answers");
  }
  row({identity, text, file}) {
    const id = h("input", {type: "text", inputmode: "numeric", size: 4, "aria-label": `node-ID of ${text}`, placeholder: "1..127"});
    const rate = h("select", {"aria-label": `bit rate of ${text}`}, h("option", {value: ""}, "bit rate as it is"), ...LSS_RATES.map(each => h("option", {value: each}, `${each} kbit/s`)));
    const store = h("input", {type: "checkbox"}), delay = h("input", {type: "text", inputmode: "numeric", size: 6, "aria-label": `delay in ms after which ${text} changes its bit rate`, placeholder: "never"});
    const set = async () => {
      const whole = (name, box, least, most) => box.value.trim() === "" ? null : wholeNumber(name, box.value, least, most);
      await connection.ask({do: "set lss", identity, "node-ID": whole("node-ID", id, 1, 127), "bit rate": rate.value ? Number(rate.value) : null, store: store.checked, activate: whole("delay", delay, 0, 65535)});
    };
    return h("tr", {}, h("th", {scope: "row"}, text), h("td", {}, file || "no file"),
      h("td", {class: "buttons"}, id, rate, h("label", {}, store, " store"), h("label", {}, "change it after ms ", delay), h("button", {onclick: () => set().catch(error => toast(error.message, true))}, "Set")));
  }
}

const nodesView = () => perSource(source => {
  const cards = new Map(), list = h("div", {class: "cards"}), tables = live ? [new ScanTable(), new LssTable()] : [];
  return {element: h("div", {}, ...tables.map(each => each.element), list), show(time) {
    for (const each of tables) each.show();
    for (const node of allNodes(source)) {
      if (cards.has(node.name)) continue;
      cards.set(node.name, new NodeCard(source, node));
      list.append(...allNodes(source).filter(each => cards.has(each.name)).map(each => cards.get(each.name).element));
    }
    for (const card of cards.values()) card.show(time);
  }};
});
