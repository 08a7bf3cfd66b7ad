"use strict";
// The view of nodes: how alive each is, its EMCY, and with control its NMT commands.

const NMT = ["start", "stop", "pre-operational", "reset", "reset communication"];

function nmtButton(command, node, words) {  // what may move something asks first, and so does what goes to all
  const act = async sure => { await connection.ask({do: "nmt", command, node, ...sure}); toast(`${command} sent to ${node === "all" ? "all nodes" : node}`); };
  return node === "all" && command === "pre-operational" ? askedTwice(words, () => act({}).catch(error => toast(error.message, true)), {}) : sureButton(words, act);
}

class NodeCard {
  constructor(source, node) {
    Object.assign(this, {source, node});
    this.life = lifeSign();
    this.state = h("span");
    this.errors = h("ol", {class: "errors", "aria-label": `EMCY of ${node.name}`});
    const [vendor, product, revision, serial] = node.identity || [null, null, null, null];
    this.control = h("div", {class: "buttons", hidden: true}, ...NMT.map(command => nmtButton(command, node.name, command)));
    this.element = h("section", {class: "card"},
      h("h2", {}, node.name, h("small", {}, ` node ${node.id}`)),
      h("p", {class: "state"}, this.life.element, " ", this.state),
      h("p", {class: "hint"}, `vendor ${hex(vendor, 8)}, product ${hex(product, 8)}, revision ${hex(revision, 8)}`
        + `, serial ${hex(serial, 8)}; ${node.file || "no file"}`),
      h("h3", {}, "EMCY"), this.errors, this.control);
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

const nodesView = () => perSource(source => {
  const cards = new Map(), element = h("div", {class: "cards"});
  return {element, show(time) {
    for (const node of allNodes(source)) {
      if (cards.has(node.name)) continue;
      cards.set(node.name, new NodeCard(source, node));
      element.append(cards.get(node.name).element);
    }
    for (const card of cards.values()) card.show(time);
  }};
});
