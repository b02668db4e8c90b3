// One expression for meshcat's own viewer (`this`): what the page's panel does, as its sliders.
(() => {
  const data = JSON.parse(@@data@@);
  const root = ["meshcat", "picchio"];
  const show = (item, on) => this.set_property(root.concat(item.path), "visible", on);
  const state = { joint: data.chosen, size: 1, factor: data.motion.factor, time: 0, playing: data.playing };
  // An older scene's loop sees by this that it is over.
  const self = (window.picchio_live = { state });

  // Float32Array of base64.
  const bytes = Uint8Array.from(atob(data.motion.samples), (c) => c.charCodeAt(0));
  const samples = new Float32Array(bytes.buffer), { count, step, slow } = data.motion;

  const told = document.getElementById("picchio-told") || document.createElement("div");
  told.id = "picchio-told";
  told.style.cssText = "position:fixed;left:8px;top:8px;padding:2px 8px;font:13px sans-serif;" +
    "background:#fffc;color:#1b2129;border-radius:3px";
  document.body.append(told);

  const draw = () => {
    told.textContent = data.told[state.joint];
    for (const item of data.items) {
      show(item, item.joint === state.joint);
      if (!item.grows) continue;
      const m = item.matrix.map((v, i) => (i < 12 ? v * state.size : v));
      this.set_transform(root.concat(item.path), m);
    }
    this.set_dirty();
  };
  const bend = () => {
    const at = Math.min(Math.floor(state.time / step), count - 1);
    for (const frame of data.frames) {
      const x = frame.follows.reduce((sum, f, j) => sum + f * samples[j * count + at], 0) * state.factor;
      const [a, b, c] = frame.axis, q = frame.position + x;
      let own = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, a * q, b * q, c * q, 1];
      if (!frame.prismatic) {
        const C = Math.cos(q), S = Math.sin(q), t = 1 - C;
        own = [t * a * a + C, t * a * b + S * c, t * a * c - S * b, 0,
          t * a * b - S * c, t * b * b + C, t * b * c + S * a, 0,
          t * a * c + S * b, t * b * c - S * a, t * c * c + C, 0, 0, 0, 0, 1];
      }
      const m = new Array(16).fill(0);
      for (let i = 0; i < 4; i++)
        for (let j = 0; j < 4; j++)
          for (let k = 0; k < 4; k++) m[4 * j + i] += frame.matrix[4 * k + i] * own[4 * j + k];
      for (const layer of data.layers) this.set_transform(root.concat(layer, frame.path), m);
    }
    this.set_dirty();
  };
  let before = null;
  const tick = (now) => {
    if (window.picchio_live !== self) return;
    requestAnimationFrame(tick);
    if (state.playing && before !== null) {
      state.time = (state.time + (now - before) / 1000 / slow) % (step * count);
      bend();
    }
    before = now;
  };
  Object.assign(self, {
    joint: (value) => { state.joint = Math.round(value) - 1; draw(); },
    size: (value) => { state.size = value; draw(); },
    exaggerated: (value) => { state.factor = data.motion.factor * 10 ** value; bend(); },
    moment: (value) => { state.playing = false; state.time = value * step * count * 0.9999; bend(); },
    play: () => { state.playing = !state.playing; },
  });
  draw();
  this.controls.target.fromArray(data.target);
  this.controls.update();
  requestAnimationFrame(tick);
  return self.@@control@@;
})()
