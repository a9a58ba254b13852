// Where the scene is seen from, and what is clicked upon in it.

// The camera moves in the page's own frame: y is up, and the middle of what is framed is the origin.
function onPage(point) {
  viewer.scene.updateMatrixWorld();
  return viewer.scene.localToWorld(new THREE.Vector3(...point));
}

function look(from, at) {
  viewer.camera.near = from.distanceTo(at) / 500;
  viewer.camera.position.copy(from);
  viewer.controls.target.copy(at);
  seenAs = null;
  if (shown >= 0) drawOverlaps(shown);
  viewer.set_dirty();
}

// One of the film's views: "opening" has what moves and what overlaps, "whole" has all but grounds.
function lookAt(name) {
  const {at, back, distances} = film.views[name];
  const wide = Object.keys(distances).map(Number).sort((a, b) => a - b);
  const distance = distances[wide[Math.max(lastUpTo(wide, viewer.camera.aspect), 0)]];
  look(onPage(at.map((part, k) => part + distance * back[k])), onPage(at));
  seenAs = name;
}

let seenAs = null;  // the view, as long as nobody turns the camera
viewer.controls.addEventListener("start", () => { seenAs = null; });
viewer.set_3d_pane_size = (size => () => {
  if (!pane.clientWidth || !pane.clientHeight) return;
  size(pane.clientWidth, pane.clientHeight);
  if (seenAs) lookAt(seenAs);
})(viewer.set_3d_pane_size.bind(viewer));
new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
viewer.set_3d_pane_size();

// The link to what is seen now: moment, camera, the pair that is chosen, and what is left out.
function linkHere() {
  const world = point => viewer.scene.worldToLocal(point.clone()).toArray().map(part => +part.toPrecision(6)).join(",");
  viewer.scene.updateMatrixWorld();
  let link = `#t=${times[shown]}&from=${world(viewer.camera.position)}&at=${world(viewer.controls.target)}`;
  if (chosen >= 0) link += `&pair=${encodeURIComponent(pairs[chosen].join(","))}`;
  if (filter.least > 0) link += `&${filter.by}=${filter.least}`;
  return link;
}

// Volumes or forces beside the largest, as many as there is room for; after each picture.
const TAGS = 5;
function placeTags() {
  const taken = [], tags = [];
  for (const {where, text, own} of shown < 0 ? [] : forcesSeen() ? forceTags() : volumeTags()) {
    const at = onPage(where).project(viewer.camera);
    const x = (1 + at.x) / 2 * pane.clientWidth + 10, y = (1 - at.y) / 2 * pane.clientHeight - 28;
    if (at.z >= 1 || x < 0 || y < 0 || x > pane.clientWidth || y > pane.clientHeight) continue;
    if (taken.some(([left, top]) => Math.abs(left - x) < 84 && Math.abs(top - y) < 24)) continue;
    taken.push([x, y]);
    const tag = element("span", {textContent: text});
    tag.className = own ? "picked" : "";
    tag.style.transform = `translate(${x}px, ${y}px)`;
    tags.push(tag);
  }
  byId("tags").replaceChildren(...tags);
}

function volumeTags() {
  if (!looks.overlaps.marks) return [];
  const wanted = largestFirst(sighted).slice(0, TAGS), own = sightingOf(chosen, shown);
  if (own >= 0 && sighted.includes(own)) wanted.unshift(own);
  return [...new Set(wanted)].map(sighting => ({
    where: measured(sighting).centroid,
    text: told(film.numbers[sighting], units, 3),
    own: sighting === own,
  }));
}

function forceTags() {
  const own = pushed.filter(each => each.pairs.includes(chosen));
  return [...new Set([...own, ...pushed.slice(0, TAGS)])].map(each => ({
    where: each.at,
    text: told(Math.hypot(...each.force), newtons, 3),
    own: own.includes(each),
  }));
}
viewer.render = (render => () => {
  fitForces();
  render();
  placeTags();
})(viewer.render.bind(viewer));

// The camera keeps its direction and comes as near as the overlap deserves.
function comeTo(sighting) {
  const at = onPage(measured(sighting).centroid);
  const offset = viewer.camera.position.clone().sub(viewer.controls.target);
  look(offset.setLength(6 * extent(sighting)).add(at), at);
}

function pickAt(x, y) {
  const box = viewer.renderer.domElement.getBoundingClientRect();
  const point = new THREE.Vector2(2 * (x - box.left) / box.width - 1, 1 - 2 * (y - box.top) / box.height);
  viewer.scene.updateMatrixWorld();
  const ray = new THREE.Raycaster();
  ray.setFromCamera(point, viewer.camera);
  const [hit] = ray.intersectObject(drawn.faces);
  if (hit) return sighted[lastUpTo(triangles, hit.faceIndex)];
  // A small overlap is hard to hit: the one nearest to the click is meant.
  let best = -1, nearest = 14;
  for (const s of sighted) {
    const at = onPage(measured(s).centroid).project(viewer.camera);
    const off = Math.hypot((at.x - point.x) * box.width, (at.y - point.y) * box.height) / 2;
    if (at.z < 1 && off < nearest) [best, nearest] = [s, off];
  }
  return best;
}

let pressed = null;
pane.addEventListener("pointerdown", event => { pressed = [event.clientX, event.clientY]; });
pane.addEventListener("pointerup", event => {
  if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
  const sighting = pickAt(event.clientX, event.clientY);
  choose(sighting < 0 ? -1 : film.sighting_pair[sighting]);
});
