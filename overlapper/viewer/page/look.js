// The panel that controls how bodies and overlaps are drawn.

const solid = actors.filter((_, node) => !film.grounds.includes(node)), grounds = actors.filter((_, node) => film.grounds.includes(node));
for (const {drawing} of solid) for (const part of drawing.children) part.userData.own = part.material.color.clone();

function dress(material, opacity) {
  material.opacity = opacity;
  material.depthWrite = opacity === 1;
}

function applyLooks() {
  const {bodies, overlaps: look} = looks;
  for (const {drawing} of grounds) {
    drawing.getObjectByName("faces").visible = bodies.faces;
    drawing.getObjectByName("edges").visible = bodies.edges;
  }
  for (const {drawing} of solid) {
    const part = name => drawing.getObjectByName(name);
    const faces = part("faces");
    faces.visible = bodies.faces;
    dress(faces.material, bodies.opacity);
    faces.material.color.copy(bodies.front ? paint(bodies.front) : faces.userData.own);
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
  for (const each of document.querySelectorAll("#legend .own")) each.hidden = look.front !== null || forcesSeen();
  byId("shared").hidden = look.front === null || forcesSeen();
  byId("normals").hidden = forcesSeen();
  for (const each of document.querySelectorAll(".pressing")) each.hidden = !forcesSeen();
  byId("shared").querySelector("rect").style.fill = look.front ?? "";
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
  input.setAttribute("aria-label", input.title);
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

const details = ["faces", "edges", "vertices", "marks", ...film.forces ? ["forces"] : [], "opacity", "front", "back"];
const kinds = ["overlaps", "bodies"];
document.querySelector("#look thead").insertRow().append(element("th"), ...kinds.map(kind => element("th", {textContent: kind, scope: "col"})));
for (const name of details) {
  const row = document.querySelector("#look tbody").insertRow();
  row.append(element("th", {textContent: name, scope: "row"}));
  for (const kind of kinds) {
    const cell = row.insertCell();
    if (kind !== "bodies" || name !== "marks" && name !== "forces") cell.append(control(kind, name));
  }
}
const resets = document.querySelector("#look tbody").insertRow();
resets.append(element("th", {textContent: "as they were"}));
for (const kind of kinds) {
  const reset = element("button", {textContent: "↺", title: `${kind} as they were (r: both)`});
  reset.onclick = () => {
    Object.assign(looks[kind], film.looks[kind]);
    renew();
  };
  resets.insertCell().append(reset);
}

// Shows the looks in the controls, and draws by them.
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
