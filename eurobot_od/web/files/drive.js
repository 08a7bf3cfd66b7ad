"use strict";
// Drives of CiA 402: the state machine with the state that a drive is in, where it is and how fast, and its buttons.
//
// Rule of this file: a jog goes on only while its button is held, and the page keeps telling the server so.

const driven = live ? sources[0].nodes.filter(each => each.drive) : [];

const BOX = {width: 216, height: 44};
const PLACES = {                            // as CiA 402 draws it: left what one passes when enabling, right the others
  "Not ready to switch on": [170, 30], "Switch on disabled": [170, 120], "Ready to switch on": [170, 210],
  "Switched on": [170, 300], "Operation enabled": [170, 390],
  "Fault reaction active": [480, 30], "Fault": [480, 120], "Quick stop active": [480, 390],
};
const FAULTY = ["Fault", "Fault reaction active"];

function edge([x, y], [dx, dy]) {           // where a line from the middle of a box leaves it
  const share = Math.min(BOX.width / 2 / (Math.abs(dx) || 1e-9), BOX.height / 2 / (Math.abs(dy) || 1e-9));
  return [x + dx * share, y + dy * share];
}
const drawn = (path, [x, y], number) => [
  s("path", {class: "arrow", d: path, "marker-end": "url(#tip)"}), s("text", {class: "number", x, y}, String(number))];
function arrowOf({number, before, after}) {
  const one = PLACES[before], two = PLACES[after], dx = two[0] - one[0], dy = two[1] - one[1];
  const rows = Math.abs(dy) / 90;
  let path, label;
  if (dx === 0 && rows > 1) {               // past the boxes between
    const x = one[0] - BOX.width / 2, bend = x - 34 * rows, middle = (one[1] + two[1]) / 2;
    path = `M${x} ${one[1]}Q${bend} ${middle} ${x - 3} ${two[1]}`;
    label = [(x + bend) / 2, middle];
  } else {
    if (dx !== 0 && dy !== 0) {             // into the side: the straight line would cut another box
      const to = [two[0] + BOX.width / 2 + 2, two[1] + 10], from = [one[0], one[1] - BOX.height / 2];
      return drawn(`M${from}L${to}`, [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2], number);
    }
    // There and back are two arrows beside each other.
    const aside = dx === 0 ? [dy > 0 ? -24 : 24, 0] : dy === 0 ? [0, dx > 0 ? -9 : 9] : [0, 0];
    const [from, to] = [edge(one, [dx, dy]), edge(two, [-dx, -dy])].map(([x, y]) => [x + aside[0], y + aside[1]]);
    path = `M${from}L${to}`;
    label = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
  }
  return drawn(path, label, number);
}

function machineOf(machine) {
  const boxes = new Map(machine.states.map(({name}) => [name, s("g", {},
    s("rect", {x: PLACES[name][0] - BOX.width / 2, y: PLACES[name][1] - BOX.height / 2, width: BOX.width, height: BOX.height, rx: 8}),
    s("text", {x: PLACES[name][0], y: PLACES[name][1]}, name))]));
  const tip = s("marker", {id: "tip", viewBox: "0 0 10 10", refX: 9, refY: 5, markerWidth: 8, markerHeight: 8, orient: "auto"},
    s("path", {class: "tip", d: "M0 0L10 5L0 10Z"}));
  const element = s("svg", {class: "machine", viewBox: "4 0 588 420", role: "img"}, s("defs", {}, tip),
    ...machine.arrows.flatMap(arrowOf), ...boxes.values());
  return {element, show(state) {
    element.setAttribute("aria-label", `state machine of CiA 402, now: ${state || "not known"}`);
    for (const [name, box] of boxes) {
      box.classList.toggle("now", name === state);
      box.classList.toggle("faulty", name === state && FAULTY.includes(name));
    }
  }};
}

class AxisView {
  constructor(source, node, number) {
    Object.assign(this, {source, node, number, keys: {}, holding: 0, said: ""});
    this.machine = machineOf(source.machine);
    this.state = h("strong", {class: "drive-state", role: "status", "aria-live": "assertive"});
    this.facts = h("p", {class: "facts"});
    this.plots = [new Plot(), new Plot()];
    this.velocity = h("input", {type: "number", step: 1, min: 0, value: node.drive.velocity});
    const command = name => h("button", {class: name === "quick stop" ? "halt" : "",
      onclick: () => quietly(request({do: "drive", ...this.named, command: name}, `${name}: done`))},
    name === "quick stop" ? "STOP this drive" : name[0].toUpperCase() + name.slice(1));
    this.control = h("div", {hidden: true},
      h("div", {class: "buttons"}, ...["enable", "disable", "fault reset", "halt", "quick stop"].map(command)),
      h("h4", {}, "Jog"), h("div", {class: "buttons jog"}, this.jogButton(-1, "◀ Jog −"), this.jogButton(1, "Jog + ▶"),
        h("label", {}, "velocity", this.velocity), h("p", {class: "hint"}, "It turns while the button is held.")));
    this.element = h("div", {class: "drive"}, h("div", {}, h("p", {class: "facts"}, this.state), this.machine.element),
      h("div", {}, this.facts, this.control, ...this.plots.map(each => each.element)));
  }
  get named() { return {node: this.node.name, axis: this.number + 1}; }
  jogButton(sign, text) {
    const press = event => { event.preventDefault(); button.setPointerCapture?.(event.pointerId); this.begin(button, sign); };
    const end = () => this.end(button);
    const key = event => [" ", "Enter"].includes(event.key);
    const button = h("button", {onpointerdown: press, onpointerup: end, onpointercancel: end, onlostpointercapture: end, onblur: end,
      oncontextmenu: event => event.preventDefault(),
      onkeydown: event => { if (key(event)) { event.preventDefault(); if (!event.repeat) this.begin(button, sign); } },
      onkeyup: event => { if (key(event)) end(); }}, text);
    return button;
  }
  begin(button, sign) {
    if (this.holding || !connection.control) return;
    button.classList.add("held");
    this.holding = setInterval(() => quietly(connection.ask({do: "hold", ...this.named})), HOLDING);
    request({do: "jog", ...this.named, velocity: sign * Math.round(Number(this.velocity.value))}).catch(() => this.end(button));
  }
  end(button) {
    if (!this.holding) return;
    clearInterval(this.holding);
    this.holding = 0;
    button.classList.remove("held");
    quietly(request({do: "drive", ...this.named, command: "halt"}));
  }
  async watch() {                           // asked for again while it is looked at, as the plots do
    if (!connection.up) return;
    for (const [name, object] of Object.entries(this.node.drive.axes[this.number])) {
      const key = await quietly(connection.ask({do: "watch", node: this.node.name, object}));
      if (!key || this.keys[name]) continue;
      this.keys[name] = key;
      const plot = this.plots[["position", "velocity"].indexOf(name)];
      if (plot) { plot.series = [Object.assign(new ObjectSeries(this.source, key, null), {name})]; plot.build(); }
    }
    stale = true;
  }
  value(name) {
    const {values, trouble} = this.source.objects.get(this.keys[name]) || {values: [], trouble: ""};
    return trouble ? undefined : values.at(-1);
  }
  show(time) {
    const word = this.value("statusword"), {states, modes} = this.source.machine;
    const state = word === undefined ? "" : states.find(each => (word & each.mask) === each.bits)?.name || "no state";
    const trouble = (this.source.objects.get(this.keys.statusword) || {}).trouble;
    const faulty = FAULTY.includes(state), code = this.value("error");
    say(this.state, trouble ? "It does not answer." : faulty && code !== undefined ? `${state}: error code ${hex(code, 4)}` : state || "…");
    this.state.classList.toggle("is-wrong", faulty || Boolean(trouble));
    this.machine.show(state);
    const mode = this.value("mode");
    say(this.facts, [
      `position ${this.value("position") ?? "–"}`, `velocity ${this.value("velocity") ?? "–"}`,
      `mode ${modes[mode] || mode || "–"}`, word === undefined ? "" : `statusword ${hex(word, 4)}`].filter(Boolean).join(" · "));
    show(this.control, connection.control);
    for (const each of this.plots) each.update(time);
  }
}
const HOLDING = 150;                        // ms between two words that a button is still held

if (driven.length) views.push({name: "drives", title: "Drives", make() {
  const all = driven.flatMap(node => node.drive.axes.map((_, number) => new AxisView(sources[0], node, number)));
  const chosen = h("select", {"aria-label": "drive", onchange: () => choose()}, ...all.map((each, place) =>
    h("option", {value: place}, each.node.name + (each.node.drive.axes.length > 1 ? `, axis ${each.number + 1}` : ""))));
  const place = h("div", {});
  let shown = all[0], asked = -Infinity;
  function choose() {
    shown = all[Number(chosen.value)];
    place.replaceChildren(shown.element);
    asked = -Infinity;
    stale = true;
  }
  choose();
  return {element: h("div", {}, h("div", {class: "tools"}, all.length > 1 ? chosen : h("h3", {}, all[0].node.name)), place), show(time) {
    if (connection.up && performance.now() - asked > WATCHED) { asked = performance.now(); quietly(shown.watch()); }
    shown.show(time);
  }};
}});
