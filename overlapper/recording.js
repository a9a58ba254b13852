// Shows what recording.py has packed. A frame is shown as a whole: bodies, overlaps, table, numbers and chart.
const {THREE} = MeshCat;
const byId = id => document.getElementById(id);
const [slider, output, play, speed] = ["slider", "", "play", "speed"].map(id => byId(id) ?? document.querySelector("#time output"));
const [table, numbers, chart] = ["overlaps", "numbers", "chart"].map(byId);

function bytes(base64) {
  return Uint8Array.from(atob(base64), letter => letter.charCodeAt(0));
}

function unpacked(id) {
  const packed = new Blob([bytes(byId(id).textContent)]);
  return new Response(packed.stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

// The heading with the arrays in it; these come byte by byte, all first bytes before all second ones.
function read(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const film = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  for (const [name, [kind, count]] of Object.entries(film.arrays)) {
    const array = new globalThis[kind](count), width = array.BYTES_PER_ELEMENT;
    const from = new Uint8Array(buffer, at, count * width), to = new Uint8Array(array.buffer);
    for (let k = 0; k < width; k++) for (let i = 0; i < count; i++) to[i * width + k] = from[k * count + i];
    film[name] = array;
    at += count * width;
  }
  return film;
}

// The sums of all counts before each.
function starts(counts) {
  const sums = new Uint32Array(counts.length + 1);
  for (let i = 0; i < counts.length; i++) sums[i + 1] = sums[i] + counts[i];
  return sums;
}

const viewer = new MeshCat.Viewer(byId("meshcat-pane"));
for (const command of JSON.parse(new TextDecoder().decode(await unpacked("commands")))) {
  for (const {data} of command.object?.geometries ?? []) {
    for (const attribute of [data.index, ...Object.values(data.attributes)]) {
      if (attribute) attribute.array = new globalThis[attribute.type](bytes(attribute.array).buffer);
    }
  }
  viewer.handle_command(command);
}
// The scene ends where the bar with the time begins.
const wholePane = viewer.set_3d_pane_size.bind(viewer);
viewer.set_3d_pane_size = () => wholePane(innerWidth, innerHeight - byId("time").offsetHeight);
viewer.set_3d_pane_size();
const film = read(await unpacked("film"));
const {times, pairs, center, size: sceneSize} = film;
const last = times.length - 1, end = times[last] + (last ? times[last] / last : 0);
const count = film.sighting_pair.length;

// Polytopes: where the vertices, facets and rings of each begin; vertices are counted from those of an earlier one.
const firstVertex = starts(film.polytope_vertices), firstFacet = starts(film.polytope_facets);
const firstCorner = starts(film.ring_length);
film.polytope_previous.forEach((like, k) => {
  if (like < 0) return;
  const shift = 3 * (firstVertex[like] - firstVertex[k]);
  for (let i = 3 * firstVertex[k]; i < 3 * firstVertex[k + 1]; i++) film.vertices[i] += film.vertices[i + shift];
});

// What a sighting, a pair in a frame, has for numbers; the centroid is in the world.
function measured(sighting) {
  const [volume, error, depth, area, x, y, z, ...normal] = Array.from({length: 10}, (_, k) => film.numbers[k * count + sighting]);
  return {volume, error, depth, area, centroid: [x, y, z].map((part, k) => part + center[k]), normal};
}

function extent(sighting) {
  return 2 * film.polytope_frame[3 * film.polytope_previous.length + film.sighting_polytope[sighting]];
}

function sightingOf(pair, frame) {
  for (let s = film.sighting_start[frame]; s < film.sighting_start[frame + 1]; s++) if (film.sighting_pair[s] === pair) return s;
  return -1;
}

// -- drawing

function nodeAt(path) {
  return viewer.scene_tree.find(path.split("/").filter(Boolean));
}

// The poses of each body, with the frames from which they hold.
const actors = film.nodes.map(path => ({node: nodeAt(path), drawing: nodeAt(path + "/<object>").object, frames: [], keys: []}));
film.key_frame.forEach((frame, key) => {
  const actor = actors[film.key_node[key]];
  actor.frames.push(frame);
  actor.keys.push(key);
});

// The last entry of a sorted list that is no larger than the wanted one, or -1.
function lastUpTo(list, wanted) {
  let low = -1, high = list.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (list[middle] <= wanted) low = middle; else high = middle;
  }
  return low;
}

function poseBodies(frame) {
  const total = film.key_frame.length;
  for (const {node, drawing, frames, keys} of actors) {
    const key = keys[lastUpTo(frames, frame)];
    const [x, y, z, ...turn] = key === undefined ? [0, 0, 0, 0, 0, 0, 0] : Array.from({length: 7}, (_, k) => film.key_pose[k * total + key]);
    drawing.visible = turn.some(part => part !== 0);  // a body that is not there has no rotation
    node.object.position.set(x, y, z);
    node.object.quaternion.set(...turn);
  }
}

// A buffer that is filled anew for each frame.
class Batch {
  constructor(names) {
    this.geometry = new THREE.BufferGeometry();
    this.geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(), Infinity);
    this.names = names;
    this.length = 0;
    this.grow(1024);
  }
  grow(size) {
    for (const name of this.names) {
      const wider = new Float32Array(3 * size);
      if (this[name]) wider.set(this[name]);
      this[name] = wider;
      this.geometry.setAttribute(name, new THREE.BufferAttribute(wider, 3).setUsage(THREE.DynamicDrawUsage));
    }
    this.size = size;
  }
  add(point, color) {
    if (this.length === this.size) {
      this.geometry.dispose();
      this.grow(2 * this.size);
    }
    this.position.set(point, 3 * this.length);
    if (color) this.color.set(color, 3 * this.length);
    this.length++;
  }
  done() {
    this.geometry.setDrawRange(0, this.length);
    for (const name of this.names) this.geometry.attributes[name].needsUpdate = true;
  }
}

const paint = color => new THREE.Color(color);
const through = {color: film.colors.ink, transparent: true, depthTest: false};
const line = {color: film.colors.line, transparent: true};
const apart = {polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1};  // from the edges upon them
const batches = {faces: new Batch(["position", "color"])};
for (const name of ["edges", "vertices", "marks", "arrows", "dots", "picked"]) batches[name] = new Batch(["position"]);
const facets = batches.faces.geometry;
const drawn = {
  inside: new THREE.Mesh(facets, new THREE.MeshBasicMaterial({vertexColors: true, transparent: true, side: THREE.BackSide, ...apart})),
  faces: new THREE.Mesh(facets, new THREE.MeshBasicMaterial({vertexColors: true, transparent: true, ...apart})),
  edges: new THREE.LineSegments(batches.edges.geometry, new THREE.LineBasicMaterial(line)),
  vertices: new THREE.Points(batches.vertices.geometry, new THREE.PointsMaterial({size: 4, sizeAttenuation: false, ...line})),
  marks: new THREE.LineSegments(batches.marks.geometry, new THREE.LineBasicMaterial(through)),
  arrows: new THREE.Mesh(batches.arrows.geometry, new THREE.MeshBasicMaterial({...through, side: THREE.DoubleSide})),
  dots: new THREE.Points(batches.dots.geometry, new THREE.PointsMaterial({size: 5, sizeAttenuation: false, ...through})),
  picked: new THREE.LineSegments(batches.picked.geometry, new THREE.LineBasicMaterial({...line, depthTest: false})),
};
const overlaps = new THREE.Group();
// Bodies come first, so that none of them tints an overlap.
for (const [order, object] of Object.values(drawn).entries()) {
  object.renderOrder = 1 + order;
  object.frustumCulled = false;
  overlaps.add(object);
}
viewer.set_object(["overlapper", "overlaps"], overlaps);

const looks = structuredClone(film.looks);
let triangles = [];  // the first triangle of each sighting of the frame

// About the point that the camera turns around, where float32 is as fine as one can come near.
function drawOverlaps(frame) {
  const origin = viewer.scene.worldToLocal(viewer.controls.target.clone());
  overlaps.position.copy(origin);
  const middle = new THREE.Vector3(...center).sub(origin);
  for (const batch of Object.values(batches)) batch.length = 0;
  triangles = [];
  for (let s = film.sighting_start[frame]; s < film.sighting_start[frame + 1]; s++) {
    triangles.push(batches.faces.length / 3);
    drawOverlap(s, middle);
  }
  for (const batch of Object.values(batches)) batch.done();
}

function drawOverlap(sighting, middle) {
  const k = film.sighting_polytope[sighting], total = film.polytope_previous.length, picked = film.sighting_pair[sighting] === chosen;
  const [x, y, z, unit] = Array.from({length: 4}, (_, part) => film.polytope_frame[part * total + k]);
  const scale = unit / 32767, points = [];
  for (let i = 3 * firstVertex[k]; i < 3 * firstVertex[k + 1]; i += 3) {
    const [u, v, w] = film.vertices.subarray(i, i + 3);
    points.push([middle.x + x + scale * u, middle.y + y + scale * v, middle.z + z + scale * w]);
  }
  const ownerOf = new Map();  // of the facet to the left of an edge
  for (let f = firstFacet[k]; f < firstFacet[k + 1]; f++) {
    const ring = film.rings.subarray(firstCorner[f], firstCorner[f + 1]), owner = film.owners[f];
    const color = shaded(ring, points, owner);
    for (let i = 1; i < ring.length - 1; i++) for (const corner of [ring[0], ring[i], ring[i + 1]]) batches.faces.add(points[corner], color);
    for (let i = 0; i < ring.length; i++) ownerOf.set(ring[i] * 65536 + ring[(i + 1) % ring.length], owner);
  }
  for (const [edge, owner] of ownerOf) {
    const from = Math.floor(edge / 65536), to = edge % 65536;
    if (from > to) continue;
    const ends = [points[from], points[to]];
    if (looks.overlaps.edges) ends.forEach(point => batches.edges.add(point));
    if (ownerOf.get(to * 65536 + from) !== owner) ends.forEach(point => batches.marks.add(point));
    if (picked) ends.forEach(point => batches.picked.add(point));
  }
  if (looks.overlaps.vertices) points.forEach(point => batches.vertices.add(point));
  const {centroid, normal, area} = measured(sighting);
  const at = centroid.map((part, i) => part - center[i] + middle.getComponent(i));
  if (unit < 0.0075 * sceneSize) batches.dots.add(at);
  if (normal.some(Boolean)) drawArrow(at, normal, Math.min(Math.max(Math.sqrt(area) / 3, 0.03 * sceneSize), 0.06 * sceneSize));
}

// Flat and matt facets look the same from everywhere: mostly of their own light, so that an owner is known in shade, too.
const skins = new Map();
function shaded(ring, points, owner) {
  let nx = 0, ny = 0, nz = 0;
  for (let i = 0; i < ring.length; i++) {
    const [ax, ay, az] = points[ring[i]], [bx, by, bz] = points[ring[(i + 1) % ring.length]], [ox, oy, oz] = points[ring[0]];
    nx += (ay - oy) * (bz - oz) - (az - oz) * (by - oy);
    ny += (az - oz) * (bx - ox) - (ax - ox) * (bz - oz);
    nz += (ax - ox) * (by - oy) - (ay - oy) * (bx - ox);
  }
  const [lx, ly, lz] = film.light, length = Math.hypot(nx, ny, nz) || 1;
  const light = 0.4 + 0.7 * (0.45 + 0.55 * Math.max(0, (nx * lx + ny * ly + nz * lz) / length));
  const skin = looks.overlaps.front ?? film.colors.owners[owner];
  if (!skins.has(skin)) skins.set(skin, paint(skin).toArray());
  return skins.get(skin).map(part => Math.min(1, part * light));
}

function drawArrow(at, normal, length) {
  const [tip, neck] = [1, 0.8].map(part => at.map((a, i) => a + part * length * normal[i]));
  batches.marks.add(at);
  batches.marks.add(tip);
  const axis = new THREE.Vector3(...normal);
  const aside = new THREE.Vector3(0, 1, 0).cross(axis);
  if (aside.length() < 0.5) aside.set(1, 0, 0).cross(axis);
  aside.setLength(0.05 * length);
  const rim = Array.from({length: 12}, (_, i) => aside.clone().applyAxisAngle(axis, i * Math.PI / 6).toArray().map((part, k) => neck[k] + part));
  rim.forEach((point, i) => [tip, point, rim[(i + 1) % 12], neck, point, rim[(i + 1) % 12]].forEach(corner => batches.arrows.add(corner)));
}

// -- what is drawn, and how

for (const {drawing} of actors) {
  for (const part of drawing.children) part.userData.own = part.material.color.clone();
  const faces = drawing.getObjectByName("faces");
  // A half-space is a plate, seen from both sides and fainter.
  if (faces.material.side === THREE.DoubleSide) faces.userData.endless = true;
}

function dress(material, opacity) {
  material.opacity = opacity;
  material.depthWrite = opacity === 1;
}

function applyLooks() {
  const {bodies, overlaps: look} = looks;
  for (const {drawing} of actors) {
    const part = name => drawing.getObjectByName(name);
    const faces = part("faces");
    faces.visible = bodies.faces;
    dress(faces.material, bodies.opacity * (faces.userData.endless ? 0.4 : 1));
    faces.material.color.copy(bodies.front ? paint(bodies.front) : faces.userData.own);
    if (faces.userData.endless) faces.material.side = bodies.back ? THREE.FrontSide : THREE.DoubleSide;
    if (bodies.back && !part("inside")) {
      const inside = new THREE.Mesh(faces.geometry, faces.material.clone());
      inside.name = "inside";
      inside.material.side = THREE.BackSide;
      drawing.add(inside);
    }
    const inside = part("inside");
    if (inside) {
      inside.visible = bodies.faces && bodies.back !== null;
      dress(inside.material, faces.material.opacity);
      if (bodies.back) inside.material.color.set(bodies.back);
    }
    part("edges").visible = bodies.edges && bodies.faces;
    part("wires").visible = bodies.edges && !bodies.faces;
    part("vertices").visible = bodies.vertices;
  }
  for (const name of ["faces", "edges", "vertices", "marks"]) drawn[name].visible = look[name];
  drawn.arrows.visible = look.marks;
  drawn.inside.visible = look.faces && look.opacity < 1;
  dress(drawn.faces.material, look.opacity);
  dress(drawn.inside.material, look.opacity);
  const own = look.back === null;
  if (drawn.inside.material.vertexColors !== own) drawn.inside.material.needsUpdate = true;
  drawn.inside.material.vertexColors = own;
  drawn.inside.material.color.set(own ? 0x808080 : look.back);
  if (shown >= 0) drawOverlaps(shown);
  viewer.set_dirty();
}

const ownSwatch = {
  "overlaps front": "linear-gradient(90deg, #e69f00 50%, #56b4e9 50%)",
  "overlaps back": "linear-gradient(90deg, #735000 50%, #2b5a75 50%)",
  "bodies front": "linear-gradient(90deg, #d66, #6d6, #66d)",
  "bodies back": "repeating-linear-gradient(45deg, #333 0 3px, #16181d 3px 6px)",
};

function control(kind, name) {
  const input = document.createElement("input"), look = looks[kind];
  input.id = `${kind}-${name}`;
  if (name === "opacity") Object.assign(input, {type: "range", min: 0, max: 1, step: 0.05});
  else input.type = name === "front" || name === "back" ? "color" : "checkbox";
  input.title = `${kind}: ${name}`;
  input.oninput = () => {
    look[name] = input.type === "checkbox" ? input.checked : input.type === "range" ? +input.value : input.value;
    renew();
  };
  if (input.type !== "color") return input;
  const swatch = document.createElement("label");
  swatch.className = "swatch";
  swatch.append(input);
  return swatch;
}

const details = ["faces", "edges", "vertices", "marks", "opacity", "front", "back"];
for (const kind of ["overlaps", "bodies"]) {
  const row = document.querySelector("#look tbody").insertRow();
  row.innerHTML = `<th>${kind}</th>`;
  for (const name of details) {
    const cell = row.insertCell();
    if (kind !== "bodies" || name !== "marks") cell.append(control(kind, name));
  }
  const reset = document.createElement("button");
  [reset.textContent, reset.title] = ["↺", `${kind} as they were (r: both)`];
  reset.onclick = () => {
    Object.assign(looks[kind], film.looks[kind]);
    renew();
  };
  row.insertCell().append(reset);
}

// The controls say what the looks are, and all is drawn so.
function renew() {
  for (const kind of ["overlaps", "bodies"]) {
    for (const name of details) {
      const input = byId(`${kind}-${name}`), value = looks[kind][name];
      if (!input) continue;
      if (input.type === "checkbox") input.checked = value;
      else if (input.type === "range") input.value = value;
      else {
        input.parentElement.style.background = value ?? ownSwatch[`${kind} ${name}`];
        if (value) input.value = value;
      }
    }
  }
  applyLooks();
}

byId("tree").onclick = () => {
  viewer.gui.domElement.classList.toggle("wanted");
  viewer.gui.open();
};
byId("look").open = innerWidth >= 1000;

// -- the camera

const home = [viewer.camera.position.clone(), viewer.controls.target.clone()];

// In the page's own frame, where the camera moves: y is up and the middle of the scene is the origin.
function onPage(point) {
  viewer.scene.updateMatrixWorld();
  return viewer.scene.localToWorld(new THREE.Vector3(...point));
}

function look(from, at) {
  viewer.camera.near = from.distanceTo(at) / 500;
  viewer.camera.position.copy(from);
  viewer.controls.target.copy(at);
  if (shown >= 0) drawOverlaps(shown);
  viewer.set_dirty();
}

// The camera keeps its direction and comes as near as the overlap deserves.
function comeTo(sighting) {
  const at = onPage(measured(sighting).centroid);
  const offset = viewer.camera.position.clone().sub(viewer.controls.target);
  look(offset.setLength(6 * extent(sighting)).add(at), at);
}

// -- numbers

const units = [[1e-9, "mm³"], [1e-6, "cm³"], [1e-3, "dm³"], [1, "m³"]];
const areas = [[1e-6, "mm²"], [1e-4, "cm²"], [1, "m²"]];

function inUnit(value, choices, digits) {
  const [unit, name] = choices.find(([unit]) => value < 1000 * unit) ?? choices[choices.length - 1];
  return [plain(value / unit, digits), name, unit];
}

// As %g has it.
function plain(value, digits) {
  const text = value.toPrecision(digits);
  return text.includes("e") && Math.abs(value) >= 1 ? String(+text) : text.replace(/(\.\d*?)0+(e|$)/, "$1$2").replace(/\.(e|$)/, "$1");
}

function named(pair) {
  const [first, second] = pairs[pair].map((name, k) => {
    const span = document.createElement("span");
    [span.className, span.textContent] = [["first", "second"][k], name];
    return span;
  });
  return [first, " – ", second];
}

let chosen = -1, hovered = -1, shown = -1;  // a pair, a pair, a frame

function choose(pair) {
  chosen = pair;
  if (shown >= 0) {
    drawOverlaps(shown);
    showTable(shown);
    showNumbers(shown);
  }
  drawChart();
  viewer.set_dirty();
}

function showNumbers(frame) {
  numbers.hidden = chosen < 0;
  if (chosen < 0) return;
  const title = document.createElement("div"), close = document.createElement("button");
  [close.textContent, close.title] = ["×", "close (escape)"];
  close.onclick = () => choose(-1);
  title.append(close, ...named(chosen));
  const sighting = sightingOf(chosen, frame);
  if (sighting < 0) {
    const none = document.createElement("div");
    [none.className, none.textContent] = ["quiet", "share nothing at this time"];
    numbers.replaceChildren(title, none);
    return;
  }
  const {volume, error, depth, area, centroid, normal} = measured(sighting);
  const [text, unit, scale] = inUnit(volume, units, 4);
  const list = document.createElement("table");
  for (const [name, value] of [
    ["volume", `${text} ± ${plain(error / scale, 1)} ${unit}`],
    ["depth", `${plain(1e3 * depth, 4)} mm`],
    ["surface", inUnit(area, areas, 4).slice(0, 2).join(" ")],
    ["centroid", `(${centroid.map(part => part.toFixed(4)).join(", ")}) m`],
    ["normal", `(${normal.map(part => part.toFixed(4)).join(", ")})`],
  ]) {
    const row = list.insertRow();
    row.append(Object.assign(document.createElement("th"), {textContent: name}));
    row.insertCell().textContent = value;
  }
  numbers.replaceChildren(title, list);
}

const ROWS = 100;
const [rows, heading] = [table.querySelector("tbody"), table.querySelector("th")];

function showTable(frame) {
  const first = film.sighting_start[frame], total = film.sighting_start[frame + 1] - first;
  heading.textContent = `${total} overlap${total === 1 ? "" : "s"}` + (looks.overlaps.front ? "" : ", facets in their owner's colour");
  while (rows.rows.length > Math.min(total, ROWS)) rows.deleteRow(-1);
  for (let k = 0; k < Math.min(total, ROWS); k++) {
    const sighting = first + k, pair = film.sighting_pair[sighting], row = rows.rows[k] ?? newRow();
    if (row.pair !== pair) row.cells[0].replaceChildren(...named(pair));
    [row.pair, row.sighting] = [pair, sighting];
    row.className = pair === chosen ? "picked" : pair === hovered ? "hovered" : "";
    const {volume, depth} = measured(sighting);
    [inUnit(volume, units, 3).slice(0, 2).join(" "), `${plain(1e3 * depth, 3)} mm`].forEach((text, i) => {
      if (row.cells[i + 1].textContent !== text) row.cells[i + 1].textContent = text;
    });
  }
  table.tFoot?.remove();
  if (total > ROWS) heading.textContent += `; the largest ${ROWS}:`;
}

function newRow() {
  const row = rows.insertRow();
  for (let i = 0; i < 3; i++) row.insertCell();
  row.title = "click for its numbers, and to come near; escape to come back";
  row.onclick = () => {
    choose(row.pair);
    comeTo(row.sighting);
  };
  row.onmouseenter = () => hover(row.pair);
  row.onmouseleave = () => hover(-1);
  return row;
}

function hover(pair) {
  if (pair === hovered) return;
  hovered = pair;
  for (const row of rows.rows) row.className = row.pair === chosen ? "picked" : row.pair === hovered ? "hovered" : "";
  drawChart();
}

// -- the chart

const EDGE = 8;  // px, the half of the slider's thumb: the chart's time is that of the slider
const curves = pairs.map(() => []);  // [frame, volume], ...
let largest = 0;
for (let frame = 0; frame <= last; frame++) {
  for (let s = film.sighting_start[frame]; s < film.sighting_start[frame + 1]; s++) {
    curves[film.sighting_pair[s]].push([frame, film.numbers[s]]);
    largest = Math.max(largest, film.numbers[s]);
  }
}
const background = document.createElement("canvas");

function place(frame, volume) {
  const {width, height} = chart, edge = EDGE * devicePixelRatio;
  return [edge + (width - 2 * edge) * (times[last] ? times[frame] / times[last] : 0), (height - 2) * (1 - 0.95 * volume / (largest || 1)) + 1];
}

// A curve falls to zero where its pair is apart.
function trace(context, curve) {
  context.beginPath();
  let before = -2;
  for (const [frame, volume] of curve) {
    if (frame !== before + 1) context.moveTo(...place(Math.max(frame - 1, 0), frame ? 0 : volume));
    context.lineTo(...place(frame, volume));
    if (last === 0) context.lineTo(chart.width, place(frame, volume)[1]);
    before = frame;
    if (frame < last && !curve.next?.has(frame + 1)) context.lineTo(...place(frame + 1, 0));
  }
  context.stroke();
}
for (const curve of curves) curve.next = new Set(curve.map(([frame]) => frame));

function sizeChart() {
  for (const canvas of [chart, background]) [canvas.width, canvas.height] = [chart.clientWidth * devicePixelRatio, chart.clientHeight * devicePixelRatio];
  const context = background.getContext("2d");
  context.lineWidth = devicePixelRatio;
  context.strokeStyle = "#4a5260";
  context.beginPath();
  context.moveTo(...place(0, 0));
  context.lineTo(...place(last, 0));
  context.stroke();
  context.strokeStyle = curves.length > 20 ? "#9aa3b070" : "#9aa3b0c0";
  for (const curve of curves) trace(context, curve);
  drawChart();
}

function drawChart() {
  const context = chart.getContext("2d");
  context.clearRect(0, 0, chart.width, chart.height);
  context.drawImage(background, 0, 0);
  context.lineWidth = 2 * devicePixelRatio;
  for (const [pair, color] of [[hovered, "#e8ebf0"], [chosen, "#ff4fa3"]]) {
    if (pair < 0) continue;
    context.strokeStyle = color;
    trace(context, curves[pair]);
  }
  if (shown >= 0) {
    const [x] = place(shown, 0);
    context.fillStyle = "#e8ebf0";
    context.fillRect(x - devicePixelRatio / 2, 0, devicePixelRatio, chart.height);
  }
  const pair = hovered >= 0 ? hovered : chosen;
  const top = document.createElement("div");
  top.textContent = largest ? `volume, up to ${inUnit(largest, units, 3).slice(0, 2).join(" ")}` : "nothing is shared";
  byId("caption").replaceChildren(top, ...(pair >= 0 ? named(pair) : []));
}

// The pair whose curve is nearest to a point of the chart.
function curveAt(x, y) {
  const frame = frameAt(timeAt(x));
  let best = -1, nearest = 12 * devicePixelRatio;
  for (let s = film.sighting_start[frame]; s < film.sighting_start[frame + 1]; s++) {
    const off = Math.abs(place(frame, film.numbers[s])[1] - y * devicePixelRatio);
    if (off < nearest) [best, nearest] = [film.sighting_pair[s], off];
  }
  return best;
}

function timeAt(x) {
  return times[last] * Math.min(Math.max((x - EDGE) / (chart.clientWidth - 2 * EDGE), 0), 1);
}

chart.onpointermove = event => {
  hover(curveAt(event.offsetX, event.offsetY));
  if (event.buttons) pauseAt(frameAt(timeAt(event.offsetX)));
};
chart.onpointerleave = () => hover(-1);
chart.onpointerdown = event => {
  chart.setPointerCapture(event.pointerId);
  const pair = curveAt(event.offsetX, event.offsetY);
  if (pair >= 0) choose(pair);
  pauseAt(frameAt(timeAt(event.offsetX)));
};
new ResizeObserver(sizeChart).observe(chart);

// -- picking in the scene

function pickAt(x, y) {
  const box = viewer.renderer.domElement.getBoundingClientRect();
  const point = new THREE.Vector2(2 * (x - box.left) / box.width - 1, 1 - 2 * (y - box.top) / box.height);
  viewer.scene.updateMatrixWorld();
  const ray = new THREE.Raycaster();
  ray.setFromCamera(point, viewer.camera);
  const [hit] = ray.intersectObject(drawn.faces);
  if (hit) return film.sighting_start[shown] + lastUpTo(triangles, hit.faceIndex);
  // A small one is hard to hit: what is nearest to the click.
  let best = -1, nearest = 14;
  for (let s = film.sighting_start[shown]; s < film.sighting_start[shown + 1]; s++) {
    const at = onPage(measured(s).centroid).project(viewer.camera);
    const off = Math.hypot((at.x - point.x) * box.width, (at.y - point.y) * box.height) / 2;
    if (at.z < 1 && off < nearest) [best, nearest] = [s, off];
  }
  return best;
}

let pressed = null;
byId("meshcat-pane").addEventListener("pointerdown", event => { pressed = [event.clientX, event.clientY]; });
byId("meshcat-pane").addEventListener("pointerup", event => {
  if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
  const sighting = pickAt(event.clientX, event.clientY);
  choose(sighting < 0 ? -1 : film.sighting_pair[sighting]);
});

// -- time

function frameAt(time) {
  return Math.max(lastUpTo(times, time), 0);
}

let playing = false, clock = 0, before = 0;

function show(frame) {
  if (frame === shown) return;
  shown = frame;
  poseBodies(frame);
  drawOverlaps(frame);
  showTable(frame);
  showNumbers(frame);
  drawChart();
  slider.value = times[frame];
  output.textContent = times[frame].toFixed(3) + " s";
  viewer.set_dirty();
}

function run(wanted) {
  playing = wanted;
  play.textContent = playing ? "❚❚" : "▶";
}

function pauseAt(frame) {
  run(false);
  clock = times[frame];
  show(frame);
}

function tick(now) {
  if (playing) {
    clock += (now - before) / 1000 * +speed.value;
    if (clock >= end) clock %= end;
    show(frameAt(clock));
  }
  before = now;
  requestAnimationFrame(tick);
}

slider.max = times[last];
slider.oninput = () => pauseAt(frameAt(+slider.value));
play.onclick = () => run(!playing);
speed.onchange = () => speed.blur();
const keys = {
  " ": () => run(!playing),
  Escape: () => {
    choose(-1);
    look(...home);
  },
  ArrowLeft: () => pauseAt(Math.max(shown - 1, 0)),
  ArrowRight: () => pauseAt(Math.min(shown + 1, last)),
  r: () => {
    for (const kind of ["bodies", "overlaps"]) Object.assign(looks[kind], film.looks[kind]);
    renew();
  },
};
for (const name of ["faces", "edges", "vertices", "marks"]) {
  for (const [key, kind] of [[name[0], "overlaps"], [name[0].toUpperCase(), "bodies"]]) {
    keys[key] = () => {
      looks[kind][name] = !looks[kind][name];
      renew();
    };
  }
}
document.onkeydown = event => {
  if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
  event.preventDefault();
  keys[event.key]();
};

// What the address asks for; also of a page that is open already.
function follow() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  look(...wanted.has("from") ? ["from", "at"].map(name => onPage(wanted.get(name).split(",").map(Number))) : home);
  pauseAt(frameAt(+wanted.get("t")));
  choose(pairs.findIndex(pair => pair.join(",") === wanted.get("pair")));
  run(!wanted.has("t") && last > 0);
}

renew();
follow();
window.onhashchange = follow;
requestAnimationFrame(now => {
  before = now;
  tick(now);
});
