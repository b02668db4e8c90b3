// --- keep: what is on the screen as a file ------------------------------------------------
function table() {
  const lines = [["model", "joint", "peak_deflection [rad]", "worst_deflection [rad]", "worst_x", "worst_y", "worst_z",
    "peak_torque [N*m]", "stress [Pa]", "utilisation", "drive_utilisation", "life [rivets]", "life_p10 [rivets]", "life_p90 [rivets]"]];
  for (const [name, model] of Object.entries(now.models)) for (const j of model ? model.joints : [])
    lines.push([name, j.name, j.peak_deflection, j.worst_deflection, ...j.worst_direction, j.peak_torque, j.stress,
      j.utilisation, j.drive_utilisation, j.life, ...(j.life_interval || [null, null])]);
  return lines;
}

function csv() {
  const cell = (x) => (x === null ? "" : typeof x === "string" && /[",\n]/.test(x) ? `"${x.replaceAll('"', '""')}"` : String(x === "unlimited" ? "inf" : x));
  return table().map((line) => line.map(cell).join(",")).join("\n") + "\n";
}

function svg() {
  const pane = byId("pane"), w = pane.offsetWidth, h = pane.offsetHeight, lines = [];
  const clean = (text) => String(text).replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
  const shown = [...byId("joints").rows].map((row) => [...row.cells].map((cell) => cell.innerText.replace(/\n/g, " ")));
  const at = [0, 170, 250, 330, 410, 490, 560];
  const text = (x, y, content, bold) => lines.push(`<text x="${x}" y="${y}"${bold ? ' font-weight="bold"' : ""}>${clean(content)}</text>`);
  const pose = now.pose.map((q, j) => `${data.joints[j].name} ${q.toFixed(4)}`).join(", ");
  text(12, h + 22, `${data.title}: ${byId("robot-life").textContent}`, true);
  text(12, h + 40, `pose: ${pose}`);
  text(12, h + 58, `force along (${now.direction.map((x) => x.toFixed(3)).join(", ")}); ` +
    Object.entries(blowSliders).map(([key, made]) => `${BLOWS[key][0]} ${made.out.textContent} ${BLOWS[key][1]}`).join(", "));
  shown.forEach((row, r) => row.forEach((cell, c) => text(12 + at[c], h + 84 + 18 * r, cell, !r)));
  text(12, h + 92 + 18 * shown.length, byId("frequencies").textContent);
  const width = Math.max(w, 760), height = h + 106 + 18 * shown.length;
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}" ` +
    `font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="#fff"/>` +
    `<image width="${w}" height="${h}" href="${viewer.capture_image()}"/>${lines.join("")}</svg>`;
}

function kept({ toml, written, poses, problem }) {
  if (problem) say(problem, true);
  if (toml) download("task.toml", toml, "application/toml");
  if (written) byId("written").textContent = `${written} has ${poses} pose${poses === 1 ? "" : "s"} now`;
}

function keep() {
  byId("write").textContent = `put the pose into ${data.file}`;
  byId("write").onclick = () => socket.send(JSON.stringify({ write: true }));
  byId("svg").onclick = () => download("view.svg", svg(), "image/svg+xml");
  byId("csv").onclick = () => download("values.csv", csv(), "text/csv");
  byId("toml").onclick = () => socket.send(JSON.stringify({ toml: true }));
}

unpack().then((array) => {
  build(array);
  stage();
  makeTable();
  makeSliders();
  hands();
  keep();
  window.picchio = { viewer, parts, data, latency, drawn, pen, balls: 0, values: () => now, idle: () => waiting === null && next === null };
  connect();
  const ready = setInterval(() => {
    if (!now) return;
    clearInterval(ready);
    document.documentElement.dataset.ready = "true";
  }, 20);
}).catch((error) => {
  say(`The page could not be drawn: ${error.message}`, true);
  throw error;
});
