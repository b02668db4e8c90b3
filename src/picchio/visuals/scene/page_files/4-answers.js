// --- answers: click a joint or a rivet, hover a ball, look along an axis -------------------
const frameAt = new Map(data.frames.map((frame) => [frame.path, frame]));

function under(event, wanted) {
  aim(event);
  const shownNow = made.filter(({ object, item }) => object.visible && wanted(item));
  const hit = ray.intersectObjects(shownNow.map(({ object }) => object), false)[0];
  return hit && { ...hit, item: shownNow.find(({ object }) => object === hit.object).item };
}

// The flexible joint of a ring, or that moves the link that was clicked.
function jointOf(item) {
  if (item.layer === "joints") return item.joint;
  for (let path = item.node; path; path = path.replace(/\/?[^/]*$/, "")) {
    const joint = frameAt.get(path) && frameAt.get(path).joint;
    if (joint !== null && joint !== undefined) return joint;
  }
  return null;
}

function rowsOf(rows) {
  return rows.map(([words, value, source]) => {
    const cell = element("td", {}, value), short = source && source.length > 160 ? `${source.slice(0, 157)}…` : source;
    if (source) cell.append(element("br"), element("small", { textContent: short, title: source }));
    return element("tr", {}, element("th", {}, words), cell);
  });
}

function card(title, rows) {
  byId("card").hidden = false;
  byId("card-title").textContent = title;
  byId("card-rows").replaceChildren(...rowsOf(rows));
  byId("card-plot").replaceChildren();
  byId("card").scrollIntoView({ block: "nearest" });
}

function tellJoint(j) {
  state.joint = j;
  byId("joint").value = j;
  drawOverlay();
  const { name, card: own } = data.joints[j];
  card(name, own.rows);
  plotJoint(j, own.stress);
}

// The vibration as it is played: deflection over time, the stress on a second axis.
function plotJoint(j, stress) {
  const along = motion.directions[state.direction].along, values = [];
  for (let i = 0; i < motion.count; i++)
    values.push(1e3 * [0, 1, 2].reduce((sum, d) => sum + along[d] * samples[(3 * j + d) * motion.count + i], 0));
  const top = Math.max(...values.map(Math.abs)) || 1, W = 250, H = 118, at = (v) => 54 - (44 * v) / top;
  const NS = "http://www.w3.org/2000/svg", plot = document.createElementNS(NS, "svg");
  plot.setAttribute("viewBox", `0 0 ${W} ${H}`);
  const add = (name, attributes, text) => {
    const part = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, value);
    if (text !== undefined) part.textContent = text;
    plot.append(part);
  };
  add("line", { x1: 34, x2: 214, y1: 54, y2: 54, class: "axis" });
  add("polyline", { points: values.map((v, i) => `${(34 + (180 * i) / motion.count).toFixed(1)},${at(v).toFixed(1)}`).join(" ") });
  const unit = data.joints[j].scale.unit, told = (v) => Number(v.toPrecision(2)).toString();
  for (const [v, y] of [[top, 14], [-top, 102]]) {
    add("text", { x: 31, y, "text-anchor": "end" }, told(v));
    if (stress !== null) add("text", { x: 217, y }, told((v * stress) / 1e9));
  }
  add("text", { x: 31, y: 57, "text-anchor": "end" }, unit);
  if (stress !== null) add("text", { x: 217, y: 57 }, "MPa");
  add("text", { x: 34, y: 115 }, "0");
  add("text", { x: 214, y: 115, "text-anchor": "end" }, `${(1e3 * duration).toFixed(0)} ms, force ${motion.directions[state.direction].text}`);
  byId("card-plot").replaceChildren(plot);
}

function hover(event) {
  const hit = event.buttons ? null : under(event, (item) => item.layer === "envelope");
  byId("value").hidden = !hit;
  if (!hit) return;
  const local = hit.object.worldToLocal(hit.point.clone()), length = local.length();
  const [x, y, z] = local.multiplyScalar(1 / length).toArray().map((c) => c.toFixed(2));
  const { scale, name } = data.joints[state.joint];
  byId("value").textContent = `${name}: ${Number((1e3 * length).toPrecision(3))} ${scale.unit} along (${x}, ${y}, ${z})`;
  byId("value").style.left = `${event.clientX + 14}px`;
  byId("value").style.top = `${event.clientY + 14}px`;
}

// A map can be cut open: of each axis, what is kept between two ends.
function cuts() {
  const maps = made.filter(({ item }) => item.layer === "map");
  byId("cut").hidden = !maps.length;
  if (!maps.length) return;
  viewer.renderer.localClippingEnabled = true;
  const box = new THREE.Box3();
  for (const { object } of maps) {
    object.geometry.computeBoundingBox();
    box.union(object.geometry.boundingBox);
  }
  // The world's axes as three.js has them: its y is up.
  const axes = { x: [1, 0, 0], y: [0, 0, -1], z: [0, 1, 0] }, planes = [];
  for (const [name, way] of Object.entries(axes)) for (const side of ["min", "max"]) {
    const sign = side === "min" ? 1 : -1, [low, high] = [box.min[name], box.max[name]];
    const plane = new THREE.Plane(new THREE.Vector3(...way).multiplyScalar(sign), 1e9);
    planes.push(plane);
    const id = `cut-${name}-${side}`, out = element("output");
    const input = element("input", { id, type: "range", min: 0, max: 1, step: 0.005, value: side === "min" ? 0 : 1 });
    input.oninput = () => {
      const at = low + (high - low) * input.value;
      out.textContent = `${at.toFixed(2)} m`;
      plane.constant = Number(input.value) === (sign > 0 ? 0 : 1) ? 1e9 : -sign * at;
      viewer.set_dirty();
    };
    input.oninput();
    byId("cut").append(element("label", { htmlFor: id }, `${name} ${side === "min" ? "from" : "to"} `, out), input);
  }
  for (const { object } of maps) object.material.clippingPlanes = planes;
}

function answers() {
  cuts();
  const pane = byId("pane");
  let from = null;
  pane.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; }, true);
  pane.addEventListener("click", (event) => {
    if (from && Math.hypot(event.clientX - from[0], event.clientY - from[1]) > 5) return;
    const hit = under(event, (item) => item.told || item.layer === "joints") ||
      under(event, (item) => item.layer === "robot");
    if (!hit) return;
    if (hit.item.told) card("Rivet", hit.item.told);
    else if (jointOf(hit.item) !== null) tellJoint(jointOf(hit.item));
  });
  pane.addEventListener("pointermove", hover);
  pane.addEventListener("pointerleave", () => { byId("value").hidden = true; });
  byId("card-close").onclick = () => { byId("card").hidden = true; };
}
