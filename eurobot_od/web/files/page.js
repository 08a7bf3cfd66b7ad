"use strict";
// The whole: the table of views, the header, which view is shown, the keys. The other scripts make the views.

// In the order of their tabs; `if`: where there is one; `control`: it takes control; `whole`: it stands alone; `bare`: without a source
const VIEWS = [
  {name: "messages", title: "Messages", make: messagesView},
  {name: "trace", title: "Trace", make: traceView, whole: true},
  {name: "plots", title: "Plots", make: plotsView},
  {name: "nodes", title: "Nodes", make: nodesView},
  {name: "objects", title: "Objects", make: objectsView, if: live},
  {name: "send", title: "Send", make: sendView, if: live, control: true},
  {name: "settings", title: "Settings", make: settingsView, if: live},
  {name: "checks", title: "Checks", make: checksView, if: live},
  {name: "drives", title: "Drives", make: drivesView, if: driven.length > 0},
  {name: "events", title: "Events", make: eventsView},
  {name: "diagnosis", title: "Diagnosis", make: diagnosisView, if: live || content.sources.some(each => each.diagnosis || each.long)},
  {name: "files", title: "Files", make: filesView, if: content.editor === true, whole: true, bare: true},
  {name: "compare", title: "Compare", make: content.comparison && compareView, if: Boolean(content.comparison)},
];
const TABLES = 100;                         // ms between two updates of tables and numbers

function leaveButton() {                    // back to the page that begins with nothing
  const button = h("button", {id: "leave", onclick: () => loudly(fetch("/leave", {method: "POST"}).then(answer => answer.json()).then(said => { if (said.error) throw new Error(said.error); }))},
    live ? "Disconnect" : "Close");
  return content.leave ? [button] : [];
}
function recordButton() {
  const button = h("button", {id: "record", onclick: () => quietly(connection.state?.recording.on
    ? request({do: "stop recording"}, "recorded") : request({do: "record"}, "recording"))}, "Record");
  const link = h("a", {hidden: true});
  let troubled = "";
  return {elements: [button, link], show({recording}) {
    if (recording.trouble && recording.trouble !== troubled) toast(recording.trouble, true);
    troubled = recording.trouble;
    show(button, connection.control);
    say(button, recording.on ? `Stop (${recording.frames})` : "Record");
    button.setAttribute("aria-label", recording.on ? "stop recording" : "record");
    button.classList.toggle("recording", recording.on);
    show(link, !recording.on && recording.file !== "");
    if (recording.file) { link.href = `/recording/${recording.file}`; say(link, "Save"); link.title = recording.file; }
  }};
}

function statusLine() {
  const text = h("span"), load = h("span", {class: live ? "more" : ""}), count = h("span", {class: "fewer", title: "frames"}), life = lifeSign();
  const nodes = h("button", {id: "life", onclick: () => document.getElementById("tab-nodes").click()}, life.element);
  const freeze = h("button", {id: "freeze", "aria-pressed": "false", title: "hold what is shown: f", onclick: () => toggleFreeze()}, "Freeze");
  const record = recordButton();
  const element = h("div", {class: "status", role: "status", "aria-live": "off"}, nodes, text, load, count, ...(live ? [freeze, ...record.elements, new Layouts().button] : []), ...leaveButton());
  return {element, show(time) {
    if (!sources.length) return;
    const [worst] = sources.map(each => lifeOf(each, time)).sort((one, two) => WORST.indexOf(one.life) - WORST.indexOf(two.life));
    life.set(worst.life, worst.text);
    nodes.title = `${(worst.names || []).join(", ")} ${worst.life}: show the nodes`.trim();
    if (!live) {
      say(text, sources.map(each => each.long?.words || (each.leftOut ? `${each.leftOut} frames left out` : "")).filter(Boolean).join(", "));
      say(load, `load ${sources.map(each => `${(100 * each.load(time)).toFixed(1)} %`).join(" | ")}`);
      return;
    }
    const {state, trouble} = connection;
    element.classList.toggle("is-wrong", Boolean(trouble));
    text.classList.toggle("more", !trouble);  // a phone has no room for the time
    say(text, trouble || `${time.toFixed(1)} s`);
    freeze.setAttribute("aria-pressed", String(clock.frozen !== null));
    if (!state) return;
    say(count, trouble ? "" : state.frames < 1e4 ? `${state.frames}` : `${Math.floor(state.frames / 1000)}k`);
    say(load, trouble ? "" : `load ${(100 * state.load).toFixed(1)} %, ${state.rate.toFixed(0)} frames/s, ${state.frames} frames`);
    record.show(state);
    element.title = load.textContent;         // a phone has no room for it
  }};
}

function faults(time) {                     // what a person has to hear of, whatever view they are in
  return sources.flatMap(source => {
    const lost = allNodes(source).filter(node => nodeNow(source, node, time).life === "lost").map(node => `${node.name} is lost`);
    const named = new Map();                // of each node its last EMCY
    for (const each of source.sortedEvents()) if (each.kind === "EMCY" && each.time <= time) named.set(each.data.node, each);
    const errors = [...named.values()].filter(each => each.wrong).map(each => each.text);
    return [...(live && connection.trouble ? [connection.trouble] : []), ...lost, ...errors];
  });
}
function toggleFreeze() {
  clock.frozen = clock.frozen === null ? clock.time : null;
  stale = true;
}

// Stop

const stopNow = () => request({do: "stop"}, answer => `stop sent: ${answer}`);
function stopFailures() {                   // in every view: what did not stop, as far as is known
  const list = h("div", {id: "not-stopped", role: "alert", hidden: true});
  let told = "";
  return {element: list, show() {
    const wrong = connection.state?.motion?.wrong || [], words = wrong.join("\n");
    if (words === told) return;
    told = words;
    show(list, wrong.length > 0);
    list.replaceChildren(...wrong.map(text => h("p", {}, text)));
  }};
}
function stopButton() {                     // it says beforehand that it cannot be sent
  const button = h("button", {id: "stop", hidden: true, title: "Stop: Escape", onclick: () => quietly(stopNow())});
  return {element: button, show() {
    show(button, connection.control);
    button.classList.toggle("dead", Boolean(connection.trouble));
    say(button, connection.trouble ? "STOP cannot be sent" : "STOP");
  }};
}

// The views

class Tabs {                                // which view is shown; a panel has the whole window, or stands beside another
  constructor(all) {
    this.all = all;
    this.made = all.map(view => view.make());
    this.tabs = all.map((view, place) => h("button", {
      role: "tab", id: `tab-${view.name}`, "aria-controls": `view-${view.name}`, title: `key ${place + 1}`,
      onclick: () => this.choose(view), onkeydown: event => this.key(event, place)}, view.title));
    this.sections = all.map((view, place) => h("section", {
      class: `view ${view.panel ? "panel" : ""}`, id: `view-${view.name}`, role: "tabpanel", "aria-labelledby": `tab-${view.name}`, tabindex: 0,
    }, view.panel ? null : h("h2", {class: "heard-only"}, view.title), this.made[place].element));
    this.wide = matchMedia("(min-width: 1200px)");
    this.wide.addEventListener("change", () => this.layout());
    addEventListener("popstate", () => {    // back and forward lead from view to view
      const named = all.find(view => `#${view.name}` === location.hash.split("?")[0]);
      if (named) { this.current = named; this.layout(); }
    });
    this.current = all.find(view => `#${view.name}` === location.hash.split("?")[0]) || (live && this.wide.matches ? all.find(view => !view.panel) : all[0]);
  }
  get shown() { return this.tabs.filter(tab => !tab.hidden); }
  choose(view) {
    if (view !== this.current) history.pushState(null, "", `#${view.name}`);
    this.current = view;
    this.layout();
  }
  key(event, place) {
    const here = this.shown.indexOf(this.tabs[place]), to = {ArrowRight: here + 1, ArrowLeft: here - 1, Home: 0, End: -1}[event.key];
    if (to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const next = this.shown.at(to % this.shown.length);
    next.click();
    next.focus();
  }
  layout() {
    const beside = this.wide.matches && this.all.some(view => view.panel) && !this.current.panel && !this.current.whole;
    this.all.forEach((view, place) => {
      const chosen = view === this.current;
      this.tabs[place].setAttribute("aria-selected", String(chosen));
      this.tabs[place].tabIndex = chosen ? 0 : -1;
      show(this.tabs[place], !(view.control && !connection.control));
      show(this.sections[place], chosen || (beside && view.panel === true));
    });
    document.body.classList.toggle("beside", beside);
    document.body.classList.toggle("alone", this.current.panel === true);
    this.tabs[this.all.indexOf(this.current)].scrollIntoView({block: "nearest", inline: "nearest"});
    stale = true;
  }
  draw(time, tables) {
    this.all.forEach((view, place) => { if (!this.sections[place].hidden && (tables || view.panel)) this.made[place].show(time); });
  }
  get find() { const shown = this.made[this.all.indexOf(this.current)]; return shown.find && (() => shown.find()); }
  begins() { return Math.min(...this.made.map(each => each.begins ? each.begins() : Infinity)); }
}

function assembled(tabs, status, line, stop, failures, alarms) {
  const header = h("header", {}, h("div", {class: "top"}, h("h1", {}, content.title), ...(sources.length ? [status.element, stop.element] : leaveButton())),
    h("nav", {role: "tablist", "aria-label": "views"}, ...tabs.tabs));
  const footer = h("footer", {}, line && line.element), measured = {"--header": header, "--foot": footer};
  const observer = new ResizeObserver(() => {
    for (const [name, each] of Object.entries(measured)) document.body.style.setProperty(name, `${each.getBoundingClientRect().height}px`);
  });
  for (const each of Object.values(measured)) observer.observe(each);
  return [header, h("main", {}, ...tabs.sections), footer, toastLine, failures.element, alarms];
}

function reopen(begins) {                   // a log opens where there is something to see, or where this window has left it
  const log = JSON.stringify([sources.map(each => each.name), clock.end]), left = kept("place", {}, sessionStorage);
  if (left.log === log) { clock.seek(left.time); Object.assign(plots, left.plots); }
  else {
    if (begins < Infinity) clock.seek(begins);
    const isAgain = performance.getEntries()[0]?.type === "reload";  // the first entry is how this page was come to
    if (content.plays && !isAgain && !matchMedia("(prefers-reduced-motion: reduce)").matches) clock.play();
  }
  addEventListener("pagehide", () => keep("place", {log, time: clock.time, plots: {zoomed: plots.zoomed, marks: plots.marks}}, sessionStorage));
}

function start() {
  const panels = content.panels.filter(each => panelMakers.has(each.name)).map(each => ({name: each.name, title: each.title,
    panel: true, make: () => perSource(source => panelMakers.get(each.name)(each.setup, source))}));
  const tabs = new Tabs([...panels, ...VIEWS.filter(view => view.if !== false && (view.bare || sources.length))]);
  if (!live) reopen(tabs.begins());
  const status = statusLine(), line = live || !sources.length ? null : timeline(), stop = stopButton(), failures = stopFailures();
  const alarms = h("div", {id: "alarms", class: "heard-only", role: "alert"});
  document.body.classList.toggle("bare", !sources.length);
  document.body.append(...assembled(tabs, status, line, stop, failures, alarms));
  tabs.layout();
  keyboard(tabs);
  let drawn = 0, controlled = false;
  function frame() {
    const time = clock.time, now = performance.now();
    if (!live && clock.running && time >= clock.end) clock.pause();
    if (plots.lost && (!live || connection.up)) plots.restore();
    for (const {long} of sources) long?.follow(time);
    if (clock.running || stale) {
      const tables = now - drawn > TABLES || (stale && !clock.running);
      stale = false;
      if (tables) drawn = now;
      if (controlled !== connection.control) { controlled = connection.control; tabs.layout(); }
      document.body.classList.toggle("control", connection.control);
      tabs.draw(time, tables);
      if (line) line.show(time);
      if (tables) { stop.show(); failures.show(); status.show(time); say(alarms, faults(time).join("; ")); }
      document.body.dataset.time = time.toFixed(3);
    }
    requestAnimationFrame(frame);
  }
  if (content.leave) watchServer();
  if (live) {
    connection.open();
    // What this page moves stops when nobody looks at it, also what was sent raw.
    document.addEventListener("visibilitychange", () => { if (document.hidden && connection.control) quietly(connection.ask({do: "hidden"})); });
    setInterval(() => plots.watched().forEach(each => quietly(connection.ask({do: "watch", ...each.watched}))), WATCHED);
  }
  requestAnimationFrame(frame);
}

function keyboard(tabs) {
  const log = {
    " ": () => clock.toggle(), "ArrowRight": () => clock.seek(clock.time + 1), "ArrowLeft": () => clock.seek(clock.time - 1),
    ".": () => stepEvent(1), ",": () => stepEvent(-1), "Home": () => clock.seek(0), "End": () => clock.seek(clock.end),
    "+": () => clock.faster(1), "-": () => clock.faster(-1),
  };
  const bus = {"f": toggleFreeze, "Escape": () => { if (connection.control) quietly(stopNow()); }};
  const find = () => { if (tabs.find) { tabs.find(); return; } document.getElementById("tab-messages").click(); document.getElementById("search").focus(); };
  document.addEventListener("keydown", event => {
    const typing = event.target.closest("input:not([type=range]):not([type=checkbox]), select, textarea");
    if (event.ctrlKey || event.metaKey || event.altKey || (typing && event.key !== "Escape")) return;
    // A button takes these keys itself: Space on Play would start the log and pause it at once.
    if (event.target.closest("button, [role=button], summary, input") && [" ", "Enter"].includes(event.key)) return;
    const tab = event.key >= "1" ? tabs.shown[Number(event.key) - 1] : undefined;
    const act = (live ? bus : log)[event.key] || (event.key === "/" ? find : null) || (tab ? () => tab.click() : null);
    if (act) { event.preventDefault(); act(); }
  });
}
document.addEventListener("DOMContentLoaded", start);
