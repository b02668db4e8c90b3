// --- layers, joint, size ----------------------------------------------------------------
const shown = (layer, joint) =>
  state.on[layer] && (joint === null || joint === undefined || layer === "joints" || joint === state.joint);
const bars = {};
const base = new THREE.Matrix4(), grow = new THREE.Matrix4();

function drawOverlay() {
  for (const { object, item } of made) {
    object.visible = shown(item.layer, item.joint);
    if (item.layer === "envelope" || item.layer === "worst") {
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

function fillBar(element, scale) {
  element.replaceChildren();
  const strip = document.createElement("i"), ends = document.createElement("b");
  strip.style.background = `linear-gradient(90deg, ${scale.colours.join(", ")})`;
  for (const text of ["0", `${Number(scale.top.toPrecision(3))} ${scale.unit}`]) {
    const end = document.createElement("span");
    end.textContent = text;
    ends.append(end);
  }
  element.append(strip, ends);
}

// --- labels -----------------------------------------------------------------------------
const spot = new THREE.Vector3(), centre = new THREE.Vector3();
const labels = data.labels.map((label) => {
  const element = document.createElement("span");
  element.textContent = label.text;
  element.className = label.layer;
  byId("labels").append(element);
  return { label, element };
});

function drawLabels() {
  const { offsetWidth: width, offsetHeight: height } = byId("labels"), taken = [];
  const tool = new THREE.Vector3();
  for (const { label, element } of labels) {
    let visible = shown(label.layer, label.joint);
    if (visible) {
      if (label.node) {
        const { object } = viewer.scene_tree.find(pathOf("joints", label.node));
        object.updateWorldMatrix(true, false);
        spot.fromArray(label.at || [0, 0, 0]).applyMatrix4(object.matrixWorld);
      } else {
        spot.fromArray(label.at);
        if (label.layer === "worst") {
          tool.fromArray(data.tool);
          spot.sub(tool).multiplyScalar(state.size).add(tool);
        }
        spot.applyMatrix4(viewer.scene.matrixWorld);
      }
      spot.project(viewer.camera);
      visible = spot.z < 1 && Math.abs(spot.x) < 1.05 && Math.abs(spot.y) < 1.05;
    }
    element.hidden = !visible;
    if (!visible) continue;
    const box = { w: element.offsetWidth, h: element.offsetHeight };
    let x = ((spot.x + 1) / 2) * width + 14, y = ((1 - spot.y) / 2) * height - box.h / 2;
    if (label.layer === "worst") {
      // Beyond the arrow's tip, away from the tool.
      tool.fromArray(data.tool).applyMatrix4(viewer.scene.matrixWorld).project(viewer.camera);
      x -= 14 + box.w / 2;
      y += (tool.y > spot.y ? 1 : -1) * (box.h / 2 + 10);
    }
    // Above what is pointed at, which may be as large as the label.
    if (label.layer in data.swatches) y -= 0.9 * box.h;
    x = Math.min(Math.max(x, 4), width - box.w - 4);
    // Joints lie close together: a label that would cover another moves below it.
    for (let tries = 0; tries < 24; tries++) {
      const hit = taken.find((t) => x < t.x + t.w && t.x < x + box.w && y < t.y + t.h && t.y < y + box.h);
      if (!hit) break;
      y = hit.y + hit.h + 1;
    }
    taken.push({ x, y, ...box });
    element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
  }
}
