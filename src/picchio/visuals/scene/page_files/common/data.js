const THREE = MeshCat.THREE;
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
function element(name, properties, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function download(name, content, type) {
  const link = element("a", { download: `${data.title.replace(/[^\w-]/g, "_")}-${name}` });
  link.href = content.startsWith("data:") ? content : URL.createObjectURL(new Blob([content], { type }));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const dark = matchMedia("(prefers-color-scheme: dark)").matches;
const viewer = new MeshCat.Viewer(byId("pane"));
const ROOT = ["picchio"];

// --- arrays -----------------------------------------------------------------------------
const TYPES = { f4: Float32Array, u4: Uint32Array, u2: Uint16Array, u1: Uint8Array };

async function unpack() {
  const packed = Uint8Array.from(atob(byId("arrays").textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(stream).arrayBuffer();
  return ([kind, offset, count]) => new TYPES[kind](buffer, offset, count);
}

// Corners apart, with the mean normal of the neighbours that lie within the crease angle.
function geometry(mesh, array) {
  const raw = array(mesh.vertices), faces = array(mesh.faces);
  let points = raw;
  if (mesh.low) {
    points = new Float32Array(raw.length);
    for (let i = 0; i < raw.length; i++) points[i] = mesh.low[i % 3] + mesh.step * raw[i];
  }
  const corners = faces.length, around = Array.from({ length: points.length / 3 }, () => []);
  const normals = new Float32Array(corners), areas = new Float32Array(corners);
  for (let f = 0; f < corners; f += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => 3 * faces[f + k]);
    const u = [0, 1, 2].map((k) => points[b + k] - points[a + k]);
    const v = [0, 1, 2].map((k) => points[c + k] - points[a + k]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const size = Math.hypot(...n) || 1;
    for (let k = 0; k < 3; k++) {
      areas[f + k] = n[k];
      normals[f + k] = n[k] / size;
      around[faces[f + k]].push(f);
    }
  }
  const position = new Float32Array(3 * corners), normal = new Float32Array(3 * corners);
  const colours = mesh.colours && array(mesh.colours);
  const colour = colours && new Uint8Array(3 * corners);
  const limit = Math.cos((mesh.crease * Math.PI) / 180) - 1e-6;
  for (let i = 0; i < corners; i++) {
    const own = i - (i % 3), vertex = faces[i];
    for (const f of around[vertex]) {
      const dot = normals[own] * normals[f] + normals[own + 1] * normals[f + 1] +
        normals[own + 2] * normals[f + 2];
      if (f === own || dot >= limit)
        for (let k = 0; k < 3; k++) normal[3 * i + k] += areas[f + k];
    }
    const size = Math.hypot(normal[3 * i], normal[3 * i + 1], normal[3 * i + 2]) || 1;
    for (let k = 0; k < 3; k++) {
      normal[3 * i + k] /= size;
      position[3 * i + k] = points[3 * vertex + k];
      if (colour) colour[3 * i + k] = colours[3 * vertex + k];
    }
  }
  const result = new THREE.BufferGeometry();
  result.setAttribute("position", new THREE.BufferAttribute(position, 3));
  result.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
  if (colour) result.setAttribute("color", new THREE.BufferAttribute(colour, 3, true));
  return result;
}

function material(mesh, item, order) {
  const coloured = Boolean(mesh.colours) && !item.colour;
  const translucent = mesh.opacity < 1;
  return new THREE.MeshPhongMaterial({
    color: coloured ? 0xffffff : item.colour || mesh.colour, vertexColors: coloured,
    transparent: translucent, opacity: mesh.opacity, depthWrite: !translucent,
    side: THREE.DoubleSide, shininess: 12, specular: 0x181818,
    // URDFs lay faces upon one another: the later one wins everywhere instead of in spots.
    polygonOffset: true, polygonOffsetFactor: 0, polygonOffsetUnits: -2 * order,
  });
}
