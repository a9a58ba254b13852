// Reads what recording.py has packed. The files of this folder are joined to one script in the order that it names.
const {THREE} = MeshCat;
const byId = id => document.getElementById(id);
const [slider, play, speed, numbers, chart, pane] = ["slider", "play", "speed", "numbers", "chart", "meshcat-pane"].map(byId);
const output = document.querySelector("#bar output");

// Texts come from files of others, so they are never taken for HTML.
function element(kind, properties = {}, ...children) {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...children);
  return made;
}

function bytes(base64) {
  return Uint8Array.from(atob(base64), letter => letter.charCodeAt(0));
}

function unpacked(id) {
  const packed = new Blob([bytes(byId(id).textContent)]);
  return new Response(packed.stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

// The heading with its arrays. The bytes of an array come in the order: all first bytes, all second bytes, ...
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

// For each count, the sum of the counts before it.
function starts(counts) {
  const sums = new Uint32Array(counts.length + 1);
  for (let i = 0; i < counts.length; i++) sums[i + 1] = sums[i] + counts[i];
  return sums;
}

const viewer = new MeshCat.Viewer(pane);
viewer.gui.domElement.remove();  // the panels are in its place
const known = new Map();  // geometries by uuid: a geometry that is used again comes without its data
for (const command of JSON.parse(new TextDecoder().decode(await unpacked("commands")))) {
  for (const geometry of command.object?.geometries ?? []) {
    geometry.data ??= known.get(geometry.uuid);
    if (known.has(geometry.uuid)) continue;
    known.set(geometry.uuid, geometry.data);
    for (const attribute of [geometry.data.index, ...Object.values(geometry.data.attributes)]) {
      if (attribute) attribute.array = new globalThis[attribute.type](bytes(attribute.array).buffer);
    }
  }
  viewer.handle_command(command);
}
const film = read(await unpacked("film"));
const {times, pairs, links, names, center, size: sceneSize} = film;
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

// The numbers of a sighting, which is a pair in a frame; the centroid is in the world.
function measured(sighting) {
  const [volume, error, depth, area, x, y, z, ...normal] = Array.from({length: 10}, (_, k) => film.numbers[k * count + sighting]);
  return {volume, error, depth, area, centroid: [x, y, z].map((part, k) => part + center[k]), normal};
}

// The forces of a sighting; null if the film has none for it.
function pressOf(sighting) {
  if (!film.forces) return null;
  const [x, y, z, torque, energy, slip, u, v, w, stiffness, hardening] = Array.from({length: 11}, (_, k) => film.presses[k * count + sighting]);
  return stiffness ? {force: [x, y, z], torque, energy, slip, normal: [u, v, w], stiffness, hardening} : null;
}

function extent(sighting) {
  return 2 * film.polytope_frame[3 * film.polytope_previous.length + film.sighting_polytope[sighting]];
}

function sightingOf(pair, frame) {
  for (let s = film.sighting_start[frame]; s < film.sighting_start[frame + 1]; s++) if (film.sighting_pair[s] === pair) return s;
  return -1;
}
