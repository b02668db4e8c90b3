// --- parts: robot, rings, ball, arrow, tool ---------------------------------------------
const reach = data.reach, parts = { rings: [], balls: {} };
const nodes = data.frames.map(() => new THREE.Group());
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
    shine(mesh);
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
    nodes[k].matrix.copy(jointAt(frame, frame.row.reduce((sum, r, i) => sum + r * pose[i], frame.shift)));
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
  fit();
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
