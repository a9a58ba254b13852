// Where the scene is seen from, and what is clicked upon in it.

// In the page's own frame, where the camera moves: y is up and the middle of what is framed is the origin.
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

// One of the film's views: "opening" has what moves and what overlaps, "whole" has all but grounds.
function lookAt(name) {
  const {at, back, distances} = film.views[name];
  const wide = Object.keys(distances).map(Number).sort((a, b) => a - b);
  const distance = distances[wide[Math.max(lastUpTo(wide, viewer.camera.aspect), 0)]];
  look(onPage(at.map((part, k) => part + distance * back[k])), onPage(at));
}

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
