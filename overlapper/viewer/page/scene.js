// Draws a frame: the bodies where they were, and their overlaps.

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
const apart = {polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1};  // so that edges lie in front of faces
const batches = {faces: new Batch(["position", "color"])};
for (const name of ["edges", "vertices", "marks", "arrows", "dots", "specks", "picked", "forces", "friction"]) batches[name] = new Batch(["position"]);
const facets = batches.faces.geometry;
const drawn = {
  inside: new THREE.Mesh(facets, new THREE.MeshBasicMaterial({vertexColors: true, transparent: true, side: THREE.BackSide, ...apart})),
  faces: new THREE.Mesh(facets, new THREE.MeshBasicMaterial({vertexColors: true, transparent: true, ...apart})),
  edges: new THREE.LineSegments(batches.edges.geometry, new THREE.LineBasicMaterial(line)),
  vertices: new THREE.Points(batches.vertices.geometry, new THREE.PointsMaterial({size: 4, sizeAttenuation: false, ...line})),
  marks: new THREE.LineSegments(batches.marks.geometry, new THREE.LineBasicMaterial(through)),
  arrows: new THREE.Mesh(batches.arrows.geometry, new THREE.MeshBasicMaterial({...through, side: THREE.DoubleSide})),
  dots: new THREE.Points(batches.dots.geometry, new THREE.PointsMaterial({size: 5, sizeAttenuation: false, ...through})),
  specks: new THREE.Points(batches.specks.geometry, new THREE.PointsMaterial({size: 3, sizeAttenuation: false, ...through, opacity: 0.5})),
  picked: new THREE.LineSegments(batches.picked.geometry, new THREE.LineBasicMaterial({...line, depthTest: false})),
  forces: new THREE.Mesh(batches.forces.geometry, new THREE.MeshBasicMaterial({...through, color: film.forces?.force})),
  friction: new THREE.Mesh(batches.friction.geometry, new THREE.MeshBasicMaterial({...through, color: film.forces?.friction})),
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
let triangles = [], sighted = [];  // what is drawn in the frame, and the first triangle of each
const PROMINENT = 12;  // the largest, which are marked: marks of hundreds would say nothing

// About the point that the camera turns around, where float32 is as fine as one can come near.
function drawOverlaps(frame) {
  const origin = viewer.scene.worldToLocal(viewer.controls.target.clone());
  overlaps.position.copy(origin);
  const middle = new THREE.Vector3(...center).sub(origin);
  for (const batch of Object.values(batches)) batch.length = 0;
  [triangles, sighted] = [[], sightings(frame)];
  const marked = new Set(largestFirst(sighted).slice(0, PROMINENT));
  for (const s of sighted) {
    triangles.push(batches.faces.length / 3);
    drawOverlap(s, middle, marked.has(s) || film.sighting_pair[s] === chosen);
  }
  drawForces(middle);
  for (const batch of Object.values(batches)) batch.done();
  byId("dull").hidden = marked.size === sighted.length || forcesSeen();
}

function drawOverlap(sighting, middle, marked) {
  const k = film.sighting_polytope[sighting], total = film.polytope_previous.length, picked = film.sighting_pair[sighting] === chosen;
  const [x, y, z, unit] = Array.from({length: 4}, (_, part) => film.polytope_frame[part * total + k]);
  const scale = unit / 32767, points = [];
  for (let i = 3 * firstVertex[k]; i < 3 * firstVertex[k + 1]; i += 3) {
    const [u, v, w] = film.vertices.subarray(i, i + 3);
    points.push([middle.x + x + scale * u, middle.y + y + scale * v, middle.z + z + scale * w]);
  }
  const pressure = forcesSeen() && pressureIn(sighting, k), place = [middle.x + x, middle.y + y, middle.z + z];
  const halvings = sighted.length < 12 ? 4 : sighted.length < 60 ? 3 : 2;
  const ownerOf = new Map();  // of the facet to the left of an edge
  for (let f = firstFacet[k]; f < firstFacet[k + 1]; f++) {
    const ring = film.rings.subarray(firstCorner[f], firstCorner[f + 1]), owner = film.owners[f];
    const color = pressure ? null : shaded(ring, points, owner, marked);
    if (pressure) paintFacet(Array.from(ring, corner => points[corner].map((part, axis) => part - place[axis])), place, pressure, halvings);
    else for (let i = 1; i < ring.length - 1; i++) for (const corner of [ring[0], ring[i], ring[i + 1]]) batches.faces.add(points[corner], color);
    for (let i = 0; i < ring.length; i++) ownerOf.set(ring[i] * 65536 + ring[(i + 1) % ring.length], owner);
  }
  for (const [edge, owner] of ownerOf) {
    const from = Math.floor(edge / 65536), to = edge % 65536;
    if (from > to) continue;
    const ends = [points[from], points[to]];
    if (looks.overlaps.edges) ends.forEach(point => batches.edges.add(point));
    if (marked && ownerOf.get(to * 65536 + from) !== owner) ends.forEach(point => batches.marks.add(point));
    if (picked) ends.forEach(point => batches.picked.add(point));
  }
  if (looks.overlaps.vertices) points.forEach(point => batches.vertices.add(point));
  const {centroid, normal, area} = measured(sighting);
  const at = centroid.map((part, i) => part - center[i] + middle.getComponent(i));
  if (unit < 0.0075 * sceneSize) (marked ? batches.dots : batches.specks).add(at);
  if (marked && !forcesSeen() && normal.some(Boolean)) drawArrow(at, normal, Math.min(Math.max(Math.sqrt(area) / 3, 0.03 * sceneSize), 0.06 * sceneSize));
}

// Flat and matt facets look the same from everywhere: mostly of their own light, so that an owner is known in shade, too.
const skins = new Map();
const DULL = [0.23, 0.26, 0.31];
function shaded(ring, points, owner, marked) {
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
  return skins.get(skin).map((part, k) => Math.min(1, (marked ? part : 0.4 * part + 0.6 * DULL[k]) * light));
}

const turns = Array.from({length: 8}, (_, i) => [Math.cos(i * Math.PI / 4), Math.sin(i * Math.PI / 4)]);
// Two unit vectors across a normal; the first is made with the axis that it has least of.
function aside([nx, ny, nz]) {
  const steep = Math.abs(ny) > 0.8;
  let u = steep ? [0, nz, -ny] : [-nz, 0, nx];
  const size = Math.hypot(...u);
  u = u.map(part => part / size);
  return [u, [ny * u[2] - nz * u[1], nz * u[0] - nx * u[2], nx * u[1] - ny * u[0]]];
}

function drawArrow(at, normal, length) {
  const [tip, neck] = [1, 0.8].map(part => at.map((a, i) => a + part * length * normal[i]));
  batches.marks.add(at);
  batches.marks.add(tip);
  const [u, v] = aside(normal);
  const rim = turns.map(([c, s]) => neck.map((part, i) => part + 0.05 * length * (c * u[i] + s * v[i])));
  rim.forEach((point, i) => {
    const next = rim[(i + 1) % rim.length];
    for (const corner of [tip, point, next, neck, point, next]) batches.arrows.add(corner);
  });
}
