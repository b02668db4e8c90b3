// --- items, and the beginning ---------------------------------------------------------------
function addItems(array) {
  const shapes = data.meshes.map((mesh) => geometry(mesh, array));
  const ghost = new THREE.MeshPhongMaterial({ color: dark ? 0xffffff : 0x334155, opacity: 0.16,
    transparent: true, depthWrite: false });
  const paints = { ghost };
  for (const { layer, colour } of motion.tracks)
    paints[layer] = new THREE.MeshPhongMaterial({ color: colour, opacity: 0.5, transparent: true });
  data.items.forEach((item, k) => {
    const layers = item.layer === "robot" ? ["robot", ...Object.keys(paints)] : [item.layer];
    for (const layer of layers) {
      const paint = paints[layer] || material(data.meshes[item.mesh], item, item.layer === "robot" ? k : 0);
      const object = new THREE.Mesh(shapes[item.mesh], paint);
      base.fromArray(item.matrix);
      base.decompose(object.position, object.quaternion, object.scale);
      if (layer === "envelope") object.renderOrder = 2;
      viewer.set_object(pathOf(layer, item.node).concat(`item${k}`), object);
      made.push({ object, item: { ...item, layer } });
      if (marks.includes(layer)) shine(object);
    }
  });
}

let before = null;
function tick(now) {
  requestAnimationFrame(tick);
  if (state.playing && before !== null) {
    state.time = (state.time + (now - before) / 1000 / motion.slow) % duration;
    drawMotion();
  }
  before = now;
  drawLabels();
}

unpack().then((array) => {
  samples = array(motion.samples);
  for (const track of motion.tracks) track.array = array(track.samples);
  addItems(array);
  controls();
  stage();
  answers();
  play(state.playing);
  drawOverlay();
  // Else it stands at rest until it is played.
  if (data.playing) drawMotion();
  tick(performance.now());
  window.picchio = { viewer, state, data, made, ready: true };
  document.documentElement.dataset.ready = "true";
}).catch((error) => {
  byId("labels").textContent = `The scene could not be drawn: ${error.message}`;
  throw error;
});
