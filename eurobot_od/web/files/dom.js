"use strict";
// Helpers of all views: elements, texts, numbers that a person types, files to save, and what is said at the bottom.

const content = JSON.parse(document.getElementById("content").textContent);
const live = content.live === true;

function filled(made, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== null && value !== undefined && value !== false) made.setAttribute(name, value);
  }
  made.append(...children.filter(each => each !== null && each !== undefined));
  return made;
}
const h = (tag, attributes, ...children) => filled(document.createElement(tag), attributes, children);
const s = (tag, attributes, ...children) =>
  filled(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
const plain = name => name.replace(/[ _-]/g, "").toLowerCase();
const say = (element, text) => { if (element.textContent !== text) element.textContent = text; };
const show = (element, visible) => { if (element.hidden === visible) element.hidden = !visible; };
const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function upTo(times, time) {                // how many of the times, which are in order, are not later
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1; else high = middle;
  }
  return low;
}
function saved(name, blob) {
  const link = h("a", {href: URL.createObjectURL(blob), download: name});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);   // not at once: the browser has yet to read it
}
const savedText = (name, type, lines) => saved(name, new Blob([lines.join("\n"), "\n"], {type}));
const quoted = text => `"${String(text).replaceAll('"', '""')}"`;

// What is said in passing

let toastTimer = 0;
const toastLine = h("output", {id: "toast", role: "status", hidden: true});
function toast(text, wrong) {
  clearTimeout(toastTimer);
  say(toastLine, text);
  toastLine.className = wrong ? "wrong" : "";
  show(toastLine, true);
  toastTimer = setTimeout(() => show(toastLine, false), wrong ? 8000 : 3000);
}

// Numbers

const WHOLE = /^[+-]?(\d+|0x[\da-f]+)$/i;   // as the server reads them: not 1_000, and no digits of other scripts
function wholeNumber(name, text, low, high) {  // the number; throws what is wrong with it, and the range
  const allowed = `allowed: ${low}..${high}`, word = text.trim();
  if (word === "") throw new Error(`${name} is empty; ${allowed}`);
  if (!WHOLE.test(word)) throw new Error(`${name} = ${word} is not a whole number; ${allowed}`);
  const sign = word.startsWith("-") ? -1 : 1, value = sign * Number(word.replace(/^[+-]/, ""));
  if (value < low || value > high) throw new Error(`${name} = ${word} is not allowed; ${allowed}`);
  return value;
}

// Bit 29 stands for a 29-bit identifier, which is written with eight digits.
const EXTENDED = 2 ** 29;
const identifier = id => id === null ? "" : (id % EXTENDED).toString(16).toUpperCase().padStart(id < EXTENDED ? 3 : 8, "0");
const hex = (value, digits) => value === null ? "–" : `0x${value.toString(16).toUpperCase().padStart(digits, "0")}`;
const octets = data => data.match(/../g) || [];
const RADICES = {                           // how whole numbers and bytes are written
  Decimal: {number: value => String(value), bytes: data => octets(data).join(" ").toUpperCase()},
  Hex: {number: value => `${value < 0 ? "-" : ""}0x${Math.abs(value).toString(16).toUpperCase()}`,
    bytes: data => octets(data).join(" ").toUpperCase()},
  Binary: {number: value => `${value < 0 ? "-" : ""}0b${Math.abs(value).toString(2)}`,
    bytes: data => octets(data).map(each => parseInt(each, 16).toString(2).padStart(8, "0")).join(" ")},
};

// Filters: `one, two, !three`

function listFilter(text, test) {           // passes what one of the wanted parts fits, or any without these, and no part behind `!`; throws
  const parts = text.split(",").map(each => each.trim()).filter(Boolean).map(each => ({isOut: each.startsWith("!"), test: test(each.replace(/^!\s*/, ""))}));
  const wanted = parts.filter(each => !each.isOut), others = parts.filter(each => each.isOut);
  return thing => (!wanted.length || wanted.some(each => each.test(thing))) && !others.some(each => each.test(thing));
}
function numberTest(word, otherwise) {      // `180`, `0x180-0x1FF` in hexadecimal digits, as a test of a number; of anything else what `otherwise` returns
  const found = /^(?:0x)?([\da-f]+)(?:\s*-\s*(?:0x)?([\da-f]+))?$/i.exec(word);
  if (!found) return otherwise(word);
  const low = parseInt(found[1], 16), high = parseInt(found[2] ?? found[1], 16);
  if (low > high) throw new Error(`“${word}”: the first is more than the last`);
  return number => number !== null && number >= low && number <= high;
}
function wordFilter(text) {                 // of things that have `words`, and an `id`, by a part of their words or a range of numbers
  return listFilter(text, word => {
    if (!word || /^[\da-fx]+\s*-$|^-/i.test(word)) throw new Error(`“${word || "!"}” is not understood: write a part of a name, 180-1FF, or !name for all others`);
    const isRange = word.includes("-") && numberTest(word, () => null), wanted = plain(word);
    return isRange ? thing => isRange(thing.id) : thing => thing.words.includes(wanted);
  });
}
// The filters of a view are in the address, `#trace?identifier=180,200`: a link, a layout and a reload lead to the same.
function namedFilters(view) {
  const [name, words] = location.hash.split("?");
  return new URLSearchParams(name === `#${view}` ? words : "");
}
function nameFilters(view, chosen) {
  const words = new URLSearchParams(chosen).toString();
  history.replaceState(null, "", words ? `#${view}?${words}` : `#${view}`);
}
function filterBox(view, attributes, act) {  // a box for such a filter: it says what it does not understand, and filters nothing then
  const said = h("span", {class: "hint", role: "status"});
  const box = h("input", {type: "search", value: namedFilters(view).get("search"), ...attributes, oninput: () => {
    nameFilters(view, box.value.trim() ? {search: box.value} : {});
    filter();
  }});
  const filter = () => {
    let found = () => true;
    try { found = wordFilter(box.value); say(said, ""); } catch (error) { say(said, error.message); }
    box.setAttribute("aria-invalid", String(said.textContent !== ""));
    said.classList.toggle("is-wrong", said.textContent !== "");
    act(found);
  };
  if (box.value) filter();
  return {box, said};
}

// Controls

const ARMED = 4000;                         // ms that a first click counts
function askedTwice(text, act, attributes) {  // a button for what moves something: a second click has to confirm it
  let timer = 0;
  const disarm = () => { clearTimeout(timer); timer = 0; say(button, text); button.classList.remove("armed"); };
  const button = h("button", {...attributes, "data-armed": `${text}: press again`, onclick: event => {
    event.preventDefault();
    if (timer) { disarm(); act(event); return; }
    say(button, button.dataset.armed);
    button.classList.add("armed");
    timer = setTimeout(disarm, ARMED);
  }, onblur: () => { if (timer) disarm(); }}, text);
  return button;
}
// A button for what the server may ask about: `act` is given what it has to add once the person is sure. While a reason
// is shown the button is armed, and only a second click on it carries it out.
function sureButton(text, act, attributes = {}) {
  let timer = 0, asked = "";                // what the person says yes to
  const disarm = () => { clearTimeout(timer); timer = 0; say(button, text); say(reason, ""); show(reason, false); button.classList.remove("armed"); };
  const arm = why => {
    asked = why;
    say(button, button.dataset.armed);
    say(reason, why);
    show(reason, true);
    button.classList.add("armed");
    timer = setTimeout(disarm, ARMED);
  };
  const button = h("button", {type: "button", "data-armed": `${text}: press again`, ...attributes, onclick: async event => {
    event.preventDefault();
    const sure = timer ? {sure: true, confirmed: asked} : {};
    if (timer) disarm();
    try { await act(sure); } catch (error) { if (error.asks) arm(error.asks); else toast(error.message, true); }
  }, onblur: () => { if (timer) disarm(); }}, text);
  const reason = h("small", {class: "reason", role: "alert", hidden: true});
  return h("span", {class: "sure"}, button, reason);
}
function kept(name, otherwise, storage = localStorage) {  // what this browser, or this window, remembers of the page
  try { return JSON.parse(storage.getItem(`canopen-page ${name}`)) ?? otherwise; } catch { return otherwise; }
}
function keep(name, value, storage = localStorage) {
  try { storage.setItem(`canopen-page ${name}`, JSON.stringify(value)); } catch { /* it is full */ }
}

// Files for the server, and the page that it shows; `connection` is the bus's, or that of the page that begins with nothing

const PART = 30000;                         // bytes of a file that are sent at once
async function upload(file) {               // send a file to the server, and return its name there
  const bytes = new Uint8Array(await file.arrayBuffer());
  for (let at = 0; at === 0 || at < bytes.length; at += PART) {
    const data = btoa(String.fromCharCode(...bytes.subarray(at, at + PART)));
    await connection.ask({do: "file", name: file.name, at, data});
  }
  return file.name;
}
function dropZone(words, take, accept = "") {  // a button for a file, on which one can also be dropped
  const input = h("input", {type: "file", hidden: true, accept, onchange: () => { if (input.files.length) take(input.files[0]); input.value = ""; }});
  const button = h("button", {type: "button", class: "drop", onclick: () => input.click(),
    ondragover: event => { event.preventDefault(); button.classList.add("over"); }, ondragleave: () => button.classList.remove("over"),
    ondrop: event => { event.preventDefault(); button.classList.remove("over"); if (event.dataTransfer.files.length) take(event.dataTransfer.files[0]); }}, words);
  return h("span", {}, button, input);
}
const DEVICE_FILES = ".eds,.dcf,.xdd,.xdc,.xml";
const loudly = promise => promise.catch(error => toast(error.message, true));
const quietly = promise => promise.catch(() => undefined);

let shownPage = "";                         // what the server shows: this page, until it says otherwise
function watchServer() {                    // loads the page anew once the server shows another one
  const look = async () => {
    const shown = await fetch("/shown").then(answer => answer.ok ? answer.text() : "").catch(() => "");
    if (shown && shownPage && shown !== shownPage) { location.hash = ""; location.reload(); return; }
    shownPage ||= shown;
    setTimeout(look, SERVER_LOOK);
  };
  look();
}
const SERVER_LOOK = 1000;                   // ms between two looks
