"use strict";
// What is wrong on the bus so far: the verdict, and the incidents, worst first. The server has the rules.

const LEVEL_CLASSES = {error: "is-error", warning: "is-warning", note: "is-note"};

function incidentItem({level, title, facts}) {
  return h("details", {class: `incident ${LEVEL_CLASSES[level]}`, "data-key": title.replace(/[\d.]+/g, "")},
    h("summary", {}, h("b", {class: "level"}, level), " ", title),
    h("dl", {}, ...facts.flatMap(([what, text]) => [h("dt", {}, what), h("dd", {}, text)])));
}

function diagnosisView() {
  const verdict = h("p", {class: "verdict", role: "status"}, "Waiting for frames."), list = h("div", {class: "incidents"});
  let asked = -Infinity, told = "";
  async function update() {
    const found = await connection.ask({do: "diagnosis"});
    say(verdict, found.verdict);
    const text = JSON.stringify(found.incidents);
    if (text === told) return;
    told = text;
    const open = new Set([...list.querySelectorAll("details[open]")].map(each => each.dataset.key));
    const items = found.incidents.map(incidentItem);
    for (const each of items) each.open = open.has(each.dataset.key);
    list.replaceChildren(...items);
  }
  return {element: h("div", {class: "diagnosis"}, verdict, list), show() {
    if (!connection.up || performance.now() - asked < 1000) return;
    asked = performance.now();
    quietly(update());
  }};
}
