// Forces, if the film has them: pressures as colours of overlaps, and an arrow for each pair of links.

const forcesSeen = () => film.forces !== null && looks.overlaps.forces;
const ramp = film.forces?.colors.map(color => paint(color).toArray()) ?? [];

function colored(pressure) {
  const at = Math.min(pressure / film.forces.top, 1) * (ramp.length - 1), below = Math.min(Math.floor(at), ramp.length - 2);
  return ramp[below].map((part, k) => part + (at - below) * (ramp[below + 1][k] - part));
}

// The pressure at a point about a polytope's middle: stiffness times the polytope's extent along the normal there, with the hardening.
function pressureIn(sighting, polytope) {
  const press = pressOf(sighting), total = film.owners.length, planes = [];
  const unit = film.polytope_frame[3 * film.polytope_previous.length + polytope];
  if (!press) return () => 0;
  for (let f = firstFacet[polytope]; f < firstFacet[polytope + 1]; f++) {
    const plane = Array.from({length: 4}, (_, part) => film.planes[part * total + f]);
    const slope = plane[0] * press.normal[0] + plane[1] * press.normal[1] + plane[2] * press.normal[2];
    if (Math.abs(slope) > 1e-6) planes.push([...plane.slice(0, 3), unit * plane[3], slope]);
  }
  return ([x, y, z]) => {
    let ahead = Infinity, behind = Infinity;
    for (const [a, b, c, offset, slope] of planes) {
      const way = Math.max(-(a * x + b * y + c * z + offset), 0) / Math.abs(slope);
      if (slope > 0) ahead = Math.min(ahead, way); else behind = Math.min(behind, way);
    }
    return press.stiffness * (ahead + behind) * (1 + press.hardening * (ahead + behind));
  };
}

// A triangle is cut in four until pressures differ by little in each; `at` has its corners about the polytope's middle.
// Pressures are taken a little within the rim of a facet, where they may jump to 0.
function paintFacet(ring, middle, pressure, halvings) {
  const facet = [0, 1, 2].map(k => ring.reduce((sum, point) => sum + point[k], 0) / ring.length);
  const within = point => pressure(point.map((part, k) => part + 0.01 * (facet[k] - part)));
  for (let i = 1; i < ring.length - 1; i++) paintPressure([ring[0], ring[i], ring[i + 1]], middle, within, halvings);
}

function paintPressure(at, middle, pressure, halvings) {
  const inside = at[0].map((_, k) => (at[0][k] + at[1][k] + at[2][k]) / 3);
  const found = at.map(pressure), all = [...found, pressure(inside)].map(each => Math.min(each, film.forces.top));
  if (!halvings || Math.max(...all) - Math.min(...all) <= film.forces.top / 25) {
    at.forEach((point, i) => batches.faces.add(point.map((part, k) => part + middle[k]), colored(found[i])));
    return;
  }
  const half = at.map((point, i) => point.map((part, k) => (part + at[(i + 1) % 3][k]) / 2));
  for (let i = 0; i < 3; i++) paintPressure([at[i], half[i], half[(i + 2) % 3]], middle, pressure, halvings - 1);
  paintPressure(half, middle, pressure, halvings - 1);
}

// Sums of force and friction on one of two links, the largest first, and the mean of their places.
function pushes(some) {
  const sums = new Map();
  for (const sighting of some) {
    const press = pressOf(sighting), pair = film.sighting_pair[sighting];
    if (!press) continue;
    const sign = film.forces.on_second[pair] ? -1 : 1, weight = Math.hypot(...press.force);
    if (!weight) continue;
    const sum = sums.get(linkKeys[pair]) ?? {pairs: [], at: [0, 0, 0], force: [0, 0, 0], friction: [0, 0, 0], weight: 0};
    sums.set(linkKeys[pair], sum);
    sum.pairs.push(pair);
    sum.weight += weight;
    const {centroid} = measured(sighting), along = press.force.reduce((dot, part, k) => dot + part * press.normal[k], 0);
    for (let k = 0; k < 3; k++) {
      sum.at[k] += (centroid[k] - sum.at[k]) * weight / sum.weight;
      sum.force[k] += sign * press.force[k];
      sum.friction[k] += sign * (press.force[k] - along * press.normal[k]);
    }
  }
  return [...sums.values()].sort((a, b) => Math.hypot(...b.force) - Math.hypot(...a.force));
}

// The height that is seen, in m, at the point that the camera turns about.
function seenHeight() {
  return 2 * viewer.camera.position.distanceTo(viewer.controls.target) * Math.tan(viewer.camera.fov * Math.PI / 360);
}

// Rounded to one digit.
function roundedUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * Math.ceil(value / power * (1 - 1e-9));
}

// Rounded to a power of ten.
function inLengths(length) {
  return length >= 0.999 ? `${plain(length, 1)} m` : length >= 0.00999 ? `${plain(100 * length, 1)} cm` : `${plain(1000 * length, 1)} mm`;
}

let fitted = 0, about = null, pushed = [];  // the height that arrows are drawn for, where they are from, and what they show
const [LONGEST, SHORTEST] = [0.45, 0.01];  // of that height: a shorter arrow would be a speck
const MANY = 40;  // arrows: if there are more, they are thinner

// The length of an arrow: the usual force is a quarter of the height at most.
function drawForces(middle) {
  [about, fitted] = [middle, seenHeight()];
  batches.forces.length = batches.friction.length = 0;
  pushed = forcesSeen() ? pushes(sighted) : [];
  if (!forcesSeen()) return;
  const length = 10 ** Math.floor(Math.log10(fitted / 4)), force = roundedUp(film.forces.usual * length / (fitted / 4));
  byId("arrow-scale").textContent = `${inLengths(length)} = ${told(force, newtons, 3)}`;
  const thick = (pushed.length > MANY ? 0.0016 : 0.0028) * fitted;
  for (const each of pushed) {
    const at = each.at.map((part, k) => part - center[k] + middle.getComponent(k));
    drawForce(batches.forces, at, each.force.map(part => part * length / force), thick);
    drawForce(batches.friction, at, each.friction.map(part => part * length / force), 1.15 * thick);
  }
}

// Called before each picture, as arrows follow the distance of the camera.
function fitForces() {
  if (shown < 0 || !forcesSeen() || Math.abs(seenHeight() / fitted - 1) < 0.02) return;
  drawForces(about);
  batches.forces.done();
  batches.friction.done();
}

// A shaft and a head; two heads if it would be longer than is drawn.
function drawForce(batch, at, vector, thick) {
  const whole = Math.hypot(...vector), length = Math.min(whole, LONGEST * fitted);
  if (length < SHORTEST * fitted) return;
  const way = vector.map(part => part / whole), head = Math.min(10 * thick, 0.5 * length);
  const frame = aside(way), width = Math.min(3.4 * thick, 0.35 * head), shaft = Math.min(thick, 0.4 * width);
  const ring = (along, radius) => turns.map(([c, s]) => at.map((part, i) => part + along * way[i] + radius * (c * frame[0][i] + s * frame[1][i])));
  const wall = (lower, upper) => lower.forEach((point, i) => {
    const k = (i + 1) % lower.length;
    for (const corner of [point, lower[k], upper[i], lower[k], upper[k], upper[i]]) batch.add(corner);
  });
  wall(ring(0, shaft), ring(length - head, shaft));
  for (const tip of whole > length ? [length, length - 0.7 * head] : [length]) {
    wall(ring(tip - head, 0), ring(tip - head, width));
    wall(ring(tip - head, width), ring(tip, 0));
  }
}
