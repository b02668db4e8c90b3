// --- controls ---------------------------------------------------------------------------
function options(select, texts, chosen) {
  texts.forEach((text, k) => {
    const option = document.createElement("option");
    option.value = k;
    option.textContent = text;
    select.append(option);
  });
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
    const line = document.createElement("label"), box = document.createElement("input");
    const text = document.createElement("span");
    line.className = "check";
    box.type = "checkbox";
    box.id = `layer-${layer.id}`;
    box.checked = layer.on;
    box.onchange = () => { state.on[layer.id] = box.checked; drawOverlay(); };
    text.textContent = layer.text;
    line.append(box, text);
    const track = motion.tracks.find((t) => t.layer === layer.id);
    const colour = track ? track.colour : data.swatches[layer.id];
    if (colour) line.append(swatch(colour));
    byId("layers").append(line);
    if (data.scales[layer.id]) bars[layer.id] = addBar(data.scales[layer.id]);
  }
  if (data.scales.rivets) {
    const title = document.createElement("label");
    title.textContent = data.scales.rivets.title;
    byId("layers").append(title);
    addBar(data.scales.rivets);
  }
}

function swatch(colour) {
  const patch = document.createElement("i");
  patch.className = "swatch";
  patch.style.background = colour;
  return patch;
}

function tellDiagnosis({ verdict, lines }) {
  byId("diagnosis").hidden = false;
  byId("verdict").textContent = verdict;
  for (const { text, layer } of lines) {
    const line = document.createElement("li"), words = document.createElement("span");
    words.textContent = text;
    line.append(swatch(data.swatches[layer]), words);
    byId("causes").append(line);
  }
}

function addBar(scale) {
  const bar = document.createElement("div");
  bar.className = "bar";
  fillBar(bar, scale);
  byId("layers").append(bar);
  return bar;
}

function play(on) {
  state.playing = on;
  byId("play").textContent = on ? "Pause" : "Play";
}
