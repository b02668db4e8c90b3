"use strict";
(async function () {
const figure = document.currentScript.previousElementSibling;
const [json, packed] = figure.querySelectorAll("script");
const data = JSON.parse(json.textContent);
const bytes = Uint8Array.from(atob(packed.textContent), (c) => c.charCodeAt(0));
const buffer = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
const array = ([kind, offset, count]) => new { f4: Float32Array, u2: Uint16Array }[kind](buffer, offset, count);
const NS = "http://www.w3.org/2000/svg", W = 900, H = 300, L = 64, R = 12, T = 10, B = 34;
const COLOURS = data.colours;
const own = new Map();
const state = { k: 0, from: 0, to: 1, off: new Set(), at: null };

function make(name, properties, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function trace() {
  if (!own.has(state.k)) {
    const found = data.traces[state.k];
    own.set(state.k, { ...found, time: array(found.time), lines: found.lines.map((line) => ({ name: line.name,
      values: Float64Array.from(array(line.values), (c) => (c === 65535 ? NaN : line.low + line.step * c)) })) });
  }
  return own.get(state.k);
}

function whole() {
  const { time } = trace();
  [state.from, state.to] = [time[0], time[time.length - 1]];
}

// First sample at or after a time.
function first(time, t) {
  let [a, b] = [0, time.length];
  while (a < b) {
    const m = (a + b) >> 1;
    if (time[m] < t) a = m + 1;
    else b = m;
  }
  return a;
}

function ticks(from, to, count) {
  const raw = (to - from) / count || 1, size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((f) => f * size >= raw) * size, found = [];
  for (let t = Math.ceil(from / step) * step; t <= to + 1e-9 * step; t += step)
    found.push(Math.abs(t) < 1e-9 * step ? 0 : t);
  return found;
}

const told = (v) => (v === 0 ? "0" : String(Number(v.toPrecision(4))));

// The samples in view, or of many the least and largest of each pixel's.
function thinned(time, values, x) {
  const a = Math.max(first(time, state.from) - 1, 0), b = Math.min(first(time, state.to) + 1, time.length);
  const points = [];
  if (b - a < 3 * W) for (let i = a; i < b; i++) points.push([x(time[i]), values[i]]);
  else for (let pixel = 0; pixel < W; pixel++) {
    const [i, j] = [a + Math.floor(((b - a) * pixel) / W), a + Math.floor(((b - a) * (pixel + 1)) / W)];
    let [low, high] = [i, i];
    for (let s = i; s < j; s++) {
      if (values[s] < values[low]) low = s;
      if (values[s] > values[high]) high = s;
    }
    for (const s of low < high ? [low, high] : [high, low]) points.push([x(time[s]), values[s]]);
  }
  return points;
}

let svg = null;
function draw() {
  const { time, lines, unit, record, channel } = trace();
  const shown = lines.map((line, k) => ({ ...line, colour: COLOURS[k % COLOURS.length] })).filter((line) => !state.off.has(line.name));
  const x = (t) => L + ((t - state.from) / (state.to - state.from || 1)) * (W - L - R);
  const paths = shown.map((line) => thinned(time, line.values, x));
  let [low, high] = [Infinity, -Infinity];
  for (const path of paths) for (const [, v] of path) if (v === v) [low, high] = [Math.min(low, v), Math.max(high, v)];
  if (low > high) [low, high] = [-1, 1];
  const pad = 0.06 * (high - low) || 1;
  [low, high] = [low - pad, high + pad];
  const y = (v) => T + ((high - v) / (high - low)) * (H - T - B);
  svg = document.createElementNS(NS, "svg");
  const add = (name, attributes, text) => {
    const part = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, value);
    if (text !== undefined) part.textContent = text;
    svg.append(part);
    return part;
  };
  for (const [key, value] of Object.entries({ xmlns: NS, viewBox: `0 0 ${W} ${H}`, "font-family": "sans-serif", "font-size": 12, role: "img", tabindex: 0,
    "aria-label": `${channel} in ${record}, ${told(state.from)} to ${told(state.to)} s` })) svg.setAttribute(key, value);
  const grid = { stroke: "currentColor", "stroke-opacity": 0.15 };
  for (const t of ticks(state.from, state.to, 8)) {
    add("line", { x1: x(t), x2: x(t), y1: T, y2: H - B, ...grid });
    add("text", { x: x(t), y: H - B + 15, "text-anchor": "middle", fill: "currentColor" }, told(t));
  }
  for (const v of ticks(low, high, 5)) {
    add("line", { x1: L, x2: W - R, y1: y(v), y2: y(v), ...grid });
    add("text", { x: L - 5, y: y(v) + 4, "text-anchor": "end", fill: "currentColor" }, told(v));
  }
  add("text", { x: W - R, y: H - 3, "text-anchor": "end", fill: "currentColor" }, "time [s]");
  add("text", { x: L, y: H - 3, fill: "currentColor" }, `${channel} [${unit}], ${record}`);
  shown.forEach((line, k) => {
    let d = "", pen = "M";
    for (const [px, v] of paths[k]) {
      if (v !== v) { pen = "M"; continue; }
      d += `${pen}${px.toFixed(1)} ${y(v).toFixed(1)}`;
      pen = "L";
    }
    const clip = add("svg", { x: L, y: T, width: W - L - R, height: H - T - B, viewBox: `${L} ${T} ${W - L - R} ${H - T - B}` });
    const path = document.createElementNS(NS, "path");
    for (const [key, value] of Object.entries({ d, fill: "none", stroke: line.colour, "stroke-width": 1.3, class: "line" })) path.setAttribute(key, value);
    clip.append(path);
    add("text", { x: W - R - 4, y: T + 14 + 15 * k, "text-anchor": "end", fill: line.colour }, line.name);
  });
  const cursor = add("line", { y1: T, y2: H - B, stroke: "currentColor", "stroke-dasharray": "3 3", visibility: "hidden" });
  const band = add("rect", { y: T, height: H - T - B, fill: "currentColor", "fill-opacity": 0.12, visibility: "hidden" });
  figure.querySelector(".drawn").replaceChildren(svg);
  const timeOf = (event) => {
    const box = svg.getBoundingClientRect(), px = ((event.clientX - box.left) / box.width) * W;
    return state.from + Math.min(Math.max((px - L) / (W - L - R), 0), 1) * (state.to - state.from);
  };
  let began = null;
  svg.onpointerdown = (event) => { began = timeOf(event); svg.setPointerCapture(event.pointerId); };
  svg.onpointermove = (event) => {
    const t = timeOf(event), i = Math.min(first(time, t), time.length - 1);
    cursor.setAttribute("x1", x(time[i]));
    cursor.setAttribute("x2", x(time[i]));
    cursor.setAttribute("visibility", "visible");
    value.textContent = `${time[i].toPrecision(6)} s: ` + shown.map((line) => `${line.name} ${told(line.values[i])}`).join(", ") + ` ${unit}`;
    if (began === null) return;
    const [a, b] = [began, t].sort((p, q) => p - q);
    for (const [key, v] of Object.entries({ x: x(a), width: x(b) - x(a), visibility: "visible" })) band.setAttribute(key, v);
  };
  svg.onpointerup = (event) => {
    const [a, b] = [began, timeOf(event)].sort((p, q) => p - q);
    began = null;
    if (b - a > 0.01 * (state.to - state.from)) zoom(a, b);
    else band.setAttribute("visibility", "hidden");
  };
  svg.onpointerleave = () => { if (began === null) { cursor.setAttribute("visibility", "hidden"); value.textContent = ""; } };
  svg.ondblclick = () => { whole(); draw(); };
  svg.onwheel = (event) => {
    event.preventDefault();
    const t = timeOf(event), f = event.deltaY > 0 ? 1.3 : 1 / 1.3;
    zoom(t - (t - state.from) * f, t + (state.to - t) * f);
  };
  svg.onkeydown = (event) => {
    const span = state.to - state.from, way = { ArrowLeft: [-0.2, -0.2], ArrowRight: [0.2, 0.2], "+": [0.15, -0.15], "-": [-0.2, 0.2] }[event.key];
    if (!way) return;
    event.preventDefault();
    zoom(state.from + way[0] * span, state.to + way[1] * span);
    svg.focus();
  };
}

function zoom(from, to) {
  const { time } = trace();
  [state.from, state.to] = [Math.max(from, time[0]), Math.min(to, time[time.length - 1])];
  if (!(state.to > state.from)) whole();
  draw();
}

function lines() {
  switches.replaceChildren(...trace().lines.map(({ name }, k) => {
    const box = make("input", { type: "checkbox", checked: !state.off.has(name) });
    box.onchange = () => { state.off[box.checked ? "delete" : "add"](name); draw(); };
    const words = make("span", {}, name);
    words.style.color = COLOURS[k % COLOURS.length];
    return make("label", {}, box, words);
  }));
}

// What is shown as a file: the samples in view, the drawing, the drawing's pixels.
function save(name, url) {
  const { record, channel } = trace();
  make("a", { href: url, download: `${record}-${channel}`.replace(/[^\w.-]/g, "_") + `.${name}` }).click();
}
const files = {
  CSV() {
    const { time, lines: every, unit } = trace(), shown = every.filter((line) => !state.off.has(line.name)), rows = [];
    rows.push(["time [s]", ...shown.map((line) => `${line.name} [${unit}]`)].join(","));
    for (let i = first(time, state.from); i < time.length && time[i] <= state.to; i++)
      rows.push([time[i].toPrecision(8), ...shown.map((line) => (line.values[i] === line.values[i] ? line.values[i].toPrecision(7) : ""))].join(","));
    save("csv", URL.createObjectURL(new Blob([rows.join("\n") + "\n"], { type: "text/csv" })));
  },
  SVG() { save("svg", URL.createObjectURL(new Blob([text()], { type: "image/svg+xml" }))); },
  PNG() {
    const image = new Image();
    image.onload = () => {
      const canvas = make("canvas", { width: 2 * W, height: 2 * H }), pen = canvas.getContext("2d");
      pen.fillStyle = "#fff";
      pen.fillRect(0, 0, 2 * W, 2 * H);
      pen.drawImage(image, 0, 0, 2 * W, 2 * H);
      save("png", canvas.toDataURL());
    };
    image.src = `data:image/svg+xml;base64,${btoa(unescape(encodeURIComponent(text())))}`;
  },
};
function text() {
  const copy = svg.cloneNode(true);
  copy.setAttribute("width", W);
  copy.setAttribute("height", H);
  copy.setAttribute("color", "#1b2129");
  return new XMLSerializer().serializeToString(copy);
}

const value = make("output", { className: "under" }), switches = make("span", { className: "lines" });
function choice(words, key) {
  const select = make("select", { ariaLabel: words });
  const fill = () => {
    const of = key === "record" ? data.traces : data.traces.filter((t) => t.record === data.traces[state.k].record);
    const names = [...new Set(of.map((t) => t[key]))];
    select.replaceChildren(...names.map((name) => make("option", { value: name }, name)));
    select.value = data.traces[state.k][key];
  };
  select.onchange = () => {
    const before = data.traces[state.k], record = key === "record" ? select.value : before.record;
    const channel = key === "channel" ? select.value : before.channel;
    const here = data.traces.findIndex((t) => t.record === record && t.channel === channel);
    state.k = here >= 0 ? here : data.traces.findIndex((t) => t.record === record);
    refill();
    whole();
    lines();
    draw();
  };
  return { select, fill };
}
const choices = [choice("record", "record"), choice("channel", "channel")];
const refill = () => choices.forEach(({ fill }) => fill());
const all = make("button", { type: "button", onclick: () => { whole(); draw(); } }, "all");
figure.querySelector(".tools").append(...choices.map(({ select }) => select), switches, all,
  ...Object.entries(files).map(([name, act]) => make("button", { type: "button", onclick: act }, name)), value);
refill();
whole();
lines();
draw();
figure.dataset.ready = "true";
})();
