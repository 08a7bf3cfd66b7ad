"use strict";
// Plots: every sample is drawn, as the least and the most of each pixel where there are more samples than pixels, and
// every sample is in the CSV. A value holds until the next one, the last one until now.

const WATCHED = 5000;                       // ms after which the page tells the server that an object is still plotted
const LOWEST = 180;                         // px that a plot is high at least
const LINE_COLOURS = 8;                     // of page.css
const DASHES = [[undefined, [6, 4], [2, 3]], [[10, 3, 2, 3], [10, 3, 2, 3, 2, 3], [2, 6]]];  // of the first source, and of the second

function thinned(series, from, to, pixels) {  // [times, values] of a span: of each pixel the first, least, most and last
  const {times, values} = series, begin = Math.max(upTo(times, from) - 1, 0), end = Math.min(upTo(times, to) + 1, times.length);
  const places = [];
  if (end - begin <= 4 * pixels) for (let each = begin; each < end; each++) places.push(each);
  else {
    const width = (to - from) / pixels;
    for (let each = begin; each < end;) {
      const first = each, until = times[first] + width;
      let least = first, most = first, low = Infinity, high = -Infinity;
      for (; each < end && (times[each] < until || each === first); each++) {
        const value = series.number(values[each]);
        if (value !== null && value < low) { low = value; least = each; }
        if (value !== null && value > high) { high = value; most = each; }
      }
      places.push(...[...new Set([first, least, most, each - 1])].sort((one, two) => one - two));
    }
  }
  return [places.map(each => times[each]), places.map(each => series.number(values[each]))];
}
function untilNow([times, values], now) {   // a value is the last one until another one comes
  if (times.length && now > times.at(-1)) { times.push(now); values.push(values.at(-1)); }
  return [times, values];
}

class Plot {
  constructor(own = null) {                 // `own`: a height in px of its own
    this.own = own;
    this.series = [];
    this.chart = null;
    this.cursor = null;                     // the time under the pointer
    this.legend = h("div", {class: "legend"});
    this.canvas = h("div", {class: "chart"});
    this.playhead = h("div", {class: "playhead"});
    this.marks = ["A", "B"].map(name => h("div", {class: `mark-line mark-${name}`, hidden: true}, h("b", {}, name)));
    this.empty = h("p", {class: "hint"}, "Drag values here, or click them in Messages.");
    this.element = h("section", {
      class: "plot", role: "group", "aria-label": "plot",
      ondragover: event => { event.preventDefault(); this.element.classList.add("over"); },
      ondragleave: () => this.element.classList.remove("over"),
      ondrop: event => { event.preventDefault(); this.element.classList.remove("over"); this.drop(event); },
      onclick: () => plots.choose(this),
    }, h("div", {class: "plot-head"}, this.legend,
      h("div", {class: "buttons"},
        several ? h("button", {onclick: () => this.overAll(), title: "the same fields of all logs over one another"}, "All logs") : null,
        h("button", {onclick: () => loudly(this.save("csv")), "aria-label": "save this plot as CSV"}, "CSV"),
        h("button", {onclick: () => this.save("svg"), "aria-label": "save this plot as SVG"}, "SVG"),
        h("button", {onclick: () => this.save("png"), "aria-label": "save this plot as PNG"}, "PNG"),
        h("button", {onclick: event => { event.stopPropagation(); plots.remove(this); }, "aria-label": "remove this plot"}, "×"))),
    this.empty, this.canvas);
  }
  drop(event) {
    let series = null;
    try { series = seriesOf(event.dataTransfer.getData("text/plain")); } catch { /* something else was dropped */ }
    if (series && PLOTTABLE(series.field)) this.add(series); else toast("only numbers of messages and objects can be plotted", true);
  }
  add(series) {
    if (!this.series.some(each => each.id === series.id)) this.series.push(series);
    this.build();
  }
  overAll() {                               // of several logs: the same fields of each of them
    for (const {message, field} of [...this.series]) {
      for (const row of sources.map(each => message && each.row(message)).filter(Boolean)) if (row.field(field.name) >= 0) this.add(new FieldSeries(row, field.name));
    }
  }
  build() {
    plots.keep();
    if (this.chart) this.chart.destroy();
    this.chart = null;
    show(this.empty, !this.series.length);
    this.labels = this.series.map(() => h("b", {}));
    this.lines = this.drawnBy();
    this.legend.replaceChildren(...this.series.map((each, place) => h("span", {class: "line"},
      s("svg", {"aria-hidden": "true"}, s("line", {x2: "100%", "stroke-dasharray": this.lines[place].dash?.join(" ")})), each.name, " ",
      this.labels[place], h("button", {"aria-label": `take ${each.name} out of the plot`, onclick: () => {
        this.series.splice(place, 1);
        this.build();
      }}, "×"))));
    this.lines.forEach(({colour}, place) => this.legend.children[place].style.setProperty("--line", `var(${colour})`));
    if (!this.series.length || !this.canvas.clientWidth) return;
    this.ink = css("--ink");
    this.chart = new uPlot(this.options(), this.drawn(), this.canvas);
    this.chart.over.append(this.playhead, ...this.marks);
    this.ranged();
  }
  get height() { return this.own ?? plots.height; }
  get units() { return [...new Set(this.series.map(each => each.unit || ""))]; }
  axes() {                                  // one for each unit: the first on the left, the others on the right
    const axis = {stroke: css("--ink"), grid: {stroke: css("--grid"), width: 1}, ticks: {stroke: css("--grid"), width: 1}};
    const size = (_, values) => Math.max(50, 18 + 8 * Math.max(0, ...(values || []).map(each => each.length)));
    return [{...axis, label: "time in s", labelSize: 18}, ...this.units.map((unit, place) => ({
      ...axis, scale: `in ${unit}`, label: unit || undefined, labelSize: 18, side: place ? 1 : 3, size,
      grid: {...axis.grid, show: place === 0},
    }))];
  }
  options() {
    return {
      width: this.canvas.clientWidth, height: this.height, legend: {show: false},
      scales: {x: {time: false}},
      axes: this.axes(),
      cursor: {sync: {key: "time"}, drag: {x: true, y: false, setScale: false},
        bind: {dblclick: () => () => plots.follow(), mouseup: (chart, _, act) => event => { act(event); this.clicked(chart, event); }}},
      series: [{}, ...this.series.map((each, place) => ({
        label: each.name, scale: `in ${each.unit || ""}`, stroke: css(this.lines[place].colour), width: 1.6, spanGaps: true, dash: this.lines[place].dash,
        // Stepped: between two frames a value is the last one. Gaps: joined series have none where another has a time.
        paths: uPlot.paths.stepped({align: 1}), points: {show: false},
      }))],
      hooks: {
        setSelect: [chart => {
          if (chart.select.width < 4) return;
          plots.zoom([chart.posToVal(chart.select.left, "x"), chart.posToVal(chart.select.left + chart.select.width, "x")]);
          chart.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
        }],
        setCursor: [chart => {
          const {left} = chart.cursor;
          this.cursor = left >= 0 ? chart.posToVal(left, "x") : null;
          stale = true;
        }],
      },
    };
  }
  clicked(chart, event) {                   // a cursor is put where was clicked, and not dragged
    if (chart.select.width >= 4 || this.cursor === null || event.detail > 1) return;
    plots.put(event.shiftKey ? "B" : "A", this.cursor);
  }
  drawnBy() {                               // of each series: a colour of its own, or of its row's thing; there dashes differ
    const drawn = [];
    for (const {row, source, id} of this.series) {
      const own = row && ownColours.map(each => each(row, clock.time)).find(Boolean), place = own ? 0 : plots.placeOf(id, this);
      const same = drawn.filter(each => each.colour === own && each.source === source).length;
      const dashes = DASHES[Math.min(source.number, 1)], dash = dashes[(own ? same : Math.floor(place / LINE_COLOURS)) % dashes.length];
      drawn.push({own, source, dash, colour: own || `--line-${place % LINE_COLOURS}`});
    }
    return drawn;
  }
  drawn() {                                 // what can be seen
    const [from, to] = plots.range(), now = live ? clock.time : clock.end;
    return uPlot.join(this.series.map(each => untilNow(each.drawn(from, to, this.canvas.clientWidth), Math.min(to, now))));
  }
  async data() {                            // all there is; of a long log all between the ends of what is seen
    const [from, to] = plots.range(), all = each => each.source.long && each.message ? each.source.long.all(each, from, to).then(({times, values}) => [times, values]) : samplesOf(each);
    return uPlot.join(await Promise.all(this.series.map(all)));
  }
  ranged() {
    const [min, max] = plots.range();
    this.chart.setData(this.drawn(), false);  // false: uPlot would choose a range of its own
    this.chart.setScale("x", {min, max});
  }
  update(time) {
    if (!this.series.length || !this.canvas.clientWidth) return;
    const other = !this.chart || this.chart.width !== this.canvas.clientWidth || this.chart.height !== this.height;
    if (other || this.ink !== css("--ink")) this.build();  // the colours change with the system's
    if (live && clock.running) this.ranged();
    this.line(this.playhead, live ? null : time);
    for (const [place, name] of ["A", "B"].entries()) this.line(this.marks[place], plots.marks[name]);
    this.labels.forEach((label, place) => say(label, this.label(this.series[place], time)));
  }
  line(element, time) {
    const place = time === null ? -1 : this.chart.valToPos(time, "x");
    show(element, place >= 0 && place <= this.chart.over.clientWidth);
    element.style.left = `${place}px`;
  }
  label(series, time) {                     // its value; with both cursors, the values at them and how they differ
    const {A, B} = plots.marks;
    if (A === null || B === null || this.cursor !== null) return valueAt(series, this.cursor ?? A ?? B ?? time);
    const [one, two] = [numberAt(series, A), numberAt(series, B)];
    const difference = one === null || two === null ? "" : `, B − A = ${Number((two - one).toPrecision(10))}${series.unit ? " " + series.unit : ""}`;
    return `A ${valueAt(series, A)}, B ${valueAt(series, B)}${difference}`;
  }
  async save(form) {
    if (!this.chart) { toast("the plot is empty", true); return; }
    if (form === "csv") {
      const [times, ...columns] = await this.data();
      const lines = times.map((time, place) => [time, ...columns.map(column => column[place] ?? "")].join(","));
      const head = ["time in s", ...this.series.map(each => each.unit ? `${each.name} in ${each.unit}` : each.name)];
      savedText("plot.csv", "text/csv", [head.map(quoted).join(","), ...lines]);
      return;
    }
    if (form === "svg") { savedText("plot.svg", "image/svg+xml", [new XMLSerializer().serializeToString(this.picture())]); return; }
    const from = this.chart.ctx.canvas, scale = devicePixelRatio, head = 20 * scale * this.series.length + 8 * scale;
    const canvas = h("canvas", {width: from.width, height: from.height + head}), pen = canvas.getContext("2d");
    pen.fillStyle = css("--paper");
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.font = `${13 * scale}px sans-serif`;
    this.series.forEach((each, place) => {
      pen.fillStyle = css(this.lines[place].colour);
      pen.fillText(each.name, 10 * scale, 20 * scale * (place + 1));
    });
    pen.drawImage(from, 0, head);
    canvas.toBlob(blob => saved("plot.png", blob));
  }
  picture() {                               // what is seen, as SVG
    const {chart} = this, {offsetLeft: left, offsetTop: top, clientWidth: width, clientHeight: height} = chart.over, head = 20 * this.series.length + 8;
    const text = (x, y, words, more) => s("text", {x, y, fill: css("--ink"), "font-size": 12, "font-family": "sans-serif", ...more}, words);
    const drawing = s("svg", {xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${chart.width} ${chart.height + head}`, width: chart.width, height: chart.height + head},
      s("rect", {width: "100%", height: "100%", fill: css("--paper")}));
    const [times, ...columns] = chart.data, y = (value, scale) => head + top + chart.valToPos(value, scale), x = time => left + chart.valToPos(time, "x");
    chart.axes.forEach((axis, place) => (axis._splits || []).forEach((split, each) => {
      const at = axis.scale === "x" ? x(split) : y(split, axis.scale), words = axis._values[each] ?? "", side = axis.side === 1 ? left + width + axis._pos - chart.axes.find(one => one.side === 1)._pos : 0;
      if (axis.scale === "x") drawing.append(s("line", {x1: at, x2: at, y1: head + top, y2: head + top + height, stroke: css("--grid")}), text(at, head + top + height + 18, words, {"text-anchor": "middle"}));
      else if (place === 1) drawing.append(s("line", {x1: left, x2: left + width, y1: at, y2: at, stroke: css("--grid")}), text(left - 8, at + 4, words, {"text-anchor": "end"}));
      else drawing.append(text(side + 12, at + 4, words));
    }));
    drawing.append(text(left + width / 2, head + top + height + 38, "time in s", {"text-anchor": "middle"}));
    this.series.forEach((each, place) => {
      const {colour, dash} = this.lines[place], path = [];
      columns[place].forEach((value, at) => { if (value !== null && value !== undefined) path.push(path.length ? `H${x(times[at]).toFixed(1)}V${y(value, `in ${each.unit || ""}`).toFixed(1)}` : `M${x(times[at]).toFixed(1)} ${y(value, `in ${each.unit || ""}`).toFixed(1)}`); });
      drawing.append(text(30, 20 * (place + 1), `${each.name}${each.unit ? ` in ${each.unit}` : ""}`),
        s("line", {x1: 4, x2: 24, y1: 20 * place + 16, y2: 20 * place + 16, stroke: css(colour), "stroke-width": 2, "stroke-dasharray": dash?.join(" ")}),
        s("path", {d: path.join(""), fill: "none", stroke: css(colour), "stroke-width": 1.6, "stroke-dasharray": dash?.join(" ")}));
    });
    return drawing;
  }
}

const plots = {
  all: [], places: new Map(), chosen: null, lost: kept("plots", [], sessionStorage), zoomed: null, window: 30, marks: {A: null, B: null}, height: LOWEST, list: h("div", {class: "plots"}),
  range() {
    if (this.zoomed) return this.zoomed;
    const end = live ? Math.max(clock.time, 1) : clock.end || 1;
    return live && this.window < Infinity ? [Math.max(end - this.window, 0), end] : [live ? this.begin() : 0, end];
  },
  begin() {                                 // the oldest sample that is kept
    const firsts = this.all.flatMap(plot => plot.series).map(each => each.times[0] ?? Infinity);
    return Math.min(clock.time - 1, ...firsts);
  },
  zoom(range) {
    this.zoomed = range;
    this.redraw();
  },
  redraw() {
    for (const each of this.all) if (each.chart) each.ranged();
    stale = true;
  },
  follow() { this.zoom(null); },
  everything() {
    this.window = Infinity;
    this.zoom(null);
  },
  scale(factor) {
    const [low, high] = this.range(), middle = live ? high : Math.min(Math.max(clock.time, low), high);
    this.zoom([middle - (middle - low) * factor, middle + (high - middle) * factor]);
  },
  put(name, time) { this.marks[name] = time; stale = true; },
  choose(plot) {
    this.chosen = plot;
    for (const each of this.all) each.element.classList.toggle("chosen", each === plot && this.all.length > 1);
  },
  create() {
    const plot = new Plot();
    this.all.push(plot);
    this.list.append(plot.element);
    this.choose(plot);
    return plot;
  },
  remove(plot) {
    if (plot.chart) plot.chart.destroy();
    plot.element.remove();
    this.all = this.all.filter(each => each !== plot);
    this.keep();
    if (!this.all.length) this.create(); else this.choose(this.all.at(-1));
  },
  add(series) { this.chosen.add(series); stale = true; },
  keep() {                                  // for this window, when it is loaded again
    if (!this.lost) keep("plots", this.all.map(plot => plot.series.map(each => [each.id, each.watched ?? null])), sessionStorage);
  },
  restore() {                               // once their messages are known; the others are left out
    const lost = this.lost.map(plot => plot.map(([id, watched]) => seriesOf(id, watched)).filter(Boolean)).filter(plot => plot.length);
    this.lost = null;
    lost.forEach((plot, place) => { if (place) this.create(); plot.forEach(each => this.add(each)); });
  },
  fill() {                                  // the plots share the window's height
    const top = this.list.getBoundingClientRect().top + scrollY, foot = document.querySelector("footer").offsetHeight;
    const heads = this.all.reduce((sum, each) => sum + each.element.firstChild.offsetHeight + 32, 0);
    this.height = Math.max(LOWEST, Math.floor((innerHeight - top - foot - heads - 8) / this.all.length));
  },
  placeOf(id, plot) {                       // what a series is drawn by as long as it is in a plot: the same in all of them
    const shown = new Set([...this.all, plot].flatMap(each => each.series).map(each => each.id));
    for (const each of this.places.keys()) if (!shown.has(each)) this.places.delete(each);
    if (!this.places.has(id)) this.places.set(id, Array.from({length: this.places.size + 1}, (_, place) => place).find(place => ![...this.places.values()].includes(place)));
    return this.places.get(id);
  },
  watched() { return this.all.flatMap(plot => plot.series).filter(each => each instanceof ObjectSeries && each.watched); },
};
plots.create();

function cursorTools() {                    // two cursors, by the pointer or typed; their times and how they differ
  const inputs = Object.fromEntries(["A", "B"].map(name => [name, h("input", {type: "text", inputmode: "decimal", size: 8,
    "aria-label": `cursor ${name} in s`, placeholder: "s", onchange: event => {
      const time = Number(event.target.value);
      plots.put(name, event.target.value === "" || Number.isNaN(time) ? null : time);
    }})]));
  const apart = h("span", {class: "hint"});
  const clear = h("button", {onclick: () => { plots.put("A", null); plots.put("B", null); }}, "Clear");
  const trace = h("button", {onclick: () => openTrace(plots.marks.A), title: "show the frames at cursor A"}, "Frames at A");
  const element = h("span", {class: "buttons cursors"}, ...Object.entries(inputs).map(([name, input]) => h("label", {}, name, " ", input)), apart, clear, trace);
  return {element, show() {
    const {A, B} = plots.marks;
    for (const [name, input] of Object.entries(inputs)) if (document.activeElement !== input) input.value = plots.marks[name]?.toFixed(4) ?? "";
    say(apart, A === null || B === null ? "" : `Δ ${(B - A).toFixed(4)} s${B === A ? "" : `, ${(1 / Math.abs(B - A)).toPrecision(4)} Hz`}`);
    show(clear, A !== null || B !== null);
    show(trace, A !== null);
  }};
}

function plotsView() {
  const windows = h("select", {"aria-label": "span of time", onchange: () => { plots.window = Number(windows.value); plots.zoom(null); }},
    ...[10, 30, 60, 300].map(each => h("option", {value: each, selected: each === plots.window}, `last ${each} s`)), h("option", {value: Infinity}, "all"));
  const held = h("span", {class: "held", role: "status"}), follow = h("button", {class: "main", onclick: () => plots.follow()}, live ? "Follow again" : "All");
  const cursors = cursorTools();
  const element = h("div", {}, h("div", {class: "tools plots-tools"},
    h("button", {onclick: () => plots.create()}, "New plot"),
    live ? windows : null,
    h("button", {onclick: () => plots.scale(0.5)}, "Zoom in"), h("button", {onclick: () => plots.scale(2)}, "Zoom out"),
    h("button", {onclick: () => { plots.everything(); windows.value = Infinity; }}, "All"), held, follow, cursors.element,
    h("p", {class: "hint"}, "Drag across a plot to zoom; a click puts cursor A, with Shift B.")), plots.list);
  return {element, show(time) {
    const {zoomed} = plots;
    show(held, zoomed !== null);
    show(follow, zoomed !== null);
    if (zoomed) say(held, `${live ? "Held at" : "Zoomed to"} ${zoomed[0].toFixed(2)} to ${zoomed[1].toFixed(2)} s`);
    cursors.show();
    plots.fill();
    for (const each of plots.all) each.update(time);
  }};
}
