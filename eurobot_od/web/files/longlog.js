"use strict";
// A long log: the server has an index of all of it, and the page the frames around the time that is shown. Counts and
// events are those of the whole log; a plot of a longer span asks for as many samples as it has pixels.

const INDEX_LOOK = 300;                     // ms between two questions while the index is built, or the log is diagnosed
const AHEAD = 0.8;                          // part of a window after which a running clock asks for the next one

class LongLog {
  constructor(source) {
    Object.assign(this, {source, from: 0, to: -1, index: null, asking: false, series: new Map(), reading: false});
    this.grow();
  }
  async ask(what) {
    const answer = await fetch("/log", {method: "POST", body: JSON.stringify({log: String(this.source.number), ...what})});
    const said = await answer.json();
    if (said.error) throw new Error(said.error);
    return said.ok;
  }
  async grow() {                            // until the index is complete
    const index = await this.ask({do: "index"}).catch(error => ({trouble: error.message}));
    if (index.rows) this.source.takeIndex(this.index = index);
    if (index.trouble) toast(index.trouble, true);
    else if (!index.is_complete) setTimeout(() => this.grow(), INDEX_LOOK);
    clock.end = Math.max(...sources.map(each => each.end));
    stale = true;
  }
  get words() {                             // what is not there yet
    const {index} = this;
    if (!index) return "the log is opened";
    if (!index.is_complete) return `${Math.floor(100 * index.read / index.size)} % of the log is read`;
    return this.asking || this.reading ? "reading" : "";
  }
  has(from, to) { return from >= this.from && (to <= this.to || this.to >= this.source.end); }
  follow(time) {                            // asks for the frames around a time, if they are not there
    const next = clock.running ? Math.min(time + (1 - AHEAD) * (this.to - this.from), this.source.end) : time;
    if (this.asking || !this.index?.rows.length || this.has(time, next)) return;
    quietly(this.window(next));
  }
  async reach(time) {                       // until the frames around a time are there
    while (this.asking) await new Promise(done => setTimeout(done, 20));
    if (!this.has(time, time)) await this.window(time);
  }
  async window(time) {
    this.asking = true;
    try {
      const found = await this.ask({do: "window", time});
      this.source.takeWindow(found);
      this.from = found.from;
      this.to = found.to;
    } catch (error) { toast(error.message, true); await new Promise(done => setTimeout(done, SILENT)); } finally { this.asking = false; stale = true; }
  }
  async diagnosis() {                       // so far: it begins when somebody looks at it
    const found = await this.ask({do: "diagnosis"});
    this.diagnosed = found.is_complete;
    if (!this.diagnosed) setTimeout(() => { stale = true; }, INDEX_LOOK);
    return found;
  }
  samples(series, from, to, pixels) {       // [times, values] of a span that is longer than the window, once they are there
    const key = JSON.stringify([from, to, pixels]), known = this.series.get(series.id);
    if (known?.key !== key && !this.reading) quietly(this.read(series, from, to, pixels, key));
    return known ? [known.times, known.values] : thinned({times: series.times, values: series.values, number: each => series.number(each)}, from, to, pixels);
  }
  async read(series, from, to, pixels, key) {
    this.reading = true;
    try { this.series.set(series.id, {key, ...await this.all(series, from, to, {pixels})}); }
    finally { this.reading = false; plots.redraw(); }
  }
  async all(series, from, to, more = {}) {  // every sample, or with `pixels` those that a plot needs
    const {times, values} = await this.ask({do: "series", row: series.message, field: series.field.name, from, to, ...more});
    return {times, values: values.map(value => series.number(value))};
  }
}
