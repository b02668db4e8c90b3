// --- controls ---------------------------------------------------------------------------
function options(select, texts, chosen) {
  select.append(...texts.map((text, k) => element("option", { value: k }, text)));
  select.value = chosen;
}

function controls() {
  options(byId("joint"), data.joints.map((joint) => joint.name), state.joint);
  byId("joint").onchange = (e) => { state.joint = Number(e.target.value); drawOverlay(); };
  byId("size").oninput = (e) => { state.size = Number(e.target.value); drawOverlay(); };
  options(byId("direction"), motion.directions.map((d) => d.text), 0);
  byId("direction").onchange = (e) => { state.direction = Number(e.target.value); drawMotion(); };
  for (const id of ["direction", "direction-label"]) byId(id).hidden = motion.tracks.length > 0;
  const tellFactor = () => {
    byId("factor-out").textContent = `${Number(state.factor.toPrecision(2))}\u00d7`;
  };
  byId("factor").oninput = (e) => {
    state.factor = motion.factor * 10 ** Number(e.target.value);
    tellFactor();
    drawMotion();
  };
  tellFactor();
  if (data.diagnosis) tellDiagnosis(data.diagnosis);
  byId("time").oninput = (e) => { play(false); state.time = e.target.value * duration * 0.9999; drawMotion(); };
  byId("play").onclick = () => play(!state.playing);
  for (const layer of data.layers) {
    state.on[layer.id] = layer.on;
    const box = element("input", { type: "checkbox", id: `layer-${layer.id}`, checked: layer.on });
    const line = element("label", { className: "check" }, box, element("span", {}, layer.text));
    box.onchange = () => { state.on[layer.id] = box.checked; drawOverlay(); };
    const track = motion.tracks.find((t) => t.layer === layer.id);
    const colour = track ? track.colour : data.swatches[layer.id];
    if (colour) line.append(swatch(colour));
    byId("layers").append(line);
    if (data.scales[layer.id]) bars[layer.id] = addBar(data.scales[layer.id]);
  }
  if (data.scales.rivets) {
    byId("layers").append(element("label", {}, data.scales.rivets.title));
    addBar(data.scales.rivets);
  }
}

function swatch(colour) {
  const patch = element("i", { className: "swatch" });
  patch.style.background = colour;
  return patch;
}

function tellDiagnosis({ verdict, lines }) {
  byId("diagnosis").hidden = false;
  byId("verdict").textContent = verdict;
  for (const { text, layer } of lines)
    byId("causes").append(element("li", {}, swatch(data.swatches[layer]), element("span", {}, text)));
}

function addBar(scale) {
  const bar = element("div", { className: "bar" });
  fillBar(bar, scale);
  byId("layers").append(bar);
  return bar;
}

function play(on) {
  state.playing = on;
  byId("play").textContent = on ? "Pause" : "Play";
}
