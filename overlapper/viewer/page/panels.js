// The panels beside the scene, the list of bodies, and what is said about keys and links.

const narrow = matchMedia("(max-width: 900px)");
const panels = {overlaps: byId("overlaps"), bodies: byId("bodies"), look: byId("look")};

// Overlaps are on the left, one other panel on the right. Where there is little room, one panel is open.
function showPanel(name, wanted = panels[name].hidden) {
  const others = narrow.matches ? ["overlaps", "bodies", "look"] : name === "overlaps" ? [] : ["bodies", "look"];
  if (wanted) for (const other of others) panels[other].hidden = true;
  panels[name].hidden = !wanted;
  for (const [each, panel] of Object.entries(panels)) byId(`show-${each}`).ariaExpanded = !panel.hidden;
  fold();
}
for (const name of Object.keys(panels)) byId(`show-${name}`).onclick = () => showPanel(name);

function follows() {
  for (const name of ["bodies", "look"]) showPanel(name, false);
  showPanel("overlaps", !narrow.matches || innerHeight >= 1000);
  byId("legend").open = !narrow.matches && innerHeight >= 700;
}
narrow.onchange = follows;
follows();

// Bodies, their links, and the nodes of the tree that are drawn for them.
const tree = new Map();
film.linkNames.forEach(([body, link], node) => {
  if (!tree.has(body)) tree.set(body, new Map());
  if (!tree.get(body).has(link)) tree.get(body).set(link, []);
  tree.get(body).get(link).push(node);
});

function switchFor(name, nodes, inner = []) {
  const box = element("input", {type: "checkbox", checked: true, ariaLabel: name});
  box.onchange = () => {
    for (const node of nodes) actors[node].node.object.visible = box.checked;
    for (const other of inner) other.checked = box.checked;
    for (const each of switches) each.renew();
    viewer.set_dirty();
  };
  box.renew = () => {
    const seen = nodes.filter(node => actors[node].node.object.visible).length;
    [box.checked, box.indeterminate] = [seen === nodes.length, seen > 0 && seen < nodes.length];
  };
  switches.push(box);
  return box;
}

const switches = [];
for (const [body, inLinks] of tree) {
  const nodes = [...inLinks.values()].flat(), colour = element("span", {className: "colour"});
  const faces = actors[nodes[0]].drawing.getObjectByName("faces");
  colour.style.background = `#${faces.material.color.getHexString()}`;
  const isGround = nodes.every(node => film.grounds.includes(node));
  const label = [colour, element("span", {textContent: body}), ...(isGround ? [element("span", {className: "quiet", textContent: "ground"})] : [])];
  if (inLinks.size === 1) {
    byId("bodies-list").append(element("label", {className: "alone"}, switchFor(body, nodes), ...label));
    continue;
  }
  const inner = element("div");
  for (const [link, own] of inLinks) inner.append(element("label", {}, switchFor(`${body}, ${link}`, own), element("span", {textContent: link})));
  byId("bodies-list").append(element("details", {}, element("summary", {}, switchFor(body, nodes), ...label), inner));
}

function switchAll(seen) {
  for (const {node} of actors) node.object.visible = seen;
  for (const each of switches) each.renew();
  viewer.set_dirty();
}
byId("all-bodies").onclick = () => switchAll(true);
byId("no-bodies").onclick = () => switchAll(false);

// The address has the link in any case; not every browser lets a page copy. A page within another has no link.
const inside = window !== top;
async function copyLink() {
  if (inside) return;
  history.replaceState(null, "", linkHere());
  const button = byId("copy");
  try {
    await navigator.clipboard.writeText(location.href);
    button.textContent = "Copied";
  } catch {
    button.textContent = "See address";
  }
  byId("said").textContent = button.textContent === "Copied" ? "the link is copied" : "the link is in the address bar";
  setTimeout(() => { button.textContent = "Link"; }, 2500);
}
byId("copy").onclick = copyLink;
if (inside) byId("copy").hidden = byId("help").hidden = document.querySelector("#head h1").hidden = true;
byId("whole").onclick = () => lookAt(seenAs === "whole" ? "opening" : "whole");
byId("help").onclick = () => byId("keys").showModal();
document.querySelector("#head h1").textContent = film.title;
byId("left-out").hidden = !film.leftOut.length;
byId("left-out").textContent = `${film.leftOut.length} not modelled`;
byId("left-out").title = film.leftOut.join("\n");
byId("tunnelled").hidden = !film.tunnelled.length;
byId("tunnelled").textContent = `${film.tunnelled.length} tunnelled`;
byId("tunnelled").title = film.tunnelled.map(([frame, pair]) => `${times[frame].toFixed(3)} s: ${pair}`).join("\n");
// The next frame before which a pair has passed through another one.
byId("tunnelled").onclick = () => pauseAt((film.tunnelled.find(([frame]) => frame > shown) ?? film.tunnelled[0])[0]);
document.title = film.title ? `${film.title}, overlapper` : "overlapper";

if (film.forces) {
  document.body.classList.add("forced");
  byId("ramp").style.background = `linear-gradient(90deg, ${film.forces.colors.join(", ")})`;
  byId("top").textContent = told(film.forces.top, pascals, 3);
}
