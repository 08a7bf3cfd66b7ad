"use strict";
// The view of checks: suites are started with their options, their steps shown as they run, the red ones with their
// frames, and the run compared with the one before it.

const TIERS = {reading: "only read", reversible: "also reset, write PDOs and own values", destructive: "also write other values, and store"};
const RED = ["FAILED", "bus failed", "interrupted"];

class CheckRun {                            // the steps of a run, as they come; red ones are open
  constructor() {
    this.bar = jobBar("check");
    this.counts = h("span", {class: "counts"});
    this.all = h("input", {type: "checkbox", onchange: () => { this.told = ""; this.drawn = 0; this.list.replaceChildren(); stale = true; }});
    this.list = h("div", {class: "steps"});
    this.end = h("div", {class: "run-end"});
    this.element = h("div", {}, h("div", {class: "tools"}, this.counts, this.bar.element, h("label", {}, this.all, " show green and skipped steps, too")), this.end, this.list);
    this.drawn = 0;
  }
  show() {
    const job = this.bar.show();
    const told = job ? `${job.number} ${job.rows.length} ${job.state}` : "";
    if (!job || told === this.told) return;
    if (job.number !== this.number || job.rows.length < this.drawn) { this.number = job.number; this.drawn = 0; this.list.replaceChildren(); }
    this.told = told;
    const counts = new Map();
    for (const each of job.rows) if (each.status) counts.set(each.status, (counts.get(each.status) || 0) + 1);
    say(this.counts, [...counts].map(([status, count]) => `${count} ${status}`).join(", "));
    this.counts.classList.toggle("is-wrong", counts.has("FAILED"));
    this.list.append(...job.rows.slice(this.drawn).map(each => this.row(each)).filter(Boolean));
    this.drawn = job.rows.length;
    this.end.replaceChildren(...(job.result ? this.summary(job.result) : []));
  }
  forget() { for (const each of [this.list, this.end, this.counts]) each.replaceChildren(); }
  row({suite, step, status, seconds, why}) {
    if (suite) return h("h3", {}, suite);
    const red = RED.includes(status);
    if (!red && !this.all.checked) return null;
    return h("details", {class: `incident ${red ? "is-error" : ""}`, open: red}, h("summary", {}, h("b", {class: "level"}, status), " ", step, h("small", {class: "hint"}, ` ${(1000 * seconds).toFixed(1)} ms`)),
      why.length ? h("pre", {tabindex: 0}, why.join("\n")) : null);
  }
  summary({summary, notes, files, before, changes}) {
    const names = {html: "Report", xml: "JUnit", txt: "CTT", json: "JSON"};
    const links = files.map(file => h("a", {href: `/report/${file}`, download: file}, names[file.split(".").at(-1)]));
    const compared = before ? h("details", {class: "compared", open: changes.length > 0 && changes.length < 20}, h("summary", {}, changes.length ? `${changes.length} steps ended otherwise than in ${before}` : `as in ${before}`),
      h("ul", {}, ...changes.map(each => h("li", {}, `${each.step}: ${each.before} → ${each.after}`)))) : null;
    const wrong = [...RED, "NOTHING"].some(each => summary.includes(each));
    return [h("p", {class: `verdict ${wrong ? "is-wrong" : "is-good"}`}, summary), h("p", {class: "buttons"}, ...links), ...notes.map(each => h("p", {}, each)), compared].filter(Boolean);
  }
}

class ChecksView {
  constructor(source) {
    this.node = h("select", {"aria-label": "node"}, ...source.nodes.map(node => h("option", {}, node.name)));
    this.suites = h("select", {"aria-label": "suites", onchange: () => { stale = true; }}, ...["CiA 301", "CiA 401", "CiA 402"].map(each => h("option", {}, each)));
    this.tier = h("select", {"aria-label": "how far it goes"}, ...Object.entries(TIERS).map(([tier, words]) => h("option", {value: tier}, words)));
    this.steps = h("input", {type: "search", size: 20, "aria-label": "only steps with this in their name", placeholder: "all steps"});
    this.start = sureButton("Start", sure => this.begin(sure), {class: "main"});
    this.motion = h("input", {size: 12, "aria-label": "also move the motor: distance@velocity", placeholder: "no motion; 2000@100"});
    this.switches = h("input", {type: "checkbox"});
    this.outputs = h("label", {}, this.switches, " also switch the outputs");
    [this.from, this.to] = ["from", "to"].map(each => h("input", {size: 4, inputmode: "decimal", "aria-label": `${each} second`, placeholder: each === "from" ? "0" : "end"}));
    this.recorded = h("span", {hidden: true}, h("button", {onclick: () => loudly(this.make())}, "Make the recording a suite"), " from s ", this.from, " to ", this.to);
    this.run = new CheckRun();
    this.form = h("div", {class: "tools"}, this.node, this.suites, this.tier, this.motion, this.outputs, this.steps, this.start, this.recorded);
    this.element = h("div", {}, this.form, this.run.element);
  }
  async begin(sure) {
    this.run.forget();                      // a run that is refused would show the one before as its own
    const also = {...(this.motion.hidden ? {} : {motion: this.motion.value.trim()}), ...(this.outputs.hidden ? {} : {outputs: this.switches.checked})};
    await connection.ask({do: "check", node: this.node.value, suites: this.suites.value, tier: this.tier.value, steps: this.steps.value.trim(), ...also, ...sure});
  }
  async make() {                            // what was done becomes a test
    const name = await connection.ask({do: "suite of recording", node: this.node.value, from: Number(this.from.value), to: Number(this.to.value)});
    await this.load();
    this.suites.value = name;
    toast(`${name} is made`);
  }
  async load() {
    this.loaded = true;
    const files = await quietly(connection.ask({do: "suites"})) || [], known = [...this.suites.options].map(each => each.value);
    this.suites.append(...files.filter(each => !known.includes(each)).map(each => h("option", {}, each)));
  }
  show() {
    if (!this.loaded && connection.alive) this.load();
    show(this.form, connection.control);
    show(this.recorded, Boolean(connection.state && connection.state.recording.file && !connection.state.recording.on));
    show(this.tier, this.suites.value.startsWith("CiA "));
    show(this.motion, this.suites.value === "CiA 402");
    show(this.outputs, this.suites.value === "CiA 401");
    this.start.querySelector("button").disabled = Boolean(runningJob()) || !this.node.value;
    this.run.show();
  }
}
const checksView = () => new ChecksView(sources[0]);
