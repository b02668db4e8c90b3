// --- talk: one question under way at a time, what comes meanwhile is asked next -----------
let socket = null, number = 0, waiting = null, next = null, stamps = [], now = null;
const latency = [], asked = new Map();
const moving = () => waiting !== null || next !== null || held !== null;

// `stamp` is when the hand moved, ms.
function ask(part, stamp) {
  next = { ...next, ...part, joints: { ...(next && next.joints), ...part.joints },
    blows: { ...(next && next.blows), ...part.blows } };
  stamps.push(stamp === undefined ? performance.now() : stamp);
  send();
}

function send() {
  if (waiting !== null || next === null || socket.readyState !== 1) return;
  waiting = ++number;
  asked.set(number, stamps);
  for (const key of ["joints", "blows"]) if (!Object.keys(next[key]).length) delete next[key];
  socket.send(JSON.stringify({ id: number, ...next }));
  next = null;
  stamps = [];
}

function heard({ data: text }) {
  const message = JSON.parse(text);
  if (message.values) take(message.values);
  if (message.ball) {
    drawBall(message.ball);
    window.picchio.balls += 1;
  }
  if (message.file) kept(message.file);
}

function take(values) {
  now = values;
  tell(values);
  const made = asked.get(values.answers);
  if (made) {
    const at = performance.now();
    for (const stamp of made) latency.push({ ms: at - stamp, took: values.took });
    asked.delete(values.answers);
  }
  if (values.answers !== null && values.answers === waiting) waiting = null;
  send();
  stand(values.pose);
  hit(values.tool, values.direction);
  if (values.settled && pen.coarse) sharpen(false);
  draw();
}

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${location.pathname}live`);
  socket.onmessage = heard;
  socket.onclose = () => say("picchio has ended: start picchio explore again", true);
}
