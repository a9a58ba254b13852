// The table of overlaps, and the numbers of the one that is chosen.

const units = [[1e-9, "mm³"], [1e-6, "cm³"], [1e-3, "dm³"], [1, "m³"]];
const areas = [[1e-6, "mm²"], [1e-4, "cm²"], [1, "m²"]];
const prefixed = unit => [[1e-6, `µ${unit}`], [1e-3, `m${unit}`], [1, unit], [1e3, `k${unit}`], [1e6, `M${unit}`]];
const [newtons, joules] = [prefixed("N"), prefixed("J")], torques = prefixed("N m").slice(0, 4);
const speeds = prefixed("m/s").slice(0, 3), pascals = [...prefixed("Pa").slice(2), [1e9, "GPa"]];

function inUnit(value, choices, digits) {
  const [unit, name] = choices.find(([unit]) => value < 1000 * unit) ?? choices[choices.length - 1];
  return [plain(value / unit, digits), name, unit];
}

function told(value, choices, digits = 4) {
  return inUnit(value, choices, digits).slice(0, 2).join(" ");
}

// Writes a number as %g does.
function plain(value, digits) {
  const text = value.toPrecision(digits);
  return text.includes("e") && Math.abs(value) >= 1 ? String(+text) : text.replace(/(\.\d*?)0+(e|$)/, "$1$2").replace(/\.(e|$)/, "$1");
}

function named([first, second]) {
  return [element("span", {className: "first", textContent: first}), " – ", element("span", {className: "second", textContent: second})];
}

// The filter: the list, the scene and the chart leave out overlaps with less volume in m³, depth in m, or force in N.
const filter = {by: "volume", least: 0};
const row = {volume: 0, depth: 2};  // among the numbers of a sighting

function measure(sighting, by) {
  if (by === "force") return Math.hypot(...pressOf(sighting)?.force ?? [0]);
  return film.numbers[row[by] * count + sighting];
}

function sightings(frame) {
  const all = Array.from({length: film.sighting_start[frame + 1] - film.sighting_start[frame]}, (_, k) => film.sighting_start[frame] + k);
  return all.filter(sighting => measure(sighting, filter.by) >= filter.least);
}

function largestFirst(some) {
  return [...some].sort((a, b) => film.numbers[b] - film.numbers[a]);  // the first numbers are volumes
}

const STILL = 1e-9;  // m/s: a slip that is rounding
let chosen = -1, hovered = -1, shown = -1;  // a pair, a pair, a frame

function choose(pair) {
  chosen = pair;
  if (shown >= 0) {
    drawOverlaps(shown);
    showList(shown);
    showNumbers(shown);
  }
  drawChart();
  viewer.set_dirty();
}

// Empty panels take no room. Where there is little room, the panels on the right come before the numbers.
function fold() {
  const none = each => [...each.children].every(section => section.hidden);
  byId("right").hidden = none(byId("right"));
  byId("left").hidden = none(byId("left")) || narrow.matches && !byId("right").hidden;
}

function showNumbers(frame) {
  numbers.hidden = chosen < 0;
  fold();
  if (chosen < 0) return;
  const close = element("button", {textContent: "×", title: "close (escape)", ariaLabel: "close"});
  close.onclick = () => choose(-1);
  const title = element("div", {}, close, ...named(pairs[chosen]));
  const sighting = sightingOf(chosen, frame);
  if (sighting < 0) {
    numbers.replaceChildren(title, element("div", {className: "quiet", textContent: "share nothing at this time"}));
    return;
  }
  const {volume, error, depth, area, centroid, normal} = measured(sighting);
  const [text, unit, scale] = inUnit(volume, units, 4);
  const list = document.createElement("table"), press = pressOf(sighting);
  for (const [name, value] of [
    ["volume", `${text} ± ${plain(error / scale, 1)} ${unit}`],
    ["depth", `${plain(1e3 * depth, 4)} mm`],
    ["surface", told(area, areas)],
    ["centroid", `(${centroid.map(part => part.toFixed(4)).join(", ")}) m`],
    ["normal", `(${normal.map(part => part.toFixed(4)).join(", ")})`],
    ...press ? [
      ["force", told(Math.hypot(...press.force), newtons)],
      ["torque", told(press.torque, torques)],
      ["energy", told(press.energy, joules)],
      ["slip", press.slip < STILL ? "sticks" : told(press.slip, speeds)],
    ] : [],
  ]) {
    const row = list.insertRow();
    row.append(element("th", {textContent: name}));
    row.insertCell().textContent = value;
  }
  numbers.replaceChildren(title, list);
}

