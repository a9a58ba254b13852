// The table of overlaps, and the numbers of the one that is chosen.

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
  const sightings = Array.from({length: film.sighting_start[frame + 1] - film.sighting_start[frame]}, (_, k) => film.sighting_start[frame] + k);
  sightings.sort((a, b) => film.numbers[b] - film.numbers[a]);  // the first numbers are volumes
  const total = sightings.length;
  heading.textContent = `${total} overlap${total === 1 ? "" : "s"}` + (looks.overlaps.front ? "" : ", facets in their owner's colour");
  while (rows.rows.length > Math.min(total, ROWS)) rows.deleteRow(-1);
  for (let k = 0; k < Math.min(total, ROWS); k++) {
    const sighting = sightings[k], pair = film.sighting_pair[sighting], row = rows.rows[k] ?? newRow();
    if (row.pair !== pair) row.cells[0].replaceChildren(...named(pair));
    [row.pair, row.sighting] = [pair, sighting];
    row.className = pair === chosen ? "picked" : pair === hovered ? "hovered" : "";
    const {volume, depth} = measured(sighting);
    [inUnit(volume, units, 3).slice(0, 2).join(" "), `${plain(1e3 * depth, 3)} mm`].forEach((text, i) => {
      if (row.cells[i + 1].textContent !== text) row.cells[i + 1].textContent = text;
    });
  }
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
