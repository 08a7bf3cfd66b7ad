"use strict";
// The view of settings: what of a node differs from its file, saved as a DCF, compared with a DCF or another node and then
// applied, stored, restored; and the download of a program.

class SettingsView {
  constructor(source) {
    this.source = source;
    this.bar = jobBar("settings", "program");
    this.rows = h("tbody");
    this.heads = [h("th", {scope: "col"}, "Now"), h("th", {scope: "col"}, "Then")];
    this.table = h("table", {class: "found", hidden: true, "aria-label": "settings"}, h("thead", {}, h("tr", {}, h("th", {scope: "col"}, "Object"), h("th", {scope: "col"}, "Name"), ...this.heads)), this.rows);
    this.text = h("p", {class: "verdict", role: "status"});
    this.node = h("select", {"aria-label": "node"}, ...source.nodes.map(node => h("option", {}, node.name)));
    this.dcf = this.program = null;         // names of the files that were sent
    this.sent = [];                         // of the DCF, and the files beside it
    const act = (words, what) => h("button", {onclick: () => loudly(this.ask(what))}, words);
    this.element = h("div", {class: "settings"},
      h("div", {class: "tools"}, this.node, act("Differences from its file", {do: "differences"}), this.bar.element),
      this.control = h("div", {hidden: true}, this.keeping(act), this.applying(), this.downloading()), this.text, this.table);
  }
  ask(what, sure = {}) { return connection.ask({node: this.node.value, ...what, ...sure}); }
  keeping(act) {
    return h("fieldset", {class: "buttons"}, h("legend", {}, "Keep"), act("Save as DCF", {do: "save"}), act("Store in the node", {do: "store"}),
      sureButton("Restore defaults and reset", sure => this.ask({do: "restore"}, sure)));
  }
  applying() {
    const FILE = "a DCF";
    this.from = h("select", {"aria-label": "compare with", onchange: () => { stale = true; }}, h("option", {value: ""}, FILE), ...this.source.nodes.map(node => h("option", {}, node.name)));
    this.cobIds = h("select", {"aria-label": "COB-IDs that do not follow the node-ID"},
      h("option", {value: ""}, "ask about chosen COB-IDs"), h("option", {value: "keep"}, "keep chosen COB-IDs"), h("option", {value: "move"}, "move chosen COB-IDs"));
    this.dropped = h("span", {class: "hint"});
    const drop = dropZone("drop a DCF, and the files of its DOMAINs", file => loudly(upload(file).then(name => {
      if (/\.(dcf|xdc)$/i.test(name)) this.dcf = name;
      this.sent = [...new Set([...this.sent, name])];
      say(this.dropped, this.sent.join(", "));
    })));
    this.drop = h("span", {}, drop, " ", this.dropped);
    const source = () => {
      if (!this.from.value && !this.dcf) throw new Error("drop a DCF first, or choose a node");
      return {cob_ids: this.cobIds.value, ...(this.from.value ? {from: this.from.value} : {file: this.dcf})};
    };
    const compare = async () => { await this.ask({do: "preview", ...source()}); this.shown = JSON.stringify([this.node.value, source()]); };
    this.apply = sureButton("Apply", sure => this.ask({do: "apply", ...source()}, sure), {class: "main"});
    this.isShown = () => this.shown === JSON.stringify([this.node.value, this.from.value || this.dcf ? source() : null]);
    return h("fieldset", {class: "buttons"}, h("legend", {}, "Set as"), this.from, this.drop, this.cobIds,
      h("button", {onclick: () => loudly(compare())}, "Compare"), this.apply);
  }
  downloading() {
    const name = h("span", {class: "hint"}), number = h("input", {type: "text", inputmode: "numeric", size: 3, value: 1, "aria-label": "number of the program"});
    const crc = h("input", {type: "checkbox", checked: true}), force = h("input", {type: "checkbox"});
    const drop = dropZone("drop a program", file => loudly(upload(file).then(found => { this.program = found; say(name, found); })));
    const begin = sure => {
      if (!this.program) throw new Error("drop a program first");
      return this.ask({do: "program", file: this.program, number: wholeNumber("program", number.value, 1, 254), crc: crc.checked, force: force.checked}, sure);
    };
    return h("fieldset", {class: "buttons"}, h("legend", {}, "Program"), drop, name, h("label", {}, "number ", number),
      h("label", {}, crc, " compare the CRC"), h("label", {}, force, " also if its package objects"), sureButton("Download", begin));
  }
  show() {
    const job = this.bar.show(), ready = job?.state === "done" && this.isShown?.() && job.result?.changes > 0;
    show(this.control, connection.control);
    show(this.drop, this.from.value === "");
    this.apply.querySelector("button").disabled = !ready;
    for (const each of this.element.querySelectorAll("button:not(.drop)")) if (!this.apply.contains(each) && each.textContent !== "End") each.disabled = Boolean(runningJob()) || !this.node.value;
    const told = job ? `${job.number} ${job.rows.length} ${job.state}` : "";
    if (!job || told === this.told) return;
    this.told = told;
    const result = job.result;
    this.text.replaceChildren(...(result ? [result.text, " ", result.file ? h("a", {href: `/report/${result.file}`, download: result.file}, "Save") : ""] : []));
    this.heads.forEach((each, place) => say(each, (result?.heads || ["Now", "Then"])[place]));
    show(this.table, job.rows.length > 0);
    this.rows.replaceChildren(...job.rows.map(({object, name, before, after}) =>
      h("tr", {}, h("td", {class: "id"}, object), h("th", {scope: "row"}, name), h("td", {}, before), h("td", {class: "after"}, after))));
  }
}
const settingsView = () => new SettingsView(sources[0]);
