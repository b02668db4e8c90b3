// --- stage: background, floor, light, where the camera stands ------------------------------
const turn = new THREE.Matrix4(), own = new THREE.Matrix4(), axis = new THREE.Vector3();

// A joint's frame in its parent's; the joint is at `at`, rad or m.
function jointAt(frame, at) {
  own.fromArray(frame.matrix);
  if (!frame.axis) return own;
  axis.fromArray(frame.axis);
  if (frame.prismatic) turn.makeTranslation(...axis.multiplyScalar(at).toArray());
  else turn.makeRotationAxis(axis, at);
  return own.multiply(turn);
}

// What marks a joint or a cause shines through the link that it is in.
function shine(mesh) {
  const through = new THREE.Mesh(mesh.geometry, mesh.material.clone());
  Object.assign(through.material, { depthTest: false, transparent: true, opacity: 0.45 });
  through.renderOrder = 1;
  mesh.add(through);
}

// A ray from the eye through the pointer.
const ray = new THREE.Raycaster();
function aim(event) {
  const box = byId("pane").getBoundingClientRect();
  const at = new THREE.Vector2(((event.clientX - box.left) / box.width) * 2 - 1,
    1 - ((event.clientY - box.top) / box.height) * 2);
  viewer.camera.updateMatrixWorld(true);
  ray.setFromCamera(at, viewer.camera);
}

function look(view) {
  const [at, to] = data.camera.map((p) => new THREE.Vector3(...p)), far = at.distanceTo(to);
  const way = { x: [1, 0, 0.001], y: [0, -1, 0.001], z: [0, -0.001, 1] }[view];
  if (way) at.set(...way).multiplyScalar(far).add(to);
  // It is placed for a pane as wide as high: from farther away a narrow one shows as much.
  const pane = byId("pane");
  at.sub(to).multiplyScalar(Math.max(1, pane.offsetHeight / pane.offsetWidth)).add(to);
  // The camera's node is turned: its y is the world's z.
  viewer.camera.position.set(at.x, at.z, -at.y);
  viewer.controls.target.set(to.x, to.z, -to.y);
  viewer.controls.update();
  viewer.set_dirty();
  return far;
}

const fit = () => viewer.set_3d_pane_size(byId("pane").offsetWidth, byId("pane").offsetHeight);

function stage() {
  viewer.set_property(["Background"], "top_color", dark ? [0.09, 0.11, 0.13] : [0.98, 0.985, 0.99]);
  viewer.set_property(["Background"], "bottom_color", dark ? [0.16, 0.19, 0.22] : [0.87, 0.9, 0.93]);
  // A floor about the robot, with squares of a round size: meshcat's own runs to the horizon.
  const { cell, squares, at } = data.floor, grid = new THREE.GridHelper(cell * squares, squares);
  grid.rotateX(Math.PI / 2);
  grid.position.set(...at);
  Object.assign(grid.material, { opacity: dark ? 0.25 : 0.5, transparent: true });
  viewer.set_object(["Grid"], grid);
  const found = (...path) => viewer.scene_tree.find([...path, "<object>"]).object;
  found("Axes").scale.setScalar(3 * cell);
  const lights = { AmbientLight: 0.5, PointLightNegativeX: 0.1, PointLightPositiveX: 0.1, FillLight: 0.22 };
  for (const [name, intensity] of Object.entries(lights)) found("Lights", name).intensity = intensity;
  const sun = new THREE.DirectionalLight(0xffffff, 0.42);
  sun.position.set(3, -4, 6);
  viewer.set_object(["Lights", "Sun"], sun);
  const far = look("home");
  Object.assign(viewer.camera, { fov: 42, near: far / 200, far: far * 60 });
  addEventListener("resize", fit);
  fit();
  for (const button of document.querySelectorAll("#views [data-view]"))
    button.onclick = () => look(button.dataset.view);
  byId("png").onclick = () => download("view.png", viewer.capture_image());
}
