// --- stage ------------------------------------------------------------------------------
function stage() {
  const colour = dark ? [0.09, 0.11, 0.13] : [0.98, 0.985, 0.99];
  const low = dark ? [0.16, 0.19, 0.22] : [0.87, 0.9, 0.93];
  viewer.set_property(["Background"], "top_color", colour);
  viewer.set_property(["Background"], "bottom_color", low);
  // A floor about the robot, with squares of a round size: meshcat's own runs to the horizon.
  const { cell, squares, at: [floorX, floorY, floorZ] } = data.floor;
  const grid = new THREE.GridHelper(cell * squares, squares);
  grid.rotateX(Math.PI / 2);
  grid.position.set(floorX, floorY, floorZ);
  viewer.set_object(["Grid"], grid);
  viewer.scene_tree.find(["Axes", "<object>"]).object.scale.setScalar(3 * cell);
  grid.material.opacity = dark ? 0.25 : 0.5;
  grid.material.transparent = true;
  const ambient = viewer.scene_tree.find(["Lights", "AmbientLight", "<object>"]).object;
  ambient.intensity = 0.5;
  for (const side of ["PointLightNegativeX", "PointLightPositiveX"])
    viewer.scene_tree.find(["Lights", side, "<object>"]).object.intensity = 0.1;
  viewer.scene_tree.find(["Lights", "FillLight", "<object>"]).object.intensity = 0.22;
  const sun = new THREE.DirectionalLight(0xffffff, 0.42);
  sun.position.set(3, -4, 6);
  viewer.set_object(["Lights", "Sun"], sun);
  // The camera's node is turned: its y is the world's z.
  const [at, to] = data.camera.map(([x, y, z]) => new THREE.Vector3(x, z, -y));
  viewer.camera.fov = 42;
  viewer.camera.near = at.distanceTo(to) / 200;
  viewer.camera.far = at.distanceTo(to) * 60;
  viewer.camera.position.copy(at);
  viewer.controls.target.copy(to);
  viewer.controls.update();
  const fit = () => viewer.set_3d_pane_size(byId("pane").offsetWidth, byId("pane").offsetHeight);
  addEventListener("resize", fit);
  fit();
}

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
      if (!marks.includes(layer)) continue;
      // What marks a joint or a cause shines through the link that it is in.
      const through = new THREE.Mesh(shapes[item.mesh], paint.clone());
      Object.assign(through.material, { depthTest: false, transparent: true, opacity: 0.45 });
      through.renderOrder = 1;
      object.add(through);
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
