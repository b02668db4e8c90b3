// --- robot ------------------------------------------------------------------------------
function pathOf(layer, node) {
  return ROOT.concat(layer, node ? node.split("/") : []);
}

function place(layer, frame, moved) {
  viewer.set_transform(pathOf(layer, frame.path), jointAt(frame, frame.position + moved).toArray());
}

const moving = data.frames.filter((frame) => frame.axis && frame.follows);
const marks = ["joints", ...Object.keys(data.swatches)];
const layersOfRobot = ["robot", "ghost", ...marks, ...data.motion.tracks.map((t) => t.layer)];
// Rings and causes sit on the same tree as the links; the ghost stays where it is.
for (const layer of layersOfRobot) for (const frame of data.frames) place(layer, frame, 0);

// --- state ------------------------------------------------------------------------------
const motion = data.motion;
const state = { joint: data.chosen, size: 1, factor: motion.factor, direction: 0, time: 0,
  playing: data.playing && !matchMedia("(prefers-reduced-motion: reduce)").matches, on: {} };
const duration = motion.step * motion.count;
let samples = null;
const made = [];

function deflections(time) {
  const n = data.joints.length, at = time / motion.step;
  const i = Math.floor(at) % motion.count, next = (i + 1) % motion.count, part = at - Math.floor(at);
  const along = motion.directions[state.direction].along, x = new Array(n).fill(0);
  for (let j = 0; j < n; j++)
    for (let d = 0; d < 3; d++) {
      const row = (3 * j + d) * motion.count;
      x[j] += along[d] * ((1 - part) * samples[row + i] + part * samples[row + next]);
    }
  return x;
}

// A recorded history plays as it is, whatever the direction.
function recorded(track, time) {
  const at = Math.min(time / motion.step, motion.count - 1), i = Math.floor(at), part = at - i;
  const next = Math.min(i + 1, motion.count - 1);
  return data.joints.map((_, j) => {
    const row = j * motion.count;
    return (1 - part) * track.array[row + i] + part * track.array[row + next];
  });
}

function bend(layers, x) {
  for (const frame of moving) {
    const moved = frame.follows.reduce((sum, f, j) => sum + f * x[j], 0) * state.factor;
    for (const layer of layers) place(layer, frame, moved);
  }
}

function drawMotion() {
  if (motion.tracks.length)
    motion.tracks.forEach((track, k) => bend(k ? [track.layer] : [track.layer, ...marks], recorded(track, state.time)));
  else bend(["robot", ...marks], deflections(state.time));
  byId("clock").textContent = `${(1e3 * state.time).toFixed(0)} ms of ` +
    `${(1e3 * duration).toFixed(0)}, ${motion.slow}\u00d7 slow`;
  byId("time").value = state.time / duration;
  viewer.set_dirty();
}
