// --- panel: numbers, sliders --------------------------------------------------------------
const BLOWS = { force: ["force of a blow", "N", 1], rate: ["blows a second", "1/s", 1],
  width: ["width of a blow", "ms", 1e3], preload: ["feed force", "N", 1], hits: ["blows a rivet", "", 1] };
const HEADS = [["joint", ""], ["peak", "mrad"], ["worst", "mrad"], ["torque", "N m"], ["stress", "MPa"],
  ["utilisation", "%"], ["life, rivets", "P10 to P90"]];
const rows = {}, sliders = [];

function say(text, bad) {
  byId("state").textContent = text;
  byId("state").className = bad ? "bad" : "";
}

const number3 = (x) => (x === null ? "–" : Math.abs(x) >= 1e5 ? x.toExponential(1) : x !== 0 && Math.abs(x) < 1e-3 ? "≈ 0"
  : Number(x.toPrecision(3)).toString());
const count = (x) => (x === "unlimited" ? x : x >= 1e5 ? x.toExponential(1) : String(Math.round(x)));
function lifeText(joint) {
  if (joint.life_interval === null) return joint.life === null ? "–" : count(joint.life);
  const [low, high] = joint.life_interval.map(count);
  return low === high ? low : `${low} to ${high}`;
}
const used = (joint) => {
  const known = [joint.utilisation, joint.drive_utilisation].filter((u) => u !== null);
  return known.length ? Math.max(...known) : null;
};

function makeTable() {
  byId("joints").tHead.append(element("tr", {}, ...HEADS.map(([head, unit]) =>
    element("th", { scope: "col" }, head, element("br"), unit))));
  data.flexible.forEach((joint, j) => data.models.forEach((name, k) => {
    const row = element("tr", { className: k ? name : "", title: k ? `${joint.name}, ${name} model` : joint.name,
      tabIndex: k ? -1 : 0 }, ...HEADS.map(() => element("td")));
    row.cells[0].textContent = k ? `  ${name}` : joint.name;
    row.cells[5].className = "use";
    row.onclick = () => ask({ joint: j });
    row.onkeydown = (e) => { if (e.key === "Enter") ask({ joint: j }); };
    byId("joints").tBodies[0].append(row);
    rows[`${name}/${j}`] = row;
  }));
  byId("scale").style.background = `linear-gradient(90deg, ${data.colours.join(", ")})`;
}

function slider(into, id, text, range, act, scale = 1) {
  const out = element("output", { id: `${id}-out` }), label = element("label", { htmlFor: id }, text, " ", out);
  const input = element("input", { id, type: "range", ...range });
  input.oninput = (e) => act(Number(input.value) / scale, e.timeStamp);
  into.append(label, input);
  return { input, out, label };
}

function put({ input, out }, value, text) {
  if (document.activeElement !== input || !input.matches(":active")) input.value = value;
  out.textContent = text;
}

function makeSliders() {
  data.joints.forEach((joint, j) => {
    const step = (joint.upper - joint.lower) / 2000 || 0.001;
    sliders.push(slider(byId("sliders"), `joint-${j}`, joint.name, { min: joint.lower, max: joint.upper, step },
      (value, stamp) => ask({ joints: { [j]: value } }, stamp)));
  });
  for (const k of [0, 1, 2]) byId(`tool-${k}`).onchange = () =>
    ask({ tool: [0, 1, 2].map((i) => Number(byId(`tool-${i}`).value)) });
  const turned = (e) => {
    const [a, b] = ["azimuth", "elevation"].map((id) => (Number(byId(id).value) * Math.PI) / 180);
    ask({ direction: [Math.cos(a) * Math.cos(b), Math.sin(a) * Math.cos(b), Math.sin(b)] }, e.timeStamp);
  };
  byId("azimuth").oninput = byId("elevation").oninput = turned;
  byId("along").onclick = () => ask({ along_tool: true });
  byId("worst").onclick = () => ask({ worst: now.joint });
  byId("home").onclick = () => ask({ home: true });
  byId("keeps").onchange = () => ask({ keeps_axis: byId("keeps").checked });
  byId("keeps-line").hidden = !data.aims;
}

const blowSliders = {};
function makeBlows(blows) {
  const top = (x, least) => Math.max(4 * x, least);
  const ranges = { force: [0, top(blows.force, 100), 1], rate: [1, top(blows.rate, 50), 0.5],
    width: [0.2, 1e3 * Math.min(blows.width * 4, 0.9 * blows.period), 0.1],
    preload: [0, top(blows.preload, 200), 1], hits: [1, top(blows.hits, 40), 1] };
  for (const [key, [text, unit, scale]] of Object.entries(BLOWS)) {
    if (blows[key] === undefined || (key === "rate" && blows.period === undefined)) continue;
    const [min, max, step] = ranges[key];
    blowSliders[key] = slider(byId("blows"), key, `${text}${unit && `, ${unit}`}`, { min, max, step },
      (value, stamp) => ask({ blows: { [key]: value } }, stamp), scale);
  }
}

function tell(values) {
  if (!Object.keys(blowSliders).length) makeBlows(values.blows);
  data.models.forEach((name, k) => {
    const model = values.models[name];
    data.flexible.forEach((flexible, j) => {
      const row = rows[`${name}/${j}`];
      row.classList.toggle("old", !model);
      row.classList.toggle("chosen", !k && j === values.joint);
      if (!model) return;
      const joint = model.joints[j], share = used(joint);
      const cells = [null, joint.peak_deflection * 1e3, joint.worst_deflection === null ? null : joint.worst_deflection * 1e3,
        joint.peak_torque, joint.stress === null ? null : joint.stress / 1e6, share === null ? null : 100 * share];
      cells.forEach((value, c) => { if (c) row.cells[c].textContent = number3(value); });
      row.cells[5].style.setProperty("--share", `${Math.min(100 * (share || 0), 100)}%`);
      row.cells[5].classList.toggle("over", share > 1);
      row.cells[6].textContent = lifeText(joint);
      if (!k) paintRing(j, share);
    });
  });
  const shafts = Object.values(values.models).some((model) => model && model.joints.some((joint) => joint.stress !== null));
  byId("joints").classList.toggle("no-shafts", !shafts);
  byId("frequencies").textContent = data.models.filter((name) => values.models[name]).map((name) =>
    `natural frequencies${data.models.length > 1 ? `, ${name}` : ""}: ` +
    [values.models[name].natural_frequencies.map(number3).join(", ") + " Hz", ...values.models[name].notes].join("; ")).join("; ");
  byId("robot-life").textContent = weakest(values);
  values.pose.forEach((q, j) => {
    put(sliders[j], q, `${q.toFixed(3)} ${data.joints[j].unit}`);
    sliders[j].label.classList.toggle("limit", values.at_limit.includes(data.joints[j].name));
  });
  values.tool.forEach((x, k) => { if (document.activeElement !== byId(`tool-${k}`)) byId(`tool-${k}`).value = x.toFixed(4); });
  const [x, y, z] = values.direction, turnedBy = { azimuth: Math.atan2(y, x), elevation: Math.asin(Math.max(-1, Math.min(1, z))) };
  for (const [id, angle] of Object.entries(turnedBy))
    put({ input: byId(id), out: byId(`${id}-out`) }, (angle * 180) / Math.PI, `${((angle * 180) / Math.PI).toFixed(0)}°`);
  for (const [key, made] of Object.entries(blowSliders))
    put(made, values.blows[key] * BLOWS[key][2], number3(values.blows[key] * BLOWS[key][2]));
  byId("keeps").checked = values.keeps_axis;
  const told = [values.problem, ...values.touching.map(([a, b]) => `${a} touches ${b}`), ...values.notes,
    ...(values.at_limit.length ? [`at its limit: ${values.at_limit.join(", ")}`] : [])].filter(Boolean);
  if (!told.length && data.collisions && !values.answers) told.push(`no collision check: ${data.collisions}`);
  say(told.join("; "), told.length > 0 && !(told.length === 1 && told[0].startsWith("no collision")));
}

function weakest(values) {
  return data.models.filter((name) => values.models[name]).map((name) => {
    const known = values.models[name].joints.filter((joint) => used(joint) !== null);
    if (!known.length) return "no shaft and no drive is known: no life";
    const end = (joint) => (joint.life_interval ? joint.life_interval[0] : joint.life);
    const low = (joint) => { const life = end(joint); return life === "unlimited" || life === null ? Infinity : life; };
    const worst = known.reduce((a, b) => (low(b) < low(a) || (low(b) === low(a) && used(b) > used(a)) ? b : a));
    const told = data.models.length > 1 ? `${name}: ` : "";
    const lasts = lifeText(worst) === "unlimited" ? "an unlimited life" : `${lifeText(worst)} rivets`;
    return `${told}${worst.name} decides: ${lasts}, ${number3(100 * used(worst))} % utilisation`;
  }).join("; ");
}
