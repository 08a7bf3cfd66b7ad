"use strict";
// What is wrong on the bus so far, or in each log: the verdict, and the incidents, worst first. The server has the rules.

const LEVEL_CLASSES = {error: "is-error", warning: "is-warning", note: "is-note"};

function incidentItem({level, title, facts}) {
  return h("details", {class: `incident ${LEVEL_CLASSES[level]}`, "data-key": title.replace(/[\d.]+/g, "")},
    h("summary", {}, h("b", {class: "level"}, level), " ", title),
    h("dl", {}, ...facts.flatMap(([what, text]) => [h("dt", {}, what), h("dd", {}, text)])));
}

function diagnosisOf({name, diagnosis}) {
  const verdict = h("p", {class: "verdict", role: "status"}, "Waiting for frames."), list = h("div", {class: "incidents"});
  let told = "";
  function take(found) {
    say(verdict, found.verdict);
    const text = JSON.stringify(found.incidents);
    if (text === told) return;
    told = text;
    const open = new Set([...list.querySelectorAll("details[open]")].map(each => each.dataset.key));
    const items = found.incidents.map(incidentItem);
    for (const each of items) each.open = open.has(each.dataset.key);
    list.replaceChildren(...items);
  }
  if (diagnosis) take(diagnosis);
  return {element: h("section", {}, several ? h("h2", {}, name) : "", verdict, list), take};
}

function diagnosisView() {
  const all = content.sources.map(diagnosisOf);
  let asked = -Infinity;
  return {element: h("div", {class: "diagnosis"}, ...all.map(each => each.element)), show() {
    if (!live || !connection.up || performance.now() - asked < 1000) return;
    asked = performance.now();
    quietly(connection.ask({do: "diagnosis"}).then(all[0].take));
  }};
}
