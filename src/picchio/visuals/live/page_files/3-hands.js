// --- hands: drag the tool, drag the arrow -------------------------------------------------
const plane = new THREE.Plane(), point = new THREE.Vector3();
let held = null;

// A handle is as large as a finger, whatever is drawn.
function near(object, event) {
  const box = byId("pane").getBoundingClientRect();
  object.updateWorldMatrix(true, false);
  const at = new THREE.Vector3().setFromMatrixPosition(object.matrixWorld).project(viewer.camera);
  return Math.hypot(event.clientX - box.left - ((at.x + 1) / 2) * box.width,
    event.clientY - box.top - ((1 - at.y) / 2) * box.height);
}

function grab(event) {
  if (event.button || !now) return;
  viewer.camera.updateMatrixWorld(true);
  const size = event.pointerType === "touch" ? 34 : 18;
  const [tool, tail] = [near(parts.tool, event), near(parts.tail, event)];
  if (Math.min(tool, tail) > size) return;
  held = tail < tool ? "arrow" : "tool";
  const centre = new THREE.Vector3().setFromMatrixPosition(parts.tool.matrixWorld);
  plane.setFromNormalAndCoplanarPoint(viewer.camera.getWorldDirection(new THREE.Vector3()), centre);
  byId("pane").setPointerCapture(event.pointerId);
  event.stopPropagation();
  event.preventDefault();
}

function drag(event) {
  if (!held) return;
  event.stopPropagation();
  aim(event);
  if (held === "tool") {
    if (!ray.ray.intersectPlane(plane, point)) return;
    root().worldToLocal(point);
    ask({ tool: point.toArray() }, event.timeStamp);
    return;
  }
  // The tail runs on a ball about the tool; beyond its rim it stays on the rim.
  const centre = new THREE.Vector3().setFromMatrixPosition(parts.tool.matrixWorld);
  const ball = new THREE.Sphere(centre, 0.26 * reach);
  if (!ray.ray.intersectSphere(ball, point)) ray.ray.closestPointToPoint(centre, point);
  root().worldToLocal(point);
  const way = new THREE.Vector3().copy(toolAt).sub(point);
  if (way.length() > 1e-9) ask({ direction: way.normalize().toArray() }, event.timeStamp);
}

function hands() {
  const pane = byId("pane");
  pane.addEventListener("pointerdown", grab, true);
  pane.addEventListener("pointermove", drag, true);
  for (const end of ["pointerup", "pointercancel"])
    pane.addEventListener(end, (event) => { if (held) event.stopPropagation(); held = null; }, true);
}
