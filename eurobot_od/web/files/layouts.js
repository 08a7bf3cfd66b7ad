"use strict";
// Layouts: which view is shown, with its filters, the columns and the plots, kept by name in the folder of the server.

const OF_LAYOUT = {columns: localStorage, plots: sessionStorage};   // what this browser keeps, by where

function presentLayout() {
  plots.keep();
  return {address: location.hash, kept: Object.fromEntries(Object.entries(OF_LAYOUT).map(([name, storage]) => [name, kept(name, null, storage)]))};
}
function showLayout(layout) {               // by the same way as after a reload
  for (const [name, storage] of Object.entries(OF_LAYOUT)) if (layout.kept[name] !== null) keep(name, layout.kept[name], storage);
  plots.lost = null;                        // what is there now is not kept over it
  plots.keep = () => {};
  history.replaceState(null, "", layout.address || location.pathname);
  location.reload();
}

class Layouts {
  constructor() {
    this.list = h("ul", {class: "layouts"});
    this.name = h("input", {size: 18, "aria-label": "name of the layout", placeholder: "name"});
    this.form = h("form", {class: "buttons", onsubmit: event => { event.preventDefault(); loudly(this.add()); }}, this.name, h("button", {}, "Keep what is shown"));
    this.dialog = h("dialog", {"aria-label": "layouts"}, h("h2", {}, "Layouts"), this.list, this.form,
      h("p", {class: "hint"}, "Views, filters, columns and plots, kept in the server's folder."), h("button", {onclick: () => this.dialog.close()}, "Close"));
    this.button = h("button", {id: "layouts", class: "more", onclick: () => loudly(this.open())}, "Layouts");
  }
  async open() {
    if (!this.dialog.isConnected) document.body.append(this.dialog);
    await this.load();
    show(this.form, connection.control);
    if (!this.dialog.open) this.dialog.showModal();
  }
  async load() {
    const all = Object.entries(await connection.ask({do: "layouts"}));
    this.list.replaceChildren(...all.map(([name, layout]) => h("li", {class: "buttons"},
      h("button", {onclick: () => showLayout(layout)}, name),
      connection.control ? h("button", {"aria-label": `remove ${name}`, onclick: () => loudly(this.remove(name))}, "×") : null)));
    if (!all.length) this.list.append(h("li", {class: "hint"}, "none yet"));
  }
  async add() {
    await connection.ask({do: "keep layout", name: this.name.value.trim(), layout: presentLayout()});
    this.name.value = "";
    await this.load();
  }
  async remove(name) {
    await connection.ask({do: "remove layout", name});
    await this.load();
  }
}
