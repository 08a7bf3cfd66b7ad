"use strict";
// Drives of CiA 402: the state machine with the state that a drive is in, where it is and how fast, and its buttons.
//
// Rule of this file: a jog goes on only while its button is held, and a move only while its page is seen; the page keeps
// telling the server so. Nothing above the controls changes its height: they do not move under the pointer.

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

const STATUS_BITS = ["ready to switch on", "switched on", "operation enabled", "fault", "voltage enabled", "no quick stop", "switch on disabled",
  "warning", "bit 8", "remote", "target reached", "internal limit", "bit 12", "bit 13", "bit 14", "bit 15"];
const SHOWN_VALUES = ["position", "velocity", "torque", "following error"];
const MOTOR = {position: "turns", velocity: "1/min"};
const HOLDING = 150;                        // ms between two words that a button is still held
const BEGINS = 3000;                        // ms in which a move that was ordered begins
const STEP_SPAN = 3;                        // s of a step response

class AxisView {
  constructor(source, node, number) {
    Object.assign(this, {source, node, number, keys: {}, holding: 0, step: null});
    this.axis = node.drive.axes[number];
    this.machine = machineOf(source.machine);
    this.state = h("strong", {class: "drive-state", role: "status", "aria-live": "assertive"});
    this.facts = h("dl", {class: "facts"});
    this.bits = h("p", {class: "bits", "aria-label": "bits of the statusword"});
    this.plots = [new Plot(150), new Plot(150)];
    this.alarm = h("div", {class: "alarm", role: "alert"});
    this.accepting = h("p", {class: "alarm is-wrong", role: "alert"});
    this.control = h("div", {hidden: true}, this.stateButtons(), this.jogs(), this.moves());
    this.element = h("div", {class: "drive"}, h("div", {class: "controls"}, this.control, this.alarm, this.accepting, this.facts, ...this.plots.map(each => each.element)),
      h("div", {}, h("p", {class: "drive-line"}, this.state), this.machine.element, this.bits));
    for (const gone of ["pagehide", "blur", "freeze"]) addEventListener(gone, () => this.leave());
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.leave(); });
  }
  leave() {                                 // nobody sees the drive any more
    if (this.holding) { this.end(this.held); return; }
    if (this.attending) { this.attend(false); this.order("halt"); }
  }
  get named() { return {node: this.node.name, axis: this.number + 1}; }

  // Controls

  order(command, numbers = {}, words = answer => answer ?? `${command}: done`) {
    const said = request({do: "drive", ...this.named, command, seen: connection.state?.time, ...numbers}, words);
    return quietly(said.catch(error => this.ask(error)));
  }
  ask(error) {                              // a drive that does not watch us: a person has to know, once
    if (!error.asks) return;
    this.accepting.replaceChildren(h("span", {}, `${error.asks}. `),
      h("button", {onclick: () => quietly(request({do: "accept", ...this.named}, "accepted").then(() => this.accepting.replaceChildren()))}, "I know: let it move"));
  }
  attend(wanted) {                          // a move goes on while this page is seen
    clearInterval(this.attending);
    this.attending = wanted ? setInterval(() => quietly(connection.ask({do: "hold", ...this.named})), HOLDING) : 0;
  }
  move(command, numbers, words) {
    this.attend(true);
    this.begun = performance.now();
    return this.order(command, numbers, words);
  }
  stateButtons() {
    const command = name => h("button", {class: name === "quick stop" ? "halt" : "", onclick: () => this.order(name)},
      name === "quick stop" ? "STOP this drive" : name[0].toUpperCase() + name.slice(1));
    return h("div", {class: "buttons"}, ...["enable", "disable", "fault reset", "halt", "quick stop"].map(command));
  }
  field(name, words, value = "") {          // a field whose bounds are those of the drive, and of the person
    const input = h("input", {type: "text", inputmode: "numeric", size: 9, autocomplete: "off", value});
    const [low, high] = this.axis.bounds[name];
    return {input, label: h("label", {}, words, input), read: () => wholeNumber(words, input.value, low, high),
      // Of a jog the button says the direction.
      amount: () => wholeNumber(words, input.value, 1, Math.min(high, -low, this.limit()))};
  }
  limit() {                                 // the most that the person allows a jog
    return this.most.value.trim() === "" ? Infinity : wholeNumber("own limit", this.most.value, 1, 2 ** 31 - 1);
  }
  jogs() {
    this.most = h("input", {type: "text", inputmode: "numeric", size: 9, value: kept(`limit ${this.node.name} ${this.number}`, ""), placeholder: "none",
      onchange: () => keep(`limit ${this.node.name} ${this.number}`, this.most.value)});
    const velocity = this.field("velocity", "velocity", this.node.drive.velocity ?? "");
    this.velocity = velocity.input;
    const torque = this.field("torque", "torque ‰"), hasTorque = "torque" in this.axis.objects;
    const row = (target, field, words) => h("div", {class: "buttons jog"}, this.jogButton(-1, `◀ ${words} −`, target, field), this.jogButton(1, `${words} + ▶`, target, field), field.label);
    return h("div", {}, h("h3", {}, "Jog"), row("velocity", velocity, "Jog"), hasTorque ? row("torque", torque, "Torque") : null,
      h("p", {class: "hint"}, h("label", {}, "own limit ", this.most), ` It turns while the button is held; at most ${this.axis.bounds.velocity[1]}.`));
  }
  moves() {
    const position = this.field("position", "position"), distance = this.field("position", "distance"), velocity = this.field("velocity", "velocity");
    const method = h("input", {type: "text", inputmode: "numeric", size: 5, placeholder: "as set"});
    const numbers = (name, field) => ({[name]: field.read(), ...(velocity.input.value.trim() === "" ? {} : {velocity: velocity.amount()})});
    const careful = (words, act) => askedTwice(words, () => { try { act(); } catch (error) { toast(error.message, true); } }, {});
    this.save = h("button", {hidden: true, onclick: () => this.saveStep()}, "Save step as CSV");
    return h("div", {}, h("h3", {}, "Move"), h("div", {class: "buttons"}, position.label, careful("Move to", () => this.move("move", numbers("position", position), "on its way"))),
      h("div", {class: "buttons"}, distance.label, careful("Move by", () => this.move("move by", numbers("distance", distance), "on its way")),
        careful("Step response", () => this.beginStep(numbers("distance", distance))), this.save, velocity.label),
      h("div", {class: "buttons"}, h("label", {}, "homing method", method),
        careful("Home", () => this.move("home", method.value.trim() === "" ? {} : {method: wholeNumber("method", method.value, -128, 127)}, "homing"))));
  }
  jogButton(sign, text, target, field) {
    const press = event => { event.preventDefault(); button.setPointerCapture?.(event.pointerId); this.begin(button, sign, target, field); };
    const end = () => this.end(button);
    const key = event => [" ", "Enter"].includes(event.key);
    const button = h("button", {onpointerdown: press, onpointerup: end, onpointercancel: end, onlostpointercapture: end, onblur: end,
      oncontextmenu: event => event.preventDefault(),
      onkeydown: event => { if (key(event)) { event.preventDefault(); if (!event.repeat) this.begin(button, sign, target, field); } },
      onkeyup: event => { if (key(event)) end(); }}, text);
    return button;
  }
  begin(button, sign, target, field) {
    if (this.holding || !connection.control) return;
    let amount;
    try { amount = field.amount(); } catch (error) { toast(error.message, true); return; }
    button.classList.add("held");
    this.held = button;
    this.holding = setInterval(() => quietly(connection.ask({do: "hold", ...this.named})), HOLDING);
    request({do: "jog", ...this.named, [target]: sign * amount, seen: connection.state?.time}).catch(error => { this.ask(error); this.end(button); });
  }
  end(button) {
    if (!this.holding) return;
    clearInterval(this.holding);
    this.holding = 0;
    button.classList.remove("held");
    this.order("halt");
  }

  // A step response: what the values did from a move on

  async beginStep(numbers) {
    this.step = {from: clock.time, to: clock.time + STEP_SPAN, distance: numbers.distance};
    await this.move("move by", numbers, `a step of ${numbers.distance}: recorded for ${STEP_SPAN} s`);
  }
  saveStep() {
    const series = SHOWN_VALUES.map(name => this.series(name)).filter(Boolean), {from, to} = this.step;
    const [times, ...columns] = uPlot.join(series.map(samplesOf));
    const lines = times.map((time, place) => ({time, line: [(time - from).toFixed(6), ...columns.map(column => column[place] ?? "")].join(",")}));
    const head = ["time in s", ...series.map(each => each.name)].map(quoted).join(",");
    savedText("step.csv", "text/csv", [head, ...lines.filter(({time}) => time >= from && time <= to).map(({line}) => line)]);
  }

  // Values: from a PDO at its rate, or else polled

  series(name) {
    const object = this.axis.objects[name], found = object && this.source.carrier(this.node.name, object);
    if (found) return Object.assign(found, {name});
    return this.keys[name] ? Object.assign(new ObjectSeries(this.source, this.keys[name], null), {name}) : null;
  }
  async watch() {                           // asked for again while it is looked at, as the plots do
    for (const [name, object] of Object.entries(this.axis.objects)) {
      if (!connection.alive) return;
      if (this.source.carrier(this.node.name, object)) continue;
      const key = await quietly(connection.ask({do: "watch", node: this.node.name, object}));
      if (key) this.keys[name] = key;
    }
    stale = true;
  }
  draw() {                                  // the plots, once it is known where their values come from
    for (const [place, name] of ["position", "velocity"].entries()) {
      const series = this.series(name), plot = this.plots[place];
      if (series && plot.series[0]?.id !== series.id) { plot.series = [series]; plot.build(); }
    }
  }
  value(name) {
    const series = this.series(name);
    return !series || series.trouble ? undefined : series.number(series.values.at(-1) ?? null) ?? undefined;
  }
  tellState(word, known) {
    const state = word === undefined ? "" : this.source.machine.states.find(each => (word & each.mask) === each.bits)?.name || "no state";
    const trouble = this.series("statusword")?.trouble, faulty = FAULTY.includes(state), code = this.value("error");
    say(this.state, !known ? "not connected" : trouble ? "It does not answer." : faulty && code !== undefined ? `${state}: error code ${hex(code, 4)}` : state || "…");
    this.state.classList.toggle("is-wrong", !known || faulty || Boolean(trouble));
    this.machine.show(known ? state : "");
  }
  measured(name) {                          // a value, and what it is at the motor if the file says so
    const value = this.value(name), unit = this.axis.units[name];
    return value === undefined ? value : `${value}${unit ? ` (${(value * unit).toFixed(3)} ${MOTOR[name]})` : ""}`;
  }
  tellFacts(word) {
    const {modes} = this.source.machine, mode = this.value("mode");
    const facts = [["mode", modes[mode] || mode], ...SHOWN_VALUES.filter(name => name in this.axis.objects).map(name => [name, this.measured(name)]),
      ["statusword", word === undefined ? undefined : hex(word, 4)]];
    if (facts.join() === this.told) return;
    this.told = facts.join();
    this.facts.replaceChildren(...facts.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value ?? "–"))));
    this.bits.replaceChildren(...STATUS_BITS.map((name, bit) => h("span", {class: word >> bit & 1 ? "bit on" : "bit"}, name)));
  }
  tellMotion() {                            // what the server says of motions and stops
    const motion = connection.state?.motion || {moving: [], said: [], wrong: []};
    const moves = motion.moving.some(([name, number]) => name === this.node.name && number === this.number + 1);
    if (this.attending && !moves && performance.now() - this.begun > BEGINS) this.attend(false);
    const lines = [...motion.wrong.map(text => ({text, wrong: true})), ...motion.said.map(text => ({text, wrong: false}))];
    if (JSON.stringify(lines) === this.said) return;
    this.said = JSON.stringify(lines);
    this.alarm.replaceChildren(...lines.map(each => h("p", {class: each.wrong ? "is-wrong" : ""}, each.text)));
  }
  show(time) {
    this.tellMotion();
    const word = this.value("statusword");
    this.tellState(word, !connection.trouble);
    this.tellFacts(word);
    this.draw();
    show(this.control, connection.control);
    show(this.save, this.step !== null && time >= this.step.to);
    for (const each of this.plots) each.update(time);
  }
}

function drivesView() {
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
  return {element: h("div", {}, h("div", {class: "tools"}, all.length > 1 ? chosen : h("h2", {}, all[0].node.name)), place), show(time) {
    if (connection.alive && performance.now() - asked > WATCHED) { asked = performance.now(); quietly(shown.watch()); }
    shown.show(time);
  }};
}
