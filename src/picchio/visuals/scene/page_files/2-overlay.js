// --- layers, joint, size ----------------------------------------------------------------
const shown = (layer, joint) =>
  state.on[layer] && (joint === null || joint === undefined || layer === "joints" || joint === state.joint);
const bars = {};
const base = new THREE.Matrix4(), grow = new THREE.Matrix4();

function drawOverlay() {
  for (const { object, item } of made) {
    object.visible = shown(item.layer, item.joint);
    if (["envelope", "worst"].includes(item.layer)) {
      base.fromArray(item.matrix);
      grow.makeScale(state.size, state.size, state.size);
      base.multiply(grow);
      base.decompose(object.position, object.quaternion, object.scale);
    }
  }
  byId("size-out").textContent = `${state.size.toFixed(2)}\u00d7`;
  const scale = data.joints[state.joint].scale;
  fillBar(byId("bar-envelope"), scale);
  if (bars.map) fillBar(bars.map, data.joints[state.joint].map || data.scales.map);
  viewer.set_dirty();
}

function fillBar(bar, scale) {
  const ends = ["0", `${Number(scale.top.toPrecision(3))} ${scale.unit}`];
  bar.replaceChildren(element("i"), element("b", {}, ...ends.map((text) => element("span", {}, text))));
  bar.firstChild.style.background = `linear-gradient(90deg, ${scale.colours.join(", ")})`;
}

// --- labels -----------------------------------------------------------------------------
const spot = new THREE.Vector3(), centre = new THREE.Vector3();
const leaders = byId("leaders");
const labels = data.labels.map((label) => {
  const tag = element("span", { textContent: label.text, className: label.layer });
  const leader = document.createElementNS(leaders.namespaceURI, "line");
  leaders.append(leader);
  byId("labels").append(tag);
  return { label, tag, leader, way: 0 };
});

// Where a label may stand: round what it names, ever further away. The first that is free is taken.
const WAYS = [];
for (const far of [14, 30, 50, 75, 105, 140, 180, 230])
  for (const [dx, dy] of [[1, 0], [1, -1], [1, 1], [-1, 0], [-1, -1], [-1, 1], [0, -1], [0, 1]])
    WAYS.push([dx * far, dy * far, dx, dy]);

const covers = (a, b) => a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;

// The place of a label beside (x, y) that covers no other and is within the picture; or null.
function placed(entry, x, y, box, room, taken) {
  const fits = (at) => !taken.some((other) => covers(at, other)) && at;
  const tried = (way) => {
    const [far, down, dx, dy] = WAYS[way];
    const at = { x: x + far + (dx - 1) * box.w / 2, y: y + down + (dy - 1) * box.h / 2, ...box };
    at.x = Math.min(Math.max(at.x, 4), room.w - box.w - 4);
    at.y = Math.min(Math.max(at.y, 4), room.h - box.h - 4);
    return fits(at);
  };
  // As before where that is still free: a label must not hop about while the arm vibrates.
  for (const way of [entry.way, ...WAYS.keys()]) {
    const at = tried(way);
    if (at) {
      entry.way = way;
      return at;
    }
  }
  for (let row = 4; row + box.h + 4 < room.h; row += box.h + 1) {
    const at = fits({ x: 4, y: row, ...box }) || fits({ x: room.w - box.w - 4, y: row, ...box });
    if (at) return at;
  }
  return null;
}

function drawLabels() {
  const { offsetWidth: w, offsetHeight: h } = byId("labels"), taken = [];
  for (const entry of labels) {
    const { label, tag, leader } = entry;
    let visible = shown(label.layer, label.joint);
    if (visible) {
      if (label.node) {
        const { object } = viewer.scene_tree.find(pathOf("joints", label.node));
        object.updateWorldMatrix(true, false);
        spot.fromArray(label.at || [0, 0, 0]).applyMatrix4(object.matrixWorld);
      } else {
        spot.fromArray(label.at);
        if (label.layer === "worst") {
          centre.fromArray(data.tool);
          spot.sub(centre).multiplyScalar(state.size).add(centre);
        }
        spot.applyMatrix4(viewer.scene.matrixWorld);
      }
      spot.project(viewer.camera);
      visible = spot.z < 1 && Math.abs(spot.x) < 1 && Math.abs(spot.y) < 1;
    }
    tag.hidden = !visible;
    const x = ((spot.x + 1) / 2) * w, y = ((1 - spot.y) / 2) * h;
    const box = visible && { w: tag.offsetWidth, h: tag.offsetHeight };
    const at = visible && placed(entry, x, y, box, { w, h }, taken);
    tag.hidden = !at;
    leader.style.display = at ? "" : "none";
    if (!at) continue;
    taken.push(at);
    tag.style.transform = `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px)`;
    const ends = { x1: x, y1: y, x2: Math.min(Math.max(x, at.x), at.x + box.w),
      y2: Math.min(Math.max(y, at.y), at.y + box.h) };
    for (const [name, value] of Object.entries(ends)) leader.setAttribute(name, value.toFixed(1));
  }
}
