// --- stage: robot, rings, ball, arrow, tool ---------------------------------------------
const reach = data.reach, parts = { rings: [], balls: {} };
const nodes = data.frames.map(() => new THREE.Group());
const turn = new THREE.Matrix4(), own = new THREE.Matrix4(), axis = new THREE.Vector3();
const arm = new THREE.Group(), toolAt = new THREE.Vector3(), along = new THREE.Vector3(0, 0, 1);
const root = () => viewer.scene_tree.find(ROOT).object;

function pinned(object, matrix) {
  object.matrix.fromArray(matrix);
  object.matrixAutoUpdate = false;
  return object;
}

function build(array) {
  const shapes = data.meshes.map((mesh) => geometry(mesh, array));
  data.frames.forEach((frame, k) => {
    nodes[k].matrixAutoUpdate = false;
    (frame.parent === null ? arm : nodes[frame.parent]).add(nodes[k]);
  });
  data.items.forEach((item, k) => nodes[item.frame].add(
    pinned(new THREE.Mesh(shapes[item.mesh], material(data.meshes[item.mesh], item, k)), item.matrix)));
  parts.rings = data.rings.map((ring) => {
    if (!ring) return null;
    const mesh = new THREE.Mesh(shapes[ring.mesh], new THREE.MeshPhongMaterial({ color: 0x888888 }));
    const through = new THREE.Mesh(mesh.geometry, mesh.material.clone());
    Object.assign(through.material, { depthTest: false, transparent: true, opacity: 0.45 });
    mesh.add(through);
    nodes[ring.frame].add(pinned(mesh, ring.matrix));
    return mesh;
  });
  for (const [fineness, ball] of Object.entries(data.spheres)) {
    data.spheres[fineness] = { vertices: array(ball.vertices), faces: array(ball.faces) };
  }
  data.models.forEach((name, k) => {
    const mesh = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshPhongMaterial({
      color: k ? 0xd97706 : 0xffffff, vertexColors: !k, transparent: true, opacity: k ? 0.5 : 0.5,
      depthWrite: false, side: THREE.DoubleSide, wireframe: k > 0 }));
    mesh.renderOrder = 2;
    parts.balls[name] = mesh;
    arm.add(mesh);
  });
  const paint = (color) => new THREE.MeshPhongMaterial({ color });
  parts.tool = new THREE.Mesh(new THREE.SphereGeometry(0.022 * reach, 20, 14), paint(0xa21caf));
  parts.tail = new THREE.Mesh(new THREE.SphereGeometry(0.02 * reach, 20, 14), paint(0xc2410c));
  const rod = new THREE.CylinderGeometry(0.007 * reach, 0.007 * reach, 0.19 * reach, 16);
  rod.rotateX(Math.PI / 2);
  rod.translate(0, 0, -0.165 * reach);
  const head = new THREE.ConeGeometry(0.018 * reach, 0.05 * reach, 24);
  head.rotateX(Math.PI / 2);
  head.translate(0, 0, -0.045 * reach);
  parts.arrow = new THREE.Group();
  for (const shape of [rod, head]) parts.arrow.add(new THREE.Mesh(shape, paint(0xc2410c)));
  parts.tail.position.set(0, 0, -0.26 * reach);
  parts.arrow.add(parts.tail);
  arm.add(parts.tool, parts.arrow);
  viewer.set_object(ROOT.concat("arm"), arm);
}

function stand(pose) {
  data.frames.forEach((frame, k) => {
    own.fromArray(frame.matrix);
    if (frame.axis) {
      const at = frame.row.reduce((sum, r, i) => sum + r * pose[i], frame.shift);
      axis.fromArray(frame.axis);
      if (frame.prismatic) turn.makeTranslation(...axis.multiplyScalar(at).toArray());
      else turn.makeRotationAxis(axis, at);
      own.multiply(turn);
    }
    nodes[k].matrix.copy(own);
    nodes[k].matrixWorldNeedsUpdate = true;
  });
}

function hit(tool, direction) {
  toolAt.fromArray(tool);
  along.fromArray(direction);
  parts.tool.position.copy(toolAt);
  parts.arrow.position.copy(toolAt);
  parts.arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), along);
  for (const ball of Object.values(parts.balls)) ball.position.copy(toolAt);
}

const palette = data.colours.map((c) => new THREE.Color(c));
function colourOf(share) {
  const at = Math.min(Math.max(share, 0), 1) * (palette.length - 1), i = Math.min(Math.floor(at), palette.length - 2);
  return palette[i].clone().lerp(palette[i + 1], at - i);
}

function paintRing(j, share) {
  const ring = parts.rings[j];
  if (!ring) return;
  const colour = share === null ? new THREE.Color("#9aa3ad") : colourOf(share);
  ring.material.color.copy(colour);
  ring.children[0].material.color.copy(colour);
}

// The double balls: as long in each direction as the peak of a force along it.
// Drawing must not keep the numbers waiting: where it is slow (no graphics card), it takes a third of
// the time at most while a hand moves, at half the resolution, and the whole picture comes at rest.
const SLOW = 40;  // ms
const drawn = [], pen = { wanted: false, until: 0, coarse: false, off: false };
function draw() {
  pen.wanted = true;
  const wait = pen.until - performance.now();
  if (pen.off || wait > 0) return;
  pen.wanted = false;
  pen.until = Infinity;
  const began = performance.now();
  viewer.set_dirty();
  requestAnimationFrame(() => setTimeout(() => {
    const cost = performance.now() - began;
    drawn.push(cost);
    const slow = cost > SLOW && moving();
    if (slow && !pen.coarse) sharpen(true);
    pen.until = performance.now() + (slow ? 2 * cost : 0);
    setTimeout(() => { if (pen.wanted) draw(); }, slow ? 2 * cost : 0);
  }, 0));
}

function sharpen(coarse) {
  pen.coarse = coarse;
  viewer.renderer.setPixelRatio(devicePixelRatio * (coarse ? 0.5 : 1));
  const pane = byId("pane");
  viewer.set_3d_pane_size(pane.offsetWidth, pane.offsetHeight);
}

function drawBall({ radii, subdivisions }) {
  const { vertices, faces } = data.spheres[subdivisions];
  const largest = Math.max(...Object.values(radii).map((r) => Math.max(...r))) || 1;
  for (const [name, mesh] of Object.entries(parts.balls)) {
    mesh.visible = Boolean(radii[name]);
    if (!radii[name]) continue;
    const position = new Float32Array(vertices.length), colour = new Float32Array(vertices.length);
    radii[name].forEach((r, v) => {
      const c = colourOf(r / largest);
      for (let k = 0; k < 3; k++) position[3 * v + k] = (0.26 * reach * r / largest) * vertices[3 * v + k];
      colour.set([c.r, c.g, c.b], 3 * v);
    });
    mesh.geometry.dispose();
    mesh.geometry = new THREE.BufferGeometry();
    mesh.geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    mesh.geometry.setAttribute("color", new THREE.BufferAttribute(colour, 3));
    mesh.geometry.setIndex(new THREE.BufferAttribute(faces, 1));
    mesh.geometry.computeVertexNormals();
  }
  draw();
}

function look(view) {
  const [x, y, z] = data.middle, far = 2.1 * reach, tilt = { x: [1, 0, 0.001], y: [0, -1, 0.001], z: [0, -0.001, 1] };
  const way = tilt[view] || [0.55, -1, 0.5], size = Math.hypot(...way);
  const at = way.map((w, k) => data.middle[k] + (far * w) / size);
  // The camera's node is turned: its y is the world's z.
  viewer.camera.position.set(at[0], at[2], -at[1]);
  viewer.controls.target.set(x, z, -y);
  viewer.controls.update();
  viewer.set_dirty();
}

function stage() {
  viewer.set_property(["Background"], "top_color", dark ? [0.09, 0.11, 0.13] : [0.98, 0.985, 0.99]);
  viewer.set_property(["Background"], "bottom_color", dark ? [0.16, 0.19, 0.22] : [0.87, 0.9, 0.93]);
  const grid = new THREE.GridHelper(2.4 * reach, 24);
  grid.rotateX(Math.PI / 2);
  grid.position.set(0, 0, data.floor);
  Object.assign(grid.material, { opacity: dark ? 0.25 : 0.5, transparent: true });
  viewer.set_object(["Grid"], grid);
  viewer.scene_tree.find(["Axes", "<object>"]).object.scale.setScalar(0.2 * reach);
  viewer.scene_tree.find(["Lights", "AmbientLight", "<object>"]).object.intensity = 0.5;
  for (const side of ["PointLightNegativeX", "PointLightPositiveX"])
    viewer.scene_tree.find(["Lights", side, "<object>"]).object.intensity = 0.1;
  viewer.scene_tree.find(["Lights", "FillLight", "<object>"]).object.intensity = 0.22;
  const sun = new THREE.DirectionalLight(0xffffff, 0.42);
  sun.position.set(3, -4, 6);
  viewer.set_object(["Lights", "Sun"], sun);
  viewer.camera.fov = 42;
  viewer.camera.near = reach / 100;
  viewer.camera.far = reach * 60;
  const fit = () => viewer.set_3d_pane_size(byId("pane").offsetWidth, byId("pane").offsetHeight);
  addEventListener("resize", fit);
  fit();
  look("home");
}
